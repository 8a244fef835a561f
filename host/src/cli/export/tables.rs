//! What stands in the campaign file beside signals: every record with its verdict and standing, every channel with its scale, every
//! calibration.

use std::collections::HashMap;
use std::path::Path;

use super::bad;
use super::records::Written;
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::record_row::{Damaged, RecordRow};
use crate::cli::error::CliError;
use crate::exchange::tables_output::write_rows;

/// Columns of `records.csv`.
const RECORDS: [&str; 23] = [
    "record",
    "configuration",
    "impact",
    "response",
    "attempt",
    "session",
    "utc",
    "utc_error_s",
    "verdict",
    "measure",
    "limit",
    "sentence",
    "standing",
    "overruled_utc",
    "overruled_reason",
    "peak_n",
    "pulse_us",
    "samples",
    "trigger_index",
    "lost_samples",
    "damage",
    "file",
    "hit",
];

/// Columns of `channels.csv`.
const CHANNELS: [&str; 14] = [
    "session",
    "place",
    "channel",
    "role",
    "unit",
    "rate_hz",
    "units_per_volt",
    "units_per_volt_as_measured",
    "range_v",
    "bits",
    "delay_s",
    "model",
    "serial",
    "calibrated",
];

/// Columns of `calibrations.csv`.
const CALIBRATIONS: [&str; 11] = [
    "utc",
    "from_session",
    "channel",
    "sensitivity_v",
    "polarity",
    "delay_s",
    "uncertainty",
    "model",
    "serial",
    "calibrated",
    "reason",
];

/// Writes `records.csv`, `channels.csv` and, where there are any, `calibrations.csv`.
pub(super) fn write(store: &Store, folder: &Path, written: &[Written]) -> Result<(), CliError> {
    records(store, &folder.join("records.csv"), written)?;
    channels(store, &folder.join("channels.csv"))?;
    let entered = store.calibrations()?;
    if entered.is_empty() {
        return Ok(());
    }
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    let text = |value: &Option<String>| value.clone().unwrap_or_default();
    let rows = entered.iter().map(|row| {
        vec![
            row.utc.clone(),
            row.from_session.to_string(),
            row.channel.clone(),
            number(row.sensitivity_v),
            row.polarity.map_or(String::new(), |sign| sign.to_string()),
            number(row.delay_s),
            number(row.uncertainty),
            text(&row.model),
            text(&row.serial),
            text(&row.calibrated),
            row.reason.clone(),
        ]
    });
    let rows: Vec<Vec<String>> = std::iter::once(heading(&CALIBRATIONS)).chain(rows).collect();
    write_rows(&folder.join("calibrations.csv"), &rows).map_err(bad)
}

fn heading(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn records(store: &Store, path: &Path, written: &[Written]) -> Result<(), CliError> {
    let cells: HashMap<i64, _> = store.cells()?.into_iter().map(|row| (row.id, row.cell)).collect();
    let places: HashMap<i64, &Written> = written.iter().map(|one| (one.record, one)).collect();
    let overrules = store.overrules()?;
    let mut rows = vec![heading(&RECORDS)];
    for record in store.records()? {
        let (id, cell, attempt) = match &record {
            Ok(row) => (row.id, row.cell, row.attempt),
            Err(Damaged { place, .. }) => (place.id, place.cell, place.attempt),
        };
        let cell = cells.get(&cell);
        let named = |of: fn(&crate::campaign::plan::Cell) -> String| cell.map_or(String::new(), of);
        let mut line = vec![
            id.to_string(),
            named(|cell| configuration_name(cell.configuration).into()),
            named(|cell| cell.impact.clone()),
            named(|cell| cell.response.clone()),
            attempt.to_string(),
        ];
        match &record {
            Ok(row) => {
                // the last one counts
                let last = overrules.iter().rfind(|overrule| overrule.record == id);
                line.extend(of_record(row));
                line.extend([
                    last.map_or(String::new(), |one| one.utc.clone()),
                    last.map_or(String::new(), |one| one.reason.clone()),
                    row.peak_n.to_string(),
                    row.pulse_us.to_string(),
                    row.scans.to_string(),
                    row.trigger_index.to_string(),
                    row.gaps.iter().map(std::ops::Range::len).sum::<usize>().to_string(),
                    String::new(),
                ]);
            }
            Err(Damaged { what, .. }) => {
                line.resize(RECORDS.len() - 3, String::new());
                line.push(what.clone());
            }
        }
        let place = places.get(&id);
        line.push(place.map_or(String::new(), |one| one.file.clone()));
        line.push(place.map_or(String::new(), |one| one.hit.to_string()));
        rows.push(line);
    }
    write_rows(path, &rows).map_err(bad)
}

fn of_record(row: &RecordRow) -> [String; 8] {
    [
        row.session.to_string(),
        row.utc.clone(),
        row.utc_error_s.map_or(String::new(), |error| error.to_string()),
        row.verdict.name().into(),
        row.measure.to_string(),
        row.limit.to_string(),
        row.sentence.clone(),
        row.standing().name().into(),
    ]
}

fn channels(store: &Store, path: &Path) -> Result<(), CliError> {
    let mut rows = vec![heading(&CHANNELS)];
    for (session, _) in store.sessions()? {
        let (now, then, sensors) =
            (store.channels(session)?, store.channels_as_measured(session)?, store.sensors(session)?);
        for (place, channel) in now.channels.iter().enumerate() {
            let sensor = sensors.get(place);
            let known = |of: fn(&crate::campaign::store::session_table::Sensor) -> &Option<String>| {
                sensor.and_then(|sensor| of(sensor).clone()).unwrap_or_default()
            };
            rows.push(vec![
                session.to_string(),
                place.to_string(),
                channel.name.to_string(),
                format!("{:?}", channel.role),
                channel.quantity.unit().into(),
                now.rate_hz.to_string(),
                channel.units_per_volt.to_string(),
                then.channels[place].units_per_volt.to_string(),
                channel.range_v.to_string(),
                channel.bits.to_string(),
                (f64::from(channel.delay_ns) * 1e-9).to_string(),
                known(|sensor| &sensor.model),
                known(|sensor| &sensor.serial),
                known(|sensor| &sensor.calibrated),
            ]);
        }
    }
    write_rows(path, &rows).map_err(bad)
}
