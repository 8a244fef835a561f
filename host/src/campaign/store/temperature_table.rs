//! The specimen's temperature in the campaign file, as the controller measured it.

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::table::{Row, table};

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

impl Store {
    /// Notes the specimen's temperature now, °C.
    pub fn note_temperature(&self, session: i64, celsius: f64) -> Result<(), StoreError> {
        let row = TemperatureRow { session, utc: utc_now(), celsius };
        self.change("noting a temperature", |connection| row.insert(connection, &[]))
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
