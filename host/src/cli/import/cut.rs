//! Imports a continuous recording: its hits are found, fitted to the plan, printed, and stored.

use std::path::Path;

use super::bad;
use super::records::{length_notice, origin_of};
use crate::campaign::cut::levels::SteadyCriteria;
use crate::campaign::cut::marker::{self, Marker};
use crate::campaign::cut::places::{Fitted, Named, Unclear};
use crate::campaign::cut::recording::LongRecording;
use crate::campaign::cut::{
    CutError, CutHit, Only, Place, assign, contradictions, cut_hit, cut_level, find_hits, find_levels,
    places_of, stated, unclear_marker,
};
use crate::campaign::import::assign::Calibrations;
use crate::campaign::import::{CellName, Hit, NewLevelRecord, Origin, add_hits, add_level};
use crate::campaign::plan::level::{Held, Moment};
use crate::campaign::plan::{Plan, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::cli::error::CliError;
use crate::cli::output::{self, Waiting};
use crate::untrusted_input;
use crate::untrusted_text::tell_line;

/// Most hits that are held in memory at once.
const TOGETHER: usize = 16;

/// What is known of the recording.
pub(super) struct Recorded<'r> {
    pub(super) file: &'r Path,
    pub(super) into: &'r Path,
    pub(super) only: Only<'r>,
    /// Whether the places were struck in the plan's order.
    pub(super) in_order: bool,
    /// The table that names places.
    pub(super) table: Option<&'r Path>,
    /// The channel that says which place is struck.
    pub(super) marker: Option<&'r Marker>,
    /// Whether hits are listed and not stored.
    pub(super) dry_run: bool,
    pub(super) replace: bool,
    /// Sensitivities of recorded voltages.
    pub(super) calibrate: &'r Calibrations,
    /// The steady parts of a shaker's recording are wanted, measured before or after the cells.
    pub(super) levels: Option<Moment>,
}

impl From<CutError> for CliError {
    fn from(error: CutError) -> Self {
        Self::Bad(error.to_string())
    }
}

/// The channels that no analysis will use.
fn unused(recording: &LongRecording, marker: Option<&Marker>) -> Option<String> {
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

/// Numbers of hits, from 1, with ranges.
fn numbers(hits: &[usize]) -> String {
    let mut ranges: Vec<[usize; 2]> = Vec::new();
    for hit in hits {
        match ranges.last_mut() {
            Some(last) if last[1] + 1 == *hit => last[1] = *hit,
            _ => ranges.push([*hit, *hit]),
        }
    }
    let text = |[first, last]: &[usize; 2]| {
        if first == last { format!("{}", first + 1) } else { format!("{}-{}", first + 1, last + 1) }
    };
    ranges.iter().map(text).collect::<Vec<_>>().join(", ")
}

/// Imports the steady parts of a shaker's recording as levels.
fn levels(from: &Recorded<'_>, mut store: Store, plan: &Plan, moment: Moment) -> Result<(), CliError> {
    let recording = LongRecording::open(from.file, plan, from.calibrate)?;
    let waiting = Waiting::of("reading the recording, percent");
    let found = find_levels(&recording, plan, SteadyCriteria::default(), &mut |done, all| {
        waiting.at((100 * done / all.max(1)) as usize, 100);
    })?;
    drop(waiting);
    let fs_hz = recording.map().fs_hz();
    let mut lines = vec![format!(
        "{}: {:.1} s, {} steady parts (amplitude within {} %, {} s at least)",
        recording.name(),
        recording.length_s(),
        found.len(),
        100.0 * SteadyCriteria::default().tolerance,
        SteadyCriteria::default().least_s
    )];
    lines.extend(unused(&recording, None));
    for level in &found {
        lines.push(format!(
            "  {:.2} to {:.2} s: {} (reached {}), {}",
            level.scans.start as f64 / fs_hz,
            level.scans.end as f64 / fs_hz,
            level.level,
            Held::Displacement.show(level.reached_m),
            if level.planned { "a level of the plan" } else { "not in the plan: stored as measured" }
        ));
    }
    if from.dry_run {
        lines.push("nothing is stored (--dry-run)".into());
        return output::lines(lines);
    }
    let called = from.file.file_name().unwrap_or(from.file.as_os_str()).to_string_lossy();
    let origin = origin_of(from.file, &called)?;
    let mut already = 0;
    for level in &found {
        let new = NewLevelRecord {
            moment,
            level: level.level,
            samples: cut_level(&recording, level.scans.clone())?,
            first_scan: level.scans.start,
            gaps: Vec::new(),
        };
        already += usize::from(add_level(&mut store, &origin, recording.map(), new)?.already);
    }
    store.log(&format!("cut {} into {} levels of the shaker", from.file.display(), found.len()))?;
    store.close()?;
    let there = if already > 0 { format!(", {already} were there already") } else { String::new() };
    lines.push(format!("{}: {} levels {} the cells{there}", from.into.display(), found.len(), moment.name()));
    output::lines(lines)
}

/// Imports the recording.
///
/// # Errors
/// It cannot be read or cut; the places of hits are not certain (nothing is stored, and the message
/// lists what to state); hits of it are stored at other places already.
pub(super) fn import(from: &Recorded<'_>) -> Result<(), CliError> {
    let Recorded { file, into, .. } = *from;
    let mut store = if from.dry_run { Store::open_read_only(into)? } else { Store::open(into)? };
    let plan = store.plan()?;
    if let Some(moment) = from.levels {
        return levels(from, store, &plan, moment);
    }
    let places = places_of(&plan, &from.only).map_err(CliError::Usage)?;
    if !from.in_order && from.table.is_none() && from.marker.is_none() && places.len() > 1 {
        return Err(CliError::Usage(format!(
            "the hits may be at {} places: add --order plan if they were struck in the plan's order, --marker CHANNEL:STEP if a channel \
             says which, --table TABLE.csv with the columns \
             hit (or time_s), configuration, impact, response, or --configuration, --impact and --response",
            places.len()
        )));
    }
    let recording = LongRecording::open(file, &plan, from.calibrate)?;
    let waiting = Waiting::of("reading the recording, percent");
    let hits = find_hits(&recording, &plan, &mut |done, all| {
        waiting.at((100 * done / all.max(1)) as usize, 100);
    })?;
    drop(waiting);
    let found = found(&recording, &hits, from.marker);
    let Stated { named, marked, doubts } = stated(from, &plan, &places, (&recording, &hits))?;
    let open = [doubts, contradictions(&hits, &plan, &places, &named, &marked)].concat();
    if !open.is_empty() {
        return Err(asked(from, &places, &hits, found, &unclear_marker(&hits, &named, open)));
    }
    let fitted = match assign(&hits, &plan, &places, &named) {
        Ok(fitted) => fitted,
        Err(unclear) => return Err(asked(from, &places, &hits, found, &unclear)),
    };
    let mut lines = found;
    lines.extend(by_place(&places, &hits, &fitted));
    lines.extend(fitted.notes.iter().cloned());
    if from.dry_run {
        lines.push("nothing is stored (--dry-run)".into());
        return output::lines(lines);
    }
    // printed before anything is stored
    output::lines(lines)?;
    let called = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let origin = origin_of(file, &called)?;
    refuse_other_places(&store, &origin, &places, &fitted)?;
    let (mut stored, mut kept, mut already) = (0, 0, 0);
    let waiting = Waiting::of("storing hits");
    for (number, place) in places.iter().enumerate() {
        let own: Vec<usize> = (0..hits.len()).filter(|hit| fitted.places[*hit] == Some(number)).collect();
        for some in own.chunks(TOGETHER) {
            waiting.at(stored, hits.len());
            let mut batch = Vec::new();
            for hit in some {
                if let Some((samples, trigger)) = cut_hit(&recording, &plan, &hits[*hit])? {
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
            let mut tell = |hit, verdict: &Judgement| {
                if verdict.kind != Verdict::Good {
                    tell_line!("{}: hit {hit}: {} ({})", place.name, verdict.kind, verdict.sentence);
                }
            };
            let added =
                add_hits(&mut store, &origin, &name, recording.map(), batch, from.replace, &mut tell)?;
            stored += added.hits;
            kept += added.kept;
            already += added.already;
        }
    }
    drop(waiting);
    store.log(&format!("cut {} into {stored} hits", file.display()))?;
    let length = length_notice(&store)?;
    store.close()?;
    let there = if already > 0 { format!(", {already} were there already") } else { String::new() };
    let mut lines = vec![format!("{}: {stored} hits, {kept} of them good{there}", into.display())];
    lines.extend(length);
    output::lines(lines)
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
    from: &Recorded<'_>,
    plan: &Plan,
    places: &[Place],
    (recording, hits): (&LongRecording, &[CutHit]),
) -> Result<Stated, CliError> {
    let mut named = match from.table {
        None if !from.in_order && from.marker.is_none() => vec![Some(Named::Place(0)); hits.len()],
        None => vec![None; hits.len()],
        Some(table) => {
            let text = untrusted_input::text(table, untrusted_input::TABLE).map_err(|source| {
                CliError::Read { path: table.into(), doing: "reading the table of places", source }
            })?;
            let at_s: Vec<f64> = hits.iter().map(|hit| hit.at_s).collect();
            stated::from_table(&text, plan, places, &at_s)
                .map_err(|what| bad(format!("{}: {what}", table.display())))?
        }
    };
    let (mut marked, mut doubts) = (vec![false; hits.len()], Vec::new());
    if let Some(marker) = from.marker {
        let read = marker::read(recording, marker, hits, places)?;
        let open = |(hit, _): &(usize, String)| named[*hit].is_none() && hits[*hit].is_good();
        doubts = read.doubts.into_iter().filter(open).collect();
        for ((own, marked), said) in named.iter_mut().zip(&mut marked).zip(read.named) {
            *marked = own.is_none();
            *own = own.or(said);
        }
    }
    if !from.in_order {
        // without an order, a hit that neither table nor marker names is at no place
        for one in &mut named {
            *one = one.or(Some(Named::Nowhere));
        }
    }
    Ok(Stated { named, marked, doubts })
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
    from: &Recorded<'_>,
    places: &[Place],
    hits: &[CutHit],
    found: Vec<String>,
    unclear: &Unclear,
) -> CliError {
    let mut lines = found;
    lines.push("it is not certain where these hits were struck, and nothing is stored:".into());
    lines.extend(unclear.questions.iter().map(|question| format!("  {question}")));
    lines.push(format!(
        "state it with --table TABLE.csv; lines whose places you know suffice (all three names empty: at no place). The good hits, \
         with a line for each stretch of one response, which begins at {}:",
        unclear
            .visits
            .iter()
            .map(|visit| format!("{:.1} s", hits[visit.hits[0]].at_s))
            .collect::<Vec<_>>()
            .join(", ")
    ));
    lines.push(stated::to_complete(places, &unclear.visits).trim_end().to_owned());
    bad(format!("{}: {}", from.file.display(), lines.join("\n")))
}

/// Refuses to store a hit at a place if an earlier import stored it at another one.
fn refuse_other_places(
    store: &Store,
    origin: &Origin,
    places: &[Place],
    fitted: &Fitted,
) -> Result<(), CliError> {
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
            return Err(bad(format!(
                "{}: hit {hit} of this recording is stored at {}/{}/{} (record {}), and now it would be {}: drop it there first \
                 (jointrig campaign drop), or correct the table",
                store.path().display(),
                configuration_name(cell.cell.configuration),
                cell.cell.impact,
                cell.cell.response,
                row.id,
                now.map_or("at no place".into(), |place| format!("at {}", places[place].name))
            )));
        }
    }
    Ok(())
}
