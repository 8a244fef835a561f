//! The specimen's temperature in the campaign file, as measured by the controller.

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::table::{Row, table};

table! {
    /// A temperature at one time in a session.
    #[derive(Clone, Debug, PartialEq)]
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
