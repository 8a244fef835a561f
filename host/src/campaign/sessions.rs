//! Sessions in the campaign file: what was connected, and the channels that it had.

use jointrig_protocol::channel::Channel;
use rusqlite::{Row, params};

use super::rows::SessionInfo;
use super::store::{Store, utc_now};
use super::store_error::{StoreError, sqlite};
use crate::device::channels::ChannelMap;

impl Store {
    /// Notes a connection to a device and its channels; returns its id.
    pub fn begin_session(&mut self, info: &SessionInfo, channels: &ChannelMap) -> Result<i64, StoreError> {
        let path = self.path.clone();
        self.write_session(info, channels).map_err(|error| sqlite(&path, "noting the session", error))
    }

    fn write_session(&mut self, info: &SessionInfo, channels: &ChannelMap) -> rusqlite::Result<i64> {
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
