//! Rows of another campaign file, read in the form in which they are written again: with their
//! times, and under the same lock, seals and chain as rows that are measured.

use rusqlite::params;
use serde::{Deserialize, Serialize};
use std::path::Path;

use super::Store;
use super::calibration_table::Calibration;
use super::cell_table::{CellRow, write_cell};
use super::error::{StoreError, sqlite};
use super::level_table::{LevelRow, NewLevel};
use super::notes::{LogLine, PlanText};
use super::record_table::{NewRecord, Overrule, RecordRow};
use super::session_table::{
    Begun, ClockRow, Counters, EdgeRow, Sensor, SessionInfo, TemperatureRow, make, write_session,
};
use super::table::Row;
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::campaign::verdict::Judgement;
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use jointrig_protocol::channel::Channel;

/// A plan's text, and the name of the file that it came from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanSource {
    /// The name of the file.
    pub source: String,
    /// The plan's text.
    pub text: String,
}

/// A session with everything that is stored about it. Its channels have the scales that it was
/// measured with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SessionCopy {
    /// Its id in the file that it comes from.
    pub id: i64,
    /// When it began, and which jointrig stored it.
    pub begun: Begun,
    /// The device.
    pub info: SessionInfo,
    /// Scans per second, Hz; the nearest integer where `exact_hz` is set.
    pub rate_hz: u32,
    /// The rate where it is not an integer, Hz.
    pub exact_hz: Option<f64>,
    /// The channels.
    pub channels: Vec<Channel>,
    /// The sensors on them.
    pub sensors: Vec<Sensor>,
    /// The link's counters.
    pub link: Option<Counters>,
    /// The clock that timed its scans, if that was stored.
    pub clock: Option<ClockRow>,
}

impl SessionCopy {
    /// Its channels, with the scales that it was measured with.
    pub fn map(&self) -> ChannelMap {
        let Self { rate_hz, exact_hz, channels, .. } = self.clone();
        ChannelMap { id: 0, rate_hz, exact_hz, channels }
    }
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogCopy {
    /// Time, RFC 3339.
    pub utc: String,
    /// The event.
    pub text: String,
}

impl Store {
    /// Every plan that the file has had, the current one last.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn plan_sources(&self) -> Result<Vec<PlanSource>, StoreError> {
        let sql = format!("SELECT {} FROM plan ORDER BY id", PlanText::list());
        let read = |row: &rusqlite::Row<'_>| {
            PlanText::read(row).map(|plan| PlanSource { source: plan.source, text: plan.text })
        };
        self.all(&sql, [], read, "reading the plans")
    }

    /// Every session.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn session_copies(&self) -> Result<Vec<SessionCopy>, StoreError> {
        let begun = |row: &rusqlite::Row<'_>| {
            Ok((row.get::<_, i64>(0)?, Begun { utc: row.get(1)?, software_version: row.get(2)? }))
        };
        let sql = "SELECT id, utc, software_version FROM sessions ORDER BY id";
        let begun = self.all(sql, [], begun, "reading sessions")?;
        let link = |row: &rusqlite::Row<'_>| Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?));
        let links =
            self.all("SELECT session, counters FROM links", [], link, "reading the link's counters")?;
        let clocks = self.clocks()?;
        let mut copies = Vec::new();
        for ((id, info), (_, begun)) in self.sessions()?.into_iter().zip(begun) {
            let ChannelMap { rate_hz, exact_hz, channels, .. } = self.channels_as_measured(id)?;
            let counters = links.iter().find(|(session, _)| *session == id).map(|(_, text)| text);
            let link = counters.map(|text| serde_json::from_str(text)).transpose();
            let link = link.map_err(|error| {
                self.content(format!("session {id}: the link's counters cannot be read: {error}"))
            })?;
            copies.push(SessionCopy {
                id,
                begun,
                info,
                rate_hz,
                exact_hz,
                channels,
                sensors: self.sensors(id)?,
                link,
                clock: clocks.iter().find(|clock| clock.session == id).cloned(),
            });
        }
        Ok(copies)
    }

    /// Every note about the whole campaign that is not about this file or one of its sessions.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn notes(&self) -> Result<Vec<(String, String)>, StoreError> {
        let read = |row: &rusqlite::Row<'_>| Ok((row.get(0)?, row.get(1)?));
        let sql = "SELECT key, value FROM meta ORDER BY key";
        let mut all: Vec<(String, String)> = self.all(sql, [], read, "reading notes")?;
        all.retain(|(key, _)| {
            !([super::WRITTEN, "software_version"].contains(&key.as_str())
                || key.starts_with("exact_rate_hz"))
        });
        Ok(all)
    }

    /// Creates a campaign file that has had these plans, the last of which is in effect. Unlike a
    /// new plan, they may be implausible: a campaign was measured with them.
    ///
    /// # Errors
    /// The file exists, cannot be written, or a plan is wrong.
    pub fn create_with(path: &Path, plans: &[PlanSource]) -> Result<Self, StoreError> {
        let read = |own: &PlanSource| Plan::parse(&own.text, &own.source);
        let parsed = plans.iter().map(read).collect::<Result<Vec<Plan>, _>>()?;
        let mut each = plans.iter().zip(&parsed);
        let Some((own, plan)) = each.next() else {
            return Err(StoreError::Content { path: path.into(), what: "there is no plan".into() });
        };
        let mut store = Self::empty(path)?;
        store.fill(plan, &own.text, &own.source).map_err(|error| sqlite(path, "creating", error))?;
        for (own, plan) in each {
            store.next_plan(own, plan)?;
        }
        store.mark_written()?;
        Ok(store)
    }

    /// Puts a later plan in effect, before anything is measured.
    fn next_plan(&self, own: &PlanSource, plan: &Plan) -> Result<(), StoreError> {
        let (rows, cells) = (self.cells()?, plan.cells());
        let same = |cell: &Cell, row: &CellRow| {
            (cell.configuration, &cell.impact, &cell.response)
                == (row.cell.configuration, &row.cell.impact, &row.cell.response)
        };
        self.change("taking over the plan", |connection| {
            for row in rows.iter().filter(|row| !cells.iter().any(|cell| same(cell, row))) {
                connection.execute("DELETE FROM cells WHERE id = ?1", [row.id])?;
            }
            for cell in &cells {
                write_cell(connection, cell)?;
            }
            super::notes::write_plan(connection, &own.text, &own.source)
        })
    }

    /// Stores a session; returns its id here.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_session(&self, copy: &SessionCopy) -> Result<i64, StoreError> {
        let map = copy.map();
        let sensor = |place: usize, _: &Channel| {
            copy.sensors.get(place).filter(|sensor| **sensor != Sensor::default()).cloned()
        };
        let session = self.change("copying a session", |connection| {
            write_session(connection, &copy.info, &map, &copy.begun, sensor)
        })?;
        if let Some(link) = &copy.link {
            self.note_link(session, link)?;
        }
        if let Some(clock) = &copy.clock {
            self.change("copying a clock", |connection| {
                make(connection)?;
                ClockRow { session, ..clock.clone() }.insert(connection, &[])
            })?;
        }
        Ok(session)
    }

    /// Stores a record whose row names a cell, an attempt and a session of this file; returns its
    /// id here. Its samples may be missing.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_record(&self, row: &RecordRow, samples: Samples, link: &Counters) -> Result<i64, StoreError> {
        let record = NewRecord {
            cell: row.cell,
            attempt: row.attempt,
            session: row.session,
            utc: row.utc.clone(),
            utc_error_s: row.utc_error_s,
            recording: Recording {
                epoch: row.epoch,
                first_scan: row.first_scan,
                trigger_index: row.trigger_index,
                samples,
                gaps: row.gaps.clone(),
                shot: row.shot,
            },
            verdict: Judgement {
                peak_n: row.peak_n,
                ..Judgement::without_pulse(row.verdict, row.measure, row.limit, row.sentence.clone())
            },
        };
        self.insert(&record, link)
    }

    /// Stores a level whose row names a session of this file; returns its id here.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_level(&self, row: &LevelRow, samples: Samples) -> Result<i64, StoreError> {
        let new = NewLevel {
            session: row.session,
            moment: row.moment,
            level: row.level(),
            settled: row.settled(),
            epoch: row.epoch,
            first_scan: row.first_scan,
            samples,
            gaps: row.gaps.clone(),
        };
        self.insert_level_at(&new, row.utc.clone())
    }

    /// Stores a row of one of the tables whose rows stand alone; the ids in it are those of this
    /// file.
    fn copy_row<R: Row>(&self, row: R) -> Result<(), StoreError> {
        self.change("copying a row", |connection| row.insert(connection, &[]))
    }

    /// Stores a verdict that a person overruled.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_overrule(&self, row: Overrule) -> Result<(), StoreError> {
        self.copy_row(row)
    }

    /// Stores a calibration.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_calibration(&self, row: Calibration) -> Result<(), StoreError> {
        self.copy_row(row)
    }

    /// Stores a temperature.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_temperature(&self, row: TemperatureRow) -> Result<(), StoreError> {
        self.copy_row(row)
    }

    /// Stores an edge of the sync input or output.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_edge(&self, row: EdgeRow) -> Result<(), StoreError> {
        self.change("copying an edge", |connection| {
            make(connection)?;
            row.insert(connection, &[])
        })
    }

    /// Stores a line of the log.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_log(&self, line: LogCopy) -> Result<(), StoreError> {
        self.copy_row(LogLine { utc: line.utc, text: line.text })
    }

    /// Gives the cell of this name the state of `row`, and the number of hits wanted.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn copy_cell_state(
        &self,
        cell: &Cell,
        given_up: Option<&str>,
        settled: Option<&str>,
    ) -> Result<(), StoreError> {
        let name = configuration_name(cell.configuration);
        self.change("copying a cell's state", |connection| {
            connection
                .execute(
                    "UPDATE cells SET wanted = ?4, given_up = ?5, settled = ?6 \
                     WHERE configuration = ?1 AND impact = ?2 AND response = ?3",
                    params![name, cell.impact, cell.response, cell.wanted, given_up, settled],
                )
                .map(|_| ())
        })
    }
}
