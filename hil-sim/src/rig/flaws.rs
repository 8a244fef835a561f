//! Errors of a campaign's instruments: true positions of the spots, and errors of the sensors.
//!
//! All are keyed to (seed, purpose): the same in every cell and configuration, whatever was visited
//! before.

use super::aim::shifted;
use super::channels::{CHANNELS, Channel, FORCE, LOAD_CELLS, is_gauged};
use super::config::{RigConfig, Spot, Spots};
use super::fixed::{self, FixedFlaw};
use super::key::{normal, stream};

/// Instrument errors of one campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Flaws {
    /// True positions of the single-point vibrometers.
    pub spots: Spots,
    /// Ratio of each channel's reading to the true value: 1 without error.
    pub gains: [f64; CHANNELS],
    /// Delay of each channel beyond the declared one and the latency below (s); negative if it is
    /// early.
    pub skews_s: [f64; CHANNELS],
    /// Whole scans by which all channels are delayed, so that none precedes its cause.
    pub latency_scans: u32,
    /// Errors of the fixed vibrometers.
    pub fixed: Vec<FixedFlaw>,
    /// Fraction of the force of each load cell (column) that each other one (row) reads; the
    /// diagonal is zero.
    pub cross_talk: [[f64; 3]; 3],
}

impl Flaws {
    /// Errors for the rig `seed`.
    pub(super) fn new(seed: u64, config: &RigConfig, channels: &[Channel; CHANNELS]) -> Self {
        let errors = config.errors.acting();
        let draw = |words: &[&str]| normal(&mut stream(seed, words));
        let gains = std::array::from_fn(|at| {
            let sigma = match at {
                FORCE => errors.hammer_gain,
                _ if is_gauged(at) => errors.gain,
                _ => 0.0,
            };
            let stated = errors.volts.get(&channels[at].name).copied().unwrap_or(1.0);
            stated * (1.0 + sigma * draw(&["gain", &channels[at].name]))
        });
        let skews_s = std::array::from_fn(|at| {
            if at == FORCE { 0.0 } else { errors.skew_s * draw(&["skew", &channels[at].name]) }
        });
        let fixed = fixed::flaws(seed, config);
        let name = |cell: usize| channels[LOAD_CELLS[cell]].name.as_str();
        let cross_talk = std::array::from_fn(|reads: usize| {
            std::array::from_fn(|of: usize| {
                let words = ["cross-talk", name(reads), name(of)];
                if reads == of { 0.0 } else { errors.load_cell_cross_talk * draw(&words) }
            })
        });
        let spot = |name: &str, nominal: &Spot| Spot {
            body: nominal.body,
            position_m: shifted(
                nominal.position_m,
                errors.spot_m,
                &mut stream(seed, &["spot position", name]),
            ),
        };
        Self {
            spots: Spots {
                ldv_a: spot("ldv_a", &config.spots.ldv_a),
                ldv_b: spot("ldv_b", &config.spots.ldv_b),
            },
            gains,
            skews_s,
            latency_scans: latency_scans(
                skews_s.iter().copied().chain(fixed.iter().map(|own| own.skew_s)),
                f64::from(config.scan_rate_hz),
            ),
            fixed,
            cross_talk,
        }
    }
}

/// One scan more than the earliest channel is early, so that the interpolating cubic has a sample
/// on either side; 0 if no channel is skewed.
fn latency_scans(mut skews_s: impl Iterator<Item = f64> + Clone, rate_hz: f64) -> u32 {
    if skews_s.clone().all(|skew| skew == 0.0) {
        return 0;
    }
    let earliest = skews_s.by_ref().fold(0.0_f64, f64::min);
    1 + (-earliest * rate_hz).ceil() as u32
}
