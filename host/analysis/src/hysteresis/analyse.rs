//! The front door: a record in, its loop's figures out.

use super::HysteresisError;
use super::compliance::{ContactCompliance, ImaginaryPeak, SEARCH_HZ};
use super::correction::Correction;
use super::cycle::Cycle;
use super::cycles::{Force, Steady, Summed};
use super::finding::LoopFinding;
use super::friction_harmonic::Quadratures;
use super::hum;
use super::impact::{DecayCycle, FIRST_CYCLES, decay, dominant_frequency};
use super::loops::{
    OverCycles, energy, equivalent_stiffness, fundamental_stiffness, secant_stiffness, swing,
};
use super::plateau::Plateaus;
use super::record::{HysteresisRecord, Relative};
use super::repair::Repair;
use super::shape::{Shape, ShapeEvidence, shape};
use super::stick::{
    Part, bends, first_part, flank_part, friction_limit, slope_over, strokes, tangent_at_reversal,
};
use super::timing::Timing;
use num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// How the contact was moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Steadily, at one frequency.
    Shaker,
    /// By one hit, decaying.
    Impact,
}

/// All that a record's loops say. One loop of the shaker's kind is periodic; an impact's are those of its first cycles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopAnalysis {
    /// How it was moved.
    pub kind: Kind,
    /// Excitation frequency, or the dominant mode of the decay, Hz.
    pub frequency_hz: f64,
    /// Half the swing of Δx (averaged loop; first cycle of a decay), m.
    pub amplitude_m: f64,
    /// Half the swing of T in the same loop, N.
    pub force_amplitude_n: f64,
    /// The loop's shape.
    pub shape: Shape,
    /// What the shape was told from; none for a decay, where it is told from the frequency's fall at large amplitude.
    pub shape_evidence: Option<ShapeEvidence>,
    /// k_T: slope of the stick part, N/m. None for an ellipse.
    pub k_t_n_per_m: Option<OverCycles>,
    /// The part of the force's swing after each reversal in which k_T was read; only where something slips.
    pub stick_part: Option<[f64; 2]>,
    /// k_eq: least-squares slope over the whole loop, N/m.
    pub k_eq_n_per_m: OverCycles,
    /// Loop area per cycle, J. None for a decay, whose loops do not close.
    pub energy_j: Option<OverCycles>,
    /// Peak secant of the averaged loop, N/m.
    pub k_secant_n_per_m: Option<f64>,
    /// T₁/Δx₁ of the averaged loop, N/m (complex: real part, imaginary part).
    pub k_fundamental_n_per_m: Option<Complex<f64>>,
    /// μN from the plateau's median, N; only in gross slip.
    pub friction_limit_n: Option<f64>,
    /// μ; only with a known normal load.
    pub friction_coefficient: Option<f64>,
    /// Phase by which Δx lags T at the fundamental, degrees.
    pub phase_deg: f64,
    /// Δx of the loop to be drawn, m: the averaged cycle, or the first cycles of a decay.
    pub loop_displacement_m: Vec<f64>,
    /// T of the same points, N.
    pub loop_force_n: Vec<f64>,
    /// Every cycle of a decay; empty for a shaker.
    pub decay_cycles: Vec<DecayCycle>,
    /// What is wrong with the loop or was put right, with its measure.
    pub findings: Vec<LoopFinding>,
    /// What a reader must know.
    pub warnings: Vec<String>,
}

/// A record without an excitation frequency is steady when its last quarter is this strong against its first.
const STEADY: f64 = 0.7;

/// A decay's frequency below this fraction of its later one is slip softening the joint: some of it, all of it.
const SOFTENED: (f64, f64) = (0.9, 0.6);

/// A frequency that was read off a record may be off by this part.
const GUESSED: f64 = 5e-3;

/// A stuck loop's phase is positive, or the force is late: below minus this, rad (a quarter of a degree),
const LATE_RAD: f64 = 4.4e-3;

/// and so many standard deviations.
const LATE_SIGNIFICANT: f64 = 5.0;

/// A negative slope counts from so many standard errors on,
const REVERSED_SIGNIFICANT: f64 = 4.0;

/// if the loop's area is no larger than this part of force times displacement.
const NO_ENERGY: f64 = 0.05;

/// A line explaining less of T than this in the first cycles is no clean loop.
const CLEAN_LINE: f64 = 0.95;

/// Analyses a record. With an excitation frequency it is taken as a shaker record; without one it is a shaker record if the motion
/// is steady, and an impact if it decays.
///
/// # Errors
/// [`HysteresisError`] when the signals do not fit together, nothing moves, or there is no whole cycle.
pub fn analyse(record: &HysteresisRecord) -> Result<LoopAnalysis, HysteresisError> {
    match excitation(record)? {
        Some(frequency_hz) => shaker(record, [None], frequency_hz).map(|[found]| found),
        None => impact(record, &record.relative()),
    }
}

/// As [`analyse`], with the force at the contact in place of the load cells' sum.
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
    // a shaker's record is long: no second one is made of it
    let frequency_hz = excitation(record)?.ok_or(HysteresisError::NoMotion)?;
    shaker(record, [Some(correction)], frequency_hz).map(|[found]| found)
}

/// What [`analyse`] and [`analyse_corrected`] say, in this order; the cycles of a shaker's record are cut once for both.
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

/// The frequency of a steady record that is good; none of one that decays.
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

/// Cycles as they came, and what is to be said of their frequency.
fn timing(record: &HysteresisRecord, frequency_hz: f64) -> (Timing, Option<LoopFinding>) {
    let Some(tracked) = Timing::tracked(&record.force_n, record.fs_hz, frequency_hz) else {
        return (Timing::steady(frequency_hz), None);
    };
    let end_hz = tracked.at(record.force_n.len() as f64 / record.fs_hz);
    let off = LoopFinding::FrequencyOff {
        stated_hz: record.excitation_hz,
        from_hz: tracked.start_hz,
        to_hz: end_hz,
    };
    // a guess from the record's spectrum may be off by a part of a line
    let drifts = (end_hz / tracked.start_hz - 1.0).abs() > GUESSED;
    (tracked, (record.excitation_hz.is_some() || drifts).then_some(off))
}

/// The force against the motion, in loops that show no plateau: late by at least this.
fn late_at_least(quadratures: &Quadratures, frequency_hz: f64) -> Option<LoopFinding> {
    // microslip takes energy, which a delay must have given back before any is missing
    let friction = if quadratures.slips() { 0.6 * -5.0 * quadratures.third } else { 0.0 };
    let ahead = friction - quadratures.first;
    let turn = TAU * frequency_hz;
    (ahead > LATE_RAD.max(LATE_SIGNIFICANT * quadratures.first_std)).then(|| LoopFinding::LateForce {
        by_s: ahead / turn,
        std_s: quadratures.first_std / turn,
        at_least: true,
        corrected: false,
    })
}

/// A record's loops with each of these forces.
fn shaker<const N: usize>(
    record: &HysteresisRecord,
    forces: [Force<'_>; N],
    frequency_hz: f64,
) -> Result<[LoopAnalysis; N], HysteresisError> {
    let (timing, off) = timing(record, frequency_hz);
    let cycles = Steady::new(record, timing)?;
    let frequency_hz = timing.at(0.5 * record.force_n.len() as f64 / record.fs_hz);
    let hum = hum::at_the_loop(record, frequency_hz);
    let summed = cycles.summed(forces);
    let still = |all: &Summed| swing(&all.mean.displacement_m) == 0.0 || swing(&all.mean.force_n) == 0.0;
    if summed.iter().any(still) {
        return Err(HysteresisError::NoMotion);
    }
    let steady = SteadyRecord { record, cycles, frequency_hz, off, hum };
    let mut forces = forces.into_iter();
    Ok(summed.map(|all| steady.loops(forces.next().flatten(), all)))
}

/// What the loops of a steady record have in common, whichever force they show.
struct SteadyRecord<'a> {
    record: &'a HysteresisRecord,
    cycles: Steady<'a>,
    frequency_hz: f64,
    off: Option<LoopFinding>,
    hum: Option<LoopFinding>,
}

impl SteadyRecord<'_> {
    fn loops(&self, force: Force<'_>, summed: Summed) -> LoopAnalysis {
        let Self { record, cycles, frequency_hz, off, hum } = self;
        let frequency_hz = *frequency_hz;
        let Summed { mean, mut slopes, mut energies, harmonics, of_mean, scatter } = summed;
        let mut findings: Vec<LoopFinding> = off.iter().copied().collect();
        let raw = OverCycles::of(&slopes).expect("Steady::new() gives at least one cycle");
        let quadratures = Quadratures::of(&of_mean, &harmonics);
        let (shape, evidence) = shape(&mean, &scatter, quadratures);
        let taken = OverCycles::of(&energies).expect("as many as slopes");
        let reversed = is_reversed(&raw, &taken, 0.25 * swing(&mean.force_n) * swing(&mean.displacement_m));
        if reversed {
            findings.push(LoopFinding::ReversedForce { k_eq_n_per_m: raw.mean, energy_j: taken.mean });
        } else if shape != Shape::GrossSlip {
            findings.extend(quadratures.and_then(|q| late_at_least(&q, frequency_hz)));
        }
        findings.extend(hum.iter().copied());
        let strokes = strokes(&mean);
        let mut warnings = Vec::new();
        let repair = if shape == Shape::GrossSlip && !reversed {
            let (repair, said) = Repair::of(&mean, cycles.dt_s());
            findings.extend(said);
            repair
        } else {
            Repair::default()
        };
        if repair.is_late() {
            let both = cycles.each(force, |cycle| {
                let cycle = repair.in_step(cycle);
                (equivalent_stiffness(&cycle), energy(&cycle))
            });
            (slopes, energies) = both.into_iter().unzip();
        }
        let k_eq = OverCycles::of(&slopes).expect("as many as there are cycles");
        let friction = repair.friction(&mean);
        let stick_part: Option<Part> = match shape {
            Shape::Stuck | Shape::Elliptical => None,
            Shape::Microslip => Some(first_part(&friction, &strokes)),
            Shape::GrossSlip => Some(flank_part(&friction, &strokes)),
        };
        let k_t = match (shape, stick_part) {
            _ if reversed => None,
            (Shape::Stuck, _) => Some(k_eq),
            (_, None) => {
                warnings.push(
                "an ellipse without slip: something between the measured spots resonates near this frequency; its slope is no contact stiffness"
                    .into(),
            );
                None
            }
            (_, Some(part)) => {
                let read = |cycle: &Cycle| {
                    if bends(part) {
                        tangent_at_reversal(cycle, &strokes)
                    } else {
                        slope_over(cycle, &strokes, part)
                    }
                };
                let values: Vec<Option<f64>> = if repair.is_some() {
                    cycles.each(force, |cycle| read(&repair.friction(cycle)))
                } else {
                    cycles.each(force, read)
                };
                let values: Vec<f64> = values.into_iter().flatten().collect();
                if values.len() < slopes.len() {
                    warnings.push(format!(
                    "{} of {} cycles have too few samples on the stick part: sample faster, or excite more slowly",
                    slopes.len() - values.len(),
                    slopes.len()
                ));
                }
                let before = repair.is_some().then(|| read(&mean)).flatten();
                OverCycles::of(&values).map(|k| widened(k, before, repair.unsure()))
            }
        };
        let mut friction_limit_n =
            if shape == Shape::GrossSlip && !reversed { friction_limit(&friction, &strokes) } else { None };
        if let (Some(limit), Some(k)) = (friction_limit_n, k_t)
            && let Some(plateaus) = Plateaus::of(&friction, &strokes, k.mean, limit)
            && plateaus.is_uneven()
        {
            findings.push(LoopFinding::UnevenLoad { change: plateaus.change, std: plateaus.std });
            friction_limit_n = Some(plateaus.limit_n);
        }
        let shown = repair.in_step(&mean);
        LoopAnalysis {
            kind: Kind::Shaker,
            frequency_hz,
            amplitude_m: 0.5 * swing(&mean.displacement_m),
            force_amplitude_n: 0.5 * swing(&mean.force_n),
            shape,
            shape_evidence: Some(evidence),
            k_t_n_per_m: k_t,
            stick_part,
            k_eq_n_per_m: k_eq,
            energy_j: OverCycles::of(&energies),
            k_secant_n_per_m: Some(secant_stiffness(&shown)),
            k_fundamental_n_per_m: Some(fundamental_stiffness(&shown)),
            friction_limit_n,
            friction_coefficient: friction_limit_n
                .zip(record.normal_load_n)
                .map(|(limit, load)| limit / load),
            phase_deg: evidence.phase_deg,
            loop_displacement_m: mean.displacement_m,
            loop_force_n: mean.force_n,
            decay_cycles: Vec::new(),
            findings,
            warnings,
        }
    }
}

/// Whether the force has the wrong sign: it falls where the contact is pushed, and the loop takes no energy. One beside a resonance
/// may fall too, but takes some. `product` is that of both amplitudes, J.
fn is_reversed(slope: &OverCycles, energy: &OverCycles, product: f64) -> bool {
    let error = slope.std / (slope.cycles as f64).sqrt();
    slope.mean < -REVERSED_SIGNIFICANT * error && energy.mean < NO_ENERGY * product
}

/// The interval opened by what is not known of a repair that moved it here from `before`.
fn widened(k: OverCycles, before: Option<f64>, unsure: f64) -> OverCycles {
    let more = before.map_or(0.0, |before| 2.0 * unsure * (k.mean - before).abs());
    OverCycles { ci95: k.ci95.map(|[low, high]| [low - more, high + more]), ..k }
}

/// A resonance of one specimen that the record itself shows.
fn hidden_resonance(record: &HysteresisRecord) -> Option<ImaginaryPeak> {
    let contact = ContactCompliance::of_record(record, SEARCH_HZ)?;
    contact.imaginary_peak().filter(ImaginaryPeak::stands_out)
}

fn impact(record: &HysteresisRecord, motion: &Relative) -> Result<LoopAnalysis, HysteresisError> {
    let decay = decay(motion, &record.force_n, record.fs_hz)?;
    let used = &decay.cycles[..FIRST_CYCLES.min(decay.cycles.len())];
    let slopes: Vec<f64> = used.iter().map(|c| c.stiffness_n_per_m).collect();
    let k = OverCycles::of(&slopes).expect("decay() gives at least one cycle");
    let (from, to) = (used[0].first_sample, used[used.len() - 1].end_sample);
    let ratio = used[0].frequency_hz / decay.frequency_hz;
    let shape = if ratio < SOFTENED.1 {
        Shape::GrossSlip
    } else if ratio < SOFTENED.0 {
        Shape::Microslip
    } else {
        Shape::Stuck
    };
    let hidden = hidden_resonance(record);
    // the loops of a decay do not close, and have no energy to ask
    let findings: Vec<LoopFinding> = (k.mean < 0.0)
        .then_some(LoopFinding::ReversedForce { k_eq_n_per_m: k.mean, energy_j: 0.0 })
        .into_iter()
        .collect();
    let mut warnings = vec![
        "slope over the first cycles of a decay: every mode that the hit excites is in it, so it is not the contact's stiffness alone".to_string(),
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
            "this slope is k_eq, not k_T: near {:.0} Hz Δx and T are out of phase, so that a resonance of one specimen is in it",
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
