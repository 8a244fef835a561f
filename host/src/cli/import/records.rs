//! Imports impact records into one cell of a campaign file.

use std::path::Path;

use toml::Spanned;

use super::bad;
use crate::analyse::AnalysedLength;
use crate::campaign::import::as_recorded::as_recorded;
use crate::campaign::import::{Added, CellName, Hit, Origin, add_hits, find};
use crate::campaign::plan::{Cell, Plan};
use crate::campaign::store::Store;
use crate::campaign::verdict::Judgement;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::device::channels::ChannelMap;
use crate::exchange::StatedUnits;
use crate::exchange::record_file::{PlannedPlace, RecordFile};
use crate::exchange::record_uff::read_record_file;
use crate::untrusted_text::tell_line;

/// The file as the origin of hits, which the campaign file will call `name`.
pub(super) fn origin_of(path: &Path, name: &str) -> Result<Origin, CliError> {
    Origin::of_file(path, name).map_err(|source| CliError::Read {
        path: path.into(),
        doing: "reading a file to import",
        source,
    })
}

/// Result of an import of records.
#[derive(Debug, Clone, Default)]
pub(super) struct Brought {
    pub(super) cells: usize,
    pub(super) hits: usize,
    pub(super) kept: usize,
    /// Hits that were already stored by an earlier import of the same file.
    pub(super) already: usize,
    /// Name and type of each channel as stored.
    types: Vec<String>,
    /// What was used of the last file, in one line.
    pub(super) taken: String,
}

impl Brought {
    pub(super) fn add(&mut self, other: &Brought) {
        self.cells += other.cells;
        self.hits += other.hits;
        self.kept += other.kept;
        self.already += other.already;
    }
}

/// Imports one file, and prints what was done.
pub(super) fn import(
    file: &Path,
    into: &Path,
    name: &CellName<'_>,
    replace: bool,
    units: &StatedUnits,
) -> Result<(), CliError> {
    let read = read_record_file(file, units).map_err(bad)?;
    for note in &read.notes {
        tell_line!("{}: {note}", file.display());
    }
    let mut store = Store::open(into)?;
    let called = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let origin = origin_of(file, &called)?;
    let Brought { hits, kept, already, types, taken, .. } =
        bring(&mut store, &origin, name, read, replace, &mut |hit, verdict| {
            tell_line!("hit {hit}: {} ({})", verdict.kind, verdict.sentence);
        })?;
    store.log(&format!("imported {hits} hits from {}", file.display()))?;
    let length = length_notice(&store)?;
    store.close()?;
    if kept == 0 {
        return Err(bad(format!(
            "{}: none of the {hits} hits is good; they are stored with their verdicts, and no analysis uses them",
            file.display()
        )));
    }
    let mut lines = vec![
        format!("{}: {taken}", file.display()),
        format!("{}: {kept} of {hits} hits are good", into.display()),
    ];
    lines.extend(length);
    if already > 0 {
        lines.push(format!("{already} of them were there already, from an earlier import of the same file"));
    }
    if already < hits {
        lines.push(format!("stored with every digit: {}", types.join(", ")));
    }
    output::lines(lines)
}

/// Message about the length of the records that were imported into a campaign.
pub(super) fn length_notice(store: &Store) -> Result<Option<String>, CliError> {
    let notice = AnalysedLength::of(store, &store.plan()?)?.notice();
    Ok(notice.map(|notice| format!("{}: {notice}", store.path().display())))
}

/// Adds the hits of a file of force and responses to a cell; reports each verdict.
///
/// # Errors
/// As [`add_hits`], or the labels contradict the plan.
pub(super) fn bring(
    store: &mut Store,
    origin: &Origin,
    name: &CellName<'_>,
    read: RecordFile,
    replace: bool,
    tell: &mut dyn FnMut(u32, &Judgement),
) -> Result<Brought, CliError> {
    let plan = store.plan()?;
    let (_, cell, _) = find(store, name)?;
    let wrong = |reason: String| bad(format!("{}: {reason}", origin.name));
    let (read, axes) = along_plan(&plan, &cell, read).map_err(wrong)?;
    let RecordFile { records, delay_s, taken, .. } = read;
    let (mut map, samples) = as_recorded(&records, axes).map_err(wrong)?;
    put_in_step(&mut map, &delay_s);
    let hits = (0..).zip(samples).map(|(number, samples)| Hit::new(number, samples)).collect();
    let Added { hits, kept, already, types } = add_hits(store, origin, name, &map, hits, replace, tell)?;
    Ok(Brought { cells: 1, hits, kept, already, types, taken })
}

/// The records along the directions that the plan defines for the cell, and the number of axes of
/// its location.
fn along_plan(plan: &Plan, cell: &Cell, read: RecordFile) -> Result<(RecordFile, usize), String> {
    let points = |name: &str| plan.geometry.response.iter().map(Spanned::get_ref).find(|p| p.name == name);
    let hammer = plan.geometry.impact.iter().map(Spanned::get_ref).find(|p| p.name == cell.impact);
    let (Some(sensor), Some(hammer)) = (points(&cell.response), hammer) else { return Ok((read, 3)) };
    let axes: Vec<[f64; 3]> = sensor.axes().into_iter().map(|(_, axis)| axis).collect();
    let place = PlannedPlace {
        impact: &cell.impact,
        push: hammer.direction,
        response: &cell.response,
        axes: &axes,
        own_axes: sensor.axes.is_some(),
    };
    Ok((read.along_plan(&place)?, axes.len()))
}

/// Stores the delay of each channel relative to the earliest, since delays of channels are not
/// negative.
fn put_in_step(map: &mut ChannelMap, delay_s: &[f64]) {
    let earliest = delay_s.iter().copied().fold(0.0, f64::min);
    let late = std::iter::once(0.0).chain(delay_s.iter().copied());
    for (channel, late) in map.channels.iter_mut().zip(late) {
        // less than a sample
        channel.delay_ns = (1e9 * (late - earliest)).round() as u32;
    }
}
