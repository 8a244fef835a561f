//! Verdicts overruled by a person: stored in addition to the original; the last one counts.

use rusqlite::Connection;

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::table::{Row, table};
use crate::campaign::verdict::Kind;

table! {
    /// A verdict that a person overruled.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Overrule {
        "overrules" {
            "id INTEGER PRIMARY KEY",
            /// The record.
            record: i64 = "record INTEGER NOT NULL REFERENCES records(id)",
            /// Time, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// The new verdict.
            verdict: String = "verdict TEXT NOT NULL",
            /// The reason.
            reason: String = "reason TEXT NOT NULL",
        }
    }
}

impl Store {
    /// Overrules a record's verdict; the original one is kept in the file. A settled cell that is
    /// left with fewer good hits than it was settled with is reopened.
    pub fn overrule(&self, record: i64, verdict: Kind, reason: &str) -> Result<(), StoreError> {
        self.change("overruling a verdict", |connection| write_overrule(connection, record, verdict, reason))
    }

    /// Restarts a cell: its good records are dropped, and it is reopened. Returns the number of
    /// dropped records.
    pub fn redo(&self, cell: i64, reason: &str) -> Result<usize, StoreError> {
        let records = self.records_of(cell)?;
        let good = records.iter().flatten().filter(|record| record.standing() == Kind::Good);
        let good: Vec<i64> = good.map(|record| record.id).collect();
        self.change("opening a cell again", |connection| {
            for record in &good {
                write_overrule(connection, *record, Kind::Dropped, reason)?;
            }
            connection.execute("UPDATE cells SET settled = NULL, given_up = NULL WHERE id = ?1", [cell])
        })?;
        Ok(good.len())
    }

    /// Every overruled verdict.
    pub fn overrules(&self) -> Result<Vec<Overrule>, StoreError> {
        let sql = format!("SELECT {} FROM overrules ORDER BY id", Overrule::list());
        self.all(&sql, [], Overrule::read, "reading overrules")
    }
}

fn write_overrule(connection: &Connection, record: i64, verdict: Kind, reason: &str) -> rusqlite::Result<()> {
    let overrule = Overrule { record, utc: utc_now(), verdict: verdict.name().into(), reason: reason.into() };
    overrule.insert(connection, &[])?;
    if verdict != Kind::Good {
        connection.execute(
            "UPDATE cells SET settled = NULL WHERE id = (SELECT cell FROM records WHERE id = ?1)",
            [record],
        )?;
    }
    Ok(())
}
