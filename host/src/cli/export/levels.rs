//! Exports the shaker's levels: the time record of each, and a table of ordered and reached
//! amplitudes.

use std::collections::HashMap;
use std::path::Path;

use super::records::write_channels;
use super::{Format, bad, make_folder};
use crate::campaign::run::shaking;
use crate::campaign::store::Store;
use crate::campaign::store::level_table::{DamagedLevel, LevelRow};
use crate::cli::error::CliError;
use crate::exchange::channel_records::ChannelRecords;
use crate::exchange::typed_table::{Kind, Table, Value};
use crate::exchange::{tables_output, uff_output, write_level};
use crate::hysteresis::HysteresisRecord;

/// One row for each level.
const COLUMNS: [(&str, Kind); 15] = [
    ("level", Kind::Whole),
    ("when", Kind::Text),
    ("utc", Kind::Utc),
    ("frequency_hz", Kind::Real),
    ("end_hz", Kind::Real),
    ("control", Kind::Text),
    ("amplitude", Kind::Real),
    ("reached", Kind::Real),
    ("overshoot", Kind::Real),
    ("settled_after_s", Kind::Real),
    ("drive_v", Kind::Real),
    ("seconds", Kind::Real),
    ("lost_samples", Kind::Whole),
    ("damage", Kind::Text),
    ("file", Kind::Text),
];

/// The levels that were written.
#[derive(Default)]
pub(super) struct Levels {
    /// Number of levels.
    pub(super) count: usize,
    /// The file with all channels of each level, relative to the export.
    pub(super) channels: HashMap<i64, String>,
}

/// Writes `levels.csv` and, if requested, the records into `folder`: the loop's signals of each
/// level, and all its channels as measured. Damaged levels are in the table but have no file, and
/// those with lost samples have no loop.
pub(super) fn write(
    store: &Store,
    folder: &Path,
    format: Format,
    with_records: bool,
) -> Result<Levels, CliError> {
    if store.levels()?.is_empty() {
        return Ok(Levels::default());
    }
    make_folder(folder)?;
    let table = table(store, |row| {
        if !(with_records && row.whole()) {
            return Ok(None);
        }
        let name = format!("level_{}.{}", row.id, format.extension());
        one(&folder.join(&name), format, &record(store, row)?, row.id)?;
        Ok(Some(name))
    })?;
    table.write_csv(&folder.join("levels.csv")).map_err(bad)?;
    let mut written = Levels { count: table.rows().len(), ..Levels::default() };
    for row in store.levels()?.iter().flatten().filter(|_| with_records) {
        let name = format!("channels_{}.{}", row.id, format.extension());
        write_channels(&folder.join(&name), format, &channels(store, row)?)?;
        written.channels.insert(row.id, format!("levels/{name}"));
    }
    Ok(written)
}

/// All channels of a level as measured, in SI units.
fn channels(store: &Store, row: &LevelRow) -> Result<ChannelRecords, CliError> {
    let (map, samples) = (store.channels(row.session)?, store.level_samples(row)?);
    Ok(ChannelRecords {
        fs_hz: map.fs_hz(),
        names: map.channels.iter().map(|channel| channel.name.to_string()).collect(),
        quantities: map.channels.iter().map(|channel| channel.quantity).collect(),
        delay_s: vec![map.channels.iter().map(|channel| f64::from(channel.delay_ns) * 1e-9).collect()],
        records: vec![row.id],
        signals: vec![(0..map.len()).map(|place| map.to_si(place, samples.channel(place))).collect()],
    })
}

/// Ordered and reached amplitudes, level by level; `file` returns the file of each level's samples.
pub(super) fn table(
    store: &Store,
    mut file: impl FnMut(&LevelRow) -> Result<Option<String>, CliError>,
) -> Result<Table, CliError> {
    let mut table = Table::new(&COLUMNS);
    for level in &store.levels()? {
        table.push(match level {
            Ok(row) => line(row, store.channels(row.session)?.fs_hz(), file(row)?),
            Err(damaged) => damaged_line(damaged),
        });
    }
    Ok(table)
}

/// The velocities and the force of a level, aligned in time.
pub(in crate::cli) fn record(store: &Store, row: &LevelRow) -> Result<HysteresisRecord, CliError> {
    let plan = store.plan()?;
    let channels = plan.along_sliding(store.channels(row.session)?);
    let samples = store.level_samples(row)?;
    let normal_load_n = plan.contact.as_ref().and_then(|contact| contact.get_ref().normal_load_n);
    let record = shaking::record(&channels, &plan.load_cells(&channels), &samples, &row.level())
        .map_err(|what| CliError::Bad(format!("the shaker's level {} ({}): {what}", row.id, row.level())))?;
    Ok(HysteresisRecord { normal_load_n, ..record })
}

fn one(path: &Path, format: Format, record: &HysteresisRecord, level: i64) -> Result<(), CliError> {
    match format {
        Format::Npz => write_level(path, record).map_err(bad),
        Format::Uff58 => uff_output::write_loop(path, record, level).map_err(bad),
        Format::Csv => tables_output::write_loop(path, record).map_err(bad),
    }
}

/// Row of a damaged level: only its number and the damage.
fn damaged_line(damaged: &DamagedLevel) -> Vec<Value> {
    let mut line = vec![Value::Missing; COLUMNS.len()];
    line[0] = damaged.id.into();
    line[COLUMNS.len() - 2] = damaged.what.as_str().into();
    line
}

fn line(row: &LevelRow, rate_hz: f64, file: Option<String>) -> Vec<Value> {
    let (level, settled) = (row.level(), row.settled());
    vec![
        row.id.into(),
        row.moment.name().into(),
        row.utc.as_str().into(),
        level.frequency_hz.into(),
        level.end_hz.into(),
        level.held.name().into(),
        level.amplitude.into(),
        settled.reached.into(),
        settled.overshoot.into(),
        settled.after_s.into(),
        settled.drive_v.into(),
        (row.scans as f64 / rate_hz).into(),
        row.gaps.iter().map(std::ops::Range::len).sum::<usize>().into(),
        Value::Missing,
        file.into(),
    ]
}
