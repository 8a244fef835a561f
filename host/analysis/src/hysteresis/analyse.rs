//! Entry points of the module. [`analyse`] takes a record and returns the figures of its loop;
//! [`FirstCycle`] takes a hit's decay and returns the slope of its first cycle, and the correction
//! that an arm's inertia would add.

use super::compliance::{ContactCompliance, ImaginaryPeak, SEARCH_HZ};
use super::frequency::dominant_frequency;
use super::impact::{Decay, DecayCycle, FIRST_CYCLES, decay};
use super::loops::{OverCycles, slope, swing};
use super::record::{HysteresisRecord, Relative, RelativeMotion};
use super::shape::Shape;
use super::static_arm::{Correction, rate};
use super::steady::shaker;
use super::{HysteresisError, Kind, LoopAnalysis, LoopFinding};
use crate::median::middle;

/// A record without an excitation frequency counts as steady when the strength of its last quarter
/// is at least this fraction of that of its first. A decay after a hit is strongest at its
/// beginning; an excitation that is faded in and out is strongest in the middle.
const STEADY: f64 = 0.7;

/// The record moves from where the force first exceeds this fraction of its maximum to where it
/// last does. Before a hit, and around an excitation, it is at rest.
const MOVES: f64 = 0.1;

/// If the frequency early in a decay is below this fraction of the later one, slip is softening the
/// joint: partial slip, gross slip.
const SOFTENED: (f64, f64) = (0.9, 0.6);

/// If a straight line explains less of T than this in the first cycles, the loop is not clean.
const CLEAN_LINE: f64 = 0.95;

/// Analyses a record. With an excitation frequency it is treated as a shaker record; without one it
/// is treated as a shaker record if the motion is steady, and as an impact if it decays.
///
/// # Errors
/// [`HysteresisError`] when the signals do not match, nothing moves, or there is no whole cycle.
pub fn analyse(record: &HysteresisRecord) -> Result<LoopAnalysis, HysteresisError> {
    match excitation(record)? {
        Some(frequency_hz) => shaker(record, [None], frequency_hz).map(|[found]| found),
        None => impact(record, &record.relative()),
    }
}

/// As [`analyse`], with the force at the contact instead of the load cells' sum.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_corrected(
    record: &HysteresisRecord,
    correction: &Correction,
) -> Result<LoopAnalysis, HysteresisError> {
    if record.excitation_hz.is_none() {
        return analyse(&correction.applied(record));
    }
    // a shaker record is long, so it is not copied
    let frequency_hz = excitation(record)?.ok_or(HysteresisError::NoMotion)?;
    shaker(record, [Some(correction)], frequency_hz).map(|[found]| found)
}

/// The results of [`analyse`] and [`analyse_corrected`], in this order; the cycles of a shaker
/// record are cut once for both.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_both(
    record: &HysteresisRecord,
    correction: &Correction,
) -> Result<[LoopAnalysis; 2], HysteresisError> {
    if record.excitation_hz.is_none() {
        return Ok([analyse(record)?, analyse_corrected(record, correction)?]);
    }
    let frequency_hz = excitation(record)?.ok_or(HysteresisError::NoMotion)?;
    shaker(record, [None, Some(correction)], frequency_hz)
}

/// The frequency of a valid steady record; `None` for one that decays.
fn excitation(record: &HysteresisRecord) -> Result<Option<f64>, HysteresisError> {
    record.check()?;
    match record.excitation_hz {
        Some(f) if f > 0.0 && f.is_finite() => Ok(Some(f)),
        Some(f) => Err(HysteresisError::Excitation(f)),
        None if is_steady(&record.force_n) => {
            dominant_frequency(&record.force_n, record.fs_hz).map(Some).ok_or(HysteresisError::NoMotion)
        }
        None => Ok(None),
    }
}

/// The part of the record that moves.
fn moving(force_n: &[f64]) -> &[f64] {
    let rest = middle(force_n).unwrap_or_default();
    let most = force_n.iter().map(|v| (v - rest).abs()).fold(0.0, f64::max);
    let moves = |v: &f64| (v - rest).abs() >= MOVES * most;
    match (force_n.iter().position(moves), force_n.iter().rposition(moves)) {
        (Some(first), Some(last)) => &force_n[first..=last],
        _ => force_n,
    }
}

fn is_steady(force_n: &[f64]) -> bool {
    let force_n = moving(force_n);
    let quarter = force_n.len() / 4;
    let strength = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
        x.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt()
    };
    let of = |which: usize| strength(&force_n[which * quarter..(which + 1) * quarter]);
    quarter > 0 && (of(3) > STEADY * of(0) || of(1).max(of(2)) > of(0))
}

/// A resonance of one specimen that is visible in the record itself.
fn hidden_resonance(record: &HysteresisRecord) -> Option<ImaginaryPeak> {
    let contact = ContactCompliance::of_record(record, SEARCH_HZ)?;
    contact.imaginary_peak().filter(ImaginaryPeak::stands_out)
}

/// The first `most` cycles of the decay after a hit, and its shape; `None` for a steady record.
pub(super) fn decay_of(
    record: &HysteresisRecord,
    most: usize,
) -> Result<Option<(Decay, Shape)>, HysteresisError> {
    if excitation(record)?.is_some() {
        return Ok(None);
    }
    let decay = decay(&record.relative(), &record.force_n, record.fs_hz, most)?;
    let shape = shape_of(&decay);
    Ok(Some((decay, shape)))
}

fn shape_of(decay: &Decay) -> Shape {
    let ratio = decay.cycles[0].frequency_hz / decay.frequency_hz;
    if ratio < SOFTENED.1 {
        Shape::GrossSlip
    } else if ratio < SOFTENED.0 {
        Shape::Microslip
    } else {
        Shape::Stuck
    }
}

fn impact(record: &HysteresisRecord, motion: &Relative) -> Result<LoopAnalysis, HysteresisError> {
    let decay = decay(motion, &record.force_n, record.fs_hz, usize::MAX)?;
    let used = &decay.cycles[..FIRST_CYCLES.min(decay.cycles.len())];
    let slopes: Vec<f64> = used.iter().map(|c| c.stiffness_n_per_m).collect();
    let k = OverCycles::of(&slopes).expect("decay() gives at least one cycle");
    let (from, to) = (used[0].first_sample, used[used.len() - 1].end_sample);
    let shape = shape_of(&decay);
    let hidden = hidden_resonance(record);
    // the loops of a decay do not close, so they have no energy to check
    let findings: Vec<LoopFinding> = (k.mean < 0.0)
        .then_some(LoopFinding::ReversedForce { k_eq_n_per_m: k.mean, energy_j: 0.0 })
        .into_iter()
        .collect();
    let mut warnings = vec![
        "slope over the first cycles of a decay: it contains every mode that the hit excites, so it is not the contact's stiffness alone".to_string(),
    ];
    let worst = used.iter().map(|c| c.r_squared).fold(1.0, f64::min);
    if worst < CLEAN_LINE {
        warnings.push(format!(
            "a straight line explains only {:.0} % of T in the first cycles: local modes open the loop",
            100.0 * worst
        ));
    }
    if let Some(peak) = hidden {
        warnings.push(format!(
            "this slope is k_eq, not k_T: near {:.0} Hz Δx and T are out of phase, so it contains a resonance of one specimen",
            peak.frequency_hz
        ));
    }
    Ok(LoopAnalysis {
        kind: Kind::Impact,
        frequency_hz: decay.frequency_hz,
        amplitude_m: used[0].amplitude_m,
        force_amplitude_n: 0.5 * swing(&record.force_n[used[0].first_sample..used[0].end_sample]),
        shape,
        shape_evidence: None,
        k_t_n_per_m: (shape == Shape::Stuck && hidden.is_none() && findings.is_empty()).then_some(k),
        stick_part: None,
        k_eq_n_per_m: k,
        energy_j: None,
        k_secant_n_per_m: None,
        k_fundamental_n_per_m: None,
        friction_limit_n: None,
        friction_limit_ci95_n: None,
        friction_coefficient: None,
        friction_coefficient_ci95: None,
        phase_deg: decay.phase_deg,
        loop_displacement_m: decay.displacement_m[from..to].to_vec(),
        loop_force_n: record.force_n[from..to].to_vec(),
        decay_cycles: decay.cycles,
        findings,
        warnings,
    })
}

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
