//! The seal of a row: a CRC-32 over every column of its type, so that every flipped bit is
//! detected.
//!
//! It runs over the columns in the order of the table ([`super::table`]); for a record over those
//! of `records` and then of `seals`. Each value contributes its type (0 null, 1 integer, 2 real, 3
//! text, 4 bytes), then eight bytes little-endian (the integer, the real's bits, or the length),
//! then the text or bytes themselves. A null in a column that older files lack contributes nothing.
//! For the samples these columns contain separate checksums: one over the samples, one over the
//! bytes as they are stored.

use rusqlite::types::{Value, ValueRef};

use super::table::{Row, SINCE_3};

/// The seal of values that are to be stored.
pub(super) fn of<R: Row>(values: &[Value]) -> u32 {
    over::<R>(values.iter().map(ValueRef::from))
}

/// Reads a row that is followed by its seal; an error message if the seal does not match.
pub(super) fn read<R: Row>(row: &rusqlite::Row<'_>) -> rusqlite::Result<Result<R, String>> {
    let columns = R::columns().count();
    let Some(stored) = row.get::<_, Option<u32>>(columns)? else {
        return Ok(Err("its seal is missing".into()));
    };
    let values = (0..columns).map(|place| row.get_ref(place)).collect::<rusqlite::Result<Vec<_>>>()?;
    if over::<R>(values.into_iter()) == stored {
        R::read(row).map(Ok)
    } else {
        Ok(Err("its description was changed".into()))
    }
}

fn over<'v, R: Row>(values: impl Iterator<Item = ValueRef<'v>>) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for (column, value) in R::columns().zip(values) {
        if counts(column.name(), value) {
            each(value, |bytes| hasher.update(bytes));
        }
    }
    hasher.finalize()
}

/// Whether a column's value is part of a seal or digest.
pub(super) fn counts(column: &str, value: ValueRef<'_>) -> bool {
    column != SINCE_3 || value != ValueRef::Null
}

/// Passes type, number and bytes of a value to `take`, in that order.
pub(super) fn each(value: ValueRef<'_>, mut take: impl FnMut(&[u8])) {
    let (kind, number, bytes): (u8, [u8; 8], &[u8]) = match value {
        ValueRef::Null => (0, [0; 8], &[]),
        ValueRef::Integer(number) => (1, number.to_le_bytes(), &[]),
        ValueRef::Real(real) => (2, real.to_bits().to_le_bytes(), &[]),
        ValueRef::Text(text) => (3, (text.len() as u64).to_le_bytes(), text),
        ValueRef::Blob(blob) => (4, (blob.len() as u64).to_le_bytes(), blob),
    };
    take(&[kind]);
    take(&number);
    take(bytes);
}
