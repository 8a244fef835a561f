//! The shaker's levels for other programs: the time record of each, and a table of what was ordered and what came of it.

use std::path::Path;

use super::{Format, bad};
use crate::campaign::run::shaking;
use crate::campaign::store::Store;
use crate::campaign::store::level_table::{DamagedLevel, LevelRow};
use crate::cli::error::CliError;
use crate::exchange::{tables_output, uff_output, write_level};
use crate::hysteresis::HysteresisRecord;

/// Columns of `levels.csv`.
const COLUMNS: [&str; 15] = [
    "level",
    "when",
    "utc",
    "frequency_hz",
    "end_hz",
    "control",
    "amplitude",
    "reached",
    "overshoot",
    "settled_after_s",
    "drive_v",
    "seconds",
    "lost_samples",
    "damage",
    "file",
];

/// Writes `levels.csv` and, if they are wanted, the records into `folder`; how many levels there are. What is damaged or has lost samples
/// stands in the table without a file.
pub(super) fn write(
    store: &Store,
    folder: &Path,
    format: Format,
    with_records: bool,
) -> Result<usize, CliError> {
    let levels = store.levels()?;
    if levels.is_empty() {
        return Ok(0);
    }
    std::fs::create_dir_all(folder).map_err(|source| CliError::File {
        path: folder.into(),
        doing: "making the folder",
        source,
    })?;
    let plan = store.plan()?;
    let load = plan.contact.as_ref().and_then(|contact| contact.get_ref().normal_load_n);
    let mut table = vec![COLUMNS.map(String::from).to_vec()];
    for level in &levels {
        let row = match level {
            Ok(row) => row,
            Err(damaged) => {
                table.push(damaged_line(damaged));
                continue;
            }
        };
        let file = if with_records && row.whole() {
            let name = format!("level_{}.{}", row.id, format.extension());
            let record = HysteresisRecord { normal_load_n: load, ..record(store, row)? };
            one(&folder.join(&name), format, &record, row.id)?;
            name
        } else {
            String::new()
        };
        table.push(line(row, f64::from(store.channels(row.session)?.rate_hz), file));
    }
    tables_output::write_rows(&folder.join("levels.csv"), &table).map_err(bad)?;
    Ok(levels.len())
}

fn record(store: &Store, row: &LevelRow) -> Result<HysteresisRecord, CliError> {
    let channels = store.channels(row.session)?;
    let samples = store.level_samples(row)?;
    shaking::record(&channels, &samples, &row.level())
        .map_err(|what| CliError::Bad(format!("the shaker's level {} ({}): {what}", row.id, row.level())))
}

fn one(path: &Path, format: Format, record: &HysteresisRecord, level: i64) -> Result<(), CliError> {
    match format {
        Format::Npz => write_level(path, record).map_err(bad),
        Format::Uff58 => uff_output::write_loop(path, record, level).map_err(bad),
        Format::Csv => tables_output::write_loop(path, record).map_err(bad),
    }
}

/// Of a damaged level only its number and what is wrong can be told.
fn damaged_line(damaged: &DamagedLevel) -> Vec<String> {
    let mut line = vec![String::new(); COLUMNS.len()];
    line[0] = damaged.id.to_string();
    line[COLUMNS.len() - 2].clone_from(&damaged.what);
    line
}

fn line(row: &LevelRow, rate_hz: f64, file: String) -> Vec<String> {
    let (level, settled) = (row.level(), row.settled());
    let lost: usize = row.gaps.iter().map(std::ops::Range::len).sum();
    vec![
        row.id.to_string(),
        row.moment.name().into(),
        row.utc.clone(),
        level.frequency_hz.to_string(),
        level.end_hz.map_or(String::new(), |end| end.to_string()),
        level.held.name().into(),
        level.amplitude.to_string(),
        settled.reached.to_string(),
        settled.overshoot.to_string(),
        settled.after_s.to_string(),
        settled.drive_v.to_string(),
        (row.scans as f64 / rate_hz).to_string(),
        lost.to_string(),
        String::new(),
        file,
    ]
}
