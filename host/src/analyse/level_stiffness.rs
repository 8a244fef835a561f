//! k_T of the shaker's steady levels, each corrected with the results from the hits, or the reason
//! why it has none.

use super::averages::CellAverage;
use super::cell::{Measurements, ShakerLevel};
use super::contact_answer::{cells, input};
use crate::contact::{
    ContactError, Joint, Known, LevelError, LevelStiffness, SteadyLevel, Stiffness, joint, level_stiffness,
};
use crate::hysteresis::static_arm::Tones;
use crate::hysteresis::{LoopAnalysis, LoopFinding, Shape};

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
pub fn of<M: Measurements>(
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
    let Ok(light) = input(measurements, light) else { return all(NoLevelStiffness::NoContact) };
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
pub fn together(own: Result<&(Stiffness, Known), &ContactError>, levels: &[LevelOutcome]) -> Option<Joint> {
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
