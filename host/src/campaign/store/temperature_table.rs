//! The specimen's temperature in the campaign file, as the controller measured it.

use rusqlite::Connection;

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::table::{Row, create, table};

table! {
    /// A temperature at some moment of a session.
    #[derive(Clone, Debug, PartialEq)]
    pub struct TemperatureRow {
        "temperatures" {
            "id INTEGER PRIMARY KEY",
            /// Which session.
            session: i64 = "session INTEGER NOT NULL REFERENCES sessions(id)",
            /// When, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// At the specimen, °C.
            celsius: f64 = "celsius REAL NOT NULL",
        }
    }
}

/// Notes one; a file from before there were temperatures gets their table.
pub(super) fn write_temperature(connection: &Connection, session: i64, celsius: f64) -> rusqlite::Result<()> {
    if !connection.table_exists(None, "temperatures")? {
        connection.execute_batch(&create::<TemperatureRow>())?;
    }
    TemperatureRow { session, utc: utc_now(), celsius }.insert(connection, &[])
}

impl Store {
    /// Notes the specimen's temperature now, °C.
    pub fn note_temperature(&self, session: i64, celsius: f64) -> Result<(), StoreError> {
        write_temperature(&self.connection, session, celsius).map_err(self.failed("noting a temperature"))
    }

    /// Every temperature that was noted, in that order.
    pub fn temperatures(&self) -> Result<Vec<TemperatureRow>, StoreError> {
        let there = self.connection.table_exists(None, "temperatures");
        if !there.map_err(self.failed("looking for temperatures"))? {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {} FROM temperatures ORDER BY id", TemperatureRow::list());
        self.all(&sql, [], TemperatureRow::read, "reading temperatures")
    }
}
