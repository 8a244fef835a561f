//! The loops of the impacts: the first cycle of each hit used, and all of them combined.

use super::cell::{ContactDelays, ContactSignals};
use super::checks::HiddenResonance;
use crate::hysteresis::analyse::{DECAY_CYCLES, FirstCycle};
use crate::hysteresis::cycles::open_record;
use crate::hysteresis::impact::DecayCycle;
use crate::hysteresis::phase_split::decaying;
use crate::hysteresis::static_arm::Identified;
use crate::hysteresis::{HysteresisError, OverCycles, Shape, record};
use crate::results::{DecayStep, ImpactSlope, LoopCurve, Reconstruction, rounded};

/// If a straight line explains less of T than this, the loop is not clean.
const CLEAN_LINE: f64 = 0.9;

/// One hit and its first cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactLoop {
    /// The record.
    pub record: i64,
    /// The impact's name.
    pub impact: String,
    /// Its first cycle.
    pub first: FirstCycle,
}

/// All first cycles combined.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactLoops {
    /// The records, in the order of the cells.
    pub records: Vec<i64>,
    /// The most frequent shape.
    pub shape: Shape,
    /// Slope of T on Δx, N/m.
    pub slope_n_per_m: OverCycles,
    /// The same with the corrected force; `None` if the static arm is not known.
    pub corrected_n_per_m: Option<OverCycles>,
    /// The name that this slope may be given.
    pub slope_is: SlopeIs,
    /// Mean frequency of the decays' main mode, Hz.
    pub frequency_hz: Option<f64>,
    /// Mean of half the swing of Δx, m.
    pub amplitude_m: Option<f64>,
    /// Mean phase by which Δx lags T over the first cycle, degrees; equal to that of the decay's
    /// first step.
    pub phase_deg: Option<f64>,
    /// Number of cycles in which a straight line explains less than 90 % of T.
    pub open: usize,
    /// The decay's cycles over all hits.
    pub decay: Vec<DecayStep>,
    /// The slopes of the single hits.
    pub slopes: Vec<ImpactSlope>,
}

/// The name that the slope of the first cycles may be given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SlopeIs {
    /// k_T: the loops are straight, and there is no hidden resonance.
    Contact,
    /// k_eq: the loops are not straight.
    NotStraight,
    /// k_eq: it includes a resonance of one specimen, at this frequency in Hz.
    Resonant(f64),
    /// k_eq: whether it includes such a resonance is undecided.
    Undecided,
    /// k_eq: the contact slips under the hammer, so the slope depends on the force.
    Slipping,
}

/// Analyses one hit.
///
/// # Errors
/// The signals hold no whole cycle, or contain values that are not finite.
pub fn of_hit(
    record: i64,
    impact: &str,
    fs_hz: f64,
    contact: &ContactSignals,
    delays: ContactDelays,
) -> Result<ImpactLoop, HysteresisError> {
    let [a, b, force_n] = in_step(contact, delays, fs_hz);
    Ok(ImpactLoop { record, impact: impact.into(), first: FirstCycle::of(fs_hz, [a, b], force_n)? })
}

/// v_A, v_B and T with their relative delays removed.
fn in_step(contact: &ContactSignals, delays: ContactDelays, fs_hz: f64) -> [Vec<f64>; 3] {
    let ContactSignals { specimen_a_m_per_s, specimen_b_m_per_s, tangential_n, .. } = contact;
    let delays = [delays.specimen_a, delays.specimen_b, delays.load_cells];
    let signals = [specimen_a_m_per_s, specimen_b_m_per_s, tangential_n];
    record::in_step(signals.map(Vec::clone), delays, fs_hz)
}

/// All first cycles combined; `None` without any.
pub fn gathered(
    loops: &[ImpactLoop],
    arm: Option<&Identified>,
    hidden: &HiddenResonance,
    slips: bool,
) -> Option<ImpactLoops> {
    let over = |value: &dyn Fn(&FirstCycle) -> f64| {
        let values = loops.iter().map(|l| value(&l.first)).filter(|v| v.is_finite());
        OverCycles::of(&values.collect::<Vec<_>>())
    };
    let mean = |value: fn(&FirstCycle) -> f64| over(&value).map(|v| v.mean);
    // slip that does not change the decay's frequency is still slip
    let shape = match most_common(loops)? {
        Shape::Stuck if slips => Shape::Microslip,
        other => other,
    };
    Some(ImpactLoops {
        records: loops.iter().map(|l| l.record).collect(),
        shape,
        slope_n_per_m: over(&|l| l.slope_n_per_m)?,
        corrected_n_per_m: arm.and_then(|arm| over(&|l| l.corrected_slope(&arm.correction))),
        slope_is: match (hidden.ok(), hidden.resonance_hz()) {
            _ if slips => SlopeIs::Slipping,
            _ if shape != Shape::Stuck => SlopeIs::NotStraight,
            (Some(true), _) => SlopeIs::Contact,
            (_, Some(resonance_hz)) => SlopeIs::Resonant(resonance_hz),
            _ => SlopeIs::Undecided,
        },
        frequency_hz: mean(|l| l.frequency_hz),
        amplitude_m: mean(|l| l.amplitude_m),
        phase_deg: mean(|l| l.phase_deg),
        open: loops.iter().filter(|l| l.first.r_squared < CLEAN_LINE).count(),
        decay: decay(loops),
        slopes: slopes(loops),
    })
}

/// The decay's cycles over all hits.
fn decay(loops: &[ImpactLoop]) -> Vec<DecayStep> {
    (0..DECAY_CYCLES)
        .filter_map(|c| {
            let here: Vec<&DecayCycle> = loops.iter().filter_map(|l| l.first.decay.get(c)).collect();
            let over = |value: fn(&DecayCycle) -> f64| {
                OverCycles::of(&here.iter().map(|d| value(d)).filter(|v| v.is_finite()).collect::<Vec<_>>())
            };
            Some(DecayStep {
                cycle: c + 1,
                k_eq_n_per_m: over(|d| d.stiffness_n_per_m)?,
                phase_deg: over(|d| d.phase_deg)?.mean,
                amplitude_m: over(|d| d.amplitude_m)?.mean,
            })
        })
        .collect()
}

fn most_common(loops: &[ImpactLoop]) -> Option<Shape> {
    [Shape::Stuck, Shape::Elliptical, Shape::Microslip, Shape::GrossSlip]
        .into_iter()
        .rev()
        .max_by_key(|shape| loops.iter().filter(|l| l.first.shape == *shape).count())
        .filter(|_| !loops.is_empty())
}

/// The slopes of the single hits.
fn slopes(loops: &[ImpactLoop]) -> Vec<ImpactSlope> {
    loops
        .iter()
        .filter(|l| l.first.slope_n_per_m.is_finite())
        .map(|l| ImpactSlope {
            record: l.record,
            impact: l.impact.clone(),
            k_eq_n_per_m: rounded(l.first.slope_n_per_m, 6),
        })
        .collect()
}

/// The loop to show: the one with the median slope.
pub fn middle(loops: &[ImpactLoop]) -> Option<&ImpactLoop> {
    let mut sorted: Vec<&ImpactLoop> = loops.iter().filter(|l| l.first.slope_n_per_m.is_finite()).collect();
    sorted.sort_by(|a, b| a.first.slope_n_per_m.total_cmp(&b.first.slope_n_per_m));
    sorted.get(sorted.len() / 2).copied()
}

/// Its signals from shortly before the first cycle to the end of the fourth.
pub fn drawn(shown: &ImpactLoop, fs_hz: f64, contact: &ContactSignals, delays: ContactDelays) -> LoopCurve {
    let [a, b, force_n] = in_step(contact, delays, fs_hz);
    let [start, end] = shown.first.cycle;
    let lead = (end - start) / 10;
    let from = start.saturating_sub(lead);
    // the paper also shows the fourth cycle, which ends later if the period is longer
    let fourth = shown.first.decay.get(3).map_or(0, |cycle| cycle.end_sample);
    let to = (start + 4 * (end - start)).max(fourth).min(force_n.len());
    let offset = |v: &[f64]| {
        v[..start.max(1).min(v.len())].iter().sum::<f64>() / start.max(1).min(v.len()).max(1) as f64
    };
    let displacement = |v: &[f64]| -> Vec<f64> { open_record(&v[from..to], offset(v), 1.0 / fs_hz) };
    let (x_a, x_b) = (displacement(&a), displacement(&b));
    let rest = offset(&force_n);
    let short = |values: Vec<f64>| values.into_iter().map(|v| rounded(v, 5)).collect::<Vec<_>>();
    LoopCurve {
        record: shown.record,
        impact: shown.impact.clone(),
        step_s: 1.0 / fs_hz,
        displacement_m: short(x_a.iter().zip(&x_b).map(|(a, b)| a - b).collect()),
        displacement_a_m: short(x_a),
        displacement_b_m: short(x_b),
        force_n: short(force_n[from..to].iter().map(|f| f - rest).collect()),
        cycle: [start - from, end - from],
        cycles: cycles(&shown.first, from, to),
        slope_n_per_m: shown.first.slope_n_per_m,
    }
}

/// The sample ranges of the first cycle and the following ones within the part shown.
fn cycles(first: &FirstCycle, from: usize, to: usize) -> Vec<[usize; 2]> {
    let all = first.decay.iter().map(|one| [one.first_sample, one.end_sample]);
    all.filter(|[a, b]| *a >= from && a < b && *b <= to).map(|[a, b]| [a - from, b - from]).collect()
}

/// Length of the reconstructed decay, s: long enough to resolve 192 Hz and 208 Hz.
const REBUILT_S: f64 = 0.1;

/// Only every nth sample of it is kept.
const THINNED: usize = 8;

/// The specimens' decay from the second cycle on, reconstructed from the hidden resonance and the
/// common mode.
pub fn rebuilt(
    shown: &ImpactLoop,
    fs_hz: f64,
    contact: &ContactSignals,
    delays: ContactDelays,
    hidden_hz: f64,
) -> Option<Reconstruction> {
    let [a, b, _] = in_step(contact, delays, fs_hz);
    let from = shown.first.cycle[1];
    let to = (from + (REBUILT_S * fs_hz) as usize).min(a.len());
    let rest = shown.first.cycle[0].max(1);
    let displacement = |v: &[f64]| -> Vec<f64> {
        let offset = v[..rest].iter().sum::<f64>() / rest as f64;
        open_record(v, offset, 1.0 / fs_hz)
            .get(from..to)
            .unwrap_or_default()
            .iter()
            .step_by(THINNED)
            .copied()
            .collect()
    };
    let (x_a, x_b) = (displacement(&a), displacement(&b));
    let step_s = THINNED as f64 / fs_hz;
    let common_hz = shown.first.frequency_hz;
    let both = decaying(&x_a, 1.0 / step_s, &[hidden_hz, common_hz])?;
    let alone = decaying(&x_a, 1.0 / step_s, &[common_hz])?;
    let of_b = decaying(&x_b, 1.0 / step_s, &[common_hz])?;
    let short = |values: Vec<f64>| values.into_iter().map(|v| rounded(v, 5)).collect::<Vec<_>>();
    let level = |x: Vec<f64>, trend: &[f64]| x.into_iter().zip(trend).map(|(v, line)| v - line).collect();
    Some(Reconstruction {
        record: shown.record,
        hidden_hz,
        common_hz,
        step_s,
        displacement_a_m: short(level(x_a, &both.trend)),
        displacement_b_m: short(level(x_b, &of_b.trend)),
        rebuilt_a_m: short(both.signal),
        rebuilt_b_m: short(of_b.signal),
        explained_a: [both.explained, alone.explained],
        explained_b: of_b.explained,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(gathered(&[], None, &HiddenResonance::NoSignals, false), None);
        assert_eq!(middle(&[]), None);
    }
}
