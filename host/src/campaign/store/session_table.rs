//! Sessions in the campaign file: the connected device, its channels and the sensors on them, and
//! what is stored along with a session.
//!
//! - The specimen's temperature, as measured by the controller.
//! - Synchronisation data: the clock that timed a session's scans, and edges that another recorder
//!   also records. They are stored only for a plan with `[sync]`; other files do not have these
//!   tables.

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::stored::Hex;
use super::table::{Row, create, table};
use crate::device::channels::ChannelMap;
use jointrig_protocol::channel::{Channel, Quantity, Role};
use jointrig_protocol::sync::{Clock, Edge, Line, Sync};
use rusqlite::{Connection, ToSql, params};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use toml::Spanned;

table! {
    /// The connected device. One row per connection.
    #[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub struct SessionInfo {
        "sessions" {
            "id INTEGER PRIMARY KEY",
            "utc TEXT NOT NULL",
            /// The device's address.
            address: String = "address TEXT NOT NULL",
            /// The board's name.
            board: String = "board TEXT NOT NULL",
            /// Its serial number.
            serial: String = "serial TEXT NOT NULL",
            /// Its firmware's version.
            firmware_version: String = "firmware_version TEXT NOT NULL",
            /// The target triple that it was built for.
            target: String = "target TEXT NOT NULL",
            /// The build's number.
            build: Hex = "build TEXT NOT NULL",
            /// The protocol's schema hash.
            schema_hash: Hex = "schema_hash TEXT NOT NULL",
            "software_version TEXT NOT NULL",
            "rate_hz INTEGER NOT NULL",
        }
    }
}

table! {
    /// A channel: SI value = code · units_per_volt · range_v / 2ⁿ⁻¹, where n is 16 for samples of
    /// type i16 and `bits` for i32; or sample · units_per_volt for f32 and f64. A range of 0 is
    /// unknown.
    pub(super) struct ChannelColumns {
        "channels" {
            "session INTEGER NOT NULL REFERENCES sessions(id)",
            "place INTEGER NOT NULL",
            /// Its name.
            name: String = "name TEXT NOT NULL",
            /// Its role.
            role: Role = "role TEXT NOT NULL",
            /// The quantity that it measures.
            quantity: Quantity = "quantity TEXT NOT NULL",
            "unit TEXT NOT NULL",
            /// Units of the quantity per volt, with the sensor's polarity.
            units_per_volt: f32 = "units_per_volt REAL NOT NULL",
            /// Range of the converter, V.
            range_v: f32 = "range_v REAL NOT NULL",
            /// Its delay, ns.
            delay_ns: u32 = "delay_ns INTEGER NOT NULL",
            /// Resolution of the converter, bits.
            bits: u8 = "bits INTEGER NOT NULL",
            "PRIMARY KEY (session, place)",
        }
    }
}

table! {
    /// The plan's data on the sensor of a channel; sensitivity and polarity are part of the
    /// channel's scale.
    #[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub struct Sensor {
        "sensors" {
            "session INTEGER NOT NULL REFERENCES sessions(id)",
            "place INTEGER NOT NULL",
            /// Its model.
            model: Option<String> = "model TEXT",
            /// Its serial number.
            serial: Option<String> = "serial TEXT",
            /// When it was calibrated, YYYY-MM-DD.
            calibrated: Option<String> = "calibrated TEXT",
            "PRIMARY KEY (session, place)",
        }
    }
}

impl SessionInfo {
    /// Board name for records that were imported from a file.
    pub const IMPORTED: &str = "imported";
}

/// Counters of a link by name.
pub type Counters = BTreeMap<String, u64>;

/// Writes the counters of a session's link so far.
pub(super) fn write_link(connection: &Connection, session: i64, counters: &Counters) -> rusqlite::Result<()> {
    let failed = |error| rusqlite::Error::ToSqlConversionFailure(Box::new(error));
    let text = serde_json::to_string(counters).map_err(failed)?;
    connection
        .prepare_cached("INSERT OR REPLACE INTO links VALUES (?1, ?2)")?
        .execute(params![session, text])
        .map(|_| ())
}

/// Key of the note with a session's rate in Hz if it is not a whole number: the column of the table
/// holds whole numbers only.
fn exact_rate(session: i64) -> String {
    format!("exact_rate_hz of session {session}")
}

/// When a session began, and which jointrig stored it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Begun {
    /// When it began, RFC 3339.
    pub utc: String,
    /// The version of jointrig.
    pub software_version: String,
}

pub(super) fn write_session(
    connection: &Connection,
    info: &SessionInfo,
    map: &ChannelMap,
    begun: &Begun,
    sensor_of: impl Fn(usize, &Channel) -> Option<Sensor>,
) -> rusqlite::Result<i64> {
    let beside: [(&str, &dyn ToSql); 3] =
        [("utc", &begun.utc), ("software_version", &begun.software_version), ("rate_hz", &map.rate_hz)];
    info.clone().insert(connection, &beside)?;
    let session = connection.last_insert_rowid();
    if let Some(exact_hz) = map.exact_hz {
        // all digits, so that reading gives the same number
        let row = (exact_rate(session), exact_hz.to_string());
        connection.execute("INSERT INTO meta VALUES (?1, ?2)", row)?;
    }
    for (place, channel) in map.channels.iter().enumerate() {
        let columns = ChannelColumns {
            name: channel.name.as_str().into(),
            role: channel.role,
            quantity: channel.quantity,
            units_per_volt: channel.units_per_volt,
            range_v: channel.range_v,
            delay_ns: channel.delay_ns,
            bits: channel.bits,
        };
        let at: [(&str, &dyn ToSql); 2] = [("session", &session), ("place", &place)];
        columns.insert(connection, &[at[0], at[1], ("unit", &channel.quantity.unit())])?;
        if let Some(sensor) = sensor_of(place, channel) {
            sensor.insert(connection, &at)?;
        }
    }
    Ok(session)
}

impl Store {
    /// Stores a connection to a device, its channels, and the plan's sensors on them; returns its
    /// id.
    pub fn begin_session(&mut self, info: &SessionInfo, channels: &ChannelMap) -> Result<i64, StoreError> {
        let plan = self.plan()?;
        let begun = Begun { utc: utc_now(), software_version: env!("CARGO_PKG_VERSION").into() };
        let sensor_of = |_: usize, channel: &Channel| {
            let mut sensors = plan.channel.iter().map(Spanned::get_ref);
            let own = sensors.find(|sensor| sensor.name == channel.name.as_str())?;
            let (model, serial) = (own.model.clone(), own.serial.clone());
            Some(Sensor { model, serial, calibrated: own.calibrated.clone() })
        };
        self.change("noting the session", |connection| {
            write_session(connection, info, channels, &begun, sensor_of)
        })
    }

    /// The channels of one session, with all calibrations entered so far.
    pub fn channels(&self, session: i64) -> Result<ChannelMap, StoreError> {
        self.calibrated(session, self.channels_as_measured(session)?)
    }

    /// The channels of one session, with the scales that it was measured with.
    pub fn channels_as_measured(&self, session: i64) -> Result<ChannelMap, StoreError> {
        let rate_hz = self
            .connection
            .query_row("SELECT rate_hz FROM sessions WHERE id = ?1", [session], |row| row.get(0))
            .map_err(self.failed("reading a session"))?;
        let sql =
            format!("SELECT {} FROM channels WHERE session = ?1 ORDER BY place", ChannelColumns::list());
        let rows = self.all(&sql, [session], ChannelColumns::read, "reading channels")?;
        let channel = |row: ChannelColumns| {
            let ChannelColumns { name, role, quantity, units_per_volt, range_v, delay_ns, bits } = row;
            let wrong =
                |_| self.content(format!("session {session}: the name `{name}` of a channel is too long"));
            let name = name.as_str().try_into().map_err(wrong)?;
            Ok(Channel { name, role, quantity, units_per_volt, range_v, delay_ns, bits })
        };
        let channels = rows.into_iter().map(channel).collect::<Result<_, StoreError>>()?;
        let exact_hz = match self.meta(&exact_rate(session))? {
            None => None,
            Some(text) => {
                let rate = text.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
                let wrong = || self.content(format!("session {session}: `{text}` is not a sampling rate"));
                Some(rate.ok_or_else(wrong)?)
            }
        };
        Ok(ChannelMap { id: 0, rate_hz, exact_hz, channels })
    }

    /// The distinct versions of jointrig that wrote the sessions.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn software_versions(&self) -> Result<Vec<String>, StoreError> {
        let sql = "SELECT DISTINCT software_version FROM sessions ORDER BY software_version";
        self.all(sql, [], |row| row.get(0), "reading the sessions")
    }

    /// The sensors of one session's channels, in channel order.
    pub fn sensors(&self, session: i64) -> Result<Vec<Sensor>, StoreError> {
        let sql = format!(
            "SELECT {} FROM channels LEFT JOIN sensors USING (session, place) WHERE session = ?1 ORDER BY place",
            Sensor::list()
        );
        self.all(&sql, [session], Sensor::read, "reading sensors")
    }

    /// Stores the counters of a session's link.
    pub fn note_link(&self, session: i64, counters: &Counters) -> Result<(), StoreError> {
        self.change("noting the link's counters", |connection| write_link(connection, session, counters))
    }

    /// The counters of the link, summed over all sessions that stored them.
    pub fn link_counters(&self) -> Result<Counters, StoreError> {
        let mut sum = Counters::new();
        let texts: Vec<String> =
            self.all("SELECT counters FROM links", [], |row| row.get(0), "reading the link's counters")?;
        for text in texts {
            let counters: Counters = serde_json::from_str(&text)
                .map_err(|error| self.content(format!("the link's counters cannot be read: {error}")))?;
            for (name, count) in counters {
                *sum.entry(name).or_default() += count;
            }
        }
        Ok(sum)
    }

    /// The sessions of this file: id and device.
    pub fn sessions(&self) -> Result<Vec<(i64, SessionInfo)>, StoreError> {
        let sql = format!("SELECT {}, id FROM sessions ORDER BY id", SessionInfo::list());
        let read = |row: &rusqlite::Row<'_>| Ok((row.get("id")?, SessionInfo::read(row)?));
        self.all(&sql, [], read, "reading sessions")
    }
}

table! {
    /// The clock that timed the scans of a session.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
pub(super) fn make(connection: &Connection) -> rusqlite::Result<()> {
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

table! {
    /// A temperature at one time in a session.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct TemperatureRow {
        "temperatures" {
            "id INTEGER PRIMARY KEY",
            /// The session.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// Time, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// Temperature of the specimen, °C.
            celsius: f64 = "celsius REAL NOT NULL",
        }
    }
}

impl Store {
    /// Stores the specimen's current temperature, °C.
    pub fn note_temperature(&self, session: i64, celsius: f64) -> Result<(), StoreError> {
        let row = TemperatureRow { session, utc: utc_now(), celsius };
        self.change("noting a temperature", |connection| row.insert(connection, &[]))
    }

    /// Every stored temperature, in order.
    pub fn temperatures(&self) -> Result<Vec<TemperatureRow>, StoreError> {
        let there = self.connection.table_exists(None, "temperatures");
        if !there.map_err(self.failed("looking for temperatures"))? {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {} FROM temperatures ORDER BY id", TemperatureRow::list());
        self.all(&sql, [], TemperatureRow::read, "reading temperatures")
    }
}
