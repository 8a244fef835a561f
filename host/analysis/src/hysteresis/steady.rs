//! Analyses a shaker record: averages its cycles, evaluates the average loop and its scatter, and
//! looks for mains hum.
//!
//! At the loop's own frequency hum cannot be distinguished from the excitation: it is as steady,
//! and identical in every cycle. But hum has harmonics, and those that do not coincide with the
//! loop's own harmonics are isolated in the spectrum of the whole record.

use super::HysteresisError;
use super::cycles::{CycleForce, Harmonics, Steady, Summed};
use super::frequency::{Timing, line_sum, runs_at, turns};
use super::loops::{
    Cycle, OverCycles, closed_swing, energy, equivalent_stiffness, fundamental_stiffness, secant_stiffness,
    swing,
};
use super::record::{HysteresisRecord, Relative, RelativeMotion};
use super::repair::{Delay, Repair, delay};
use super::shape::{Quadratures, Shape, ShapeEvidence, shape};
use super::stick::{
    BEFORE_PLAY, Plateaus, Play, SwingPart, bends, first_part, flank_part, friction_limit, slope_over,
    strokes, tangent_at_reversal,
};
use super::{Kind, LoopAnalysis, LoopFinding};
use crate::median::{middle, noise_of};
use crate::parallel::join;
use crate::parallel::prelude::*;
use crate::spectra::fft::forward;
use num_complex::Complex;
use std::f64::consts::TAU;
use std::ops::Range;

/// Relative error of a frequency that was estimated from a record.
const GUESSED: f64 = 5e-3;

/// The phase of a stuck loop is positive. If it is below minus this, rad (a quarter of a degree),
const LATE_RAD: f64 = 4.4e-3;

/// and below minus this many standard deviations, the force is delayed.
const LATE_SIGNIFICANT: f64 = 5.0;

/// A negative slope counts from this many standard errors,
const REVERSED_SIGNIFICANT: f64 = 4.0;

/// if the loop's area is at most this fraction of force times displacement.
const NO_ENERGY: f64 = 0.05;

/// Steady cycles may differ in amplitude by this fraction of their median,
const ALIKE: f64 = 0.04;

/// in T₁/Δx₁ by this fraction,
const ALIKE_RATIO: f64 = 0.1;

/// or by this many times the scatter of neighbouring cycles, if that is more.
const SCATTERS: f64 = 12.0;

/// A cycle is at rest below this fraction of the largest amplitude.
const AT_REST: f64 = 0.05;

/// The cycles of a frequency that was not stated are those of an excitation if their average has
/// this fraction of their amplitude.
const IN_PHASE: f64 = 0.95;

/// If others have this many times their amplitude, steady cycles are the record's main part only
const LARGER: f64 = 2.0;

/// if they have this fraction of the sum of squares of all amplitudes.
const MAIN: f64 = 0.5;

/// Cycles whose mean square tells their scatter: with ten second differences, to a third. Of fewer
/// cycles, those that grow and fade would be taken for scatter.
const TELLING: usize = 12;

/// Start times of a record's cycles, and the finding on their frequency.
fn timing(
    record: &HysteresisRecord,
    frequency_hz: f64,
) -> Result<(Timing, Option<LoopFinding>), HysteresisError> {
    let runs_hz = match record.excitation_hz {
        // a record without a whole cycle at the stated frequency is refused, and the error states
        // that frequency
        Some(stated_hz) => {
            Steady::new(record, Timing::steady(stated_hz))?;
            runs_at(record, stated_hz)?
        }
        None => frequency_hz,
    };
    let tracked = Timing::tracked(&record.force_n, record.fs_hz, runs_hz);
    let other = runs_hz != frequency_hz;
    if tracked.is_none() && !other {
        return Ok((Timing::steady(frequency_hz), None));
    }
    let timing = tracked.unwrap_or(Timing::steady(runs_hz));
    let end_hz = timing.at(record.force_n.len() as f64 / record.fs_hz);
    let off = LoopFinding::FrequencyOff {
        stated_hz: record.excitation_hz,
        from_hz: timing.start_hz,
        to_hz: end_hz,
    };
    // a frequency estimated from the record's spectrum may be off by a fraction of a line
    let drifts = (end_hz / timing.start_hz - 1.0).abs() > GUESSED;
    Ok((timing, (record.excitation_hz.is_some() || drifts).then_some(off)))
}

/// Amplitude of Δx at the fundamental, m.
fn amplitude(cycle: &Harmonics) -> f64 {
    cycle.displacement[0].norm()
}

/// The longest run of cycles that are alike in amplitude and in T₁/Δx₁. Cycles at the beginning or
/// the end may differ if the excitation grows or decays, or if the contact is loaded for the first
/// time; those at rest before and after do not count. `noise` is the standard deviation of
/// amplitude and T₁/Δx₁ by the noise of the signals, as fractions.
fn alike(cycles: &[Harmonics], noise: impl Fn() -> [f64; 2]) -> Range<usize> {
    let moving = moving(cycles);
    let first = moving.start;
    let cycles = &cycles[moving];
    // more cycles show their scatter themselves
    let noise = if cycles.len() < TELLING { noise() } else { [0.0; 2] };
    let ratio = |h: &Harmonics| h.force[0] / h.displacement[0];
    let scaled = |of: &dyn Fn(&Harmonics) -> f64, by: f64| -> Vec<f64> {
        cycles.iter().map(|cycle| of(cycle) / by).collect()
    };
    let size = |of: &dyn Fn(&Harmonics) -> f64| middle(&scaled(of, 1.0)).unwrap_or(f64::NAN);
    let (a, r) = (size(&amplitude), size(&|h| ratio(h).norm()));
    let series = [scaled(&amplitude, a), scaled(&|h| ratio(h).re, r), scaled(&|h| ratio(h).im, r)];
    let found = alike_in(&series, noise);
    first + found.start..first + found.end
}

/// From the first cycle that moves to the last one. The largest amplitude is one that two
/// neighbours have, so that a single disturbance does not make the others rest.
fn moving(cycles: &[Harmonics]) -> Range<usize> {
    let amplitudes: Vec<f64> = cycles.iter().map(amplitude).collect();
    let largest = amplitudes.windows(2).map(|two| two[0].min(two[1])).fold(0.0, f64::max);
    let moves = |own: &f64| *own >= AT_REST * largest;
    match (amplitudes.iter().position(moves), amplitudes.iter().rposition(moves)) {
        (Some(first), Some(last)) => first..last + 1,
        _ => 0..cycles.len(),
    }
}

/// As [`alike`], for the amplitudes and both parts of T₁/Δx₁, relative to their medians.
fn alike_in(series: &[Vec<f64>; 3], noise: [f64; 2]) -> Range<usize> {
    let limits = |scatters: [f64; 3]| -> [f64; 3] {
        let least = [ALIKE, ALIKE_RATIO, ALIKE_RATIO];
        std::array::from_fn(|of| least[of].max(SCATTERS * scatters[of]))
    };
    let [of_amplitude, of_ratio] = noise;
    let of_noise = [of_amplitude, of_ratio, of_ratio];
    let first = limits(std::array::from_fn(|of| scatter(&series[of], of_noise[of])));
    let used = longest_inside(series, first);
    if used.len() == series[0].len() {
        return used;
    }
    // a quartile of few values is uncertain: by chance it can be a third of its expectation, and
    // cycles that are only noisy would then be left out. The cycles found alike give a better value
    let again = limits(series.each_ref().map(|values| scatter_of_alike(&values[used.clone()])));
    longest_inside(series, std::array::from_fn(|of| first[of].max(again[of])))
}

/// The longest range in which the values of each series span at most its limit.
fn longest_inside(series: &[Vec<f64>; 3], limits: [f64; 3]) -> Range<usize> {
    let inside = |values: &[f64], limit: f64| -> bool {
        let (low, high) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        // values that are not finite cannot be compared
        high - low <= limit || !(high - low).is_finite()
    };
    let all_inside =
        |range: Range<usize>| series.iter().zip(limits).all(|(v, limit)| inside(&v[range.clone()], limit));
    let n = series[0].len();
    if all_inside(0..n) {
        return 0..n;
    }
    let mut longest = 0..1;
    let mut start = 0;
    for end in 1..=n {
        while !all_inside(start..end) {
            start += 1;
        }
        if end - start > longest.len() {
            longest = start..end;
        }
    }
    longest
}

/// Second differences, scaled to the standard deviation of independent values: a steady change has
/// none.
fn second_differences(values: &[f64]) -> impl Iterator<Item = f64> {
    values.windows(3).map(|v| (v[2] - 2.0 * v[1] + v[0]).abs() / 6f64.sqrt())
}

/// Standard deviation of the scatter between neighbouring values, from the lower quartile of their
/// second differences: a growing beginning has few small ones. Of a few values most may grow and
/// fade, so that only the smallest difference counts, or the noise of the signals, if that is more.
fn scatter(values: &[f64], noise: f64) -> f64 {
    let mut changes: Vec<f64> = second_differences(values).collect();
    changes.sort_by(f64::total_cmp);
    if values.len() < TELLING {
        return if changes.len() < 2 { noise } else { noise.max(changes[0]) };
    }
    // a quarter of normally distributed values lies within 0.3186 standard deviations
    changes[(changes.len() - 1) / 4] / 0.3186
}

/// As [`scatter`], from the mean square: for values without a growing beginning. Zero for fewer
/// than [`TELLING`] values.
fn scatter_of_alike(values: &[f64]) -> f64 {
    if values.len() < TELLING {
        return 0.0;
    }
    let squares: f64 = second_differences(values).map(|change| change * change).sum();
    (squares / (values.len() - 2) as f64).sqrt()
}

/// Standard deviation of a cycle's amplitude and T₁/Δx₁ by the independent noise of the samples,
/// as fractions of them.
fn noise_of_a_cycle(record: &HysteresisRecord, points: usize) -> [f64; 2] {
    let part = |signal: &[f64]| {
        let mean = signal.iter().sum::<f64>() / signal.len() as f64;
        let square = signal.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / signal.len() as f64;
        // the amplitude is √2 of the standard deviation, its noise √(2/n) of that of a sample
        noise_of(signal) / (square * points as f64).sqrt()
    };
    let (Relative::Velocity(motion) | Relative::Displacement(motion)) = record.relative();
    let (motion, force) = (part(&motion), part(&record.force_n));
    [motion, motion.hypot(force)]
}

/// The cycles that are alike, and the finding on the others.
fn steady_part<'a>(
    cycles: &Steady<'a>,
    summed: &Summed,
) -> Result<(Steady<'a>, Option<LoopFinding>), HysteresisError> {
    let measured = if summed.as_measured.is_empty() { &summed.harmonics } else { &summed.as_measured };
    let noise = || noise_of_a_cycle(cycles.record(), cycles.points());
    let (with_drift, without) = (alike(measured, noise), alike(&summed.harmonics, noise));
    let (used, each) =
        if without.len() > with_drift.len() { (without, &summed.harmonics) } else { (with_drift, measured) };
    if used.len() == each.len() {
        return Ok((cycles.only(used), None));
    }
    let amplitude_m = each[used.clone()].iter().map(amplitude).sum::<f64>() / used.len() as f64;
    let squares = |cycles: &[Harmonics]| cycles.iter().map(|cycle| amplitude(cycle).powi(2)).sum::<f64>();
    let (low_m, high_m) = each
        .iter()
        .map(amplitude)
        .fold((f64::INFINITY, 0.0f64), |(low, high), own| (low.min(own), high.max(own)));
    let minor = high_m > LARGER * amplitude_m && squares(&each[used.clone()]) < MAIN * squares(each);
    if used.len() < 2 || minor {
        return Err(HysteresisError::NotSteady { cycles: each.len(), low_m, high_m });
    }
    let others = each[..used.start].iter().chain(&each[used.end..]).map(amplitude);
    let left_out_amplitude_m = others
        .max_by(|a, b| (a - amplitude_m).abs().total_cmp(&(b - amplitude_m).abs()))
        .unwrap_or(amplitude_m);
    let said = LoopFinding::Unsteady {
        left_out_first: used.start,
        left_out_last: each.len() - used.end,
        used: used.len(),
        amplitude_m,
        left_out_amplitude_m,
    };
    Ok((cycles.only(used), Some(said)))
}

/// How often the frequency of the steady cycles is found again from their phase. The first time
/// cycles may still reach into others that grow.
const TIMES: usize = 3;

/// The steady part of the record at the constant frequency of these cycles; none if fewer cycles
/// are alike then, because the frequency drifts.
fn timed_again<'a, const N: usize>(
    cycles: &Steady<'a>,
    summed: &Summed,
    forces: [CycleForce<'_>; N],
) -> Option<(Steady<'a>, Option<LoopFinding>)> {
    let mut steady_hz = cycles.middle_hz() * (1.0 + turned_per_cycle(&summed.harmonics)?);
    let mut found = None;
    for _ in 0..TIMES {
        let again = Steady::new(cycles.record(), Timing::steady(steady_hz)).ok()?;
        let (own, left_out) = steady_part(&again, again.summed(forces).first()?).ok()?;
        steady_hz *= 1.0 + turned_per_cycle(&own.summed(forces).first()?.harmonics)?;
        found = Some((own, left_out));
    }
    found.filter(|(own, _)| own.len() >= cycles.len())
}

/// By what part of a turn the motion's phase advances from cycle to cycle: by how much its
/// frequency is above that of the cycles. None for a single cycle.
fn turned_per_cycle(cycles: &[Harmonics]) -> Option<f64> {
    let steps = cycles.windows(2).map(|two| two[1].displacement[0] * two[0].displacement[0].conj());
    (cycles.len() > 1).then(|| steps.sum::<Complex<f64>>().arg() / TAU)
}

/// Amplitude of the average cycle over the root mean square of those of the cycles: 1 if all have
/// the same phase.
fn in_phase(summed: &Summed) -> f64 {
    let each = summed.harmonics.iter().map(|cycle| amplitude(cycle).powi(2)).sum::<f64>();
    amplitude(&summed.of_mean) / (each / summed.harmonics.len() as f64).sqrt()
}

/// Delay of the force relative to the motion in loops without a plateau: a lower bound.
fn late_at_least(quadratures: &Quadratures, frequency_hz: f64) -> Option<LoopFinding> {
    // microslip dissipates energy, so a delay must first cancel that before the loop's area turns
    // negative
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

/// Analyses a record's loops with each of these forces.
///
/// # Errors
/// No whole cycle, or nothing moves.
pub(super) fn shaker<const N: usize>(
    record: &HysteresisRecord,
    forces: [CycleForce<'_>; N],
    frequency_hz: f64,
) -> Result<[LoopAnalysis; N], HysteresisError> {
    let (timing, mut off) = timing(record, frequency_hz)?;
    let cycles = Steady::new(record, timing)?;
    let mut frequency_hz = timing.at(0.5 * record.force_n.len() as f64 / record.fs_hz);
    let (hum, mut summed) = join(|| hum_at_the_loop(record, frequency_hz), || cycles.summed(forces));
    let still = |all: &Summed| swing(&all.mean.displacement_m) == 0.0 || swing(&all.mean.force_n) == 0.0;
    if summed.iter().any(still) {
        return Err(HysteresisError::NoMotion);
    }
    // all forces share the cycles of the first
    let Some(first) = summed.first() else { return Err(HysteresisError::NoMotion) };
    let (mut cycles, mut unsteady) = steady_part(&cycles, first)?;
    if unsteady.is_some() {
        summed = cycles.summed(forces);
        // the frequency of the whole record contains the phase of cycles that grow, fade or rest
        if record.excitation_hz.is_none()
            && let Some((again, left_out)) = timed_again(&cycles, &summed[0], forces)
        {
            (cycles, unsteady, off) = (again, left_out, None);
            summed = cycles.summed(forces);
        }
        frequency_hz = cycles.middle_hz();
    }
    if record.excitation_hz.is_none() && in_phase(&summed[0]) < IN_PHASE {
        return Err(HysteresisError::NoSteadyPhase { cycles: cycles.len(), frequency_hz });
    }
    let said = [off, unsteady, hum].into_iter().flatten().collect();
    let steady = SteadyRecord { record, cycles, frequency_hz, said };
    let mut forces = forces.into_iter();
    Ok(summed.map(|all| steady.loops(forces.next().flatten(), &all)))
}

/// Data common to the loops of a steady record, independent of the force used.
struct SteadyRecord<'a> {
    record: &'a HysteresisRecord,
    cycles: Steady<'a>,
    frequency_hz: f64,
    /// Findings of the whole record.
    said: Vec<LoopFinding>,
}

impl SteadyRecord<'_> {
    fn loops(&self, force: CycleForce<'_>, summed: &Summed) -> LoopAnalysis {
        let Self { record, cycles, frequency_hz, said } = self;
        let (frequency_hz, dt_s) = (*frequency_hz, cycles.dt_s());
        let mut findings = said.clone();
        let Summed { mean, slopes, energies, harmonics, of_mean, scatter, .. } = summed;
        let (mut slopes, mut energies) = (slopes.clone(), energies.clone());
        let raw = OverCycles::of(&slopes).expect("Steady::new() gives at least one cycle");
        let quadratures = Quadratures::of(of_mean, harmonics);
        let (mut shape_found, mut evidence) = shape(mean, scatter, quadratures);
        let taken = OverCycles::of(&energies).expect("as many as slopes");
        let product = 0.25 * swing(&mean.force_n) * swing(&mean.displacement_m);
        let reversed = is_reversed(&raw, &taken, product);
        let strokes = strokes(mean);
        let mut play = if evidence.bends() && !reversed { Play::of(mean, &strokes) } else { None };
        let out_of_step = if evidence.bends() && !reversed {
            delay(mean, dt_s, play.map_or(0.0, |play| play.size_m))
        } else {
            Delay::None
        };
        let mut late = [0.0, 0.0];
        if let Delay::Found(by_s, std_s) = out_of_step {
            let in_step = Repair::in_step_by(by_s, std_s, dt_s).in_step(mean);
            let (again, seen) = shape(&in_step, scatter, None);
            (shape_found, evidence) = (again, ShapeEvidence { quadratures, ..seen });
            play = Play::of(&in_step, &strokes);
            late = [by_s, std_s];
        }
        let [late_s, late_std_s] = late;
        let shape = shape_found;
        let play_m = play.map_or(0.0, |play| play.size_m);
        let not_put_right = match out_of_step {
            Delay::NotExplained(by_s, std_s) => Some((by_s, std_s)),
            // in gross slip the corners distinguish a dashpot from a delay
            Delay::OrDamped(by_s, std_s) if shape != Shape::GrossSlip => Some((by_s, std_s)),
            _ => None,
        };
        if reversed {
            findings.push(LoopFinding::ReversedForce { k_eq_n_per_m: raw.mean, energy_j: taken.mean });
        } else if let Some((by_s, std_s)) = not_put_right {
            findings.push(LoopFinding::LateForce { by_s, std_s, at_least: false, corrected: false });
        } else if shape != Shape::GrossSlip && late_s == 0.0 {
            findings.extend(quadratures.and_then(|q| late_at_least(&q, frequency_hz)));
        }
        findings.extend(play.map(|Play { size_m, std_m }| LoopFinding::Play { size_m, std_m }));
        let mut warnings = Vec::new();
        let usable = !reversed && not_put_right.is_none();
        let in_step_by = Repair::in_step_by(late_s, late_std_s, dt_s);
        let repair = if shape == Shape::GrossSlip && usable {
            let (repair, said) = Repair::of(&in_step_by.in_step(mean), dt_s, play_m, late_s);
            findings.extend(said);
            repair
        } else {
            if late_s != 0.0 && usable {
                findings.push(LoopFinding::LateForce {
                    by_s: late_s,
                    std_s: late_std_s,
                    at_least: false,
                    corrected: true,
                });
            }
            in_step_by
        };
        if repair.is_late() {
            let both = cycles.each(force, summed, |cycle| {
                let cycle = repair.in_step(cycle);
                (equivalent_stiffness(&cycle), energy(&cycle))
            });
            (slopes, energies) = both.into_iter().unzip();
        }
        let k_eq = OverCycles::of(&slopes).expect("as many as there are cycles");
        let friction = repair.friction(mean);
        let stick_part: Option<SwingPart> = match shape {
            Shape::Stuck | Shape::Elliptical => None,
            Shape::Microslip => Some(first_part(&friction, &strokes)),
            Shape::GrossSlip if play.is_some() => Some(BEFORE_PLAY),
            Shape::GrossSlip => Some(flank_part(&friction, &strokes)),
        };
        let k_t = match (shape, stick_part) {
            _ if !usable => None,
            (Shape::Stuck, _) => Some(k_eq),
            (_, None) => {
                warnings.push(if evidence.is_unsure() {
                    "an ellipse within the noise: it may hide slip, or something between the measured spots resonates near this frequency or adds \
                     damping, or the force is out of step with the motion; its slope is no contact stiffness".into()
                } else {
                    "an ellipse without slip: something between the measured spots resonates near this frequency or adds damping, or the force is out \
                     of step with the motion; an ellipse alone does not show which. Its slope is no contact stiffness".into()
                });
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
                    cycles.each(force, summed, |cycle| read(&repair.friction(cycle)))
                } else {
                    cycles.each(force, summed, read)
                };
                let values: Vec<f64> = values.into_iter().flatten().collect();
                if values.len() < slopes.len() {
                    warnings.push(format!(
                    "{} of {} cycles have too few samples on the stick part: sample faster, or excite more slowly",
                    slopes.len() - values.len(),
                    slopes.len()
                ));
                }
                let before = repair.is_some().then(|| read(mean)).flatten();
                OverCycles::of(&values).map(|k| widened(k, before, repair.unsure()))
            }
        };
        let mut friction_limit_n =
            if shape == Shape::GrossSlip && usable { friction_limit(&friction, &strokes) } else { None };
        if let (Some(limit), Some(k)) = (friction_limit_n, k_t)
            && let Some(plateaus) = Plateaus::of(&friction, &strokes, k.mean, limit, play_m)
            && plateaus.is_uneven()
        {
            findings.push(LoopFinding::UnevenLoad { change: plateaus.change, std: plateaus.std });
            friction_limit_n = Some(plateaus.limit_n);
        }
        let friction_limit_ci95_n = friction_limit_n.and_then(|limit| {
            let of_cycle = |cycle: &Cycle| friction_limit(&repair.friction(cycle), &strokes);
            let values: Vec<f64> = cycles.each(force, summed, of_cycle).into_iter().flatten().collect();
            let over = widened(OverCycles::of(&values)?, friction_limit(mean, &strokes), repair.unsure());
            // of the averaged loop the medians are less noisy than those of single cycles
            Some(over.ci95?.map(|end| limit + end - over.mean))
        });
        let of_load = |force_n: f64| record.normal_load_n.map(|load_n| force_n / load_n);
        let shown = repair.in_step(mean);
        LoopAnalysis {
            kind: Kind::Shaker,
            frequency_hz,
            amplitude_m: 0.5 * closed_swing(&mean.displacement_m),
            force_amplitude_n: 0.5 * closed_swing(&mean.force_n),
            shape,
            shape_evidence: Some(evidence),
            k_t_n_per_m: k_t,
            stick_part,
            k_eq_n_per_m: k_eq,
            energy_j: OverCycles::of(&energies),
            k_secant_n_per_m: Some(secant_stiffness(&shown)),
            k_fundamental_n_per_m: Some(fundamental_stiffness(&shown)),
            friction_limit_n,
            friction_limit_ci95_n,
            friction_coefficient: friction_limit_n.and_then(of_load),
            friction_coefficient_ci95: friction_limit_ci95_n
                .and_then(|[low, high]| Some([of_load(low)?, of_load(high)?])),
            phase_deg: evidence.phase_deg,
            loop_displacement_m: mean.displacement_m.clone(),
            loop_force_n: mean.force_n.clone(),
            decay_cycles: Vec::new(),
            findings,
            warnings,
        }
    }
}

/// Whether the force has the wrong sign: it falls while the contact is pushed, and the loop
/// dissipates no energy. The force near a resonance may fall too, but then energy is dissipated.
/// `product` is that of both amplitudes, J.
fn is_reversed(slope: &OverCycles, energy: &OverCycles, product: f64) -> bool {
    let error = slope.std / (slope.cycles as f64).sqrt();
    slope.mean < -REVERSED_SIGNIFICANT * error && energy.mean < NO_ENERGY * product
}

/// The interval widened by the uncertainty of a correction that moved the value here from `before`.
fn widened(k: OverCycles, before: Option<f64>, unsure: f64) -> OverCycles {
    let more = before.map_or(0.0, |before| 2.0 * unsure * (k.mean - before).abs());
    OverCycles { ci95: k.ci95.map(|[low, high]| [low - more, high + more]), ..k }
}

/// Mains frequencies in use, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Number of multiples that are checked.
const MULTIPLES: usize = 10;

/// Relative variation of the mains frequency.
const WANDER: f64 = 2e-3;

/// Longest part of the record that is used, s.
const LONGEST_S: f64 = 4.0;

/// Line widths (1/duration) that a Blackman-Harris window needs to separate two lines.
const APART: f64 = 5.0;

/// A line stands out if its power is this many times the mean of its surroundings: noise alone
/// exceeds it once in 10⁷ lines (F distribution of 2 and 2 `SURROUNDINGS` degrees of freedom; the
/// window correlates neighbours in pairs).
const STANDS_OUT: f64 = 25.0;

/// Lines on each side that determine the level of the surroundings.
const SURROUNDINGS: i32 = 24;

/// Tolerance, in line widths, for a frequency to count as lying on a line; it changes no amplitude
/// by a larger fraction.
const ON_A_LINE: f64 = 1e-6;

/// Hum below this fraction of the fundamental has no effect worth reporting.
const MATTERS: f64 = 2e-3;

/// Looks for hum in a record whose loop runs at `frequency_hz`.
fn hum_at_the_loop(record: &HysteresisRecord, frequency_hz: f64) -> Option<LoopFinding> {
    let samples = record.force_n.len().min((LONGEST_S * record.fs_hz) as usize);
    let line_hz = record.fs_hz / samples as f64;
    let multiple = |mains: f64| (frequency_hz / mains).round() * mains;
    // hum averages out unless it is within a line's width, or within the mains' variation, of the
    // loop's frequency
    let near = |mains: &f64| {
        let at = multiple(*mains);
        at > 0.0 && (frequency_hz - at).abs() < line_hz + WANDER * at
    };
    let candidates: Vec<f64> = MAINS_HZ.into_iter().filter(near).collect();
    if candidates.is_empty() {
        return None;
    }
    let (RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b }
    | RelativeMotion::Displacement { a_m: a, b_m: b }) = &record.motion;
    let relative = || a[..samples].iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
    let (force, relative) = join(|| windowed(&record.force_n[..samples]), || windowed(&relative()));
    let strongest = |mains: f64| {
        let of = |signal: &[f64]| part(signal, record.fs_hz, frequency_hz, mains);
        let (force, relative) = join(|| of(&force), || of(&relative));
        force.max(relative)
    };
    candidates
        .into_iter()
        .map(|mains_hz| LoopFinding::Hum { mains_hz, at_hz: multiple(mains_hz), part: strongest(mains_hz) })
        .find(|found| matches!(found, LoopFinding::Hum { part, .. } if *part > MATTERS))
}

/// The strongest isolated multiple of the mains frequency over the fundamental; 0 if none stands
/// out.
fn part(signal: &[f64], fs_hz: f64, frequency_hz: f64, mains_hz: f64) -> f64 {
    let line_hz = fs_hz / signal.len() as f64;
    let fft = forward(signal.len());
    let mut spectrum = fft.make_output_vec();
    // buffer lengths match the FFT plan, so this cannot fail
    if fft.process(&mut signal.to_vec(), &mut spectrum).is_err() {
        return 0.0;
    }
    let amplitude = |f: f64| amplitude_at(signal, &spectrum, f, fs_hz);
    let fundamental = amplitude(frequency_hz);
    let free = |f: &f64| {
        let harmonic = (f / frequency_hz).round() * frequency_hz;
        (f - harmonic).abs() > 2.0 * APART * line_hz + WANDER * f && *f < 0.45 * fs_hz
    };
    let multiples: Vec<f64> = (1..=MULTIPLES).map(|m| m as f64 * mains_hz).filter(free).collect();
    let found: Vec<Option<f64>> = multiples
        .into_par_iter()
        .map(|f| {
            // the mains frequency may be slightly off: take the largest of the lines nearby
            let reach = (WANDER * f / line_hz).ceil() as i32;
            let here = (-reach..=reach).map(|o| amplitude(f + f64::from(o) * line_hz)).fold(0.0, f64::max);
            let next = APART as i32 + reach;
            let beside = (next..next + SURROUNDINGS).flat_map(|o| [-o, o]);
            let around: Vec<f64> = beside
                .map(|o| f + f64::from(o) * line_hz)
                .filter(|f| *f > APART * line_hz && free(f))
                .filter_map(|f| spectrum.get((f / line_hz).round() as usize).map(Complex::norm_sqr))
                .collect();
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            (here * here > STANDS_OUT * mean).then_some(here / fundamental)
        })
        .collect();
    found.into_iter().flatten().fold(0.0, f64::max)
}

/// |X| at `f`: from the signal's spectrum if that has a line there, as for multiples of the mains
/// frequency in whole seconds, otherwise by direct summation.
fn amplitude_at(signal: &[f64], spectrum: &[Complex<f64>], f: f64, fs_hz: f64) -> f64 {
    // a real signal has the same magnitude at −f
    let widths = (f * signal.len() as f64 / fs_hz).abs();
    match spectrum.get(widths.round() as usize) {
        Some(line) if (widths - widths.round()).abs() < ON_A_LINE => line.norm(),
        _ => line_sum(signal, -TAU * f / fs_hz).norm(),
    }
}

/// Removes the mean and applies a Blackman-Harris window: 92 dB between lines that are five widths
/// apart.
fn windowed(x: &[f64]) -> Vec<f64> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let half = Complex::from_polar(1.0, 0.5 * TAU / n);
    let turns = turns(0..x.len(), TAU / n);
    x.iter()
        .zip(&turns)
        .map(|(v, turn)| {
            // cosines of two and three times the angle, computed from that of the angle
            let c = (half * turn).re;
            let (c2, c3) = (2.0 * c * c - 1.0, c * (4.0 * c * c - 3.0));
            (v - mean) * (0.35875 - 0.48829 * c + 0.14128 * c2 - 0.01168 * c3)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FS_HZ: f64 = 51_200.0;

    /// 0.6 s of 200 Hz plus one sample.
    const SAMPLES: u32 = 30_721;

    /// 200 Hz in noise, with this fraction of hum at 150 Hz.
    fn in_noise(samples: u32, seed: u64, hum: f64) -> Vec<f64> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let signal: Vec<f64> = (0..samples)
            .map(|i| {
                let turns = TAU * f64::from(i) / FS_HZ;
                let noise: f64 = StandardNormal.sample(&mut rng);
                (200.0 * turns).sin() + hum * (150.0 * turns).sin() + 0.15 * noise
            })
            .collect();
        windowed(&signal)
    }

    #[test]
    fn noise_is_no_hum_and_hum_is_found_in_it() {
        for seed in 0..100 {
            for mains in MAINS_HZ {
                let found = part(&in_noise(SAMPLES, seed, 0.0), FS_HZ, 200.0, mains);
                assert!(found == 0.0, "seed {seed}: {found} at {mains} Hz");
            }
        }
        for seed in 0..20 {
            let found = part(&in_noise(SAMPLES, seed, 0.02), FS_HZ, 200.0, 50.0);
            assert!((found - 0.02).abs() < 0.005, "seed {seed}: {found}");
        }
    }

    /// 60 cycles of 0.1 µm at 100 Hz, whose amplitudes scatter by 1 %: their range is 4.6 %, and
    /// the quartile of their second differences was too small in one record of 1200.
    #[test]
    fn cycles_that_only_scatter_are_alike_and_a_growing_beginning_is_not() {
        for seed in 0..20_000 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let mut values = |std: f64| -> Vec<f64> {
                (0..60).map(|_| 1.0 + std * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect()
            };
            let noise = [values(0.01), values(0.03), values(0.03)];
            assert_eq!(alike_in(&noise, [0.0; 2]), 0..60, "seed {seed}");
            let [mut amplitudes, re, im] = noise;
            amplitudes.iter_mut().enumerate().for_each(|(n, a)| *a -= 0.4 * (-(n as f64) / 3.0).exp());
            let used = alike_in(&[amplitudes, re, im], [0.0; 2]);
            // 12 scatters allow a range of 12 %, of which the noise takes about 5
            assert!(used.start >= 1 && used.len() >= 45, "seed {seed}: {used:?}");
        }
    }

    /// In 0.6 s, multiples of 50 Hz are lines of the spectrum.
    #[test]
    fn a_line_of_the_spectrum_is_the_sum_that_it_stands_for() {
        let signal = in_noise(SAMPLES - 1, 1, 0.02);
        let fft = forward(signal.len());
        let mut spectrum = fft.make_output_vec();
        fft.process(&mut signal.clone(), &mut spectrum).expect("lengths are the plan's own");
        let summed = |f: f64| line_sum(&signal, -TAU * f / FS_HZ).norm();
        for f in [50.0, 150.0, 200.0, 450.0] {
            let line = (f * signal.len() as f64 / FS_HZ).round() as usize;
            let found = amplitude_at(&signal, &spectrum, f, FS_HZ);
            assert_eq!(found.to_bits(), spectrum[line].norm().to_bits(), "{f} Hz");
            // rounding of both, relative to the highest line
            assert!((found - summed(f)).abs() < 1e-12 * summed(200.0), "{f} Hz: {found} {}", summed(f));
        }
        let beside = 150.3;
        assert_eq!(amplitude_at(&signal, &spectrum, beside, FS_HZ).to_bits(), summed(beside).to_bits());
    }

    /// The hum found does not depend on the method used: one sample more or less.
    #[test]
    fn lines_of_the_spectrum_say_what_sums_say() {
        for seed in 0..20 {
            let [on, off] = [SAMPLES - 1, SAMPLES]
                .map(|samples| part(&in_noise(samples, seed, 0.02), FS_HZ, 200.0, 50.0));
            // one sample of 30 000, and a shift of the line by 3e-3 of its width
            assert!((on / off - 1.0).abs() < 1e-3, "seed {seed}: {on} {off}");
        }
    }
}
