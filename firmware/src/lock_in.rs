//! Lock-in: the amplitude of one frequency in a signal, measured over whole cycles.
//!
//! The signal is multiplied by the sine and cosine of the drive's angle and summed over whole
//! cycles. Components at other frequencies average out; an offset cancels completely. The sums are
//! `f32` over some thousands of scans: each addition is accurate to 6e-8 of the sum, which after
//! 10⁴ additions is at most 1e-5 of the amplitude, and usually much less.

use crate::sine::sine;

/// A quarter of a turn.
const QUARTER: u32 = 1 << 30;

/// Sums of the signal times sine and cosine over a number of scans.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    in_phase: f32,
    quadrature: f32,
    scans: u32,
}

impl Sums {
    const NOTHING: Self = Self { in_phase: 0.0, quadrature: 0.0, scans: 0 };

    fn add(&mut self, other: &Self) {
        self.in_phase += other.in_phase;
        self.quadrature += other.quadrature;
        self.scans += other.scans;
    }

    fn amplitude(&self) -> f32 {
        let squares = self.in_phase * self.in_phase + self.quadrature * self.quadrature;
        2.0 * square_root(squares) / self.scans as f32
    }
}

/// Result after some whole cycles, in the signal's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Amplitude over the last few cycles: available early, but coarse.
    pub glance: f32,
    /// Amplitude over the whole measurement, when it is complete.
    pub whole: Option<f32>,
}

/// The sums of the current measurement and of the current glance (short measurement).
#[derive(Clone, Copy, Debug)]
pub struct LockIn {
    glance: Sums,
    whole: Sums,
    glance_scans: u32,
    least_scans: u32,
    /// A cycle has begun since the start: a renewed request arrives within a cycle, and a partial
    /// cycle can have any amplitude.
    begun: bool,
}

impl LockIn {
    /// Measures over the fewest whole cycles that last at least `least_scans` scans, and glances
    /// after the fewest that last at least `glance_scans`.
    pub const fn new(glance_scans: u32, least_scans: u32) -> Self {
        Self { glance: Sums::NOTHING, whole: Sums::NOTHING, glance_scans, least_scans, begun: false }
    }

    /// Discards the sums.
    pub fn restart(&mut self) {
        *self = Self::new(self.glance_scans, self.least_scans);
    }

    /// Adds the signal of one scan at this angle; the next scan's angle is larger by `step`.
    /// Returns a result when a glance or a measurement is complete.
    pub fn feed(&mut self, signal: f32, angle: u32, step: u32) -> Option<Seen> {
        self.begun |= angle < step;
        if !self.begun {
            return None;
        }
        self.glance.in_phase += signal * sine(angle);
        self.glance.quadrature += signal * sine(angle.wrapping_add(QUARTER));
        self.glance.scans += 1;
        let (_, cycle_ends) = angle.overflowing_add(step);
        let complete = self.whole.scans + self.glance.scans >= self.least_scans;
        if !cycle_ends || !(complete || self.glance.scans >= self.glance_scans) {
            return None;
        }
        self.whole.add(&self.glance);
        let glance = core::mem::take(&mut self.glance).amplitude();
        let whole = complete.then(|| core::mem::take(&mut self.whole).amplitude());
        Some(Seen { glance, whole })
    }
}

/// `core` has no square root, and that of micromath is accurate to a few per cent only: one Newton
/// step reduces the error to 1e-3, two to 1e-6.
fn square_root(value: f32) -> f32 {
    #[allow(unused_imports, reason = "core has no square root; where std is linked its own is taken")]
    use micromath::F32Ext;
    if value <= 0.0 {
        return 0.0;
    }
    let mut root = value.sqrt();
    for _ in 0..2 {
        root = 0.5 * (root + value / root);
    }
    root
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    fn measured(frequency_hz: f64, signal: impl Fn(f64) -> f64) -> f32 {
        let step = jointrig_protocol::request::Shake::step_of(frequency_hz, 51_200);
        let (mut lock_in, mut angle) = (LockIn::new(512, 4_096), 0_u32);
        for scan in 0..20_000 {
            let turns = f64::from(scan) * f64::from(step) / 4_294_967_296.0;
            if let Some(Seen { whole: Some(amplitude), .. }) = lock_in.feed(signal(turns) as f32, angle, step)
            {
                return amplitude;
            }
            angle = angle.wrapping_add(step);
        }
        panic!("no measurement");
    }

    #[test]
    fn it_finds_the_amplitude_at_any_phase() {
        for phase in [0.0, 0.3, 1.7, 4.0] {
            let sine = |turns: f64| 2.5e-4 * (turns * core::f64::consts::TAU + phase).sin();
            let amplitude = measured(200.0, sine);
            // error of the table-free sine (4e-6) and rounding of the sums
            assert!((amplitude / 2.5e-4 - 1.0).abs() < 2e-5, "{amplitude}");
        }
    }

    #[test]
    fn whole_cycles_that_are_no_whole_scans_cost_little() {
        // a cycle of 169.54 scans: the last one is truncated by less than one scan of about 4200
        let amplitude = measured(302.0, |turns| (turns * core::f64::consts::TAU + 0.7).sin());
        assert!((amplitude - 1.0).abs() < 5e-4, "{amplitude}");
    }

    #[test]
    fn offset_and_harmonics_do_not_count() {
        let amplitude = measured(200.0, |turns| {
            let angle = turns * core::f64::consts::TAU;
            3.0 + angle.sin() + 0.5 * (3.0 * angle).cos()
        });
        assert!((amplitude - 1.0).abs() < 1e-4, "{amplitude}");
    }

    #[test]
    fn a_glance_sees_a_change_that_the_measurement_still_averages() {
        // 256 scans per cycle: two cycles per glance, sixteen per measurement; the amplitude
        // doubles after eight cycles
        let step = jointrig_protocol::request::Shake::step_of(200.0, 51_200);
        let (mut lock_in, mut angle) = (LockIn::new(512, 4_096), 0_u32);
        let mut seen = std::vec::Vec::new();
        for scan in 0..4_096 {
            let size = if scan < 2_048 { 1.0 } else { 2.0 };
            seen.extend(lock_in.feed(size * sine(angle), angle, step));
            angle = angle.wrapping_add(step);
        }
        let glances: std::vec::Vec<i32> =
            seen.iter().map(|seen| (seen.glance * 1e4).round() as i32).collect();
        assert_eq!(glances, [[10_000; 4], [20_000; 4]].as_flattened());
        let whole: std::vec::Vec<f32> = seen.iter().filter_map(|seen| seen.whole).collect();
        assert!(whole.len() == 1 && (whole[0] - 1.5).abs() < 1e-4, "{whole:?}");
    }

    #[test]
    fn what_begins_within_a_cycle_waits_for_the_next_one() {
        // 2048 scans per cycle, of which four fifths remain: as a glance they would be wrong by a
        // seventh
        let step = jointrig_protocol::request::Shake::step_of(25.0, 51_200);
        for phase in [0.0, 0.8, 1.6] {
            let (mut lock_in, mut angle) = (LockIn::new(512, 4_096), step.wrapping_mul(410));
            let mut seen = std::vec::Vec::new();
            for _ in 0..8_192 {
                let turns = f64::from(angle) / 4_294_967_296.0;
                let signal = (turns * core::f64::consts::TAU + phase).sin() as f32;
                seen.extend(lock_in.feed(signal, angle, step));
                angle = angle.wrapping_add(step);
            }
            assert!(seen.len() >= 2 && seen.iter().all(|seen| (seen.glance - 1.0).abs() < 1e-3), "{seen:?}");
        }
    }

    #[test]
    fn roots_are_roots() {
        for value in [1e-12_f32, 3e-5, 0.7, 2.0, 4e9] {
            assert!((square_root(value) / value.sqrt() - 1.0).abs() < 1e-6, "{value}");
        }
        assert_eq!(square_root(0.0), 0.0);
    }
}
