//! Start times of the cycles of a steady record: at the stated frequency, or at the measured one.

use super::HysteresisError;
use super::dominant_frequency::line_sum;
use super::dominant_frequency::{dominant_frequency, level};
use super::record::{HysteresisRecord, Relative};
use crate::parallel::prelude::*;
use crate::vectors::{dot, mean};
use num_complex::Complex;
use std::f64::consts::TAU;

/// Phase deviation over a record from which its cycles count as off, rad: a smaller one changes an
/// average by less than 1 in 1000.
const OFF_RAD: f64 = 0.05;

/// The deviation must be this many times what the scatter of the cycles explains.
const SIGNIFICANT: f64 = 8.0;

/// Largest scatter of the cycles about a steady drift for which the drift is accepted, rad.
const SCATTER_RAD: f64 = 0.5;

/// With fewer cycles no drift can be found, only a frequency that differs from the stated one,
const FEWEST_CYCLES: usize = 8;

/// and with fewer than these not even that.
const FEWEST_PHASES: usize = 3;

/// The phases are computed again, at the frequency found, if it differs by more than this fraction:
/// a cycle cut too long or too short contains a part of its neighbour or lacks a part of its own.
const FURTHER: f64 = 5e-3;

/// A stated frequency is accepted if its tone alone has this fraction of the force's mean square in
/// stretches of this many cycles. A square wave's fundamental has 0.81 of it.
const EXPLAINED: f64 = 0.5;
const STRETCH: f64 = 16.0;

/// The strongest frequency is the stated one if they differ by less than this fraction of a line
/// (one over the record's duration).
const SAME_LINE: f64 = 0.7;

/// In the motion, the other frequency must have this many times the power of the stated one.
const STRONGER: f64 = 4.0;

/// The stated frequency is present in a signal if it has this fraction of the power of the
/// strongest one.
const PRESENT: f64 = 0.0625;

/// Frequency as a linear function of time over a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Timing {
    /// At the first sample, Hz.
    pub start_hz: f64,
    /// Rate of change, Hz/s.
    pub rate_hz_per_s: f64,
}

impl Timing {
    /// A constant frequency.
    pub fn steady(frequency_hz: f64) -> Self {
        Self { start_hz: frequency_hz, rate_hz_per_s: 0.0 }
    }

    /// When a cycle begins, s after the first sample.
    pub fn begin_s(&self, cycle: f64) -> f64 {
        if self.rate_hz_per_s == 0.0 {
            return cycle / self.start_hz;
        }
        let root = (self.start_hz.powi(2) + 2.0 * self.rate_hz_per_s * cycle).max(0.0).sqrt();
        2.0 * cycle / (self.start_hz + root)
    }

    /// Number of cycles in this time.
    pub fn cycles(&self, time_s: f64) -> f64 {
        (self.start_hz + 0.5 * self.rate_hz_per_s * time_s) * time_s
    }

    /// Frequency at this time, Hz.
    pub fn at(&self, time_s: f64) -> f64 {
        self.start_hz + self.rate_hz_per_s * time_s
    }

    /// The timing derived from the phase of `force`; `None` if it runs at `frequency_hz`
    /// throughout.
    pub fn tracked(force: &[f64], fs_hz: f64, frequency_hz: f64) -> Option<Self> {
        let first = Self::tracked_near(force, fs_hz, frequency_hz)?;
        let middle_hz = first.at(0.5 * force.len() as f64 / fs_hz);
        if (middle_hz / frequency_hz - 1.0).abs() < FURTHER {
            return Some(first);
        }
        // `None` means that the frequency found first holds for the whole record
        Some(Self::tracked_near(force, fs_hz, middle_hz).unwrap_or(Self::steady(middle_hz)))
    }

    fn tracked_near(force: &[f64], fs_hz: f64, frequency_hz: f64) -> Option<Self> {
        if frequency_hz.is_nan() || frequency_hz <= 0.0 {
            return None;
        }
        let period = fs_hz / frequency_hz;
        // tolerance, so that rounding does not make 7 cycles of 8
        let cycles = (force.len() as f64 / period + 1e-6).floor() as usize;
        if cycles < FEWEST_PHASES {
            return None;
        }
        // a drift shows as a curvature of the phase, which a few cycles do not resolve
        let terms = if cycles < FEWEST_CYCLES { 2 } else { 3 };
        let turn = TAU / period;
        let tone = |c: usize| {
            let edge = |c: usize| ((c as f64 * period).round() as usize).min(force.len());
            let (from, to) = (edge(c), edge(c + 1));
            let own = &force[from..to];
            let (rest, step) = (mean(own), Complex::from_polar(1.0, -turn));
            let mut wheel = Complex::from_polar(1.0, -turn * (from as f64 - c as f64 * period));
            let mut tone = Complex::<f64>::default();
            for value in own {
                tone += wheel * (value - rest);
                wheel *= step;
            }
            tone.arg()
        };
        let mut phases: Vec<f64> = (0..cycles).into_par_iter().map(tone).collect();
        let mut last = 0.0;
        for phase in &mut phases {
            last += wrapped(*phase - last);
            *phase = last;
        }
        // phase over u = -1…1 in Legendre polynomials, which are orthogonal over many cycles
        let n = cycles as f64;
        let u = |c: usize| (2.0 * c as f64 + 1.0) / n - 1.0;
        let basis = |c: usize| [1.0, u(c), 0.5 * (3.0 * u(c).powi(2) - 1.0)];
        let mut fit = [0.0; 3];
        for _ in 0..3 {
            // iterate, because sums over finitely many cycles are not quite orthogonal
            let mut left = [0.0; 3];
            let mut norm = [0.0; 3];
            for (c, phase) in phases.iter().enumerate() {
                let b = basis(c);
                let rest = phase - (0..terms).map(|i| fit[i] * b[i]).sum::<f64>();
                for i in 0..terms {
                    left[i] += rest * b[i];
                    norm[i] += b[i] * b[i];
                }
            }
            (0..terms).for_each(|i| fit[i] += left[i] / norm[i]);
        }
        let rest = |(c, phase): (usize, &f64)| {
            let b = basis(c);
            (phase - (0..3).map(|i| fit[i] * b[i]).sum::<f64>()).powi(2)
        };
        let scatter = (phases.iter().enumerate().map(rest).sum::<f64>() / (n - terms as f64)).sqrt();
        // from end to end the linear term rises by twice its coefficient, the quadratic one by 1.5
        // times
        let (line, bow) = (2.0 * fit[1], 1.5 * fit[2]);
        let limit = |over: f64| OFF_RAD.max(SIGNIFICANT * scatter * over / n.sqrt());
        if scatter > SCATTER_RAD || (line.abs() < limit(3.5) && bow.abs() < limit(3.4)) {
            return None;
        }
        let time_s = cycles as f64 / frequency_hz;
        // dφ/du at the beginning and the end; u goes from -1 to 1
        let [from_hz, to_hz] =
            [-1.0, 1.0].map(|u| frequency_hz + (fit[1] + 3.0 * fit[2] * u) * 2.0 / time_s / TAU);
        Some(Self { start_hz: from_hz, rate_hz_per_s: (to_hz - from_hz) / time_s })
    }
}

/// The actual frequency of a record with a stated one: the stated one, or that of force and motion
/// if both have next to no power at the stated one. Differences below a line's width are left to
/// [`Timing::tracked`].
///
/// # Errors
/// Neither force nor motion runs at the stated frequency, and they do not agree.
pub(super) fn runs_at(record: &HysteresisRecord, stated_hz: f64) -> Result<f64, HysteresisError> {
    let fs_hz = record.fs_hz;
    if explained(&record.force_n, fs_hz, stated_hz) > EXPLAINED {
        return Ok(stated_hz);
    }
    let line_hz = fs_hz / record.force_n.len() as f64;
    let same = |found_hz: f64, other_hz: f64| (found_hz - other_hz).abs() < SAME_LINE * line_hz;
    let force_hz = dominant_frequency(&level(&record.force_n), fs_hz);
    let Some(force_hz) = force_hz.filter(|found| !same(*found, stated_hz)) else { return Ok(stated_hz) };
    let (motion, order) = match record.relative() {
        Relative::Velocity(v) => (v, 1),
        Relative::Displacement(x) => (x, 0),
    };
    let motion = level(&motion);
    // power of the displacement, also if velocity was measured
    let power = |f: f64| line_power(&motion, f / fs_hz) / f.powi(2 * order);
    let motion_hz = dominant_frequency(&motion, fs_hz).unwrap_or(force_hz);
    let [stated, of_force, of_motion] = [stated_hz, force_hz, motion_hz].map(power);
    if of_force > STRONGER * stated && (of_force >= of_motion || same(force_hz, motion_hz)) {
        return Ok(force_hz);
    }
    let in_force = |f: f64| line_power(&level(&record.force_n), f / fs_hz);
    if stated >= PRESENT * of_motion || in_force(stated_hz) >= PRESENT * in_force(force_hz) {
        return Ok(stated_hz);
    }
    Err(HysteresisError::OtherFrequency { stated_hz, force_hz, motion_hz })
}

/// Fraction of a signal's variance that a tone of this frequency has, in stretches of [`STRETCH`]
/// cycles.
fn explained(x: &[f64], fs_hz: f64, frequency_hz: f64) -> f64 {
    let period = fs_hz / frequency_hz;
    let cycles = (x.len() as f64 / period + 1e-6).floor().clamp(1.0, STRETCH);
    let stretch = ((cycles * period).round() as usize).clamp(1, x.len().max(1));
    let of = |x: &[f64]| {
        let n = x.len() as f64;
        let rest = mean(x);
        // remove the mean's contribution to the sum, which matters only if the stretch is not a
        // whole number of cycles
        let turn = -TAU / period;
        let ones = Complex::from_polar(1.0, turn * n) - 1.0;
        let constant = ones / (Complex::from_polar(1.0, turn) - 1.0) * rest;
        let tone = 2.0 * (line_sum(x, turn) - constant).norm_sqr() / n;
        [tone, dot(x, x) - n * rest * rest]
    };
    let sums: Vec<[f64; 2]> = x.par_chunks(stretch).filter(|part| part.len() == stretch).map(of).collect();
    let [tone, all] = sums.iter().fold([0.0, 0.0], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
    if all > 0.0 { tone / all } else { 1.0 }
}

/// |X|² at a frequency (cycles per sample), with a Hann window.
fn line_power(x: &[f64], frequency: f64) -> f64 {
    let n = x.len() as f64;
    let at = |turns: f64| line_sum(x, -TAU * turns);
    // the window is half a constant, minus a quarter of one turn in each direction; it is centred
    // by half a sample
    let half = Complex::from_polar(1.0, 0.5 * TAU / n);
    let [below, above] = [frequency - 1.0 / n, frequency + 1.0 / n].map(at);
    (0.5 * at(frequency) - 0.25 * (half * below + half.conj() * above)).norm_sqr()
}

/// Wraps to −π…π.
fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_is_tracked_and_a_steady_record_has_none() {
        for (start, rate) in [(200.0, 4.0), (198.0, 0.0), (61.0, -1.2), (200.0, 0.0)] {
            let truth = Timing { start_hz: start, rate_hz_per_s: rate };
            let force: Vec<f64> =
                (0..51_200).map(|i| (TAU * truth.cycles(f64::from(i) / 51_200.0)).sin()).collect();
            let stated = if start < 100.0 { 61.0 } else { 200.0 };
            let found = Timing::tracked(&force, 51_200.0, stated);
            if truth == Timing::steady(stated) {
                assert_eq!(found, None);
                continue;
            }
            let found = found.expect("it is off");
            assert!(
                (found.start_hz - start).abs() < 0.02 && (found.at(1.0) - truth.at(1.0)).abs() < 0.02,
                "{found:?}"
            );
            for cycle in [0.0, 17.0, 58.0] {
                assert!((found.cycles(found.begin_s(cycle)) - cycle).abs() < 1e-9);
            }
        }
    }
}
