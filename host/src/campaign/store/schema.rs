//! Creating a campaign file: its tables, and the triggers that protect their rows.
//!
//! The columns are declared next to the type of their row; the key-value tables are declared here.
//!
//! A file with an unknown version is refused with an error message. Any change of a column makes a
//! new version; the migration of older files is here ([`super::Store::bring_up`]), and is applied
//! by [`super::Store::open`].

use std::path::Path;

use rusqlite::Connection;

use super::calibration_table::Calibration;
use super::cell_table::{CellColumns, write_cell};
use super::chain;
use super::error::{StoreError, sqlite};
use super::frf_table::FrfColumns;
use super::level_table::LevelRow;
use super::notes::{LogLine, PlanText, write_log, write_plan};
use super::overrules::Overrule;
use super::record_row::RecordRow;
use super::session_table::{ChannelColumns, Sensor, SessionInfo};
use super::table::create;
use super::temperature_table::TemperatureRow;
use super::{APPLICATION_ID, Store, VERSION};
use crate::campaign::plan::Plan;

/// Notes about the whole campaign, and the counters of each session's link so far (a JSON object of
/// numbers).
const PAIRS: &str = "
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE links (session INTEGER PRIMARY KEY REFERENCES sessions(id), counters TEXT NOT NULL) STRICT;
";

/// Tables whose rows never change, and how their triggers' messages call a row.
const APPEND_ONLY: [(&str, &str); 6] = [
    ("records", "a raw record is"),
    ("seals", "a record''s seal is"),
    ("frfs", "imported FRFs are"),
    ("levels", "a raw record is"),
    ("calibrations", "a calibration is"),
    ("chain", "an entry of the chain is"),
];

impl Store {
    /// Creates a campaign file for the plan in `text`, which errors call `source`.
    ///
    /// # Errors
    /// The file exists, cannot be written, or the plan is wrong.
    pub fn create(path: &Path, text: &str, source: &str) -> Result<Self, StoreError> {
        let plan = Plan::parse_new(text, source)?;
        let mut store = Self::empty(path)?;
        store.fill(&plan, text, source).map_err(|error| sqlite(path, "creating", error))?;
        store.mark_written()?;
        Ok(store)
    }

    fn fill(&mut self, plan: &Plan, text: &str, source: &str) -> rusqlite::Result<()> {
        let transaction = self.connection.transaction()?;
        transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
        transaction.execute_batch(&tables())?;
        transaction.pragma_update(None, "user_version", VERSION)?;
        write_plan(&transaction, text, source)?;
        transaction
            .execute("INSERT INTO meta VALUES ('software_version', ?1)", [env!("CARGO_PKG_VERSION")])?;
        for cell in &plan.cells() {
            write_cell(&transaction, cell)?;
        }
        chain::begin(&transaction)?;
        transaction.commit()
    }

    /// Migrates an older file: since version 2 every row is chained.
    pub(super) fn bring_up(&self) -> rusqlite::Result<()> {
        let version: i32 = self.connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
        if version == VERSION {
            return Ok(());
        }
        let transaction = self.connection.unchecked_transaction()?;
        transaction.execute_batch(&missing_calibrations(&transaction)?)?;
        if !transaction.table_exists(None, "temperatures")? {
            transaction.execute_batch(&create::<TemperatureRow>())?;
        }
        transaction.execute_batch(&(chain::TABLES.to_owned() + &stay(APPEND_ONLY[5])))?;
        write_log(
            &transaction,
            "rows are chained from here on; what was changed before shows in records' seals only",
        )?;
        chain::begin(&transaction)?;
        transaction.pragma_update(None, "user_version", VERSION)?;
        transaction.commit()
    }
}

/// The SQL that adds the table of calibrations to a file that was created without it; empty if it
/// exists.
pub(super) fn missing_calibrations(connection: &Connection) -> rusqlite::Result<String> {
    let there = connection.table_exists(None, "calibrations")?;
    Ok(if there { String::new() } else { create::<Calibration>() + &stay(APPEND_ONLY[4]) })
}

/// The triggers that prevent changes to the rows of a table.
fn stay((table, row): (&str, &str)) -> String {
    let one = |(name, event, done): (&str, &str, &str)| {
        format!(
            "CREATE TRIGGER {table}_{name} BEFORE {event} ON {table}\n\
             BEGIN SELECT RAISE(ABORT, '{row} never {done}'); END;\n"
        )
    };
    [("stay", "UPDATE", "changed"), ("remain", "DELETE", "deleted")].map(one).concat()
}

/// The SQL that creates an empty file.
pub(super) fn tables() -> String {
    let tables = [
        PAIRS.to_owned(),
        chain::TABLES.to_owned(),
        create::<PlanText>(),
        create::<SessionInfo>(),
        create::<ChannelColumns>(),
        create::<Sensor>(),
        create::<Calibration>(),
        create::<CellColumns>(),
        create::<RecordRow>(),
        create::<Overrule>(),
        create::<LogLine>(),
        create::<FrfColumns>(),
        create::<LevelRow>(),
        create::<TemperatureRow>(),
    ]
    .concat();
    tables + &APPEND_ONLY.map(stay).concat()
}
