//! From a recording to a campaign file: the hits are found and fitted to the plan by what is stated
//! about their places ([`cut`]), and stored ([`store`]). Nothing is stored unless all places are
//! certain. The command and Python differ only in the [`Terms`] of their messages.

use super::marker::{self, Marker};
use super::places::{Fitted, Named, Unclear, numbers};
use super::recording::LongRecording;
use super::{
    CutError, CutHit, Only, Place, assign, contradictions, cut_hit, find_hits, places_of, stated,
    unclear_marker,
};
use crate::campaign::import::{CellName, Hit, Origin, add_hits};
use crate::campaign::plan::{Plan, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::verdict::{Judgement, Verdict};

/// Most hits that are held in memory at once.
const TOGETHER: usize = 16;

/// How a user states what is asked for, in messages.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// The places were struck in the plan's order.
    pub order: &'static str,
    /// A marker channel.
    pub marker: &'static str,
    /// A table of places.
    pub table: &'static str,
    /// The names of one place.
    pub place: &'static str,
}

/// What is stated about the places of a recording's hits.
#[derive(Clone, Copy, Debug)]
pub struct Places<'s> {
    /// The part of the plan that was measured.
    pub only: Only<'s>,
    /// Whether the places were struck in the plan's order.
    pub in_order: bool,
    /// The table that names places: its name, and its text.
    pub table: Option<(&'s str, &'s str)>,
    /// The channel that says which place is struck.
    pub marker: Option<&'s Marker>,
    /// How to state it, for messages.
    pub terms: &'s Terms,
}

/// The hits of a recording, with their places.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The places of the plan.
    pub places: Vec<Place>,
    /// The hits, in order of time.
    pub hits: Vec<CutHit>,
    /// The place of each hit.
    pub fitted: Fitted,
    /// What was found, line by line: the recording, refused hits, the hits of each place, notes.
    pub report: Vec<String>,
}

/// The places that a recording may have hits at.
///
/// # Errors
/// A name is not in the plan, or nothing says at which of several places the hits are.
pub fn stated_places(plan: &Plan, by: &Places<'_>) -> Result<Vec<Place>, CutError> {
    let places = places_of(plan, &by.only).map_err(CutError::Stated)?;
    if !by.in_order && by.table.is_none() && by.marker.is_none() && places.len() > 1 {
        let Terms { order, marker, table, place } = by.terms;
        return Err(CutError::Stated(format!(
            "the hits may be at {} places: add {order} if they were struck in the plan's order, {marker} if a channel says which, {table} \
             with the columns hit (or time_s), configuration, impact, response, or {place}",
            places.len()
        )));
    }
    Ok(places)
}

/// Finds the hits of a recording and their places. `progress` receives the scans read so far and
/// their total.
///
/// # Errors
/// The recording cannot be read or cut; its places are not certain ([`CutError::Asked`]).
pub fn cut(
    recording: &LongRecording,
    plan: &Plan,
    by: &Places<'_>,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Cut, CutError> {
    let places = stated_places(plan, by)?;
    let hits = find_hits(recording, plan, progress)?;
    let mut report = found(recording, &hits, by.marker);
    let Stated { named, marked, doubts } = stated(by, plan, &places, (recording, &hits))?;
    let open = [doubts, contradictions(&hits, plan, &places, &named, &marked)].concat();
    let asked = |report, unclear: &Unclear| asked(recording.name(), (by, &places, &hits), report, unclear);
    if !open.is_empty() {
        return Err(asked(report, &unclear_marker(&hits, &named, open)));
    }
    let fitted = match assign(&hits, plan, &places, &named) {
        Ok(fitted) => fitted,
        Err(unclear) => return Err(asked(report, &unclear)),
    };
    report.extend(by_place(&places, &hits, &fitted));
    report.extend(fitted.notes.iter().cloned());
    Ok(Cut { places, hits, fitted, report })
}

/// Counts of stored hits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stored {
    /// Hits at places.
    pub hits: usize,
    /// Good ones among them.
    pub kept: usize,
    /// Those that an earlier call stored already.
    pub already: usize,
}

/// Stores the hits. `replace` drops the good hits that came from another content of the origin's
/// name. `tell` receives each hit's place, number (from 1) and verdict, `progress` the number of
/// hits stored so far.
///
/// # Errors
/// A hit of this origin is stored at another place already; the recording or the file cannot be
/// used.
pub fn store(
    recording: &LongRecording,
    (cut, plan): (&Cut, &Plan),
    (store, origin): (&mut Store, &Origin),
    replace: bool,
    tell: &mut dyn FnMut(&str, u32, &Judgement),
    progress: &mut dyn FnMut(usize),
) -> Result<Stored, CutError> {
    let Cut { places, hits, fitted, .. } = cut;
    refuse_other_places(store, origin, places, fitted)?;
    let mut all = Stored::default();
    for (number, place) in places.iter().enumerate() {
        let own: Vec<usize> = (0..hits.len()).filter(|hit| fitted.places[*hit] == Some(number)).collect();
        for some in own.chunks(TOGETHER) {
            progress(all.hits);
            let mut batch = Vec::new();
            for hit in some {
                if let Some((samples, trigger)) = cut_hit(recording, plan, &hits[*hit])? {
                    let trigger_index = Some(trigger);
                    batch.push(Hit { trigger_index, ..Hit::new(*hit as u32 + 1, samples) });
                }
            }
            if batch.is_empty() {
                continue;
            }
            let cell = &place.cell;
            let name = CellName {
                configuration: configuration_name(cell.configuration),
                impact: &cell.impact,
                response: &cell.response,
            };
            let mut tell = |hit, verdict: &Judgement| tell(&place.name, hit, verdict);
            let added = add_hits(store, origin, &name, recording.map(), batch, replace, &mut tell)?;
            all.hits += added.hits;
            all.kept += added.kept;
            all.already += added.already;
        }
    }
    store.log(&format!("cut {} into {} hits", origin.name, all.hits))?;
    Ok(all)
}

/// What is stated about the hits.
struct Stated {
    /// The place of each hit.
    named: Vec<Option<Named>>,
    /// Whether only the marker names it.
    marked: Vec<bool>,
    /// Good hits whose place the marker leaves open: their indices, and why.
    doubts: Vec<(usize, String)>,
}

/// What table and marker state of each hit; the table counts where both do.
fn stated(
    by: &Places<'_>,
    plan: &Plan,
    places: &[Place],
    (recording, hits): (&LongRecording, &[CutHit]),
) -> Result<Stated, CutError> {
    let mut named = match by.table {
        None if !by.in_order && by.marker.is_none() => vec![Some(Named::Place(0)); hits.len()],
        None => vec![None; hits.len()],
        Some((name, text)) => {
            let at_s: Vec<f64> = hits.iter().map(|hit| hit.at_s).collect();
            stated::from_table(text, plan, places, &at_s).map_err(|what| CutError::unfit(name, what))?
        }
    };
    let (mut marked, mut doubts) = (vec![false; hits.len()], Vec::new());
    if let Some(marker) = by.marker {
        let read = marker::read(recording, marker, hits, places)?;
        let open = |(hit, _): &(usize, String)| named[*hit].is_none() && hits[*hit].is_good();
        doubts = read.doubts.into_iter().filter(open).collect();
        for ((own, marked), said) in named.iter_mut().zip(&mut marked).zip(read.named) {
            *marked = own.is_none();
            *own = own.or(said);
        }
    }
    if !by.in_order {
        // without an order, a hit that neither table nor marker names is at no place
        for one in &mut named {
            *one = one.or(Some(Named::Nowhere));
        }
    }
    Ok(Stated { named, marked, doubts })
}

/// The channels that no analysis will use.
pub fn unused(recording: &LongRecording, marker: Option<&Marker>) -> Option<String> {
    let is_marker = |name: &str| marker.is_some_and(|marker| marker.is(name));
    let names: Vec<&str> =
        recording.unused().iter().map(String::as_str).filter(|name| !is_marker(name)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "  stored without a use: {}; names that are used are hammer, x, y, z, LDV_A, LDV_B, LC1 …, excitation, and the \
             channels of the plan's fixed sensors",
            names.join(", ")
        )
    })
}

/// What was found in the recording, before any fit.
fn found(recording: &LongRecording, hits: &[CutHit], marker: Option<&Marker>) -> Vec<String> {
    let counts: Vec<String> = Verdict::ALL
        .into_iter()
        .filter_map(|kind| {
            let count =
                hits.iter().filter(|hit| hit.verdict.as_ref().is_some_and(|own| own.kind == kind)).count();
            (count > 0).then(|| format!("{count} {kind}"))
        })
        .collect();
    let mut lines = vec![format!(
        "{}: {:.1} s at {} Hz, {} hits: {}",
        recording.name(),
        recording.length_s(),
        recording.map().fs_hz(),
        hits.len(),
        counts.join(", ")
    )];
    lines.extend(unused(recording, marker));
    for (number, hit) in hits.iter().enumerate() {
        let why = match (&hit.incomplete, &hit.verdict) {
            (Some(why), _) => format!("left out: {why}"),
            (None, Some(verdict)) if verdict.kind != Verdict::Good => {
                format!("{} ({})", verdict.kind, verdict.sentence)
            }
            _ => continue,
        };
        lines.push(format!("  hit {} at {:.2} s: {why}", number + 1, hit.at_s));
    }
    lines
}

/// The hits of each place.
fn by_place(places: &[Place], hits: &[CutHit], fitted: &Fitted) -> Vec<String> {
    let line = |(number, place): (usize, &Place)| {
        let own: Vec<usize> = (0..hits.len()).filter(|hit| fitted.places[*hit] == Some(number)).collect();
        let (Some(first), Some(last)) = (own.first(), own.last()) else {
            return format!("{}: no hits", place.name);
        };
        let good = own.iter().filter(|hit| hits[**hit].is_good()).count();
        format!(
            "{}: hits {} ({good} good), {:.1} to {:.1} s",
            place.name,
            numbers(&own),
            hits[*first].at_s,
            hits[*last].at_s
        )
    };
    places.iter().enumerate().map(line).collect()
}

/// The error that asks where hits belong.
fn asked(
    name: &str,
    (by, places, hits): (&Places<'_>, &[Place], &[CutHit]),
    found: Vec<String>,
    unclear: &Unclear,
) -> CutError {
    let mut lines = found;
    lines.push("it is not certain where these hits were struck, and nothing is stored:".into());
    lines.extend(unclear.questions.iter().map(|question| format!("  {question}")));
    lines.push(format!(
        "state it with {}; lines whose places you know suffice (all three names empty: at no place). The good hits, \
         with a line for each stretch of one response, which begins at {}:",
        by.terms.table,
        unclear
            .visits
            .iter()
            .map(|visit| format!("{:.1} s", hits[visit.hits[0]].at_s))
            .collect::<Vec<_>>()
            .join(", ")
    ));
    lines.push(stated::to_complete(places, &unclear.visits).trim_end().to_owned());
    CutError::Asked { name: name.into(), what: lines.join("\n") }
}

/// Refuses to store a hit at a place if an earlier import stored it at another one.
fn refuse_other_places(
    store: &Store,
    origin: &Origin,
    places: &[Place],
    fitted: &Fitted,
) -> Result<(), CutError> {
    let sessions: Vec<i64> = store
        .sessions()?
        .into_iter()
        .filter(|(_, info)| info.serial == origin.digest)
        .map(|(id, _)| id)
        .collect();
    if sessions.is_empty() {
        return Ok(());
    }
    let cells = store.cells()?;
    for row in store.records()?.iter().flatten().filter(|row| sessions.contains(&row.session) && row.kept()) {
        let hit = row.shot.number as usize;
        let Some(cell) = cells.iter().find(|cell| cell.id == row.cell) else { continue };
        let now = hit.checked_sub(1).and_then(|hit| fitted.places.get(hit).copied().flatten());
        let same = now.is_some_and(|place| {
            let own = &places[place].cell;
            (own.configuration, &own.impact, &own.response)
                == (cell.cell.configuration, &cell.cell.impact, &cell.cell.response)
        });
        if !same {
            let what = format!(
                "hit {hit} of this recording is stored at {}/{}/{} (record {}), and now it would be {}: drop it there first \
                 (jointrig campaign drop), or correct the table",
                configuration_name(cell.cell.configuration),
                cell.cell.impact,
                cell.cell.response,
                row.id,
                now.map_or("at no place".into(), |place| format!("at {}", places[place].name))
            );
            return Err(CutError::unfit(&store.path().display().to_string(), what));
        }
    }
    Ok(())
}
