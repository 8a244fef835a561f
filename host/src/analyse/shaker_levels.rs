//! The shaker's levels: each level's loop with the raw and the corrected force, its k_T or the
//! reason why it has none, an example loop, the law over amplitude.

use super::averages::CellAverage;
use super::cell::{Measurements, ShakerLevel};
use super::contact_answer::{cells, input};
use super::missing::Missing;
use crate::campaign::plan::level::Moment;
use crate::contact::{
    ContactError, Joint, Known, LevelError, LevelStiffness, SteadyLevel, Stiffness, joint, level_stiffness,
};
use crate::hysteresis::backbone::Law;
use crate::hysteresis::compliance::{ContactCompliance, SEARCH_HZ};
use crate::hysteresis::cycles::open_record;
use crate::hysteresis::static_arm::{Identified, Tones};
use crate::hysteresis::{
    HysteresisRecord, LoopAnalysis, LoopFinding, RelativeMotion, Shape, analyse, analyse_both,
    analyse_corrected,
};
use crate::results::{Backbone, ShakerLoop, rounded};

/// Margin at the ends of a sweep, which contain the ramps up and down, Hz.
const SWEEP_MARGIN_HZ: f64 = 2.0;

/// One steady level with its analysis.
#[derive(Debug)]
pub struct Analysed<'a> {
    /// The measured level.
    pub level: &'a ShakerLevel,
    /// Its loops with the raw force.
    pub raw: LoopAnalysis,
    /// With the corrected force, if the static arm was known beforehand.
    pub corrected: Option<LoopAnalysis>,
    /// Its amplitudes.
    pub tones: Option<Tones>,
}

/// The loops of one record with a steady excitation, or of one decay.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordLoops {
    /// For a level of a campaign: its id in the campaign file, and when it was measured.
    pub level: Option<(i64, Moment)>,
    /// With the raw force.
    pub raw: LoopAnalysis,
    /// With the force corrected for the static arm.
    pub corrected: Option<LoopAnalysis>,
    /// For a level of a campaign: the contact's k_T at it, or why there is none.
    pub own: Option<LevelOutcome>,
}

/// Every steady level, analysed with the raw force, and with the corrected one if the static `arm`
/// is already known; and those without a loop.
pub fn analysed<'a>(
    levels: &'a [ShakerLevel],
    arm: Option<&Identified>,
) -> (Vec<Analysed<'a>>, Vec<Missing>) {
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for level in levels.iter().filter(|level| level.level.end_hz.is_none()) {
        let both = arm.and_then(|arm| analyse_both(&level.record, &arm.correction).ok());
        let loops = match both {
            Some([raw, corrected]) => Ok((raw, Some(corrected))),
            // if the force cannot be corrected, use only the raw loops
            None => analyse(&level.record).map(|raw| (raw, None)),
        };
        match loops {
            Ok((raw, corrected)) => {
                found.push(Analysed { level, raw, corrected, tones: Tones::of(&level.record).ok() });
            }
            Err(error) => missing.push(Missing::LevelLoop { level: level.level, error }),
        }
    }
    (found, missing)
}

/// Amplitudes of the levels at which the contact sticks, from which the static arm can be
/// identified.
pub fn stuck(levels: &[Analysed<'_>]) -> Vec<Tones> {
    levels.iter().filter(|l| l.raw.shape == Shape::Stuck).filter_map(|l| l.tones).collect()
}

/// Δx/T of the sweeps, without their ends.
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

/// The loops of every level: raw, and corrected if the static arm is known and the correction gives
/// a loop; `own` is the k_T of each at the contact.
pub fn loops(
    levels: Vec<Analysed<'_>>,
    arm: Option<&Identified>,
    own: Vec<LevelOutcome>,
) -> Vec<RecordLoops> {
    let late =
        |level: &ShakerLevel| arm.and_then(|arm| analyse_corrected(&level.record, &arm.correction).ok());
    levels
        .into_iter()
        .zip(own)
        .map(|(one, own)| RecordLoops {
            level: Some((one.level.id, one.level.moment)),
            corrected: one.corrected.or_else(|| late(one.level)),
            raw: one.raw,
            own: Some(own),
        })
        .collect()
}

/// The law fitted to the levels of each frequency and moment at which something slips.
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

/// Example loops of the levels: the middle amplitude of each frequency, one cycle averaged over the
/// record.
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

/// Displacements of both specimens over the first cycle, with their mean removed.
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

/// Number of stretches of a record whose scatter gives its noise: enough to determine a standard
/// deviation to a quarter.
const STRETCHES: usize = 10;

/// If the half width of the interval over k_T exceeds this, a level's value is not called k_T. The
/// mean is also read without its interval, by scripts and people, so its name must not mislead by
/// more than a tenth. T/Δx between the measured points is off by more than that at most
/// frequencies.
const WIDEST: f64 = 0.1;

/// Largest difference between the k_T of a level and that of the hits, in standard deviations of
/// the difference: beyond it, one of the two is wrong, and the level depends on more assumptions.
const APART: f64 = 4.0;

/// A level's k_T, or the reason why it has none.
pub type LevelOutcome = Result<LevelStiffness, NoLevelStiffness>;

/// Why a level has no k_T.
#[derive(Debug, Clone, PartialEq)]
pub enum NoLevelStiffness {
    /// The contact was not identified from the hits.
    NoContact,
    /// It was identified, but an assumption is violated.
    Doubted,
    /// The contact slips under the hammer.
    SlipsUnderTheHammer,
    /// The level's own loop slips.
    Slips,
    /// The level's loop has a fault.
    Finding(LoopFinding),
    /// The level cannot be corrected.
    Level(LevelError),
    /// It contradicts the hits, by this many standard deviations.
    Apart(f64),
    /// It can be corrected, but not accurately enough: half width of its interval over k_T.
    Wide(f64),
}

/// The levels' k_T, one for each steady level and its loop with the raw force. `slips` is the
/// verdict from the hits.
pub fn k_t_of_levels<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    own: Result<&(Stiffness, Known), &ContactError>,
    slips: bool,
    levels: &[(&ShakerLevel, &LoopAnalysis)],
) -> Vec<LevelOutcome> {
    let all = |why: NoLevelStiffness| levels.iter().map(|_| Err(why.clone())).collect();
    if slips {
        return all(NoLevelStiffness::SlipsUnderTheHammer);
    }
    let Ok((contact, known)) = own else { return all(NoLevelStiffness::NoContact) };
    if !contact.doubts.is_empty() {
        return all(NoLevelStiffness::Doubted);
    }
    let light = cells(measurements, averages, |average| average.light.as_ref());
    // the gains are those of the fit of the hits
    let light = input(measurements, light, None);
    if light.spots_m.is_none() {
        return all(NoLevelStiffness::NoContact);
    }
    let usable: Vec<Result<SteadyLevel, NoLevelStiffness>> =
        levels.iter().map(|(level, raw)| steady(level, raw)).collect();
    let read: Vec<SteadyLevel> = usable.iter().filter_map(|level| level.as_ref().ok().cloned()).collect();
    let mut found = level_stiffness(&light, known, &read).into_iter();
    let outcome = |usable: Result<SteadyLevel, NoLevelStiffness>| {
        usable?;
        let one = found.next().unwrap_or(Err(LevelError::NoLines)).map_err(NoLevelStiffness::Level)?;
        let [low, high] = one.k_t_n_per_m.ci95;
        let half = 0.5 * (high - low) / one.k_t_n_per_m.mean;
        if one.apart.abs() > APART {
            return Err(NoLevelStiffness::Apart(one.apart.abs()));
        }
        if half > WIDEST { Err(NoLevelStiffness::Wide(half)) } else { Ok(one) }
    };
    usable.into_iter().map(outcome).collect()
}

/// k_T of the hits combined with that of the levels that have one; `None` if there is none, or if
/// they add nothing.
pub fn combined_with_hits(
    own: Result<&(Stiffness, Known), &ContactError>,
    levels: &[LevelOutcome],
) -> Option<Joint> {
    let (hits, known) = own.ok()?;
    let levels: Vec<&LevelStiffness> = levels.iter().flatten().collect();
    if levels.is_empty() { None } else { joint(hits, known, &levels) }
}

/// The amplitudes of a level that sticks. An ellipse sticks too: the cause of its area is corrected
/// here.
fn steady(level: &ShakerLevel, raw: &LoopAnalysis) -> Result<SteadyLevel, NoLevelStiffness> {
    if !matches!(raw.shape, Shape::Stuck | Shape::Elliptical) {
        return Err(NoLevelStiffness::Slips);
    }
    // near a resonance a force that seems late is in fact an early motion of the measured points;
    // the fit includes the possible delays
    let wrong = |finding: &&LoopFinding| {
        matches!(finding, LoopFinding::Hum { .. } | LoopFinding::FrequencyOff { .. })
    };
    if let Some(finding) = raw.findings.iter().find(wrong) {
        return Err(NoLevelStiffness::Finding(*finding));
    }
    let stretches =
        Tones::stretches(&level.record, STRETCHES).map_err(|_| NoLevelStiffness::Level(LevelError::Short))?;
    let stretches = stretches.iter().map(|one| [one.force_n, one.a_m, one.b_m]).collect();
    Ok(SteadyLevel { frequency_hz: level.level.frequency_hz, stretches })
}
