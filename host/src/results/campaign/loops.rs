//! The loops of the impacts: each counting hit's first cycle, and all of them together.

use super::cell::{ContactDelays, ContactSignals};
use crate::hysteresis::correction::rates;
use crate::hysteresis::delays;
use crate::hysteresis::impact::DecayCycle;
use crate::hysteresis::integration::open_record;
use crate::hysteresis::loops::slope;
use crate::hysteresis::reconstruction::decaying;
use crate::hysteresis::{
    Correction, HysteresisError, HysteresisRecord, Kind, OverCycles, RelativeMotion, Shape, analyse,
};
use crate::results::number::short;
use crate::results::{
    Check, DecayStep, Force, Hysteresis, Identified, ImpactSlope, LoopCurve, Reconstruction, ranges, rounded,
};

/// What one hit's first cycle says.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactLoop {
    /// The record.
    pub record: i64,
    /// The impact's name.
    pub impact: String,
    /// Least-squares slope of T on Δx over the first cycle, N/m.
    pub slope_n_per_m: f64,
    /// How much of T that line explains, 0…1.
    pub r_squared: f64,
    /// Half the swing of Δx, m.
    pub amplitude_m: f64,
    /// Frequency of the decay's main mode, Hz.
    pub frequency_hz: f64,
    /// Phase by which Δx lags T, degrees.
    pub phase_deg: f64,
    /// The shape.
    pub shape: Shape,
    /// Samples of the first cycle.
    pub cycle: [usize; 2],
    /// Least-squares slope of specimen B's acceleration on Δx over it, 1/s²: what the arm's inertia adds per kg.
    pub acceleration_per_m: f64,
    /// The first cycles of the decay.
    pub decay: Vec<DecayCycle>,
}

/// Cycles of a decay that are told: later ones drown, or carry the lowest modes alone.
const DECAY_CYCLES: usize = 8;

/// Analyses one hit.
///
/// # Errors
/// The signals hold no whole cycle, or are no numbers.
pub fn of_hit(
    record: i64,
    impact: &str,
    fs_hz: f64,
    contact: &ContactSignals,
    delays: ContactDelays,
) -> Result<ImpactLoop, HysteresisError> {
    let [a, b, force_n] = in_step(contact, delays, fs_hz);
    let acceleration = rates(&b, fs_hz);
    let found = analyse(&HysteresisRecord {
        fs_hz,
        motion: RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b },
        force_n,
        excitation_hz: None,
        normal_load_n: None,
    })?;
    let first = found.decay_cycles.first().ok_or(HysteresisError::NoMotion)?;
    let (from, to) = (first.first_sample, first.end_sample);
    // the loop to be drawn begins with the first cycle
    let displacement = &found.loop_displacement_m[..(to - from).min(found.loop_displacement_m.len())];
    Ok(ImpactLoop {
        record,
        impact: impact.into(),
        slope_n_per_m: first.stiffness_n_per_m,
        r_squared: first.r_squared,
        amplitude_m: first.amplitude_m,
        frequency_hz: found.frequency_hz,
        phase_deg: found.phase_deg,
        shape: found.shape,
        cycle: [from, to],
        acceleration_per_m: slope(displacement, &acceleration[from..from + displacement.len()]),
        decay: found.decay_cycles[..DECAY_CYCLES.min(found.decay_cycles.len())].to_vec(),
    })
}

/// v_A, v_B and T with their delays against each other taken out.
fn in_step(contact: &ContactSignals, delays: ContactDelays, fs_hz: f64) -> [Vec<f64>; 3] {
    let ContactSignals { specimen_a_m_per_s, specimen_b_m_per_s, tangential_n, .. } = contact.clone();
    let delays = [delays.specimen_a, delays.specimen_b, delays.load_cells];
    delays::in_step([specimen_a_m_per_s, specimen_b_m_per_s, tangential_n], delays, fs_hz)
}

/// All first cycles together, in the shape of the results: with the raw force, and with the corrected one where the static arm is
/// known. None without any.
pub fn gathered(loops: &[ImpactLoop], arm: Option<&Identified>) -> Vec<Hysteresis> {
    let over = |value: &dyn Fn(&ImpactLoop) -> f64| {
        OverCycles::of(&loops.iter().map(value).filter(|v| v.is_finite()).collect::<Vec<_>>())
    };
    let mean = |value: fn(&ImpactLoop) -> f64| over(&value).map(|v| v.mean);
    let (Some(raw), Some(shape)) = (over(&|l| l.slope_n_per_m), most_common(loops)) else {
        return Vec::new();
    };
    let mut warnings = vec![
        "Slope over the first cycle of a decay: every mode that the hit excites is in it, also the specimen's tilt on its clamp.".to_owned(),
    ];
    let open = loops.iter().filter(|l| l.r_squared < 0.9).count();
    if open > 0 {
        warnings.push(format!(
            "In {open} of {} first cycles a straight line explains less than 90 % of T: local modes open those loops.",
            loops.len()
        ));
    }
    if raw.mean < 0.0 {
        warnings.push("A negative slope: the polarity of a vibrometer or of the load cells is wrong.".into());
    }
    let row = |force, slope: OverCycles, decay| Hysteresis {
        force,
        kind: Kind::Impact,
        frequency_hz: mean(|l| l.frequency_hz),
        amplitude_m: mean(|l| l.amplitude_m),
        shape,
        k_t_n_per_m: (shape == Shape::Stuck).then_some(slope),
        stick_part: None,
        k_eq_n_per_m: Some(slope),
        k_secant_n_per_m: None,
        k_fundamental_n_per_m: None,
        // the first cycle of a decay is not closed
        energy_j: None,
        friction_limit_n: None,
        friction_coefficient: None,
        phase_deg: mean(|l| l.phase_deg),
        shape_evidence: None,
        decay_cycles: Vec::new(),
        decay,
        level: None,
        moment: None,
        records: ranges(loops.iter().map(|l| l.record)),
        warnings: warnings.clone(),
    };
    let mut rows = vec![row(Force::Raw, raw, decay(loops))];
    // a least-squares slope is linear in the force
    let corrected = arm.and_then(|arm| {
        let Correction { effective_mass_kg, parallel_path } = arm.correction;
        over(&|l| (1.0 + parallel_path) * l.slope_n_per_m + effective_mass_kg * l.acceleration_per_m)
    });
    rows.extend(corrected.map(|slope| row(Force::Corrected, slope, Vec::new())));
    rows
}

/// The decay's cycles over all hits.
fn decay(loops: &[ImpactLoop]) -> Vec<DecayStep> {
    (0..DECAY_CYCLES)
        .filter_map(|c| {
            let here: Vec<&DecayCycle> = loops.iter().filter_map(|l| l.decay.get(c)).collect();
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

/// Takes the name k_T from the first cycles' slope unless the contact in frequency shows that no resonance hides in it.
pub fn judge(row: &mut Hysteresis, hidden: &Check) {
    if hidden.ok == Some(true) || row.k_t_n_per_m.is_none() {
        return;
    }
    row.k_t_n_per_m = None;
    row.warnings.push(match (hidden.ok, hidden.frequency_hz) {
        (Some(false), Some(f)) => format!(
            "This slope is k_eq, not k_T: a resonance of one specimen at {} Hz is excited by every hit and moves Δx without the force.",
            short(f)
        ),
        _ => "This slope is called k_eq: whether a resonance of one specimen is in it cannot be told from these records.".into(),
    });
}

fn most_common(loops: &[ImpactLoop]) -> Option<Shape> {
    [Shape::Stuck, Shape::Elliptical, Shape::Microslip, Shape::GrossSlip]
        .into_iter()
        .rev()
        .max_by_key(|shape| loops.iter().filter(|l| l.shape == *shape).count())
        .filter(|_| !loops.is_empty())
}

/// The slopes one by one.
pub fn slopes(loops: &[ImpactLoop]) -> Vec<ImpactSlope> {
    loops
        .iter()
        .filter(|l| l.slope_n_per_m.is_finite())
        .map(|l| ImpactSlope {
            record: l.record,
            impact: l.impact.clone(),
            k_eq_n_per_m: rounded(l.slope_n_per_m, 6),
        })
        .collect()
}

/// The loop to show: the one whose slope is the middle of all.
pub fn middle(loops: &[ImpactLoop]) -> Option<&ImpactLoop> {
    let mut sorted: Vec<&ImpactLoop> = loops.iter().filter(|l| l.slope_n_per_m.is_finite()).collect();
    sorted.sort_by(|a, b| a.slope_n_per_m.total_cmp(&b.slope_n_per_m));
    sorted.get(sorted.len() / 2).copied()
}

/// Its signals from shortly before the first cycle to four cycles on.
pub fn drawn(shown: &ImpactLoop, fs_hz: f64, contact: &ContactSignals, delays: ContactDelays) -> LoopCurve {
    let [a, b, force_n] = in_step(contact, delays, fs_hz);
    let [start, end] = shown.cycle;
    let lead = (end - start) / 10;
    let from = start.saturating_sub(lead);
    let to = (start + 4 * (end - start)).min(force_n.len());
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
        slope_n_per_m: shown.slope_n_per_m,
    }
}

/// Length of the decay that is put together again, s: long enough to tell 192 Hz from 208 Hz.
const REBUILT_S: f64 = 0.1;

/// Every so many samples are kept of it.
const THINNED: usize = 8;

/// The specimens' decay from the second cycle on, put together from the hidden resonance and the common mode.
pub fn rebuilt(
    shown: &ImpactLoop,
    fs_hz: f64,
    contact: &ContactSignals,
    delays: ContactDelays,
    hidden_hz: f64,
) -> Option<Reconstruction> {
    let [a, b, _] = in_step(contact, delays, fs_hz);
    let from = shown.cycle[1];
    let to = (from + (REBUILT_S * fs_hz) as usize).min(a.len());
    let rest = shown.cycle[0].max(1);
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
    let common_hz = shown.frequency_hz;
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
        assert_eq!(gathered(&[], None), []);
        assert_eq!(middle(&[]), None);
    }
}
