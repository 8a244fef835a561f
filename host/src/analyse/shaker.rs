//! The shaker's levels: each level's loop with the raw and the corrected force, a loop to look at, before against after.

use super::cell::ShakerLevel;
use crate::campaign::level::Moment;
use crate::hysteresis::backbone::Law;
use crate::hysteresis::compliance::{ContactCompliance, SEARCH_HZ};
use crate::hysteresis::integration::open_record;
use crate::hysteresis::static_arm::{Identified, Tones};
use crate::hysteresis::{
    Correction, HysteresisRecord, LoopAnalysis, RelativeMotion, Shape, analyse, analyse_corrected,
};
use crate::results::number::short;
use crate::results::{Backbone, Check, Force, Hysteresis, ShakerLoop, rounded};

/// Name of the check on wear.
pub const UNCHANGED: &str = "contact-unchanged";

/// A level's stiffness may differ by this part before and after.
const CHANGE: f64 = 0.03;

/// A sweep's ends belong to the way up and the ramp down, Hz.
const SWEEP_MARGIN_HZ: f64 = 2.0;

/// One level in steady state, analysed.
#[derive(Debug)]
pub struct Analysed<'a> {
    /// What was measured.
    pub level: &'a ShakerLevel,
    /// Its loops with the raw force.
    pub raw: LoopAnalysis,
    /// Its amplitudes.
    pub tones: Option<Tones>,
}

/// Every steady level, analysed with the raw force; complaints about those that give no loop.
pub fn analysed(levels: &[ShakerLevel]) -> (Vec<Analysed<'_>>, Vec<String>) {
    let (mut found, mut complaints) = (Vec::new(), Vec::new());
    for level in levels.iter().filter(|level| level.level.end_hz.is_none()) {
        match analyse(&level.record) {
            Ok(raw) => found.push(Analysed { level, raw, tones: Tones::of(&level.record).ok() }),
            Err(error) => complaints.push(format!("Shaker, {}: no loop: {error}.", level.level)),
        }
    }
    (found, complaints)
}

/// Amplitudes of the levels whose contact sticks: what the static arm may be identified from.
pub fn stuck(levels: &[Analysed<'_>]) -> Vec<Tones> {
    levels.iter().filter(|l| l.raw.shape == Shape::Stuck).filter_map(|l| l.tones).collect()
}

/// Δx/T of the sweeps, inside their ends.
pub fn swept(levels: &[ShakerLevel]) -> Vec<ContactCompliance> {
    let sweeps = levels.iter().filter_map(|level| Some((level, level.level.end_hz?)));
    sweeps
        .filter_map(|(level, end_hz)| {
            let [low, high] = [level.level.frequency_hz.min(end_hz), level.level.frequency_hz.max(end_hz)];
            let band =
                [(low + SWEEP_MARGIN_HZ).max(SEARCH_HZ[0]), (high - SWEEP_MARGIN_HZ).min(SEARCH_HZ[1])];
            ContactCompliance::of_record(&level.record, band)
        })
        .collect()
}

/// The rows of the results: raw, and corrected where the static arm is known.
pub fn rows(levels: &[Analysed<'_>], arm: Option<&Identified>) -> Vec<Hysteresis> {
    let row = |level: &ShakerLevel, found: &LoopAnalysis, force| Hysteresis {
        moment: Some(level.moment.name()),
        level: Some(level.id),
        ..Hysteresis::of(found, force)
    };
    let mut rows: Vec<Hysteresis> = levels.iter().map(|one| row(one.level, &one.raw, Force::Raw)).collect();
    if let Some(arm) = arm {
        rows.extend(levels.iter().filter_map(|one| {
            let corrected = analyse_corrected(&one.level.record, &arm.correction).ok()?;
            Some(row(one.level, &corrected, Force::Corrected))
        }));
    }
    rows
}

/// The hidden resonance moves Δx at every frequency, by more the nearer: says so at the loops that still look stuck.
pub fn warn_of_resonance(rows: &mut [Hysteresis], resonance_hz: f64) {
    for row in rows.iter_mut().filter(|row| row.shape == Shape::Stuck) {
        let Some(f) = row.frequency_hz else { continue };
        let (way, effect) = if f < resonance_hz { ("adds to", "low") } else { ("takes from", "high") };
        row.warnings.push(format!(
            "a resonance of one specimen at {} Hz {way} Δx here: this k_T reads {effect}, by more the nearer it is",
            short(resonance_hz)
        ));
    }
}

/// The law through the levels of each frequency and moment at which something slips.
pub fn backbones(levels: &[Analysed<'_>]) -> Vec<Backbone> {
    let mut usable: Vec<&Analysed<'_>> =
        levels.iter().filter(|one| one.raw.shape != Shape::Elliptical).collect();
    let key = |one: &Analysed<'_>| (one.level.moment == Moment::After, one.level.level.frequency_hz);
    usable.sort_by(|a, b| {
        let ((after, f), (after_b, f_b)) = (key(a), key(b));
        after.cmp(&after_b).then(f.total_cmp(&f_b)).then(a.raw.amplitude_m.total_cmp(&b.raw.amplitude_m))
    });
    let slips = |one: &&Analysed<'_>| one.raw.shape != Shape::Stuck;
    let groups = usable.chunk_by(|a, b| key(a) == key(b)).filter(|own| own.iter().any(slips));
    groups
        .filter_map(|own| {
            let points: Vec<(f64, f64)> =
                own.iter().filter_map(|one| Some((one.raw.amplitude_m, one.raw.k_secant_n_per_m?))).collect();
            Some(Backbone {
                frequency_hz: own[0].level.level.frequency_hz,
                moment: Some(own[0].level.moment.name()),
                levels: own.iter().map(|one| one.level.id).collect(),
                law: Law::through(&points)?,
            })
        })
        .collect()
}

/// Loops of the levels to look at: the middle amplitude of each frequency, one cycle averaged over the record.
pub fn curves(levels: &[Analysed<'_>]) -> Vec<ShakerLoop> {
    let mut frequencies: Vec<f64> = levels.iter().map(|l| l.level.level.frequency_hz).collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup();
    let of = |f: f64| {
        let mut here: Vec<&Analysed<'_>> =
            levels.iter().filter(|l| l.level.level.frequency_hz == f).collect();
        here.sort_by(|a, b| a.raw.amplitude_m.total_cmp(&b.raw.amplitude_m));
        here.get(here.len() / 2).copied()
    };
    frequencies.into_iter().filter_map(of).map(curve).collect()
}

fn curve(one: &Analysed<'_>) -> ShakerLoop {
    let short = |values: &[f64]| values.iter().map(|v| rounded(*v, 5)).collect::<Vec<_>>();
    let [x_a, x_b] = specimens(&one.level.record, one.raw.loop_displacement_m.len());
    ShakerLoop {
        level: one.level.id,
        frequency_hz: one.raw.frequency_hz,
        moment: one.level.moment.name(),
        shape: one.raw.shape,
        slope_n_per_m: one.raw.k_eq_n_per_m.mean,
        displacement_m: short(&one.raw.loop_displacement_m),
        force_n: short(&one.raw.loop_force_n),
        displacement_a_m: short(&x_a),
        displacement_b_m: short(&x_b),
    }
}

/// Displacements of both specimens over the first cycle, from their middle.
fn specimens(record: &HysteresisRecord, samples: usize) -> [Vec<f64>; 2] {
    let whole = |x: &[f64]| x[..samples.min(x.len())].to_vec();
    let integrated = |v: &[f64]| {
        let v = whole(v);
        let offset = v.iter().sum::<f64>() / v.len().max(1) as f64;
        open_record(&v, offset, 1.0 / record.fs_hz)
    };
    let pair = match &record.motion {
        RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => [integrated(a_m_per_s), integrated(b_m_per_s)],
        RelativeMotion::Displacement { a_m, b_m } => [whole(a_m), whole(b_m)],
    };
    pair.map(|x| {
        let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
        x.into_iter().map(|v| v - mean).collect()
    })
}

/// The static arm as the user or the plan states it.
pub fn given(effective_mass_kg: f64, parallel_path: f64) -> Identified {
    let correction = Correction { effective_mass_kg, parallel_path };
    Identified { correction, basis: crate::hysteresis::static_arm::Basis::Given, residual: 0.0 }
}

/// Whether the levels read the same before and after the hammer's cells; none where no level was measured both times.
pub fn unchanged(levels: &[Analysed<'_>]) -> Option<Check> {
    let of = |moment: Moment| levels.iter().filter(move |l| l.level.moment == moment);
    let slope = |one: &Analysed<'_>| one.raw.k_t_n_per_m.unwrap_or(one.raw.k_eq_n_per_m);
    let mut worst: Option<(f64, &Analysed<'_>)> = None;
    let (mut pairs, mut beyond) = (0, 0);
    for before in of(Moment::Before) {
        let Some(after) = of(Moment::After).find(|a| a.level.level.same(&before.level.level)) else {
            continue;
        };
        let (k, l) = (slope(before), slope(after));
        let change = l.mean / k.mean - 1.0;
        // standard errors of both means over their cycles
        let error = |k: &crate::hysteresis::OverCycles| k.std / (k.cycles as f64).sqrt() / k.mean.abs();
        pairs += 1;
        beyond += usize::from(change.abs() > CHANGE.max(3.0 * error(&k).hypot(error(&l))));
        if worst.is_none_or(|(w, _)| change.abs() > w.abs()) {
            worst = Some((change, after));
        }
    }
    let (change, at) = worst?;
    let where_most = format!("most at {}: {} %", at.level.level, short(100.0 * change));
    let check = if beyond == 0 {
        let text = format!(
            "{pairs} levels of the shaker read the same before and after the hammer's cells ({where_most}): the contact did not change."
        );
        Check::new(UNCHANGED, Some(true), text)
    } else {
        let text = format!(
            "{beyond} of {pairs} levels of the shaker read otherwise after the hammer's cells than before ({where_most}): the contact has \
             changed while it was measured, and FBS mixes both states."
        );
        Check::new(UNCHANGED, Some(false), text)
    };
    Some(check.with("worst_change_percent", 100.0 * change).with("levels", f64::from(pairs)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::level::{Held, Level};
    use std::f64::consts::TAU;

    fn level(id: i64, moment: Moment, frequency_hz: f64, stiffness: f64) -> ShakerLevel {
        let n = (20.0 * 51_200.0 / frequency_hz) as usize + 1;
        let wave = |amplitude: f64| -> Vec<f64> {
            (0..n).map(|i| amplitude * (TAU * frequency_hz * i as f64 / 51_200.0).cos()).collect()
        };
        ShakerLevel {
            id,
            moment,
            level: Level { frequency_hz, end_hz: None, held: Held::Displacement, amplitude: 1.5e-7 },
            record: HysteresisRecord {
                fs_hz: 51_200.0,
                motion: RelativeMotion::Displacement { a_m: wave(2.5e-7), b_m: wave(1e-7) },
                force_n: wave(1.5e-7 * stiffness),
                excitation_hz: Some(frequency_hz),
                normal_load_n: None,
            },
        }
    }

    #[test]
    fn wear_between_before_and_after_shows() {
        let levels = |after: f64| {
            vec![
                level(1, Moment::Before, 100.0, 180e6),
                level(2, Moment::Before, 300.0, 180e6),
                level(3, Moment::After, 100.0, 180.5e6),
                level(4, Moment::After, 300.0, after),
            ]
        };
        let check = |levels: &[ShakerLevel]| unchanged(&analysed(levels).0);
        let same = check(&levels(179.0e6)).expect("pairs");
        assert_eq!(same.ok, Some(true), "{same:?}");
        let worn = check(&levels(150e6)).expect("pairs");
        assert_eq!(worn.ok, Some(false));
        assert!(worn.meaning.contains("1 of 2") && worn.meaning.contains("300 Hz"), "{}", worn.meaning);
        assert_eq!(check(&levels(150e6)[..2]), None);
    }

    #[test]
    fn raw_and_corrected_stand_side_by_side() {
        let levels = [level(7, Moment::Before, 250.0, 180e6)];
        let (found, complaints) = analysed(&levels);
        assert!(complaints.is_empty());
        let mut rows = rows(&found, Some(&given(1.5, 0.01)));
        assert_eq!(rows.iter().map(|r| r.force).collect::<Vec<_>>(), [Force::Raw, Force::Corrected]);
        let k: Vec<f64> = rows.iter().map(|r| r.k_t_n_per_m.expect("stuck").mean).collect();
        // F = 1.01 T − m ω² x_B, x_B = Δx / 1.5
        let expected = 1.01 * 180e6 - 1.5 * (TAU * 250.0).powi(2) / 1.5;
        assert!((k[0] / 180e6 - 1.0).abs() < 1e-6 && (k[1] / expected - 1.0).abs() < 1e-3, "{k:?}");
        warn_of_resonance(&mut rows, 192.0);
        assert!(rows.iter().all(|r| r.warnings.iter().any(|w| w.contains("reads high"))));
        assert_eq!(curves(&found).len(), 1);
    }
}
