//! Vibrometers that stay at one point while the hammer moves; each has its own channel after the
//! ten.
//!
//! Their errors are of the same kinds as those of the other vibrometers: true position (keyed to
//! the response point as for the 3-D vibrometer, but without the aiming error), gain, skew and
//! noise. Their noise has a separate stream, so that they do not change the ten channels.

use nalgebra::DVector;

use super::aim::shifted;
use super::channels::{Channel, Measured};
use super::config::{FixedVibrometer, RigConfig};
use super::converter::DelayLine;
use super::converter::code;
use super::key::{Stream, normal, stream};
use super::normalized;
use super::probe::Probe;

/// Errors of one fixed vibrometer.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedFlaw {
    /// Its true position and direction.
    pub probe: Probe,
    /// Ratio of its reading to the true value: 1 without error.
    pub gain: f64,
    /// Delay beyond the declared one and the latency (s).
    pub skew_s: f64,
}

/// The errors for the rig `seed`, in the order of the configuration. [`RigConfig::check`] has
/// verified that the points exist.
pub(super) fn flaws(seed: u64, config: &RigConfig) -> Vec<FixedFlaw> {
    let errors = config.errors.acting();
    let one = |own: &FixedVibrometer| {
        let point = config.responses.iter().find(|point| point.name == own.response)?;
        let sigma_m = if point.body.is_specimen() { errors.specimen_point_m } else { errors.position_m };
        let sigma_m = point.sigma_m.filter(|_| !errors.none).unwrap_or(sigma_m);
        let mut place = stream(seed, &["response position", &point.name]);
        let draw = |what: &str| normal(&mut stream(seed, &[what, &own.name]));
        let stated = errors.volts.get(&own.name).copied().unwrap_or(1.0);
        Some(FixedFlaw {
            probe: Probe {
                body: point.body,
                position_m: shifted(point.position_m, sigma_m, &mut place),
                direction: normalized(own.direction),
            },
            gain: stated * (1.0 + errors.gain * draw("gain")),
            skew_s: errors.skew_s * draw("skew"),
        })
    };
    config.sensors.fixed.iter().filter_map(one).collect()
}

/// Their channels, in the order of the configuration.
pub(super) fn channels(config: &RigConfig) -> Vec<Channel> {
    let one = |own: &FixedVibrometer| Channel {
        name: own.name.clone(),
        quantity: Measured::Velocity,
        unit: "m/s",
        units_per_volt: own.units_per_volt,
        range_v: config.sensors.range_v,
        delay_s: own.delay_s,
        polarity: own.polarity,
        axis: None,
    };
    config.sensors.fixed.iter().map(one).collect()
}

/// Their output rows, in state coordinates (2n).
#[derive(Debug, Clone, Default)]
pub struct FixedRows {
    /// Row of each; zero where the configuration lacks the body.
    pub rows: Vec<DVector<f64>>,
    /// Size of one converter step of each (m/s).
    pub steps: Vec<f64>,
}

/// Converts the true signals to codes.
#[derive(Debug, Clone)]
pub(super) struct FixedSensors {
    own: Vec<One>,
    signals: Vec<f64>,
    stream: Stream,
}

#[derive(Debug, Clone)]
struct One {
    codes_per_unit: f64,
    /// Noise (codes rms).
    noise: f64,
    delay: Option<DelayLine>,
}

impl FixedSensors {
    /// With the cell's idle `stream`; all channels are delayed by `latency_scans`.
    pub(super) fn new(config: &RigConfig, flaws: &[FixedFlaw], latency_scans: u32, stream: Stream) -> Self {
        let rate_hz = f64::from(config.scan_rate_hz);
        let one = |((own, channel), flaw): ((&FixedVibrometer, Channel), &FixedFlaw)| {
            let late = f64::from(latency_scans) + (own.delay_s + flaw.skew_s) * rate_hz;
            One {
                codes_per_unit: flaw.gain * f64::from(own.polarity) / channel.step(),
                // white up to half the scan rate
                noise: own.floor * (rate_hz / 2.0).sqrt() / channel.step(),
                delay: (late > 0.0).then(|| DelayLine::new(late)),
            }
        };
        let own: Vec<One> = config.sensors.fixed.iter().zip(channels(config)).zip(flaws).map(one).collect();
        Self { signals: vec![0.0; own.len()], own, stream }
    }

    /// A hit begins: the noise stream restarts here.
    pub(super) fn restart(&mut self, stream: Stream) {
        self.stream = stream;
    }

    /// Converts one scan: `read` fills in the true signals.
    pub(super) fn convert(&mut self, read: impl FnOnce(&mut [f64]), codes: &mut [i16]) {
        read(&mut self.signals);
        for (at, own) in self.own.iter_mut().enumerate() {
            let signal = match &mut own.delay {
                Some(line) => line.pass(self.signals[at]),
                None => self.signals[at],
            };
            let exact = signal * own.codes_per_unit + own.noise * normal(&mut self.stream);
            if let Some(given) = codes.get_mut(at) {
                *given = code(exact);
            }
        }
    }
}
