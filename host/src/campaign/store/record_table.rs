//! Records in the campaign file: stored once, read back checked, never changed.
//!
//! The file defines a record's columns, and its types before storing and after reading. Verdicts
//! overruled by a person are stored in addition to the original; the last one counts.

use super::codec::CodecError;
use super::error::StoreError;
use super::notes::utc_now;
use super::session_table::{Counters, write_link};
use super::stored::SampleTypes;
use super::table::{Row, SINCE_3, insert, table};
use super::{Store, codec, row_seal};
use crate::campaign::verdict::{Judgement, Verdict};
use crate::device::samples::{ChannelView, SampleType, Samples};
use crate::device::stream::Recording;
use jointrig_protocol::shot::Shot;
use rusqlite::Connection;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The index that holds every record's cell and attempt independently of its row.
const INDEX: &str = "sqlite_autoindex_records_1";

impl Store {
    /// Stores one record permanently, together with the link's `counters` so far; returns its id.
    pub fn insert(&self, record: &NewRecord, counters: &Counters) -> Result<i64, StoreError> {
        let recording = &record.recording;
        let bytes = codec::encode(&recording.samples)
            .map_err(|error| self.content(format!("a record cannot be stored: {error}")))?;
        let (crc, bytes_crc) = (codec::checksum(&recording.samples), crc32fast::hash(&bytes));
        self.change("storing a record", |connection| {
            // this is the only writer
            let id: i64 =
                connection.query_row("SELECT coalesce(max(id), 0) + 1 FROM records", [], |row| row.get(0))?;
            let values = record.row(id, crc, bytes_crc).into_values()?;
            let seal = row_seal::of::<RecordRow>(&values);
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
        let list = RecordRow::list_in(&self.connection).map_err(self.failed("reading a record"));
        let list = list.map_err(|error| Damaged { place, what: error.to_string() })?;
        let sql = format!(
            "SELECT {list}, seals.seal, \
             (SELECT verdict FROM overrules WHERE record = records.id ORDER BY id DESC LIMIT 1) \
             FROM records LEFT JOIN seals ON seals.record = records.id WHERE records.id = ?1"
        );
        let read = |row: &rusqlite::Row<'_>| {
            let overruled: Option<String> = row.get(RecordRow::columns().count() + 1)?;
            let overruled = overruled.as_deref().and_then(Verdict::named);
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
        let types = record.sample_types.each(record.channels).map_err(damaged)?;
        let decode = |bytes: &[u8]| codec::decode(bytes, &types, record.scans, record.crc);
        self.with_checked_bytes(record, decode).map_err(damaged)
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
        look: impl FnMut(usize, ChannelView<'_>),
    ) -> Result<(), StoreError> {
        let damaged = |error: CodecError| self.damaged(record.id, error.to_string());
        let types = record.sample_types.each(record.channels).map_err(damaged)?;
        let decode = |bytes: &[u8]| codec::decode_each(bytes, &types, record.scans, places, look);
        self.with_checked_bytes(record, decode).map_err(damaged)
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
                // a flipped padding bit of the compressor changes no sample, but the file still
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

    /// Total size of all samples, bytes: as stored, and as they came.
    pub fn sample_bytes(&self) -> Result<(u64, u64), StoreError> {
        let measure = || {
            let (mut stored, mut raw) = (0_u64, 0_u64);
            // a damaged row may claim anything
            let count = |row: &rusqlite::Row<'_>, place: usize| -> rusqlite::Result<u64> {
                Ok(u64::try_from(row.get::<_, i64>(place)?).unwrap_or(0))
            };
            for (table, of) in [("seals", "records LEFT JOIN seals ON record = id"), ("levels", "levels")] {
                let there = self.connection.column_exists(None, table, SINCE_3)?;
                let types = if there { SINCE_3 } else { "NULL" };
                let sql = format!("SELECT length(samples), scans, channels, {types} FROM {of}");
                let mut statement = self.connection.prepare_cached(&sql)?;
                let mut rows = statement.query([])?;
                while let Some(row) = rows.next()? {
                    let (size, scans, channels) = (count(row, 0)?, count(row, 1)?, count(row, 2)?);
                    let names: Option<String> = row.get(3)?;
                    let scan = names.map_or(channels.saturating_mul(2), |names| {
                        names.split(' ').filter_map(SampleType::named).map(|of| of.bytes() as u64).sum()
                    });
                    stored = stored.saturating_add(size);
                    raw = raw.saturating_add(scan.saturating_mul(scans));
                }
            }
            Ok((stored, raw))
        };
        measure().map_err(self.failed("measuring the file"))
    }
}

table! {
    /// A stored record without its samples: the columns that the seal covers. One row per shot of
    /// the hammer; without samples if the bolt did not arrive.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct RecordRow {
        "records" {
            /// Its id.
            id: i64 = "id INTEGER PRIMARY KEY",
            /// The cell.
            cell: i64 = "cell INTEGER NOT NULL REFERENCES cells(id)",
            /// Number of the attempt in that cell, from 0.
            attempt: u32 = "attempt INTEGER NOT NULL",
            /// The session, whose channels define the scales.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// Time of its trigger, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// Epoch of the stream that it was cut from.
            epoch: u32 = "epoch INTEGER NOT NULL",
            /// Scan index of its first sample.
            first_scan: u64 = "first_scan INTEGER NOT NULL",
            /// Index of the trigger within it.
            trigger_index: usize = "trigger_index INTEGER NOT NULL",
            /// Samples per channel.
            scans: usize = "scans INTEGER NOT NULL",
            /// Number of channels.
            channels: usize = "channels INTEGER NOT NULL",
            /// Duration of the coil's pulse, µs.
            pulse_us: u32 = "pulse_us INTEGER NOT NULL",
            /// Peak of the force as measured by the device, N.
            #[serde(with = "crate::campaign::store::stored::number")]
            device_peak_n: f64 = "peak_n REAL NOT NULL",
            /// The device's summary.
            shot: Shot = "shot TEXT NOT NULL",
            /// Missing samples, as index ranges.
            gaps: Vec<Range<usize>> = "gaps TEXT NOT NULL",
            /// The original verdict.
            verdict: Verdict = "verdict TEXT NOT NULL",
            /// The measured value that it is based on.
            #[serde(with = "crate::campaign::store::stored::number")]
            measure: f64 = "measure REAL NOT NULL",
            /// The limit for that value.
            #[serde(with = "crate::campaign::store::stored::number")]
            limit: f64 = "limit_value REAL NOT NULL",
            /// Both as a sentence.
            sentence: String = "sentence TEXT NOT NULL",
            /// CRC-32 of the raw samples.
            crc: u32 = "crc32 INTEGER NOT NULL",
            /// Always 0: the seal is in `seals`.
            reserved: i64 = "seal INTEGER NOT NULL",
            "samples BLOB NOT NULL",
            "UNIQUE (cell, attempt)",
        }
        // stored with the record: results of judging it, and the types of its samples (behind the
        // samples in `records`, SQLite would read all of them to find these)
        "seals" {
            "record INTEGER PRIMARY KEY REFERENCES records(id)",
            /// Peak of the band-limited force, N; 0 without a pulse.
            #[serde(with = "crate::campaign::store::stored::number")]
            peak_n: f64 = "peak_n REAL NOT NULL",
            /// Uncertainty of `utc`, ± s; `None` without a clock fit.
            utc_error_s: Option<f64> = "utc_error_s REAL",
            /// CRC-32 of the bytes that hold the samples in the file.
            bytes_crc: u32 = "bytes_crc32 INTEGER NOT NULL",
            /// The type of each channel.
            sample_types: SampleTypes = "sample_types TEXT",
            "seal INTEGER NOT NULL",
        }
    }
    beside {
        /// A person's later verdict.
        overruled: Option<Verdict>,
    }
}

impl RecordRow {
    /// The verdict in effect: a person's, else the original one.
    pub fn standing(&self) -> Verdict {
        self.overruled.unwrap_or(self.verdict)
    }

    /// Its identification.
    pub fn place(&self) -> Place {
        Place { id: self.id, cell: self.cell, attempt: self.attempt }
    }

    /// Whether the analysis uses it.
    pub fn kept(&self) -> bool {
        self.standing() == Verdict::Good && self.scans > 0
    }
}

/// Identifies a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Its id.
    pub id: i64,
    /// The cell.
    pub cell: i64,
    /// Number of the attempt in that cell, from 0.
    pub attempt: u32,
}

/// A record whose description is damaged: only its place from the index is reliable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damaged {
    /// Its identification.
    pub place: Place,
    /// What is wrong.
    pub what: String,
}

/// A record to be stored.
#[derive(Clone, Debug)]
pub struct NewRecord {
    /// The cell.
    pub cell: i64,
    /// Number of the attempt in that cell, from 0.
    pub attempt: u32,
    /// The session.
    pub session: i64,
    /// Time of its trigger, RFC 3339.
    pub utc: String,
    /// Uncertainty of that time, ± s; `None` without a clock fit.
    pub utc_error_s: Option<f64>,
    /// The raw samples; empty if the bolt did not arrive.
    pub recording: Recording,
    /// The verdict.
    pub verdict: Judgement,
}

impl NewRecord {
    /// The row to be stored with `id`; `crc` is that of its samples, `bytes_crc` that of the bytes
    /// that hold them.
    pub(super) fn row(&self, id: i64, crc: u32, bytes_crc: u32) -> RecordRow {
        let Recording { epoch, first_scan, trigger_index, samples, shot, gaps } = &self.recording;
        RecordRow {
            id,
            cell: self.cell,
            attempt: self.attempt,
            session: self.session,
            utc: self.utc.clone(),
            epoch: *epoch,
            first_scan: *first_scan,
            trigger_index: *trigger_index,
            scans: samples.scans(),
            channels: samples.channels(),
            pulse_us: shot.pulse_us,
            device_peak_n: shot.peak_n.into(),
            shot: *shot,
            gaps: gaps.clone(),
            verdict: self.verdict.kind,
            measure: self.verdict.measure,
            limit: self.verdict.limit,
            sentence: self.verdict.sentence.clone(),
            crc,
            reserved: 0,
            peak_n: self.verdict.peak_n,
            utc_error_s: self.utc_error_s,
            bytes_crc,
            sample_types: SampleTypes::of(samples),
            overruled: None,
        }
    }
}

table! {
    /// A verdict that a person overruled.
    #[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub struct Overrule {
        "overrules" {
            "id INTEGER PRIMARY KEY",
            /// The record.
            record: i64 = "record INTEGER NOT NULL REFERENCES records(id)",
            /// Time, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// The new verdict.
            verdict: String = "verdict TEXT NOT NULL",
            /// The reason.
            reason: String = "reason TEXT NOT NULL",
        }
    }
}

impl Store {
    /// Overrules a record's verdict; the original one is kept in the file. A settled cell that is
    /// left with fewer good hits than it was settled with is reopened.
    pub fn overrule(&self, record: i64, verdict: Verdict, reason: &str) -> Result<(), StoreError> {
        self.change("overruling a verdict", |connection| write_overrule(connection, record, verdict, reason))
    }

    /// Restarts a cell: its good records are dropped, and it is reopened. Returns the number of
    /// dropped records.
    pub fn redo(&self, cell: i64, reason: &str) -> Result<usize, StoreError> {
        let records = self.records_of(cell)?;
        let good = records.iter().flatten().filter(|record| record.standing() == Verdict::Good);
        let good: Vec<i64> = good.map(|record| record.id).collect();
        self.change("opening a cell again", |connection| {
            for record in &good {
                write_overrule(connection, *record, Verdict::Dropped, reason)?;
            }
            connection.execute("UPDATE cells SET settled = NULL, given_up = NULL WHERE id = ?1", [cell])
        })?;
        Ok(good.len())
    }

    /// Every overruled verdict.
    pub fn overrules(&self) -> Result<Vec<Overrule>, StoreError> {
        let sql = format!("SELECT {} FROM overrules ORDER BY id", Overrule::list());
        self.all(&sql, [], Overrule::read, "reading overrules")
    }
}

fn write_overrule(
    connection: &Connection,
    record: i64,
    verdict: Verdict,
    reason: &str,
) -> rusqlite::Result<()> {
    let overrule = Overrule { record, utc: utc_now(), verdict: verdict.name().into(), reason: reason.into() };
    overrule.insert(connection, &[])?;
    if verdict != Verdict::Good {
        connection.execute(
            "UPDATE cells SET settled = NULL WHERE id = (SELECT cell FROM records WHERE id = ?1)",
            [record],
        )?;
    }
    Ok(())
}

#[cfg(test)]
#[path = "store_tests.rs"]
pub(super) mod tests;
