//! Records in the campaign file: stored once, read back checked, never changed.

use super::Store;
use super::codec::{self, CodecError};
use super::error::StoreError;
use super::record_row::{Damaged, NewRecord, Place, RecordRow, Samples};
use super::row_seal;
use super::session_table::{Counters, write_link};
use super::table::{Row, insert};
use crate::campaign::verdict::Kind;

/// The index that holds every record's cell and attempt independently of its row.
const INDEX: &str = "sqlite_autoindex_records_1";

impl Store {
    /// Stores one record permanently, together with the link's `counters` so far; returns its id.
    pub fn insert(&self, record: &NewRecord, counters: &Counters) -> Result<i64, StoreError> {
        let recording = &record.recording;
        let bytes = codec::encode(&recording.codes, recording.channels)
            .map_err(|error| self.content(format!("a record could not be compressed: {error}")))?;
        let (crc, bytes_crc) = (codec::checksum(&recording.codes), crc32fast::hash(&bytes));
        self.change("storing a record", |connection| {
            // this is the only writer
            let id: i64 =
                connection.query_row("SELECT coalesce(max(id), 0) + 1 FROM records", [], |row| row.get(0))?;
            let values = record.row(id, crc, bytes_crc).into_values()?;
            let seal = row_seal::of(&values);
            insert::<RecordRow>(connection, "records", &values, &[("samples", &bytes)])?;
            insert::<RecordRow>(connection, "seals", &values, &[("record", &id), ("seal", &seal)])?;
            write_link(connection, record.session, counters)?;
            Ok(id)
        })
    }

    /// Every record without its samples, in order of measurement.
    pub fn records(&self) -> Result<Vec<Result<RecordRow, Damaged>>, StoreError> {
        Ok(self.places()?.into_iter().map(|place| self.record_at(place)).collect())
    }

    /// The records after record `last` without their samples, in order of measurement; and the
    /// number of records up to it.
    pub fn records_after(&self, last: i64) -> Result<(Vec<Result<RecordRow, Damaged>>, usize), StoreError> {
        let (before, after): (Vec<Place>, Vec<Place>) =
            self.places()?.into_iter().partition(|place| place.id <= last);
        Ok((after.into_iter().map(|place| self.record_at(place)).collect(), before.len()))
    }

    /// The records of one cell without their samples, in order of measurement.
    pub fn records_of(&self, cell: i64) -> Result<Vec<Result<RecordRow, Damaged>>, StoreError> {
        let own = self.places()?.into_iter().filter(|place| place.cell == cell);
        Ok(own.map(|place| self.record_at(place)).collect())
    }

    /// One record without its samples.
    ///
    /// # Errors
    /// There is no record with that id, or it is damaged.
    pub fn record(&self, id: i64) -> Result<RecordRow, StoreError> {
        let place = self.places()?.into_iter().find(|place| place.id == id).ok_or_else(|| {
            self.content(format!("there is no record {id}: `jointrig campaign show` lists them"))
        })?;
        self.record_at(place).map_err(|Damaged { what, .. }| self.damaged(id, what))
    }

    /// Identification of every record, read from the index so that a damaged row does not hide
    /// others.
    pub fn places(&self) -> Result<Vec<Place>, StoreError> {
        let read =
            |row: &rusqlite::Row<'_>| Ok(Place { id: row.get(0)?, cell: row.get(1)?, attempt: row.get(2)? });
        let sql = format!("SELECT id, cell, attempt FROM records INDEXED BY {INDEX} ORDER BY id");
        self.all(&sql, [], read, "reading the index of records").or_else(|_| {
            self.all("SELECT id, cell, attempt FROM records ORDER BY id", [], read, "reading records")
        })
    }

    fn record_at(&self, place: Place) -> Result<RecordRow, Damaged> {
        let sql = format!(
            "SELECT {}, seals.seal, \
             (SELECT verdict FROM overrules WHERE record = records.id ORDER BY id DESC LIMIT 1) \
             FROM records LEFT JOIN seals ON seals.record = records.id WHERE records.id = ?1",
            RecordRow::list()
        );
        let read = |row: &rusqlite::Row<'_>| {
            let overruled: Option<String> = row.get(RecordRow::columns().count() + 1)?;
            let overruled = overruled.as_deref().and_then(Kind::named);
            Ok(row_seal::read(row)?.map(|found| RecordRow { overruled, ..found }))
        };
        let found = match self.all(&sql, [place.id], read, "reading a record") {
            Ok(mut rows) => rows.pop().unwrap_or_else(|| Err("its row cannot be found".into())),
            Err(StoreError::Sqlite { source, .. }) => Err(format!("its row cannot be read: {source}")),
            Err(other) => Err(other.to_string()),
        };
        match found {
            // index and row must agree on the record's place
            Ok(row) if row.place() != place => Err("its place was changed".into()),
            other => other,
        }
        .map_err(|what| Damaged { place, what })
    }

    /// The samples of one record, verified against their checksums.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] names the record.
    pub fn samples(&self, record: &RecordRow) -> Result<Samples, StoreError> {
        let damaged = |error: CodecError| self.damaged(record.id, error.to_string());
        let decode = |bytes: &[u8]| codec::decode(bytes, record.channels, record.scans, record.crc);
        let codes = self.with_checked_bytes(record, decode).map_err(damaged)?;
        Ok(Samples { codes, channels: record.channels })
    }

    /// Passes the samples of some channels of one record to `look`, each with its index, in the
    /// order of `places`. They are verified against the checksum of the stored bytes.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] names the record. `look` may have been called for some channels by
    /// then.
    pub fn each_channel(
        &self,
        record: &RecordRow,
        places: &[usize],
        look: impl FnMut(usize, &[i16]),
    ) -> Result<(), StoreError> {
        let decode = |bytes: &[u8]| codec::decode_each(bytes, record.channels, record.scans, places, look);
        self.with_checked_bytes(record, decode).map_err(|error| self.damaged(record.id, error.to_string()))
    }

    /// Runs `work` on a record's bytes without copying them.
    fn with_checked_bytes<T>(
        &self,
        record: &RecordRow,
        work: impl FnOnce(&[u8]) -> Result<T, CodecError>,
    ) -> Result<T, CodecError> {
        let read =
            self.connection.query_row("SELECT samples FROM records WHERE id = ?1", [record.id], |row| {
                let bytes = row.get_ref(0)?.as_blob()?;
                // a flipped padding bit of the compressor changes no code, but the file still
                // differs from what was stored
                let (found, stored) = (crc32fast::hash(bytes), record.bytes_crc);
                Ok(if found == stored { work(bytes) } else { Err(CodecError::Bytes { found, stored }) })
            });
        read.map_err(|error| CodecError::Unreadable(error.to_string()))?
    }

    pub(in crate::campaign) fn damaged(&self, record: i64, what: String) -> StoreError {
        StoreError::Damaged { path: self.path.clone(), record, what }
    }

    /// The bytes that hold a record's samples in the file, unverified.
    pub fn stored_bytes(&self, id: i64) -> Result<Vec<u8>, StoreError> {
        self.connection
            .query_row("SELECT samples FROM records WHERE id = ?1", [id], |row| row.get(0))
            .map_err(self.failed("reading samples"))
    }

    /// Total size of all samples, bytes: as stored, and as raw codes.
    pub fn sample_bytes(&self) -> Result<(u64, u64), StoreError> {
        let sql = "SELECT coalesce(sum(stored), 0), coalesce(sum(raw), 0) FROM \
                   (SELECT length(samples) AS stored, 2 * scans * channels AS raw FROM records \
                   UNION ALL SELECT length(samples), 2 * scans * channels FROM levels)";
        self.connection
            .query_row(sql, [], |row| Ok((row.get(0)?, row.get(1)?)))
            .map_err(self.failed("measuring the file"))
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
