//! Levels of the shaker in the campaign file: stored once, read back checked, never changed.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::Store;
use super::codec::{self, CodecError};
use super::error::StoreError;
use super::notes::utc_now;
use super::row_seal;
use super::stored::SampleTypes;
use super::table::{Row, insert, table};
use crate::campaign::plan::level::{Held, Level, Moment};
use crate::device::samples::Samples;

table! {
    /// A stored level without its samples: the columns that the seal covers. One row per recorded
    /// level: a sine in steady state, or a sweep from rest to rest.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct LevelRow {
        "levels" {
            /// Its id, counted separately from the hammer's records.
            id: i64 = "id INTEGER PRIMARY KEY",
            /// The session, whose channels define the scales.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// When it was stored, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// Before or after the hammer's cells.
            moment: Moment = "moment TEXT NOT NULL",
            /// Its frequency, or the first frequency of a sweep, Hz.
            #[serde(with = "crate::campaign::store::stored::number")]
            frequency_hz: f64 = "frequency_hz REAL NOT NULL",
            /// The last frequency of a sweep, Hz; `None` for a step.
            end_hz: Option<f64> = "end_hz REAL",
            /// The quantity that is held constant.
            held: Held = "control TEXT NOT NULL",
            /// Ordered amplitude, m, N or V.
            #[serde(with = "crate::campaign::store::stored::number")]
            amplitude: f64 = "amplitude REAL NOT NULL",
            /// The amplitude over the record, m, N or V.
            #[serde(with = "crate::campaign::store::stored::number")]
            reached: f64 = "reached REAL NOT NULL",
            /// Largest amplitude while settling, relative to the ordered one.
            #[serde(with = "crate::campaign::store::stored::number")]
            overshoot: f64 = "overshoot REAL NOT NULL",
            /// Time from the order to the record, s of the device's clock.
            #[serde(with = "crate::campaign::store::stored::number")]
            after_s: f64 = "settle_s REAL NOT NULL",
            /// The drive's amplitude during the record, V.
            #[serde(with = "crate::campaign::store::stored::number")]
            drive_v: f64 = "drive_v REAL NOT NULL",
            /// Epoch of the stream that it was cut from.
            epoch: u32 = "epoch INTEGER NOT NULL",
            /// Scan index of its first sample.
            first_scan: u64 = "first_scan INTEGER NOT NULL",
            /// Samples per channel.
            scans: usize = "scans INTEGER NOT NULL",
            /// Number of channels.
            channels: usize = "channels INTEGER NOT NULL",
            /// Missing samples, as index ranges.
            gaps: Vec<Range<usize>> = "gaps TEXT NOT NULL",
            /// CRC-32 of the raw samples.
            crc: u32 = "crc32 INTEGER NOT NULL",
            /// CRC-32 of the bytes that hold the samples in the file.
            bytes_crc: u32 = "bytes_crc32 INTEGER NOT NULL",
            /// The type of each channel.
            sample_types: SampleTypes = "sample_types TEXT",
            "seal INTEGER NOT NULL",
            "samples BLOB NOT NULL",
        }
    }
}

/// How a level reached its amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settled {
    /// Amplitude of the controlled quantity over the record, m, N or V.
    pub reached: f64,
    /// Largest amplitude while settling, relative to the ordered one.
    pub overshoot: f64,
    /// Time from the order to the record, s of the device's clock.
    pub after_s: f64,
    /// The drive's amplitude during the record, V.
    pub drive_v: f64,
}

/// A level to be stored.
#[derive(Clone, Debug)]
pub struct NewLevel {
    /// The session.
    pub session: i64,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// The ordered level.
    pub level: Level,
    /// How it settled.
    pub settled: Settled,
    /// Epoch of the stream that it was cut from.
    pub epoch: u32,
    /// Scan index of its first sample.
    pub first_scan: u64,
    /// The samples of each channel.
    pub samples: Samples,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
}

/// A level whose description is damaged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DamagedLevel {
    /// Its id.
    pub id: i64,
    /// What is wrong.
    pub what: String,
}

impl fmt::Display for DamagedLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the shaker's level {}: {}", self.id, self.what)
    }
}

impl LevelRow {
    /// The ordered level.
    pub fn level(&self) -> Level {
        let Self { frequency_hz, end_hz, held, amplitude, .. } = *self;
        Level { frequency_hz, end_hz, held, amplitude }
    }

    /// How it settled.
    pub fn settled(&self) -> Settled {
        let Self { reached, overshoot, after_s, drive_v, .. } = *self;
        Settled { reached, overshoot, after_s, drive_v }
    }

    /// Whether it has no missing samples.
    pub fn whole(&self) -> bool {
        self.gaps.is_empty()
    }
}

impl NewLevel {
    fn row(&self, id: i64, utc: String, crc: u32, bytes_crc: u32) -> LevelRow {
        let (Level { frequency_hz, end_hz, held, amplitude }, settled) = (self.level, self.settled);
        let Settled { reached, overshoot, after_s, drive_v } = settled;
        LevelRow {
            id,
            session: self.session,
            utc,
            moment: self.moment,
            frequency_hz,
            end_hz,
            held,
            amplitude,
            reached,
            overshoot,
            after_s,
            drive_v,
            epoch: self.epoch,
            first_scan: self.first_scan,
            scans: self.samples.scans(),
            channels: self.samples.channels(),
            gaps: self.gaps.clone(),
            crc,
            bytes_crc,
            sample_types: SampleTypes::of(&self.samples),
        }
    }
}

impl Store {
    /// Stores one level permanently; returns its id.
    pub fn insert_level(&self, new: &NewLevel) -> Result<i64, StoreError> {
        self.insert_level_at(new, utc_now())
    }

    /// As [`Store::insert_level`], for a level that was stored at the time `utc` (RFC 3339) in
    /// another file.
    pub(super) fn insert_level_at(&self, new: &NewLevel, utc: String) -> Result<i64, StoreError> {
        let bytes = codec::encode(&new.samples)
            .map_err(|error| self.content(format!("a level cannot be stored: {error}")))?;
        let (crc, bytes_crc) = (codec::checksum(&new.samples), crc32fast::hash(&bytes));
        self.change("storing a level", |connection| {
            let id: i64 =
                connection.query_row("SELECT coalesce(max(id), 0) + 1 FROM levels", [], |row| row.get(0))?;
            let values = new.row(id, utc, crc, bytes_crc).into_values()?;
            let seal = row_seal::of::<LevelRow>(&values);
            insert::<LevelRow>(connection, "levels", &values, &[("seal", &seal), ("samples", &bytes)])?;
            Ok(id)
        })
    }

    /// Every level without its samples, in order of measurement.
    pub fn levels(&self) -> Result<Vec<Result<LevelRow, DamagedLevel>>, StoreError> {
        let list = LevelRow::list_in(&self.connection).map_err(self.failed("reading the shaker's levels"))?;
        let sql = format!("SELECT {list}, seal FROM levels ORDER BY id");
        let read = |row: &rusqlite::Row<'_>| {
            let id = row.get(0)?;
            Ok(row_seal::read(row)?.map_err(|what| DamagedLevel { id, what }))
        };
        self.all(&sql, [], read, "reading the shaker's levels")
    }

    /// The samples of one level, verified against their checksums.
    ///
    /// # Errors
    /// They are damaged; the error names the level.
    pub fn level_samples(&self, row: &LevelRow) -> Result<Samples, StoreError> {
        let damaged =
            |what: CodecError| self.content(format!("the shaker's level {} is damaged: {what}", row.id));
        let read = self
            .connection
            .query_row("SELECT samples FROM levels WHERE id = ?1", [row.id], |row| row.get::<_, Vec<u8>>(0));
        let bytes = read.map_err(|error| damaged(CodecError::Unreadable(error.to_string())))?;
        let found = crc32fast::hash(&bytes);
        if found != row.bytes_crc {
            return Err(damaged(CodecError::Bytes { found, stored: row.bytes_crc }));
        }
        let types = row.sample_types.each(row.channels).map_err(damaged)?;
        codec::decode(&bytes, &types, row.scans, row.crc).map_err(damaged)
    }
}

#[cfg(test)]
#[path = "level_table_tests.rs"]
mod tests;
