//! k_T of the shaker's steady levels: each corrected by what the hits told, or why it has none.

use super::averages::CellAverage;
use super::cell::{Measurements, ShakerLevel};
use super::contact_answer::{cells, input};
use crate::contact::{
    ContactError, Joint, Known, LevelError, LevelStiffness, SteadyLevel, Stiffness, joint, level_stiffness,
};
use crate::hysteresis::tones::Tones;
use crate::hysteresis::{LoopAnalysis, LoopFinding, Shape};

/// Stretches of a record whose scatter is its noise: enough to know a standard deviation to a quarter.
const STRETCHES: usize = 10;

/// Half width of the interval over k_T above which a level's value is not called k_T. Scripts and people read the mean without its interval as
/// well: what it is called must not mislead them by more than a tenth. T/Δx between the spots is off by more than that at most frequencies.
const WIDEST: f64 = 0.1;

/// Standard deviations of their difference by which a level's k_T may be apart from that of the hits: beyond, one of both is wrong, and of the
/// two the level rests on more.
const APART: f64 = 4.0;

/// What a level's k_T is, or why it has none.
pub type Outcome = Result<LevelStiffness, NoLevelStiffness>;

/// Why a level has no k_T.
#[derive(Debug, Clone, PartialEq)]
pub enum NoLevelStiffness {
    /// The contact was not read from the hits.
    NoContact,
    /// It was, but an assumption does not hold.
    Doubted,
    /// It slips under the hammer.
    SlipsUnderTheHammer,
    /// The level's own loop slips.
    Slips,
    /// Something is wrong with the level's loop.
    Finding(LoopFinding),
    /// It cannot be corrected.
    Level(LevelError),
    /// It contradicts the hits: by so many standard deviations.
    Apart(f64),
    /// It can, but not well enough: half width of its interval over k_T.
    Wide(f64),
}

/// The levels' k_T, one for each steady level and its loop with the raw force. `slips` is what the hits say of the contact.
pub fn of<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    own: Result<&(Stiffness, Known), &ContactError>,
    slips: bool,
    levels: &[(&ShakerLevel, &LoopAnalysis)],
) -> Vec<Outcome> {
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

/// k_T of the hits and of those levels together that have one; none where there is none, or they add nothing.
pub fn together(own: Result<&(Stiffness, Known), &ContactError>, levels: &[Outcome]) -> Option<Joint> {
    let (hits, known) = own.ok()?;
    let levels: Vec<&LevelStiffness> = levels.iter().flatten().collect();
    if levels.is_empty() { None } else { joint(hits, known, &levels) }
}

/// The amplitudes of a level that sticks. An ellipse sticks as well: what opens it is taken out here.
fn steady(level: &ShakerLevel, raw: &LoopAnalysis) -> Result<SteadyLevel, NoLevelStiffness> {
    if !matches!(raw.shape, Shape::Stuck | Shape::Elliptical) {
        return Err(NoLevelStiffness::Slips);
    }
    // a force that seems late beside a resonance is early motion of the spots; what delays may be is in the fit
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
