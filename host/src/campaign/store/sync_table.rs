//! Synchronisation data in the campaign file: the clock that timed a session's scans, and edges
//! that another recorder also records.
//!
//! They are stored only for a plan with `[sync]`; other files do not have these tables.

use jointrig_protocol::sync::{Clock, Edge, Line, Sync};
use rusqlite::Connection;

use super::Store;
use super::error::StoreError;
use super::table::{Row, create, table};

table! {
    /// The clock that timed the scans of a session.
    #[derive(Clone, Debug, PartialEq)]
    pub struct ClockRow {
        "clocks" {
            /// The session.
            session: i64 = "session INTEGER PRIMARY KEY REFERENCES sessions(id)",
            /// `internal` or `external`.
            source: String = "source TEXT NOT NULL",
            /// The external clock's nominal rate, Hz; `None` for the internal one.
            rate_hz: Option<i64> = "rate_hz INTEGER",
            /// Deviation of its rate from nominal, relative to the controller's crystal, when the
            /// session began, ppm; positive is faster.
            ppm: Option<f64> = "ppm REAL",
        }
    }
}

table! {
    /// An edge at the sync input or output.
    #[derive(Clone, Debug, PartialEq)]
    pub struct EdgeRow {
        "edges" {
            "id INTEGER PRIMARY KEY",
            /// The session.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// `input`, or the reason for an output edge: `fired`, `trigger`, `asked`.
            line: String = "line TEXT NOT NULL",
            /// Its number since the device started; a gap in the numbers is the number of edges
            /// that came too fast to be reported.
            number: u32 = "number INTEGER NOT NULL",
            /// The last scan at or before the edge, in the device's count.
            scan: u64 = "scan INTEGER NOT NULL",
            /// Fraction of a scan since then, in units of 1/65536.
            part: u32 = "part INTEGER NOT NULL",
        }
    }
}

impl EdgeRow {
    /// Time of the edge, in scans of the device.
    pub fn at_scan(&self) -> f64 {
        self.scan as f64 + f64::from(self.part) / 65_536.0
    }
}

/// The name of a line in files.
fn name(line: Line) -> &'static str {
    match line {
        Line::Input => "input",
        Line::Fired => "fired",
        Line::Trigger => "trigger",
        Line::Asked => "asked",
    }
}

/// The SQL that creates both tables.
pub(super) fn tables() -> String {
    create::<ClockRow>() + &create::<EdgeRow>()
}

/// Creates the tables if the file does not have them.
fn make(connection: &Connection) -> rusqlite::Result<()> {
    if connection.table_exists(None, "clocks")? { Ok(()) } else { connection.execute_batch(&tables()) }
}

impl Store {
    /// Stores the clock that times a session's scans.
    pub fn note_clock(&self, session: i64, sync: &Sync) -> Result<(), StoreError> {
        let row = match sync.clock {
            Clock::Internal => ClockRow { session, source: "internal".into(), rate_hz: None, ppm: None },
            Clock::External { rate_hz } => ClockRow {
                session,
                source: "external".into(),
                rate_hz: Some(rate_hz.into()),
                ppm: Some(f64::from(sync.ppm)),
            },
        };
        self.change("noting the clock", |connection| {
            make(connection)?;
            row.insert(connection, &[])
        })
    }

    /// Stores edges of a session.
    pub fn note_edges(&self, session: i64, edges: &[Edge]) -> Result<(), StoreError> {
        if edges.is_empty() {
            return Ok(());
        }
        self.change("noting edges of the sync input and output", |connection| {
            make(connection)?;
            edges.iter().try_for_each(|edge| {
                let row = EdgeRow {
                    session,
                    line: name(edge.line).into(),
                    number: edge.number,
                    scan: edge.at.scan,
                    part: edge.at.part.into(),
                };
                row.insert(connection, &[])
            })
        })
    }

    fn has_sync(&self) -> Result<bool, StoreError> {
        self.connection.table_exists(None, "clocks").map_err(self.failed("looking for clocks"))
    }

    /// The clocks of the sessions that stored one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn clocks(&self) -> Result<Vec<ClockRow>, StoreError> {
        if !self.has_sync()? {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {} FROM clocks ORDER BY session", ClockRow::list());
        self.all(&sql, [], ClockRow::read, "reading clocks")
    }

    /// Every stored edge, in order.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn edges(&self) -> Result<Vec<EdgeRow>, StoreError> {
        if !self.has_sync()? {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {} FROM edges ORDER BY id", EdgeRow::list());
        self.all(&sql, [], EdgeRow::read, "reading edges")
    }
}
