//! The first cycle of a hit's decay: its slope, and the correction that an arm's inertia would add.

use super::analyse::decay_of;
use super::impact::DecayCycle;
use super::loops::slope;
use super::record::{HysteresisRecord, RelativeMotion};
use super::static_arm::{Correction, rate};
use super::{HysteresisError, Shape};

/// Number of cycles of a decay that are reported: later ones are buried in noise, or contain only
/// the lowest modes.
pub const DECAY_CYCLES: usize = 8;

/// Results of one hit's first cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstCycle {
    /// Least-squares slope of T on Δx over the first cycle, N/m.
    pub slope_n_per_m: f64,
    /// Coefficient of determination R² of that line, 0…1.
    pub r_squared: f64,
    /// Half the swing of Δx, m.
    pub amplitude_m: f64,
    /// Frequency of the decay's main mode, Hz.
    pub frequency_hz: f64,
    /// Phase by which Δx lags T over the first cycle, degrees; from the same samples as slope and
    /// amplitude.
    pub phase_deg: f64,
    /// Shape of the loop.
    pub shape: Shape,
    /// Sample range of the first cycle: its first sample, and the first sample after it.
    pub cycle: [usize; 2],
    /// Least-squares slope of specimen B's acceleration on Δx over it, 1/s²: the correction per kg
    /// of the arm's effective mass.
    pub acceleration_per_m: f64,
    /// The first cycles of the decay, at most [`DECAY_CYCLES`].
    pub decay: Vec<DecayCycle>,
}

impl FirstCycle {
    /// From the velocities of specimens A and B (m/s) and the load cells' sum (N) after a hit,
    /// aligned in time.
    ///
    /// # Errors
    /// The signals hold no whole cycle, or contain values that are not finite.
    pub fn of(fs_hz: f64, [a, b]: [Vec<f64>; 2], force_n: Vec<f64>) -> Result<Self, HysteresisError> {
        let record = HysteresisRecord {
            fs_hz,
            motion: RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b },
            force_n,
            excitation_hz: None,
            normal_load_n: None,
        };
        let (decay, shape) = decay_of(&record, DECAY_CYCLES)?.ok_or(HysteresisError::NoMotion)?;
        let first = &decay.cycles[0];
        let (from, to) = (first.first_sample, first.end_sample);
        let RelativeMotion::Velocity { b_m_per_s, .. } = &record.motion else {
            unreachable!("made of velocities")
        };
        let acceleration: Vec<f64> = (from..to).map(|i| rate(b_m_per_s, i, fs_hz)).collect();
        let acceleration_per_m = slope(&decay.displacement_m[from..to], &acceleration);
        Ok(Self {
            slope_n_per_m: first.stiffness_n_per_m,
            r_squared: first.r_squared,
            amplitude_m: first.amplitude_m,
            frequency_hz: decay.frequency_hz,
            phase_deg: first.phase_deg,
            shape,
            cycle: [from, to],
            acceleration_per_m,
            decay: decay.cycles,
        })
    }

    /// The slope with the force at the contact instead of T, N/m; exact because a least-squares
    /// slope is linear in the force.
    pub fn corrected_slope(&self, by: &Correction) -> f64 {
        (1.0 + by.parallel_path) * self.slope_n_per_m + by.effective_mass_kg * self.acceleration_per_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Two modes, one of which is missing in the force, as near a hidden resonance: the phase of Δx
    /// relative to T changes from cycle to cycle.
    #[test]
    fn everything_that_is_told_is_of_the_first_cycle() {
        let fs_hz = 51_200.0;
        let at = |f: f64, rate: f64, t: f64| (-rate * t).exp() * (TAU * f * t).sin();
        let time = |i: usize| i as f64 / fs_hz - 0.005;
        let signal = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..20_480).map(|i| if time(i) > 0.0 { of(time(i)) } else { 0.0 }).collect()
        };
        let force_n = signal(&|t| 15.0 * at(208.0, 20.0, t));
        let x = signal(&|t| 1e-7 * (at(208.0, 20.0, t) + 0.8 * at(180.0, 60.0, t)));
        let v: Vec<f64> =
            (0..x.len()).map(|i| if i == 0 { 0.0 } else { (x[i] - x[i - 1]) * fs_hz }).collect();
        let still = vec![0.0; v.len()];
        let found = FirstCycle::of(fs_hz, [v, still], force_n).expect("a decay of two modes");
        let [one, two] = [&found.decay[0], &found.decay[1]];
        assert!((one.phase_deg - two.phase_deg).abs() > 3.0, "{} {}", one.phase_deg, two.phase_deg);
        assert_eq!(found.phase_deg.to_bits(), one.phase_deg.to_bits());
        assert_eq!(found.slope_n_per_m.to_bits(), one.stiffness_n_per_m.to_bits());
        assert_eq!(found.amplitude_m.to_bits(), one.amplitude_m.to_bits());
    }

    /// The unreported part of a long decay does not affect the reported values.
    #[test]
    fn the_first_cycles_are_the_same_whatever_is_told_of_later_ones() {
        let fs_hz = 51_200.0;
        let wave = |scale: f64, phase: f64| -> Vec<f64> {
            let turn = |i: usize| (TAU * 190.0 * i as f64 / fs_hz + phase).sin();
            (0..20_480).map(|i| scale * (-(i as f64) / 4000.0).exp() * turn(i)).collect()
        };
        let record = HysteresisRecord {
            fs_hz,
            motion: RelativeMotion::Velocity { a_m_per_s: wave(1e-4, 1.5), b_m_per_s: wave(1e-5, 1.4) },
            force_n: wave(15.0, 0.0),
            excitation_hz: None,
            normal_load_n: None,
        };
        let of = |most| decay_of(&record, most).expect("a decay").expect("no steady vibration");
        let (all, shape) = of(usize::MAX);
        for most in [2, 8, all.cycles.len() - 1, all.cycles.len()] {
            let (told, same_shape) = of(most);
            assert_eq!(told.cycles, all.cycles[..most]);
            assert_eq!(
                (told.frequency_hz, told.phase_deg, same_shape),
                (all.frequency_hz, all.phase_deg, shape)
            );
            assert_eq!(told.displacement_m, all.displacement_m[..told.displacement_m.len()]);
        }
    }
}
