//! A shaker's record: its cycles averaged, and everything that the average loop and its scatter say.

use super::HysteresisError;
use super::cycle::Cycle;
use super::cycles::{Force, Steady, Summed};
use super::finding::LoopFinding;
use super::friction_harmonic::Quadratures;
use super::hum;
use super::loop_analysis::{Kind, LoopAnalysis};
use super::loops::{
    OverCycles, energy, equivalent_stiffness, fundamental_stiffness, secant_stiffness, swing,
};
use super::plateau::Plateaus;
use super::record::HysteresisRecord;
use super::repair::Repair;
use super::shape::{Shape, shape};
use super::stick::{
    Part, bends, first_part, flank_part, friction_limit, slope_over, strokes, tangent_at_reversal,
};
use super::timing::Timing;
use crate::parallel::join;
use std::f64::consts::TAU;

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
///
/// # Errors
/// No whole cycle, or nothing moves.
pub(super) fn shaker<const N: usize>(
    record: &HysteresisRecord,
    forces: [Force<'_>; N],
    frequency_hz: f64,
) -> Result<[LoopAnalysis; N], HysteresisError> {
    let (timing, off) = timing(record, frequency_hz);
    let cycles = Steady::new(record, timing)?;
    let frequency_hz = timing.at(0.5 * record.force_n.len() as f64 / record.fs_hz);
    let (hum, summed) = join(|| hum::at_the_loop(record, frequency_hz), || cycles.summed(forces));
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
