//! The campaign file's data other than signals: every record with its original and current verdict,
//! every channel with its scale, every calibration.

use std::collections::HashMap;
use std::path::Path;

use super::bad;
use super::records::Written;
use crate::campaign::plan::{Cell, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::record_table::Overrule;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::campaign::store::session_table::Sensor;
use crate::campaign::store::stored::SampleTypes;
use crate::cli::error::CliError;
use crate::device::samples::SampleType;
use crate::exchange::typed_table::{Kind, Table, Value};

/// One row for each record.
const RECORDS: [(&str, Kind); 24] = [
    ("record", Kind::Whole),
    ("configuration", Kind::Text),
    ("impact", Kind::Text),
    ("response", Kind::Text),
    ("attempt", Kind::Whole),
    ("session", Kind::Whole),
    ("utc", Kind::Utc),
    ("utc_error_s", Kind::Real),
    ("verdict", Kind::Text),
    ("measure", Kind::Real),
    ("limit", Kind::Real),
    ("sentence", Kind::Text),
    ("standing", Kind::Text),
    ("overruled_utc", Kind::Utc),
    ("overruled_reason", Kind::Text),
    ("peak_n", Kind::Real),
    ("pulse_us", Kind::Whole),
    ("samples", Kind::Whole),
    ("trigger_index", Kind::Whole),
    ("lost_samples", Kind::Whole),
    ("crc32", Kind::Whole),
    ("damage", Kind::Text),
    ("file", Kind::Text),
    ("hit", Kind::Whole),
];

/// One row for each cell.
#[cfg(feature = "parquet")]
const CELLS: [(&str, Kind); 7] = [
    ("cell", Kind::Whole),
    ("configuration", Kind::Text),
    ("impact", Kind::Text),
    ("response", Kind::Text),
    ("wanted", Kind::Whole),
    ("given_up", Kind::Text),
    ("settled", Kind::Text),
];

/// One row for each overruled verdict.
#[cfg(feature = "parquet")]
const OVERRULES: [(&str, Kind); 4] =
    [("record", Kind::Whole), ("utc", Kind::Utc), ("verdict", Kind::Text), ("reason", Kind::Text)];

/// One row for each channel of each session.
const CHANNELS: [(&str, Kind); 16] = [
    ("session", Kind::Whole),
    ("place", Kind::Whole),
    ("channel", Kind::Text),
    ("role", Kind::Text),
    ("unit", Kind::Text),
    ("rate_hz", Kind::Real),
    ("sample_type", Kind::Text),
    ("units_per_code", Kind::Real),
    ("units_per_volt", Kind::Real),
    ("units_per_volt_as_measured", Kind::Real),
    ("range_v", Kind::Real),
    ("bits", Kind::Whole),
    ("delay_s", Kind::Real),
    ("model", Kind::Text),
    ("serial", Kind::Text),
    ("calibrated", Kind::Text),
];

/// One row for each edge of the sync input and output.
const EDGES: [(&str, Kind); 7] = [
    ("session", Kind::Whole),
    ("clock", Kind::Text),
    ("line", Kind::Text),
    ("number", Kind::Whole),
    ("scan", Kind::Real),
    ("record", Kind::Whole),
    ("sample", Kind::Real),
];

/// One row for each calibration.
const CALIBRATIONS: [(&str, Kind); 11] = [
    ("utc", Kind::Utc),
    ("from_session", Kind::Whole),
    ("channel", Kind::Text),
    ("sensitivity_v", Kind::Real),
    ("polarity", Kind::Whole),
    ("delay_s", Kind::Real),
    ("uncertainty", Kind::Real),
    ("model", Kind::Text),
    ("serial", Kind::Text),
    ("calibrated", Kind::Text),
    ("reason", Kind::Text),
];

/// Every cell.
#[cfg(feature = "parquet")]
pub(super) fn cells(store: &Store) -> Result<Table, CliError> {
    let mut table = Table::new(&CELLS);
    for row in store.cells()? {
        table.push(vec![
            row.id.into(),
            configuration_name(row.cell.configuration).into(),
            row.cell.impact.into(),
            row.cell.response.into(),
            row.cell.wanted.into(),
            row.given_up.into(),
            row.settled.into(),
        ]);
    }
    Ok(table)
}

/// Every overruled verdict, in order.
#[cfg(feature = "parquet")]
pub(super) fn overrules(store: &Store) -> Result<Table, CliError> {
    let mut table = Table::new(&OVERRULES);
    for row in store.overrules()? {
        table.push(vec![row.record.into(), row.utc.into(), row.verdict.into(), row.reason.into()]);
    }
    Ok(table)
}

/// Every edge of the sync input and output, with the record that contains it and its position among
/// the record's samples.
pub(super) fn edges(store: &Store) -> Result<Table, CliError> {
    let mut table = Table::new(&EDGES);
    let (edges, clocks) = (store.edges()?, store.clocks()?);
    if edges.is_empty() {
        return Ok(table);
    }
    let mut records: Vec<RecordRow> = store.records()?.into_iter().flatten().collect();
    records.sort_by_key(|record| (record.session, record.first_scan));
    for row in edges {
        let clock = clocks.iter().find(|clock| clock.session == row.session);
        // only the last record that starts before the edge can contain it
        let begun = records.partition_point(|r| (r.session, r.first_scan) <= (row.session, row.scan));
        let inside = |record: &&RecordRow| {
            record.session == row.session && row.scan < record.first_scan + record.scans as u64
        };
        let record = begun.checked_sub(1).map(|last| &records[last]).filter(inside);
        table.push(vec![
            row.session.into(),
            clock.map(|clock| clock.source.as_str()).into(),
            row.line.as_str().into(),
            row.number.into(),
            row.at_scan().into(),
            record.map(|record| record.id).into(),
            record.map(|record| row.at_scan() - record.first_scan as f64).into(),
        ]);
    }
    Ok(table)
}

/// Every calibration.
pub(super) fn calibrations(store: &Store) -> Result<Table, CliError> {
    let mut table = Table::new(&CALIBRATIONS);
    for row in store.calibrations()? {
        table.push(vec![
            row.utc.into(),
            row.from_session.into(),
            row.channel.into(),
            row.sensitivity_v.into(),
            row.polarity.into(),
            row.delay_s.into(),
            row.uncertainty.into(),
            row.model.into(),
            row.serial.into(),
            row.calibrated.into(),
            row.reason.into(),
        ]);
    }
    Ok(table)
}

/// Every record, with the file that holds its samples.
pub(super) fn records(store: &Store, written: &[Written]) -> Result<Table, CliError> {
    let cells: HashMap<i64, Cell> = store.cells()?.into_iter().map(|row| (row.id, row.cell)).collect();
    let places: HashMap<i64, &Written> = written.iter().map(|one| (one.record, one)).collect();
    let overrules = store.overrules()?;
    let mut table = Table::new(&RECORDS);
    for record in store.records()? {
        let (id, cell, attempt) = match &record {
            Ok(row) => (row.id, row.cell, row.attempt),
            Err(Damaged { place, .. }) => (place.id, place.cell, place.attempt),
        };
        let cell = cells.get(&cell);
        let mut line: Vec<Value> = vec![
            id.into(),
            cell.map(|cell| configuration_name(cell.configuration)).into(),
            cell.map(|cell| cell.impact.clone()).into(),
            cell.map(|cell| cell.response.clone()).into(),
            attempt.into(),
        ];
        match &record {
            Ok(row) => {
                // the last one applies
                let last = overrules.iter().rfind(|overrule| overrule.record == id);
                line.extend(of_record(row, last));
            }
            Err(Damaged { what, .. }) => {
                line.resize(RECORDS.len() - 3, Value::Missing);
                line.push(what.as_str().into());
            }
        }
        let place = places.get(&id);
        line.push(place.map(|one| one.file.clone()).into());
        line.push(place.map(|one| one.hit).into());
        table.push(line);
    }
    Ok(table)
}

fn of_record(row: &RecordRow, overruled: Option<&Overrule>) -> [Value; 17] {
    [
        row.session.into(),
        row.utc.as_str().into(),
        row.utc_error_s.into(),
        row.verdict.name().into(),
        row.measure.into(),
        row.limit.into(),
        row.sentence.as_str().into(),
        row.standing().name().into(),
        overruled.map(|one| one.utc.as_str()).into(),
        overruled.map(|one| one.reason.as_str()).into(),
        row.peak_n.into(),
        row.pulse_us.into(),
        row.scans.into(),
        row.trigger_index.into(),
        row.gaps.iter().map(std::ops::Range::len).sum::<usize>().into(),
        row.crc.into(),
        Value::Missing,
    ]
}

/// Every channel of every session, with the type of its samples (all records and levels of a
/// session have the same) and its scale.
pub(super) fn channels(store: &Store) -> Result<Table, CliError> {
    let mut table = Table::new(&CHANNELS);
    let mut types: HashMap<i64, SampleTypes> =
        store.levels()?.into_iter().flatten().map(|row| (row.session, row.sample_types)).collect();
    types.extend(store.records()?.into_iter().flatten().map(|row| (row.session, row.sample_types)));
    for (session, _) in store.sessions()? {
        let (now, then, sensors) =
            (store.channels(session)?, store.channels_as_measured(session)?, store.sensors(session)?);
        for (place, channel) in now.channels.iter().enumerate() {
            let sensor = sensors.get(place);
            let of = types.get(&session).map_or(SampleType::I16, |types| types.channel(place));
            let known = |of: fn(&Sensor) -> &Option<String>| sensor.and_then(|sensor| of(sensor).clone());
            table.push(vec![
                session.into(),
                place.into(),
                channel.name.to_string().into(),
                format!("{:?}", channel.role).into(),
                channel.quantity.unit().into(),
                now.fs_hz().into(),
                of.name().to_owned().into(),
                of.units(channel).into(),
                channel.units_per_volt.into(),
                then.channels[place].units_per_volt.into(),
                channel.range_v.into(),
                channel.bits.into(),
                (f64::from(channel.delay_ns) * 1e-9).into(),
                known(|sensor| &sensor.model).into(),
                known(|sensor| &sensor.serial).into(),
                known(|sensor| &sensor.calibrated).into(),
            ]);
        }
    }
    Ok(table)
}

/// Writes `records.csv`, `channels.csv` and, if there are any, `calibrations.csv` and `edges.csv`;
/// returns their names.
pub(super) fn write(store: &Store, folder: &Path, written: &[Written]) -> Result<Vec<String>, CliError> {
    let mut names = Vec::new();
    let mut put = |name: &str, table: &Table| {
        table.write_csv(&folder.join(name)).map_err(bad)?;
        names.push(name.to_owned());
        Ok::<(), CliError>(())
    };
    put("records.csv", &records(store, written)?)?;
    put("channels.csv", &channels(store)?)?;
    for (name, table) in [("edges.csv", edges(store)?), ("calibrations.csv", calibrations(store)?)] {
        if !table.rows().is_empty() {
            put(name, &table)?;
        }
    }
    Ok(names)
}
