//! Imports a continuous recording: its hits are found, fitted to the plan, printed, and stored.

use std::path::Path;

use super::records::{length_notice, origin_of};
use crate::campaign::cut::import::{self as cut, Places, Stored, Terms, stated_places, unused};
use crate::campaign::cut::levels::SteadyCriteria;
use crate::campaign::cut::marker::Marker;
use crate::campaign::cut::recording::LongRecording;
use crate::campaign::cut::{CutError, Only, cut_level, find_levels};
use crate::campaign::import::assign::Calibrations;
use crate::campaign::import::{NewLevelRecord, add_level};
use crate::campaign::plan::Plan;
use crate::campaign::plan::level::{Held, Moment};
use crate::campaign::store::Store;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::cli::error::CliError;
use crate::cli::output::{self, Waiting};
use crate::untrusted_input;
use crate::untrusted_text::tell_line;

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
        match error {
            CutError::Stated(what) => Self::Usage(what),
            CutError::Store(error) => Self::Store(error),
            CutError::Import(error) => error.into(),
            other => Self::Bad(other.to_string()),
        }
    }
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

/// How the command's user states the places.
const TERMS: Terms = Terms {
    order: "--order plan",
    marker: "--marker CHANNEL:STEP",
    table: "--table TABLE.csv",
    place: "--configuration, --impact and --response",
};

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
    let table =
        from.table.map(|table| {
            let text = untrusted_input::text(table, untrusted_input::TABLE).map_err(|source| {
                CliError::Read { path: table.into(), doing: "reading the table of places", source }
            });
            text.map(|text| (table.display().to_string(), text))
        });
    let table = table.transpose()?;
    let by = Places {
        only: from.only,
        in_order: from.in_order,
        table: table.as_ref().map(|(name, text)| (name.as_str(), text.as_str())),
        marker: from.marker,
        terms: &TERMS,
    };
    // before the recording is read
    stated_places(&plan, &by)?;
    let recording = LongRecording::open(file, &plan, from.calibrate)?;
    let waiting = Waiting::of("reading the recording, percent");
    let cut = cut::cut(&recording, &plan, &by, &mut |done, all| {
        waiting.at((100 * done / all.max(1)) as usize, 100);
    });
    drop(waiting);
    let cut = cut?;
    let mut lines = cut.report.clone();
    if from.dry_run {
        lines.push("nothing is stored (--dry-run)".into());
        return output::lines(lines);
    }
    // printed before anything is stored
    output::lines(lines)?;
    let called = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let origin = origin_of(file, &called)?;
    let waiting = Waiting::of("storing hits");
    let mut tell = |place: &str, hit, verdict: &Judgement| {
        if verdict.kind != Verdict::Good {
            tell_line!("{place}: hit {hit}: {} ({})", verdict.kind, verdict.sentence);
        }
    };
    let Stored { hits, kept, already } =
        cut::store(&recording, (&cut, &plan), (&mut store, &origin), from.replace, &mut tell, &mut |done| {
            waiting.at(done, cut.hits.len());
        })?;
    drop(waiting);
    let length = length_notice(&store)?;
    store.close()?;
    let there = if already > 0 { format!(", {already} were there already") } else { String::new() };
    let mut lines = vec![format!("{}: {hits} hits, {kept} of them good{there}", into.display())];
    lines.extend(length);
    output::lines(lines)
}
