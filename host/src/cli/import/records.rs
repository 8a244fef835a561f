//! Imports impact records into one cell of a campaign file.

use std::collections::BTreeSet;
use std::path::Path;

use toml::Spanned;

use super::bad;
use crate::analyse::AnalysedLength;
use crate::campaign::import::as_recorded::as_recorded;
use crate::campaign::import::assign::{Calibrations, assigned, names_the_contact};
use crate::campaign::import::channel_file::{is_channel_file, read_channel_file};
use crate::campaign::import::{Added, CellName, Hit, Origin, add_hits, find};
use crate::campaign::plan::{Cell, Plan, configuration_name};
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
    /// The cells that have hits of it.
    pub(super) cells: BTreeSet<i64>,
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
        self.cells.extend(&other.cells);
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
    (units, calibrate): (&StatedUnits, &Calibrations),
) -> Result<(), CliError> {
    let mut store = Store::open(into)?;
    let plan = store.plan()?;
    let called = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let origin = origin_of(file, &called)?;
    let mut tell = |hit: u32, verdict: &Judgement| {
        tell_line!("hit {hit}: {} ({})", verdict.kind, verdict.sentence);
    };
    let Brought { hits, kept, already, types, taken, .. } = if has_all_channels(file, &plan, calibrate)? {
        bring_channels(&mut store, &origin, name, file, (calibrate, replace), &mut tell)?
    } else {
        let read = read_record_file(file, units).map_err(bad)?;
        for note in &read.notes {
            tell_line!("{}: {note}", file.display());
        }
        bring(&mut store, &origin, name, read, replace, &mut tell)?
    };
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
    let (id, cell, _) = find(store, name)?;
    let wrong = |reason: String| bad(format!("{}: {reason}", origin.name));
    let (read, axes) = along_plan(&plan, &cell, read).map_err(wrong)?;
    let RecordFile { records, delay_s, taken, .. } = read;
    let (mut map, samples) = as_recorded(&records, axes).map_err(wrong)?;
    put_in_step(&mut map, &delay_s);
    let hits = (0..).zip(samples).map(|(number, samples)| Hit::new(number, samples)).collect();
    let Added { hits, kept, already, types } = add_hits(store, origin, name, &map, hits, replace, tell)?;
    Ok(Brought { cells: BTreeSet::from([id]), hits, kept, already, types, taken })
}

/// Whether a file is read with all its channels: named ones, or a universal file of which
/// sensitivities are stated or whose labels name load cells or specimens.
pub(super) fn has_all_channels(path: &Path, plan: &Plan, calibrate: &Calibrations) -> Result<bool, CliError> {
    if is_channel_file(path, *calibrate != Calibrations::default()).map_err(bad)? {
        return Ok(true);
    }
    // a file that is no list of channels is read, and refused, as one of force and responses
    let universal = is_channel_file(path, true).map_err(bad)?;
    Ok(universal && read_channel_file(path).is_ok_and(|file| names_the_contact(plan, &file)))
}

/// Adds the hits of a file with all channels to a cell; reports each verdict. Hits of fixed sensors
/// fill all cells of their row, and are stored with its first one.
///
/// # Errors
/// As [`add_hits`], or a channel's name, unit or sensitivity is missing.
pub(super) fn bring_channels(
    store: &mut Store,
    origin: &Origin,
    name: &CellName<'_>,
    path: &Path,
    (calibrate, replace): (&Calibrations, bool),
    tell: &mut dyn FnMut(u32, &Judgement),
) -> Result<Brought, CliError> {
    let plan = store.plan()?;
    let (id, _, _) = find(store, name)?;
    let struck = store.rows()?.lead(id).unwrap_or(id);
    let cell = store.cells()?.into_iter().find(|row| row.id == struck).map(|row| row.cell);
    let Some(Cell { configuration, impact, response, .. }) = cell else {
        return Err(bad(format!("{}: cell {struck} is missing", store.path().display())));
    };
    let name =
        CellName { configuration: configuration_name(configuration), impact: &impact, response: &response };
    let file = read_channel_file(path).map_err(bad)?;
    let (map, samples) = assigned(&plan, &response, &file, calibrate)
        .map_err(|what| bad(format!("{}: {what}", path.display())))?;
    let taken = map.channels.iter().map(|channel| format!("{} in {}", channel.name, channel.quantity.unit()));
    let taken = taken.collect::<Vec<_>>().join(", ");
    let hits = (0..).zip(samples).map(|(number, samples)| Hit::new(number, samples)).collect();
    let Added { hits, kept, already, types } = add_hits(store, origin, &name, &map, hits, replace, tell)?;
    Ok(Brought { cells: BTreeSet::from([struck]), hits, kept, already, types, taken })
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
