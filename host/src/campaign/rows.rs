//! Rows of the campaign file as the rest of the program sees them.

use std::ops::Range;

use jointrig_protocol::shot::Shot;
use rusqlite::Row;
use rusqlite::types::Type;

use super::judge::{Judgement, Kind};
use super::plan::Cell;
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
    /// What a person made of it later.
    pub overruled: Option<Kind>,
}

impl RecordRow {
    /// The verdict that counts: a person's, else the judge's.
    pub fn standing(&self) -> Kind {
        self.overruled.unwrap_or(self.verdict)
    }

    /// Whether analysis uses it.
    pub fn kept(&self) -> bool {
        self.standing() == Kind::Good && self.scans > 0
    }

    pub(super) fn read(row: &Row<'_>) -> rusqlite::Result<Self> {
        let wrong =
            |place: usize, name: &str| rusqlite::Error::InvalidColumnType(place, name.into(), Type::Text);
        let (shot, gaps): (String, String) = (row.get(10)?, row.get(11)?);
        let verdict: String = row.get(12)?;
        let overruled: Option<String> = row.get(17)?;
        Ok(Self {
            id: row.get(0)?,
            cell: row.get(1)?,
            attempt: row.get(2)?,
            session: row.get(3)?,
            utc: row.get(4)?,
            epoch: row.get(5)?,
            first_scan: row.get(6)?,
            trigger_index: row.get(7)?,
            scans: row.get(8)?,
            channels: row.get(9)?,
            shot: serde_json::from_str(&shot).map_err(|_| wrong(10, "shot"))?,
            gaps: serde_json::from_str(&gaps).map_err(|_| wrong(11, "gaps"))?,
            verdict: Kind::named(&verdict).ok_or_else(|| wrong(12, "verdict"))?,
            measure: row.get(13)?,
            limit: row.get(14)?,
            sentence: row.get(15)?,
            crc: row.get(16)?,
            overruled: overruled.as_deref().and_then(Kind::named),
        })
    }
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

/// CRC-32 over everything that describes a record (its samples have their own).
pub(super) fn seal(row: &RecordRow) -> u32 {
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
