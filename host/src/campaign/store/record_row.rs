//! A record of the campaign file: its columns, and its types before storing and after reading.

use std::ops::Range;

use jointrig_protocol::shot::Shot;

use super::table::table;
use crate::campaign::verdict::{Kind, Verdict};
use crate::device::recording::{Codes, Recording};

table! {
    /// A stored record without its samples: the columns that the seal covers. One row per shot of
    /// the hammer; without samples if the bolt did not arrive.
    #[derive(Clone, Debug, PartialEq)]
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
            device_peak_n: f64 = "peak_n REAL NOT NULL",
            /// The device's summary.
            shot: Shot = "shot TEXT NOT NULL",
            /// Missing samples, as index ranges.
            gaps: Vec<Range<usize>> = "gaps TEXT NOT NULL",
            /// The original verdict.
            verdict: Kind = "verdict TEXT NOT NULL",
            /// The measured value that it is based on.
            measure: f64 = "measure REAL NOT NULL",
            /// The limit for that value.
            limit: f64 = "limit_value REAL NOT NULL",
            /// Both as a sentence.
            sentence: String = "sentence TEXT NOT NULL",
            /// CRC-32 of the raw codes.
            crc: u32 = "crc32 INTEGER NOT NULL",
            /// Always 0: the seal is in `seals`.
            reserved: i64 = "seal INTEGER NOT NULL",
            "samples BLOB NOT NULL",
            "UNIQUE (cell, attempt)",
        }
        // stored with the record: results of judging it
        "seals" {
            "record INTEGER PRIMARY KEY REFERENCES records(id)",
            /// Peak of the band-limited force, N; 0 without a pulse.
            peak_n: f64 = "peak_n REAL NOT NULL",
            /// Uncertainty of `utc`, ± s; `None` without a clock fit.
            utc_error_s: Option<f64> = "utc_error_s REAL",
            /// CRC-32 of the bytes that hold the codes in the file.
            bytes_crc: u32 = "bytes_crc32 INTEGER NOT NULL",
            "seal INTEGER NOT NULL",
        }
    }
    beside {
        /// A person's later verdict.
        overruled: Option<Kind>,
    }
}

impl RecordRow {
    /// The verdict in effect: a person's, else the original one.
    pub fn standing(&self) -> Kind {
        self.overruled.unwrap_or(self.verdict)
    }

    /// Its identification.
    pub fn place(&self) -> Place {
        Place { id: self.id, cell: self.cell, attempt: self.attempt }
    }

    /// Whether the analysis uses it.
    pub fn kept(&self) -> bool {
        self.standing() == Kind::Good && self.scans > 0
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
    pub verdict: Verdict,
}

impl NewRecord {
    /// The row to be stored with `id`; `crc` is that of its codes, `bytes_crc` that of the bytes
    /// that hold them.
    pub(super) fn row(&self, id: i64, crc: u32, bytes_crc: u32) -> RecordRow {
        let Recording { epoch, first_scan, trigger_index, channels, shot, gaps, .. } = &self.recording;
        RecordRow {
            id,
            cell: self.cell,
            attempt: self.attempt,
            session: self.session,
            utc: self.utc.clone(),
            epoch: *epoch,
            first_scan: *first_scan,
            trigger_index: *trigger_index,
            scans: self.recording.scans(),
            channels: *channels,
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
            overruled: None,
        }
    }
}

/// The samples of a stored record.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Raw codes, channel after channel.
    pub codes: Vec<i16>,
    /// Number of channels.
    pub channels: usize,
}

impl Samples {
    /// A borrowed view.
    pub fn view(&self) -> Codes<'_> {
        Codes { codes: &self.codes, channels: self.channels }
    }

    /// The raw codes of one channel; empty for an index beyond the last one.
    pub fn channel(&self, place: usize) -> &[i16] {
        self.view().channel(place)
    }
}
