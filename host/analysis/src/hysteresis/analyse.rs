//! Entry point of the module: takes a record and returns the figures of its loop.

use super::HysteresisError;
use super::compliance::{ContactCompliance, ImaginaryPeak, SEARCH_HZ};
use super::dominant_frequency::dominant_frequency;
use super::impact::{Decay, FIRST_CYCLES, decay};
use super::loop_analysis::LoopFinding;
use super::loop_analysis::{Kind, LoopAnalysis};
use super::loops::{OverCycles, swing};
use super::record::{HysteresisRecord, Relative};
use super::shape::Shape;
use super::static_arm::Correction;
use super::steady::shaker;

/// A record without an excitation frequency counts as steady when the strength of its last quarter
/// is at least this fraction of that of its first.
const STEADY: f64 = 0.7;

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

fn is_steady(force_n: &[f64]) -> bool {
    let quarter = force_n.len() / 4;
    let strength = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
        x.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt()
    };
    quarter > 0 && strength(&force_n[3 * quarter..4 * quarter]) > STEADY * strength(&force_n[..quarter])
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
        friction_coefficient: None,
        phase_deg: decay.phase_deg,
        loop_displacement_m: decay.displacement_m[from..to].to_vec(),
        loop_force_n: record.force_n[from..to].to_vec(),
        decay_cycles: decay.cycles,
        findings,
        warnings,
    })
}
