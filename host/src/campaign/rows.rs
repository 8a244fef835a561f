//! Rows of the campaign file as the rest of the program sees them.

use std::collections::BTreeMap;
use std::ops::Range;

use jointrig_protocol::shot::{Phase, Shot};
use rusqlite::Row;
use rusqlite::types::Type;

use super::judge::{Judgement, Kind};
use super::plan::Cell;
use super::seal;
use crate::device::recording::Recording;

/// A cell of the plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellRow {
    /// Its id in this file.
    pub id: i64,
    /// What it is.
    pub cell: Cell,
    /// Why it was given up, if it was.
    pub given_up: Option<String>,
    /// Why it is done with fewer good hits than wanted, but enough, if it is.
    pub settled: Option<String>,
}

/// What was connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionInfo {
    /// The device's address.
    pub address: String,
    /// The board's name.
    pub board: String,
    /// Its serial number.
    pub serial: String,
    /// Its firmware's version.
    pub firmware_version: String,
    /// The target triple that it was built for.
    pub target: String,
    /// The build's number.
    pub build: u64,
    /// The protocol's schema hash.
    pub schema_hash: u64,
}

/// Counters of a link by name.
pub type Counters = BTreeMap<String, u64>;

/// A record to be stored.
#[derive(Clone, Debug)]
pub struct NewRecord {
    /// Which cell.
    pub cell: i64,
    /// Which attempt in that cell, from 0.
    pub attempt: u32,
    /// Which session.
    pub session: i64,
    /// When its trigger was, RFC 3339.
    pub utc: String,
    /// How wrong that may be, ± s; unknown without a clock to fit.
    pub utc_error_s: Option<f64>,
    /// The raw samples; none where the bolt did not arrive.
    pub recording: Recording,
    /// What it was judged to be.
    pub judgement: Judgement,
}

/// A stored record without its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordRow {
    /// Its id.
    pub id: i64,
    /// Which cell.
    pub cell: i64,
    /// Which attempt in that cell, from 0.
    pub attempt: u32,
    /// Which session: its channels give the scales.
    pub session: i64,
    /// When its trigger was, RFC 3339.
    pub utc: String,
    /// How wrong that may be, ± s.
    pub utc_error_s: Option<f64>,
    /// Epoch of the stream that it was cut from.
    pub epoch: u32,
    /// Scan index of its first sample.
    pub first_scan: u64,
    /// Index of the trigger within it.
    pub trigger_index: usize,
    /// Samples per channel.
    pub scans: usize,
    /// Channels.
    pub channels: usize,
    /// The device's summary.
    pub shot: Shot,
    /// Peak of the band-limited force, N; 0 where there was no pulse.
    pub peak_n: f64,
    /// Missing samples, as index ranges.
    pub gaps: Vec<Range<usize>>,
    /// The verdict at the time.
    pub verdict: Kind,
    /// What was measured for it.
    pub measure: f64,
    /// The limit it was held against.
    pub limit: f64,
    /// Both in words.
    pub sentence: String,
    /// CRC-32 of the raw codes.
    pub crc: u32,
    /// CRC-32 of the bytes that hold them in the file; a file of version 1 has none.
    pub bytes_crc: Option<u32>,
    /// What a person made of it later.
    pub overruled: Option<Kind>,
    /// What is wrong with this description of the record, if anything is: nothing else in it can be trusted then, and
    /// it is not kept.
    pub damage: Option<String>,
}

impl RecordRow {
    /// The verdict that counts: a person's, else the judge's.
    pub fn standing(&self) -> Kind {
        self.overruled.unwrap_or(self.verdict)
    }

    /// Whether analysis uses it.
    pub fn kept(&self) -> bool {
        self.damage.is_none() && self.standing() == Kind::Good && self.scans > 0
    }

    /// A record of which nothing but its place in the index can be read.
    pub(super) fn unreadable(id: i64, cell: i64, attempt: u32, what: String) -> Self {
        Self {
            id,
            cell,
            attempt,
            session: 0,
            utc: String::new(),
            utc_error_s: None,
            epoch: 0,
            first_scan: 0,
            trigger_index: 0,
            scans: 0,
            channels: 0,
            shot: Shot {
                number: 0,
                phase: Phase::Cancelled,
                fired_at: 0,
                trigger: 0,
                pulse_us: 0,
                peak_n: 0.0,
                width_us: 0.0,
                rebound_ratio: 0.0,
                rebound_after: 0,
                friction_peak_n: 0.0,
                quiet_ratio: 0.0,
            },
            peak_n: 0.0,
            gaps: Vec::new(),
            verdict: Kind::Gap,
            measure: 0.0,
            limit: 0.0,
            sentence: String::new(),
            crc: 0,
            bytes_crc: None,
            overruled: None,
            damage: Some(what),
        }
    }

    /// Reads a row of [`super::seal::COLUMNS`], the seal, and the last overruling verdict.
    pub(super) fn read(row: &Row<'_>) -> rusqlite::Result<Self> {
        let wrong =
            |place: usize, name: &str| rusqlite::Error::InvalidColumnType(place, name.into(), Type::Text);
        let (shot, gaps): (String, String) = (row.get(12)?, row.get(13)?);
        let verdict: String = row.get(14)?;
        let overruled: Option<String> = row.get(SEAL + 1)?;
        let device_peak: f64 = row.get(11)?;
        let mut read = Self {
            id: row.get(0)?,
            cell: row.get(1)?,
            attempt: row.get(2)?,
            session: row.get(3)?,
            utc: row.get(4)?,
            utc_error_s: row.get(21)?,
            epoch: row.get(5)?,
            first_scan: row.get(6)?,
            trigger_index: row.get(7)?,
            scans: row.get(8)?,
            channels: row.get(9)?,
            shot: serde_json::from_str(&shot).map_err(|_| wrong(12, "shot"))?,
            peak_n: row.get::<_, Option<f64>>(20)?.unwrap_or(device_peak),
            gaps: serde_json::from_str(&gaps).map_err(|_| wrong(13, "gaps"))?,
            verdict: Kind::named(&verdict).ok_or_else(|| wrong(14, "verdict"))?,
            measure: row.get(15)?,
            limit: row.get(16)?,
            sentence: row.get(17)?,
            crc: row.get(18)?,
            bytes_crc: row.get(22)?,
            overruled: overruled.as_deref().and_then(Kind::named),
            damage: None,
        };
        let whole = match row.get::<_, Option<u32>>(SEAL)? {
            Some(stored) => seal::of_row(row)? == stored,
            None => row.get::<_, u32>(19)? == first_seal(&read),
        };
        if !whole {
            read.damage = Some("its description was changed".into());
        }
        Ok(read)
    }
}

/// Place of the seal in a row.
const SEAL: usize = seal::COLUMNS.len();

/// A verdict that a person overruled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Overrule {
    /// Which record.
    pub record: i64,
    /// When, RFC 3339.
    pub utc: String,
    /// What it counts as since then.
    pub verdict: String,
    /// Why.
    pub reason: String,
}

/// What a plan says about the sensor behind a channel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sensor {
    /// Its model.
    pub model: Option<String>,
    /// Its serial number.
    pub serial: Option<String>,
    /// When it was calibrated, YYYY-MM-DD.
    pub calibrated: Option<String>,
}

/// The samples of a stored record.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Raw codes, channel after channel.
    pub codes: Vec<i16>,
    /// Channels.
    pub channels: usize,
    /// Index of the trigger.
    pub trigger_index: usize,
}

impl Samples {
    /// Those of a record that is not stored yet.
    pub fn of(recording: &Recording) -> Self {
        let Recording { codes, channels, trigger_index, .. } = recording;
        Self { codes: codes.clone(), channels: *channels, trigger_index: *trigger_index }
    }

    /// The raw codes of one channel; empty outside the map.
    pub fn channel(&self, place: usize) -> &[i16] {
        let scans = self.codes.len().checked_div(self.channels).unwrap_or(0);
        self.codes.get(place * scans..(place + 1) * scans).unwrap_or(&[])
    }
}

/// Something that is damaged in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The record, or the file as a whole.
    pub record: Option<i64>,
    /// What is wrong.
    pub what: String,
}

/// The seal of version 1: a CRC-32 over everything that describes a record, as text.
pub(super) fn first_seal(row: &RecordRow) -> u32 {
    let text = format!(
        "{} {} {} {} {} {} {} {} {} {:?} {:?} {} {:?} {:?} {} {}",
        row.cell,
        row.attempt,
        row.session,
        row.utc,
        row.epoch,
        row.first_scan,
        row.trigger_index,
        row.scans,
        row.channels,
        row.shot,
        row.gaps,
        row.verdict,
        row.measure,
        row.limit,
        row.sentence,
        row.crc,
    );
    crc32fast::hash(text.as_bytes())
}
