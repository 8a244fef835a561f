//! Levels of the shaker in the campaign file: stored once, read back checked, never changed.

use std::ops::Range;

use rusqlite::types::Value;
use rusqlite::{Row, params_from_iter};

use super::codec::{self, CodecError};
use super::level::{Level, Moment};
use super::rows::{Damage, Samples};
use super::schema::WITH_LEVELS;
use super::seal;
use super::store::{Store, utc_now};
use super::store_error::StoreError;

/// What the seal runs over, in this order.
const COLUMNS: [&str; 19] = [
    "id",
    "session",
    "utc",
    "moment",
    "frequency_hz",
    "end_hz",
    "control",
    "amplitude",
    "reached",
    "overshoot",
    "settle_s",
    "drive_v",
    "epoch",
    "first_scan",
    "scans",
    "channels",
    "gaps",
    "crc32",
    "bytes_crc32",
];

/// How a level came to its amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settled {
    /// Amplitude of what is held over the record, m, N or V.
    pub reached: f64,
    /// Largest amplitude on the way, over the ordered one.
    pub overshoot: f64,
    /// Time from the order to the record, s of the device.
    pub after_s: f64,
    /// The drive's amplitude then, V.
    pub drive_v: f64,
}

/// A level to be stored.
#[derive(Clone, Debug)]
pub struct NewLevel {
    /// Which session.
    pub session: i64,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// What was ordered.
    pub level: Level,
    /// What came of it.
    pub settled: Settled,
    /// The stream that it was cut from.
    pub epoch: u32,
    /// Scan index of its first sample.
    pub first_scan: u64,
    /// Channels.
    pub channels: usize,
    /// Raw codes, channel after channel.
    pub codes: Vec<i16>,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
}

/// A stored level without its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelRow {
    /// Its id, counted apart from the hammer's records.
    pub id: i64,
    /// Which session: its channels give the scales.
    pub session: i64,
    /// When it was stored, RFC 3339.
    pub utc: String,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// What was ordered.
    pub level: Level,
    /// What came of it.
    pub settled: Settled,
    /// Samples per channel.
    pub scans: usize,
    /// Channels.
    pub channels: usize,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
    crc: u32,
    bytes_crc: u32,
    /// What is wrong with this description, if anything is: then it is not used.
    pub damage: Option<String>,
}

impl Store {
    /// Stores one level for good; returns its id.
    pub fn insert_level(&self, new: &NewLevel) -> Result<i64, StoreError> {
        let bytes = codec::encode(&new.codes, new.channels)
            .map_err(|error| self.content(format!("a level could not be compressed: {error}")))?;
        let gaps = serde_json::to_string(&new.gaps)
            .map_err(|error| self.content(format!("a level could not be written: {error}")))?;
        let scans = new.codes.len().checked_div(new.channels).unwrap_or(0);
        let whole = |number: u64| Value::Integer(number.cast_signed());
        let store = || {
            let transaction = self.connection.unchecked_transaction()?;
            let id: i64 =
                transaction.query_row("SELECT coalesce(max(id), 0) + 1 FROM levels", [], |row| row.get(0))?;
            let mut values = vec![
                Value::Integer(id),
                Value::Integer(new.session),
                Value::Text(utc_now()),
                Value::Text(new.moment.name().into()),
                Value::Real(new.level.frequency_hz),
                new.level.end_hz.map_or(Value::Null, Value::Real),
                Value::Text(new.level.held.name().into()),
                Value::Real(new.level.amplitude),
                Value::Real(new.settled.reached),
                Value::Real(new.settled.overshoot),
                Value::Real(new.settled.after_s),
                Value::Real(new.settled.drive_v),
                Value::Integer(new.epoch.into()),
                whole(new.first_scan),
                whole(scans as u64),
                whole(new.channels as u64),
                Value::Text(gaps.clone()),
                Value::Integer(codec::checksum(&new.codes).into()),
                Value::Integer(crc32fast::hash(&bytes).into()),
            ];
            values.push(Value::Integer(seal::of_values(&values).into()));
            values.push(Value::Blob(bytes.clone()));
            let places: Vec<String> = (1..=values.len()).map(|place| format!("?{place}")).collect();
            let sql = format!(
                "INSERT INTO levels ({}, seal, samples) VALUES ({})",
                COLUMNS.join(", "),
                places.join(", ")
            );
            transaction.execute(&sql, params_from_iter(values))?;
            transaction.commit()?;
            Ok(id)
        };
        store().map_err(self.failed("storing a level"))
    }

    /// Every level without its samples, in order of measurement; none in a file of before there were any.
    pub fn levels(&self) -> Result<Vec<LevelRow>, StoreError> {
        if self.version < WITH_LEVELS {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {}, seal FROM levels ORDER BY id", COLUMNS.join(", "));
        self.all(&sql, [], LevelRow::read, "reading the shaker's levels")
    }

    /// The samples of one level, checked against their checksums.
    ///
    /// # Errors
    /// They are damaged; the level is named.
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
        let codes = codec::decode(&bytes, row.channels, row.scans, row.crc).map_err(damaged)?;
        Ok(Samples { codes, channels: row.channels, trigger_index: 0 })
    }

    /// What is damaged among the levels.
    pub(super) fn verify_levels(&self) -> Result<Vec<Damage>, StoreError> {
        let mut damage = Vec::new();
        for row in self.levels()? {
            let what = match (&row.damage, self.level_samples(&row)) {
                (Some(what), _) => format!("the shaker's level {}: {what}", row.id),
                (None, Err(error)) => error.to_string(),
                (None, Ok(_)) => continue,
            };
            damage.push(Damage { record: None, what });
        }
        Ok(damage)
    }
}

impl LevelRow {
    /// Whether analysis can use it.
    pub fn whole(&self) -> bool {
        self.damage.is_none() && self.gaps.is_empty()
    }

    fn read(row: &Row<'_>) -> rusqlite::Result<Self> {
        let wrong = |place: usize| {
            rusqlite::Error::InvalidColumnType(place, COLUMNS[place].into(), rusqlite::types::Type::Text)
        };
        let text = |place: usize| row.get::<_, String>(place);
        let values =
            (0..COLUMNS.len()).map(|place| row.get::<_, Value>(place)).collect::<Result<Vec<_>, _>>()?;
        let whole = seal::of_values(&values) == row.get::<_, u32>(COLUMNS.len())?;
        Ok(Self {
            id: row.get(0)?,
            session: row.get(1)?,
            utc: row.get(2)?,
            moment: text(3)?.parse().map_err(|_| wrong(3))?,
            level: Level {
                frequency_hz: row.get(4)?,
                end_hz: row.get(5)?,
                held: text(6)?.parse().map_err(|_| wrong(6))?,
                amplitude: row.get(7)?,
            },
            settled: Settled {
                reached: row.get(8)?,
                overshoot: row.get(9)?,
                after_s: row.get(10)?,
                drive_v: row.get(11)?,
            },
            scans: row.get(14)?,
            channels: row.get(15)?,
            gaps: serde_json::from_str(&text(16)?).map_err(|_| wrong(16))?,
            crc: row.get(17)?,
            bytes_crc: row.get(18)?,
            damage: (!whole).then(|| "its description was changed".into()),
        })
    }
}

#[cfg(test)]
#[path = "levels_tests.rs"]
mod tests;
