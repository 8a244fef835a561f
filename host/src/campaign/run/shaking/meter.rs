//! Measures the amplitude of the controlled quantity from the samples, and decides whether it has
//! settled.

use std::f64::consts::TAU;

use jointrig_protocol::channel::Role;
use num_complex::Complex;

use crate::campaign::plan::level::Held;
use crate::device::channels::ChannelMap;

/// Shortest window, s.
const WINDOW_S: f64 = 0.1;

/// Minimum number of cycles in a window.
const WINDOW_CYCLES: f64 = 3.0;

/// Number of consecutive windows that must agree.
pub const SETTLED_WINDOWS: usize = 6;

/// Relative deviation of each window from the ordered amplitude.
pub const WITHIN: f64 = 0.02;

/// Relative deviation of the later half's mean from the earlier half's.
const DRIFT: f64 = 0.01;

/// The criterion for settled, as text.
pub const CRITERION: &str = "settled: six windows of 0.1 s in a row within 2 % of the order, their later half within 1 % of the earlier";

/// Whether the last windows satisfy the criterion. Without a target (open-loop drive) they must
/// agree with each other.
pub fn is_settled(amplitudes: &[f64], target: Option<f64>) -> bool {
    let Some(from) = amplitudes.len().checked_sub(SETTLED_WINDOWS) else { return false };
    let last = &amplitudes[from..];
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let level = target.unwrap_or_else(|| mean(last));
    let (early, late) = last.split_at(SETTLED_WINDOWS / 2);
    level > 0.0
        && last.iter().all(|a| (a / level - 1.0).abs() < WITHIN)
        && (mean(late) - mean(early)).abs() < DRIFT * level
}

/// One term of the measured quantity: index in the scan, SI units per code, and the phase
/// correction for its delay.
type Term = (usize, Complex<f64>);

/// A lock-in amplifier for the controlled quantity.
pub struct Meter {
    terms: Vec<Term>,
    frequency_hz: f64,
    turn_per_scan: f64,
    cycle_scans: f64,
}

impl Meter {
    /// Creates a meter for the channels of this device; with an open-loop drive, it measures the
    /// specimens' relative displacement to determine whether the structure has settled.
    pub fn new(channels: &ChannelMap, held: Held, frequency_hz: f64) -> Self {
        let omega = TAU * frequency_hz;
        let term = |role: Role, gain: f64| {
            channels.place(role).map(|place| {
                let channel = &channels.channels[place];
                let late_s = f64::from(channel.delay_ns) * 1e-9;
                (place, Complex::from_polar(gain * channel.units_per_code(), omega * late_s))
            })
        };
        let terms = match held {
            Held::Force => vec![term(Role::Excitation, 1.0)],
            Held::Displacement | Held::Drive => {
                vec![term(Role::SpecimenA, 1.0 / omega), term(Role::SpecimenB, -1.0 / omega)]
            }
        };
        let rate_hz = f64::from(channels.rate_hz);
        Self {
            terms: terms.into_iter().flatten().collect(),
            frequency_hz,
            turn_per_scan: omega / rate_hz,
            cycle_scans: rate_hz / frequency_hz,
        }
    }

    /// Scans of one window: whole cycles, rounded to scans.
    pub fn window_scans(&self) -> u64 {
        let cycles = (WINDOW_S * self.frequency_hz).ceil().max(WINDOW_CYCLES);
        (cycles * self.cycle_scans).round() as u64
    }

    /// Amplitude in these codes (interleaved scan by scan): m for velocities, N for a force.
    pub fn amplitude(&self, codes: &[i16], channels: usize) -> f64 {
        let scans = codes.len() / channels;
        let cycles = (scans as f64 / self.cycle_scans).floor();
        let whole = ((cycles * self.cycle_scans).round() as usize).min(scans);
        let sum: Complex<f64> = self
            .terms
            .iter()
            .map(|(place, unit)| {
                let at = |scan: usize| f64::from(codes[scan * channels + place]);
                let mean = (0..whole).map(at).sum::<f64>() / whole.max(1) as f64;
                let tone: Complex<f64> = (0..whole)
                    .map(|scan| Complex::cis(-self.turn_per_scan * scan as f64) * (at(scan) - mean))
                    .sum();
                unit * tone
            })
            .sum();
        2.0 * sum.norm() / whole.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Channel, Quantity};

    fn map() -> ChannelMap {
        let channel = |name: &str, role, quantity, scale, delay_ns| Channel {
            name: name.parse().expect("short"),
            role,
            quantity,
            units_per_volt: scale,
            range_v: 10.0,
            delay_ns,
            bits: 16,
        };
        ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel("a", Role::SpecimenA, Quantity::Velocity, 1e-3, 20_000),
                channel("b", Role::SpecimenB, Quantity::Velocity, -1e-3, 0),
                channel("f", Role::Excitation, Quantity::Force, 44.6, 0),
            ],
        }
    }

    /// x_A = 0.2 µm at 0°, x_B = 0.1 µm at 60°: their difference is 0.173 µm, independent of the
    /// effect of delays and polarity on the codes.
    #[test]
    fn the_relative_displacement_is_measured_whatever_delay_and_polarity() {
        let map = map();
        for frequency_hz in [100.0, 187.3, 302.0] {
            let omega = TAU * frequency_hz;
            let meter = Meter::new(&map, Held::Displacement, frequency_hz);
            let scans = meter.window_scans();
            assert!(scans > 5_100);
            let velocity = |place: usize, amplitude: f64, phase: f64, scan: u64| {
                let channel = &map.channels[place];
                let t = scan as f64 / 51_200.0 - f64::from(channel.delay_ns) * 1e-9;
                (amplitude * omega * (omega * t + phase).cos() / channel.units_per_code()).round() as i16
            };
            let codes: Vec<i16> = (0..scans)
                .flat_map(|scan| [velocity(0, 2e-7, 0.0, scan), velocity(1, 1e-7, TAU / 6.0, scan), 0])
                .collect();
            let got = meter.amplitude(&codes, 3);
            assert!((got / (3f64.sqrt() * 1e-7) - 1.0).abs() < 1e-3, "{frequency_hz} Hz: {got}");
            assert_eq!(Meter::new(&map, Held::Force, frequency_hz).amplitude(&codes, 3), 0.0);
        }
    }

    #[test]
    fn settled_is_steady_and_where_it_was_ordered() {
        let windows = |values: [f64; 6]| [&[0.2, 0.9, 1.3][..], &values[..]].concat();
        assert!(is_settled(&windows([1.01, 0.995, 1.0, 1.002, 0.99, 1.01]), Some(1.0)));
        assert!(
            !is_settled(&windows([0.981, 0.984, 0.988, 0.992, 0.998, 1.003]), Some(1.0)),
            "still drifting"
        );
        assert!(!is_settled(&windows([1.0, 1.0, 1.0, 1.0, 1.0, 1.03]), Some(1.0)));
        assert!(!is_settled(&windows([0.5; 6]), Some(1.0)) && is_settled(&windows([0.5; 6]), None));
        assert!(!is_settled(&[1.0; 5], Some(1.0)) && !is_settled(&[0.0; 6], None));
    }
}
