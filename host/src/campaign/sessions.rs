//! Sessions in the campaign file: what was connected, and the channels that it had.

use jointrig_protocol::channel::Channel;
use rusqlite::{Row, params};
use toml::Spanned;

use super::plan::Plan;
use super::rows::{Counters, Sensor, SessionInfo};
use super::store::{Store, utc_now};
use super::store_error::{StoreError, sqlite};
use crate::device::channels::ChannelMap;

impl Store {
    /// Notes a connection to a device, its channels, and the sensors that the plan names behind them; returns its id.
    pub fn begin_session(&mut self, info: &SessionInfo, channels: &ChannelMap) -> Result<i64, StoreError> {
        let (path, plan) = (self.path.clone(), self.plan()?);
        self.write_session(info, channels, &plan).map_err(|error| sqlite(&path, "noting the session", error))
    }

    fn write_session(
        &mut self,
        info: &SessionInfo,
        channels: &ChannelMap,
        plan: &Plan,
    ) -> rusqlite::Result<i64> {
        let transaction = self.connection.transaction()?;
        transaction.execute(
            "INSERT INTO sessions (utc, address, board, serial, firmware_version, target, build, schema_hash, \
             software_version, rate_hz) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
            params![
                utc_now(),
                info.address,
                info.board,
                info.serial,
                info.firmware_version,
                info.target,
                format!("{:016x}", info.build),
                format!("{:016x}", info.schema_hash),
                env!("CARGO_PKG_VERSION"),
                channels.rate_hz,
            ],
        )?;
        let session = transaction.last_insert_rowid();
        for (place, channel) in channels.channels.iter().enumerate() {
            let json = |value: Result<String, serde_json::Error>| {
                value.map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))
            };
            transaction.execute(
                "INSERT INTO channels VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
                params![
                    session,
                    place,
                    channel.name.as_str(),
                    json(serde_json::to_string(&channel.role))?,
                    json(serde_json::to_string(&channel.quantity))?,
                    channel.quantity.unit(),
                    channel.units_per_volt,
                    channel.range_v,
                    channel.delay_ns,
                    channel.bits,
                ],
            )?;
            let named =
                plan.channel.iter().map(Spanned::get_ref).find(|sensor| sensor.name == channel.name.as_str());
            if let Some(sensor) = named {
                transaction.execute(
                    "INSERT INTO sensors VALUES (?1, ?2, ?3, ?4, ?5)",
                    params![session, place, sensor.model, sensor.serial, sensor.calibrated],
                )?;
            }
        }
        transaction.commit()?;
        Ok(session)
    }

    /// The channels of one session.
    pub fn channels(&self, session: i64) -> Result<ChannelMap, StoreError> {
        let rate_hz = self
            .connection
            .query_row("SELECT rate_hz FROM sessions WHERE id = ?1", [session], |row| row.get(0))
            .map_err(self.failed("reading a session"))?;
        let sql = "SELECT name, role, quantity, units_per_volt, range_v, delay_ns, bits FROM channels \
                   WHERE session = ?1 ORDER BY place";
        let read = |row: &Row<'_>| {
            let (name, role, quantity): (String, String, String) = (row.get(0)?, row.get(1)?, row.get(2)?);
            Ok((name, role, quantity, row.get(3)?, row.get(4)?, row.get(5)?, row.get(6)?))
        };
        let rows: Vec<(String, String, String, f32, f32, u32, u8)> =
            self.all(sql, [session], read, "reading channels")?;
        let channels = rows
            .into_iter()
            .map(|(name, role, quantity, units_per_volt, range_v, delay_ns, bits)| {
                let wrong = || self.content(format!("session {session}: channel `{name}` cannot be read"));
                Ok(Channel {
                    name: name.as_str().try_into().map_err(|_| wrong())?,
                    role: serde_json::from_str(&role).map_err(|_| wrong())?,
                    quantity: serde_json::from_str(&quantity).map_err(|_| wrong())?,
                    units_per_volt,
                    range_v,
                    delay_ns,
                    bits,
                })
            })
            .collect::<Result<_, StoreError>>()?;
        Ok(ChannelMap { id: 0, rate_hz, channels })
    }

    /// What is known of the sensors of one session's channels, in their order.
    pub fn sensors(&self, session: i64) -> Result<Vec<Sensor>, StoreError> {
        let mut sensors = vec![Sensor::default(); self.channels(session)?.len()];
        if self.version > 1 {
            let sql = "SELECT place, model, serial, calibrated FROM sensors WHERE session = ?1";
            let read = |row: &Row<'_>| {
                let sensor = Sensor { model: row.get(1)?, serial: row.get(2)?, calibrated: row.get(3)? };
                Ok((row.get::<_, usize>(0)?, sensor))
            };
            for (place, sensor) in self.all(sql, [session], read, "reading sensors")? {
                if let Some(known) = sensors.get_mut(place) {
                    *known = sensor;
                }
            }
        }
        Ok(sensors)
    }

    /// Notes the counters of a session's link.
    pub fn note_link(&self, session: i64, counters: &Counters) -> Result<(), StoreError> {
        let text = serde_json::to_string(counters)
            .map_err(|error| self.content(format!("the link's counters cannot be written: {error}")))?;
        self.connection
            .execute("INSERT OR REPLACE INTO links VALUES (?1, ?2)", params![session, text])
            .map(|_| ())
            .map_err(self.failed("noting the link's counters"))
    }

    /// The counters of the link, summed over all sessions that noted them.
    pub fn link_counters(&self) -> Result<Counters, StoreError> {
        let mut sum = Counters::new();
        if self.version > 1 {
            let texts: Vec<String> =
                self.all("SELECT counters FROM links", [], |row| row.get(0), "reading the link's counters")?;
            for text in texts {
                let counters: Counters = serde_json::from_str(&text)
                    .map_err(|error| self.content(format!("the link's counters cannot be read: {error}")))?;
                for (name, count) in counters {
                    *sum.entry(name).or_default() += count;
                }
            }
        }
        Ok(sum)
    }

    /// The sessions of this file: id, and what was connected.
    pub fn sessions(&self) -> Result<Vec<(i64, SessionInfo)>, StoreError> {
        let sql = "SELECT id, address, board, serial, firmware_version, target, build, schema_hash FROM sessions ORDER BY id";
        let hex = |row: &Row<'_>, place: usize| {
            row.get::<_, String>(place).map(|text| u64::from_str_radix(&text, 16).unwrap_or(0))
        };
        let read = |row: &Row<'_>| {
            let info = SessionInfo {
                address: row.get(1)?,
                board: row.get(2)?,
                serial: row.get(3)?,
                firmware_version: row.get(4)?,
                target: row.get(5)?,
                build: hex(row, 6)?,
                schema_hash: hex(row, 7)?,
            };
            Ok((row.get(0)?, info))
        };
        self.all(sql, [], read, "reading sessions")
    }
}
