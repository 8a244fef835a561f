//! The seal of a record: a CRC-32 over every column that describes it, so that no flipped bit goes unseen.
//!
//! It runs over the columns of `records` (all but `samples`) and of `seals` (all but `seal`), in the order of
//! [`COLUMNS`]: for each value its kind (0 nothing, 1 whole number, 2 real, 3 text, 4 bytes), then eight bytes little-endian (the
//! number, the real's bits, or the length), then the text or bytes themselves. The samples have checksums of their own among these
//! columns: one over the codes, one over the bytes as they are stored.

use rusqlite::types::{Value, ValueRef};
use rusqlite::{Connection, Row};

/// What the seal runs over.
pub(super) const COLUMNS: [&str; 23] = [
    "r.id",
    "r.cell",
    "r.attempt",
    "r.session",
    "r.utc",
    "r.epoch",
    "r.first_scan",
    "r.trigger_index",
    "r.scans",
    "r.channels",
    "r.pulse_us",
    "r.peak_n",
    "r.shot",
    "r.gaps",
    "r.verdict",
    "r.measure",
    "r.limit_value",
    "r.sentence",
    "r.crc32",
    "r.seal",
    "s.peak_n",
    "s.utc_error_s",
    "s.bytes_crc32",
];

/// How many of [`COLUMNS`] are columns of `records`.
const OF_RECORDS: usize = 20;

/// The seal of these values.
fn over<'v>(values: impl Iterator<Item = ValueRef<'v>>) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for value in values {
        let (kind, number, bytes): (u8, [u8; 8], &[u8]) = match value {
            ValueRef::Null => (0, [0; 8], &[]),
            ValueRef::Integer(number) => (1, number.to_le_bytes(), &[]),
            ValueRef::Real(real) => (2, real.to_bits().to_le_bytes(), &[]),
            ValueRef::Text(text) => (3, (text.len() as u64).to_le_bytes(), text),
            ValueRef::Blob(blob) => (4, (blob.len() as u64).to_le_bytes(), blob),
        };
        hasher.update(&[kind]);
        hasher.update(&number);
        hasher.update(bytes);
    }
    hasher.finalize()
}

/// The seal of a row that begins with [`COLUMNS`].
pub(super) fn of_row(row: &Row<'_>) -> rusqlite::Result<u32> {
    let values = (0..COLUMNS.len()).map(|place| row.get_ref(place)).collect::<rusqlite::Result<Vec<_>>>()?;
    Ok(over(values.into_iter()))
}

/// Stores a record's `samples` with `values` (of [`COLUMNS`], in order) and their seal.
pub(super) fn insert(connection: &Connection, values: &[Value], samples: &[u8]) -> rusqlite::Result<()> {
    let (record, found) = values.split_at(OF_RECORDS);
    let names: Vec<&str> = COLUMNS[..OF_RECORDS].iter().map(|name| &name[2..]).collect();
    let places: Vec<String> = (1..=OF_RECORDS + 1).map(|place| format!("?{place}")).collect();
    let sql = format!("INSERT INTO records ({}, samples) VALUES ({})", names.join(", "), places.join(", "));
    let samples = Value::Blob(samples.to_vec());
    connection.prepare_cached(&sql)?.execute(rusqlite::params_from_iter(record.iter().chain([&samples])))?;
    insert_seal(connection, &record[0], found, over(values.iter().map(ValueRef::from)))
}

/// Stores the seal of a record that is there already.
pub(super) fn insert_seal(
    connection: &Connection,
    record: &Value,
    found: &[Value],
    seal: u32,
) -> rusqlite::Result<()> {
    let seal = Value::Integer(seal.into());
    connection
        .prepare_cached(
            "INSERT INTO seals (record, peak_n, utc_error_s, bytes_crc32, seal) VALUES (?1, ?2, ?3, ?4, ?5)",
        )?
        .execute(rusqlite::params_from_iter([record].into_iter().chain(found).chain([&seal])))
        .map(|_| ())
}

/// The seal of values that are not stored yet.
pub(super) fn of_values(values: &[Value]) -> u32 {
    over(values.iter().map(ValueRef::from))
}
