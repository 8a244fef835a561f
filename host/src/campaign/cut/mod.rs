//! Cuts a continuous recording into the hits of a campaign, or into levels of the shaker.
//!
//! | step | where |
//! |---|---|
//! | any part of the recording, each channel of the type in which it came | [`recording`] |
//! | hits in the force signal | [`hits`] |
//! | how much the structure's answer differs between two hits | [`alike`] |
//! | which place of the plan each hit was at, or what to ask | [`places`] |
//! | what the user states about the places | [`stated`] |
//! | what a marker channel says about them | [`marker`] |
//! | steady parts of a shaker's recording | [`levels`] |
//! | all of it, from a recording to the campaign file | [`import`] |
//!
//! [`find_hits`] finds and judges the hits; [`assign`] fits them to the plan; [`cut_hit`] returns
//! the samples of one as a record of the plan's length, which [`campaign::import`](super::import)
//! stores. The recording is read in pieces: memory is needed for one record at a time, whatever the
//! recording's length.

pub mod alike;
pub mod hits;
pub mod import;
pub mod levels;
pub mod marker;
pub mod places;
#[cfg(test)]
mod places_tests;
pub mod recording;
pub mod stated;

use std::ops::Range;

use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::request::Configuration;

use self::alike::{Answer, Answers};
use self::hits::{ForceLevels, FoundHit, HitCriteria, HitFinder};
use self::levels::{SteadyCriteria, SteadyFinder, SteadyPart};
use self::places::{Fitted, HitEvidence, Named, PlaceOrder, Unclear};
use self::recording::LongRecording;
use crate::campaign::import::{ImportError, shot};
use crate::campaign::plan::level::{Held, Level};
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::campaign::run::shaking::Meter;
use crate::campaign::store::error::StoreError;
use crate::campaign::verdict::judge::{ByRecord, Judge};
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use crate::exchange::exported::SignalFileError;
use crate::exchange::{FrfFileError, NpzError};

/// Scans that are read at once.
const PIECE: u64 = 1 << 18;
/// Pulses within this time belong to one hit, s: a bouncing hammer returns within a tenth of a
/// second, and no person strikes twice in a quarter.
const APART_S: f64 = 0.25;
/// Longest part of a record that is compared between hits, s: the structure's answer is known from
/// its beginning.
const COMPARED_S: f64 = 1.0;
/// Time before a record in which offset and noise are measured, s.
const QUIET_S: f64 = 0.2;
/// Most hits of a recording; a person strikes some hundreds in an hour.
const MOST_HITS: usize = 20_000;

/// Why a recording cannot be cut.
#[derive(Debug, thiserror::Error)]
pub enum CutError {
    /// The file cannot be read.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// A file of another format cannot be read.
    #[error(transparent)]
    File(#[from] SignalFileError),
    /// A file whose format is not known by its name cannot be read.
    #[error(transparent)]
    Unknown(#[from] FrfFileError),
    /// What is stated does not fit the plan, or does not say at which places the hits are.
    #[error("{0}")]
    Stated(String),
    /// It is not certain where hits were struck.
    #[error("{name}: {what}")]
    Asked {
        /// The recording's name.
        name: String,
        /// What was found, which hits are not certain, and a table to be completed.
        what: String,
    },
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Its hits cannot be added to the campaign file.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// Its content does not allow it.
    #[error("{name}: {what}")]
    Unfit {
        /// The recording's name.
        name: String,
        /// What is wrong, and what to do.
        what: String,
    },
}

impl CutError {
    fn unfit(name: &str, what: impl Into<String>) -> Self {
        Self::Unfit { name: name.into(), what: what.into() }
    }
}

/// A place of hammer and sensors: a cell, or a row of cells that one hit fills.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The cell that its hits are stored with.
    pub cell: Cell,
    /// The responses of all cells that its hits fill.
    pub responses: Vec<String>,
    /// Its name: `AJB/AZ1/A1`.
    pub name: String,
}

/// Restricts the places of the plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct Only<'o> {
    /// To this configuration.
    pub configuration: Option<&'o str>,
    /// To this impact.
    pub impact: Option<&'o str>,
    /// To this response.
    pub response: Option<&'o str>,
}

/// The places of the plan in the order in which they are struck; cells that one hit fills together
/// are one place.
///
/// # Errors
/// A name is not in the plan, or no place is left.
pub fn places_of(plan: &Plan, only: &Only<'_>) -> Result<Vec<Place>, String> {
    let configuration = match only.configuration {
        None => None,
        Some(name) => {
            Some(plan.configuration(name).ok_or_else(|| format!("the plan has no configuration `{name}`"))?)
        }
    };
    let mut places: Vec<Place> = Vec::new();
    for cell in plan.cells() {
        let other = |wanted: Option<&str>, own: &str| wanted.is_some_and(|wanted| wanted != own);
        if configuration.is_some_and(|own| own != cell.configuration) || other(only.impact, &cell.impact) {
            continue;
        }
        let fixed = |response: &str| plan.own_channels(response).is_some();
        let row = places.iter_mut().find(|place| {
            let lead = &place.cell;
            lead.configuration == cell.configuration && lead.impact == cell.impact && fixed(&lead.response)
        });
        if let Some(place) = row.filter(|_| fixed(&cell.response)) {
            place.responses.push(cell.response);
        } else {
            let name =
                format!("{}/{}/{}", configuration_name(cell.configuration), cell.impact, cell.response);
            places.push(Place { responses: vec![cell.response.clone()], cell, name });
        }
    }
    if let Some(response) = only.response {
        places.retain(|place| place.responses.iter().any(|own| own == response));
    }
    if places.is_empty() {
        return Err(
            "the plan has no such place: `jointrig plan check` lists configurations, impacts and responses"
                .into(),
        );
    }
    Ok(places)
}

/// A hit of the recording.
#[derive(Clone, Debug)]
pub struct CutHit {
    /// Where it is in the recording.
    pub found: FoundHit,
    /// When it was struck, s from the recording's start.
    pub at_s: f64,
    /// Its verdict as a record of the plan's length; `None` where the recording does not contain
    /// such a record.
    pub verdict: Option<Judgement>,
    /// Why there is no record, if so.
    pub incomplete: Option<String>,
    /// The structure's answer.
    pub answer: Answer,
}

impl CutHit {
    /// Whether its verdict is good.
    pub fn is_good(&self) -> bool {
        self.verdict.as_ref().is_some_and(|verdict| verdict.kind == Verdict::Good)
    }
}

/// The record of a hit: scans before the trigger, and from it onwards, at the recording's rate.
fn record_scans(plan: &Plan, fs_hz: f64) -> (u64, u64) {
    let record = plan.record.get_ref();
    let before = f64::from(record.pre_trigger_scans) / f64::from(record.rate_hz);
    ((before * fs_hz).round() as u64, (record.length_s * fs_hz).round() as u64)
}

/// The range of scans of a hit's record; `None` where the recording does not contain all of it.
fn record_range(recording: &LongRecording, plan: &Plan, hit: &FoundHit) -> Option<Range<u64>> {
    let (before, after) = record_scans(plan, recording.map().fs_hz());
    let (start, end) = (hit.start.checked_sub(before)?, hit.start + after);
    (end <= recording.scans()).then_some(start..end)
}

/// Finds the hits of a recording and judges each as a measured one. `progress` receives the scans
/// read so far and their total.
///
/// # Errors
/// There is no force channel, its sign is wrong, there are no hits, or the file cannot be read.
pub fn find_hits(
    recording: &LongRecording,
    plan: &Plan,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Vec<CutHit>, CutError> {
    let wrong = |what: String| CutError::unfit(recording.name(), what);
    let (map, fs_hz, scans) = (recording.map(), recording.map().fs_hz(), recording.scans());
    let force = map.place(Role::HammerForce).ok_or_else(|| {
        let names: Vec<&str> = map.channels.iter().map(|channel| channel.name.as_str()).collect();
        wrong(format!(
            "no channel is the hammer's force (unit N, called `hammer` or `force`); the channels are {}",
            names.join(", ")
        ))
    })?;
    let criteria = HitCriteria { level_n: f64::from(plan.trigger.get_ref().level_n), apart_s: APART_S };
    let pieces = || (0..scans).step_by(PIECE as usize).map(|from| from..(from + PIECE).min(scans));
    let mut first = ForceLevels::new(fs_hz);
    for range in pieces() {
        progress(range.start, 3 * scans);
        first.push(&recording.si(force, range)?);
    }
    if first.is_reversed(&criteria) {
        return Err(wrong(
            "the force falls during the hits instead of rising: a push is positive, so multiply the force by -1".into(),
        ));
    }
    let mut second = HitFinder::new(first, fs_hz, &criteria);
    for range in pieces() {
        progress(scans + range.start, 3 * scans);
        second.push(&recording.si(force, range)?);
    }
    let found = second.finish();
    if found.is_empty() || found.len() > MOST_HITS {
        return Err(wrong(format!(
            "the force rises above {} N (trigger.level_n of the plan) {} times in {:.0} s: check the channel, its unit and its scale",
            criteria.level_n,
            found.len(),
            recording.length_s()
        )));
    }
    let answers = answers_for(plan, fs_hz, &found);
    let mut hits = Vec::with_capacity(found.len());
    for (number, hit) in found.iter().enumerate() {
        progress(2 * scans + hit.start, 3 * scans);
        let earlier = number.checked_sub(1).map(|before| found[before].peak_scan);
        hits.push(judged(recording, plan, force, *hit, earlier, &answers)?);
    }
    Ok(hits)
}

/// The lines on which hits are compared: within a record, and before most of the next hits.
fn answers_for(plan: &Plan, fs_hz: f64, found: &[FoundHit]) -> Answers {
    let (before, after) = record_scans(plan, fs_hz);
    let mut widths: Vec<f64> = found.iter().map(|hit| hit.width_s).collect();
    widths.sort_by(f64::total_cmp);
    let mut gaps: Vec<u64> = found.windows(2).map(|two| two[1].start - two[0].start).collect();
    gaps.sort_unstable();
    let usual_gap = gaps.get(gaps.len() / 10).copied().unwrap_or(u64::MAX);
    let samples = (before + after).min((COMPARED_S * fs_hz) as u64).min(usual_gap);
    Answers::new(fs_hz, samples as usize, widths.get(widths.len() / 2).copied().unwrap_or(0.0))
}

/// Judges a hit, and computes the structure's answer.
fn judged(
    recording: &LongRecording,
    plan: &Plan,
    force: usize,
    found: FoundHit,
    earlier: Option<u64>,
    answers: &Answers,
) -> Result<CutHit, CutError> {
    let (map, fs_hz) = (recording.map(), recording.map().fs_hz());
    let at_s = found.start as f64 / fs_hz;
    let mut hit = CutHit { found, at_s, verdict: None, incomplete: None, answer: Answer::default() };
    let Some(range) = record_range(recording, plan, &found) else {
        let (before, after) = record_scans(plan, fs_hz);
        hit.incomplete = Some(format!(
            "the recording has {:.3} s before it and {:.3} s after it, and a record of the plan needs {:.3} s and {:.3} s",
            at_s,
            recording.length_s() - at_s,
            before as f64 / fs_hz,
            after as f64 / fs_hz
        ));
        return Ok(hit);
    };
    let all: Vec<usize> = (0..map.len()).collect();
    let samples = recording.part(&all, range.clone())?;
    if let Some((channel, at)) =
        samples.each().enumerate().find_map(|(channel, own)| Some((channel, own.not_finite()?)))
    {
        hit.incomplete = Some(format!(
            "channel `{}` has a value that is not a number at {:.4} s",
            map.channels[channel].name,
            (range.start + at as u64) as f64 / fs_hz
        ));
        return Ok(hit);
    }
    // offset and noise before the record, but after the hit before
    let from = range.start.saturating_sub((QUIET_S * fs_hz) as u64).max(earlier.map_or(0, |peak| peak + 1));
    let quiet = if from < range.start { recording.part(&all, from..range.start)? } else { samples.clone() };
    let signals = |samples: &Samples, most: usize| -> Vec<Vec<f64>> {
        let is_answer = |place: &usize| {
            let channel = &map.channels[*place];
            *place != force && channel.quantity != Quantity::Voltage
        };
        let si = |place: usize| map.to_si(place, samples.channel(place).part(0, most));
        std::iter::once(force).chain((0..map.len()).filter(is_answer)).map(si).collect()
    };
    let before = if from < range.start { usize::MAX } else { (found.start - range.start) as usize };
    let own = signals(&samples, answers.samples());
    if let Some((force_n, responses)) = own.split_first() {
        hit.answer = answers.of(force_n, responses, &signals(&quiet, before));
    }
    let trigger_index = (found.start - range.start) as usize;
    let recording = Recording {
        epoch: 0,
        first_scan: range.start,
        trigger_index,
        samples,
        gaps: Vec::new(),
        shot: shot(0, trigger_index, found.peak_n, found.width_s),
    };
    // records are judged without regard to their cell
    let cell =
        Cell { configuration: Configuration::A, impact: String::new(), response: String::new(), wanted: 0 };
    hit.verdict = Some(ByRecord.judge(&cell, plan, map, &recording, &Others::default()));
    Ok(hit)
}

/// The samples of a hit's record, each channel of the type in which it came, and the index of its
/// trigger; `None` where the recording does not contain the record.
///
/// # Errors
/// The file cannot be read.
pub fn cut_hit(
    recording: &LongRecording,
    plan: &Plan,
    hit: &CutHit,
) -> Result<Option<(Samples, usize)>, CutError> {
    let Some(range) = record_range(recording, plan, &hit.found).filter(|_| hit.incomplete.is_none()) else {
        return Ok(None);
    };
    let all: Vec<usize> = (0..recording.map().len()).collect();
    Ok(Some((recording.part(&all, range.clone())?, (hit.found.start - range.start) as usize)))
}

/// The places of hits, and notes for the user; or what must be asked.
///
/// `named` is what the user states of each hit, in order; empty if nothing is stated.
///
/// # Errors
/// [`Unclear`] if more than one reading is possible.
pub fn assign(
    hits: &[CutHit],
    plan: &Plan,
    places: &[Place],
    named: &[Option<Named>],
) -> Result<Fitted, Unclear> {
    places::fit(&evidence(hits), &order(plan, places), named)
}

/// What contradicts the places that a marker names, one sentence for each hit: its number and why.
/// `marked` has the hits that only the marker names.
pub fn contradictions(
    hits: &[CutHit],
    plan: &Plan,
    places: &[Place],
    named: &[Option<Named>],
    marked: &[bool],
) -> Vec<(usize, String)> {
    places::contradictions(&evidence(hits), &order(plan, places), named, marked)
}

/// The questions about hits whose place a marker leaves open, with the stretches that it names.
pub fn unclear_marker(hits: &[CutHit], named: &[Option<Named>], open: Vec<(usize, String)>) -> Unclear {
    let own: Vec<usize> = open.iter().map(|(hit, _)| *hit).collect();
    let visits = places::stated_visits(&evidence(hits), named, &own);
    Unclear { visits, questions: open.into_iter().map(|(_, what)| what).collect() }
}

fn evidence(hits: &[CutHit]) -> Vec<HitEvidence> {
    let of = |hit: &CutHit| HitEvidence { at_s: hit.at_s, good: hit.is_good(), answer: hit.answer.clone() };
    hits.iter().map(of).collect()
}

fn order(plan: &Plan, places: &[Place]) -> PlaceOrder {
    let own = plan.hits.get_ref();
    PlaceOrder {
        names: places.iter().map(|place| place.name.clone()).collect(),
        wanted: own.wanted,
        minimum: own.minimum,
    }
}

/// Longest record of a level, s: more cycles do not make a loop more exact than the sensors are.
const LONGEST_LEVEL_S: f64 = 30.0;
/// A level of the plan is meant if its sine stays within this part of a cycle of the recorded one
/// over the record,
const SAME_CYCLES: f64 = 0.05;
/// and its amplitude deviates by at most this, relative.
const SAME_AMPLITUDE: f64 = 0.1;

/// A level of the shaker in the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct CutLevel {
    /// Its scans: the steady part, at most thirty seconds from its start.
    pub scans: Range<u64>,
    /// The level as the plan orders it, or as measured where the plan has no such level.
    pub level: Level,
    /// The amplitude of the specimens' relative displacement, m.
    pub reached_m: f64,
    /// Whether the plan has this level.
    pub planned: bool,
}

/// Finds the shaker's levels in a recording: the parts in which the reference channel (the
/// excitation's force, or else the velocity of specimen A) is a sine of constant frequency and
/// amplitude.
///
/// # Errors
/// There is no such channel or no steady part, or the file cannot be read.
pub fn find_levels(
    recording: &LongRecording,
    plan: &Plan,
    criteria: SteadyCriteria,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Vec<CutLevel>, CutError> {
    let (map, scans) = (recording.map(), recording.scans());
    let wrong = |what: String| CutError::unfit(recording.name(), what);
    let reference = map.place(Role::Excitation).or(map.place(Role::SpecimenA)).ok_or_else(|| {
        wrong("no channel is the excitation's force (`excitation`) or a specimen's velocity (`LDV_A`): name them so".into())
    })?;
    let mut finder = SteadyFinder::new(map.fs_hz(), criteria);
    for from in (0..scans).step_by(PIECE as usize) {
        progress(from, scans);
        finder.push(&recording.si(reference, from..(from + PIECE).min(scans))?);
    }
    let parts = finder.finish();
    if parts.is_empty() {
        return Err(wrong(format!(
            "channel `{}` has no part in which its amplitude stays within {} % for {} s and {} cycles",
            map.channels[reference].name,
            100.0 * criteria.tolerance,
            criteria.least_s,
            criteria.cycles
        )));
    }
    parts.iter().map(|part| level_of(recording, plan, part)).collect()
}

/// The level of a steady part.
fn level_of(recording: &LongRecording, plan: &Plan, part: &SteadyPart) -> Result<CutLevel, CutError> {
    let map = recording.map();
    let longest = (LONGEST_LEVEL_S * map.fs_hz()) as u64;
    let scans = part.scans.start..part.scans.end.min(part.scans.start + longest);
    let samples = cut_level(recording, scans.clone())?;
    let along = plan.along_sliding(map.clone());
    let reached_m = Meter::new(&along, Held::Displacement, part.frequency_hz).amplitude(&samples);
    let seconds = (scans.end - scans.start) as f64 / map.fs_hz();
    let mut measured = Level {
        frequency_hz: part.frequency_hz,
        end_hz: None,
        held: Held::Displacement,
        amplitude: reached_m,
    };
    let Some(shaker) = &plan.shaker else {
        return Ok(CutLevel { scans, level: measured, reached_m, planned: false });
    };
    let shaker = shaker.get_ref();
    let is_frequency = |hz: &&f64| (part.frequency_hz - **hz).abs() * seconds <= SAME_CYCLES;
    let frequency = shaker.frequencies_hz.iter().find(is_frequency);
    let amplitude = shaker
        .amplitudes_m
        .iter()
        .filter(|own| (reached_m / **own - 1.0).abs() <= SAME_AMPLITUDE)
        .min_by(|a, b| (reached_m - **a).abs().total_cmp(&(reached_m - **b).abs()));
    let planned = frequency.is_some() && amplitude.is_some();
    if let (Some(frequency_hz), Some(amplitude)) = (frequency, amplitude) {
        measured = Level { frequency_hz: *frequency_hz, amplitude: *amplitude, ..measured };
    }
    Ok(CutLevel { scans, level: measured, reached_m, planned })
}

/// The samples of a level's record, each channel of the type in which it came.
///
/// # Errors
/// The file cannot be read.
pub fn cut_level(recording: &LongRecording, scans: Range<u64>) -> Result<Samples, CutError> {
    let all: Vec<usize> = (0..recording.map().len()).collect();
    recording.part(&all, scans)
}
