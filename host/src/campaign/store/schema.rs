//! Creating a campaign file: its tables, and the triggers that protect their rows.
//!
//! The columns are declared next to the type of their row; the key-value tables are declared here.
//!
//! A file with an unknown version is refused with an error message. Any change of a column makes a
//! new version; the migration of older files is here ([`super::Store::bring_up`]), and is applied
//! by [`super::Store::open`].
//!
//! Checks, before anything is read, that a file's tables, triggers and indices are exactly those
//! that jointrig creates.
//!
//! Otherwise a view that never ends, or a trigger that does more than refuse, would take effect
//! with the first SELECT.

use super::calibration_table::Calibration;
use super::cell_table::{CellColumns, write_cell};
use super::error::{StoreError, sqlite};
use super::frf_table::FrfColumns;
use super::level_table::LevelRow;
use super::notes::{LogLine, PlanText, write_log, write_plan};
use super::record_table::Overrule;
use super::record_table::RecordRow;
use super::session_table::TemperatureRow;
use super::session_table::{ChannelColumns, Sensor, SessionInfo};
use super::table::{SINCE_3, create, stay};
use super::{APPLICATION_ID, Store, VERSION, chain, session_table, wear_table};
use crate::campaign::plan::Plan;
use rusqlite::Connection;
use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

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

/// Tables that name the types of samples.
const TYPED: [&str; 2] = ["seals", "levels"];

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

    pub(super) fn fill(&mut self, plan: &Plan, text: &str, source: &str) -> rusqlite::Result<()> {
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

    /// Migrates an older file: since version 2 every row is chained, since version 3 a record names
    /// the types of its samples.
    pub(super) fn bring_up(&self) -> rusqlite::Result<()> {
        let version: i32 = self.connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
        if version == VERSION {
            return Ok(());
        }
        let transaction = self.connection.unchecked_transaction()?;
        for table in TYPED {
            // the rows stay as they are, and null there counts for nothing in their seals
            if !transaction.column_exists(None, table, SINCE_3)? {
                transaction.execute_batch(&format!("ALTER TABLE {table} ADD COLUMN {SINCE_3} TEXT"))?;
            }
        }
        if version == super::OLDEST {
            transaction.execute_batch(&missing_calibrations(&transaction)?)?;
            if !transaction.table_exists(None, "temperatures")? {
                transaction.execute_batch(&create::<TemperatureRow>())?;
            }
            transaction.execute_batch(&(chain::TABLES.to_owned() + &stay(APPEND_ONLY[5])))?;
            write_log(
                &transaction,
                "rows are chained from here on; earlier changes show only in the records' seals",
            )?;
            chain::begin(&transaction)?;
        }
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

/// The schema's objects by name: type and SQL.
type Objects = HashMap<String, (String, String)>;

fn objects(connection: &Connection) -> rusqlite::Result<Objects> {
    // the indices that SQLite creates itself for UNIQUE and PRIMARY KEY have no SQL
    let mut statement = connection
        .prepare("SELECT name, type, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite!_%' ESCAPE '!'")?;
    let read = |row: &rusqlite::Row<'_>| {
        let sql: Option<String> = row.get(2)?;
        Ok((row.get(0)?, (row.get(1)?, sql.unwrap_or_default())))
    };
    statement.query_map([], read)?.collect()
}

/// The objects that jointrig creates. Needed whenever a file is opened, so computed once.
fn ours() -> rusqlite::Result<&'static Objects> {
    static OURS: OnceLock<Objects> = OnceLock::new();
    if let Some(ours) = OURS.get() {
        return Ok(ours);
    }
    let empty = Connection::open_in_memory()?;
    empty.execute_batch(&tables())?;
    empty.execute_batch(&session_table::tables())?;
    empty.execute_batch(&wear_table::tables())?;
    let made = objects(&empty)?;
    Ok(OURS.get_or_init(|| made))
}

/// Whether an object is as jointrig makes it. A table may lack the column of the samples' types
/// (version 2), or have it at its end, where ALTER TABLE put it.
fn as_made(made: &str, found: &str) -> bool {
    let without = |sql: &str| {
        let dense: String = sql.split_whitespace().collect();
        dense.replacen(&format!(",{SINCE_3}TEXT"), "", 1)
    };
    made == found || (made.contains(SINCE_3) && without(made) == without(found))
}

/// An object of the schema that jointrig does not create, or creates differently; `None` if there
/// is none.
///
/// # Errors
/// The schema cannot be read.
pub(super) fn strange(connection: &Connection) -> rusqlite::Result<Option<String>> {
    let (ours, found) = (ours()?, objects(connection)?);
    let mut names: Vec<&String> = found.keys().collect();
    names.sort();
    for name in names {
        let (kind, sql) = &found[name];
        match ours.get(name) {
            None => {
                return Ok(Some(format!(
                    "it has a {kind} `{name}`, which jointrig does not make: if you know who put it there, remove it with an SQLite \
                     program (DROP {} {name})",
                    kind.to_uppercase()
                )));
            }
            Some((own, made)) if own != kind || !as_made(made, sql) => {
                return Ok(Some(format!(
                    "its {kind} `{name}` is not as jointrig makes it: use a backup from before it was changed"
                )));
            }
            Some(_) => {}
        }
    }
    Ok(None)
}

/// The objects that jointrig creates but the schema lacks. A file of version 1 may lack those
/// introduced later.
///
/// # Errors
/// The schema cannot be read.
pub(super) fn missing(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let version: i32 = connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
    let later =
        |name: &String| ["chain", "calibrations", "temperatures"].iter().any(|later| name.starts_with(later));
    let found = objects(connection)?;
    let mut names: Vec<String> = ours()?.keys().filter(|name| !found.contains_key(*name)).cloned().collect();
    names.retain(|name| version > super::OLDEST || !later(name));
    // created on demand
    names.retain(|name| !["clocks", "edges"].contains(&name.as_str()));
    if !wear_table::there(connection)? {
        names.retain(|name| !name.starts_with("wear_"));
    }
    if version >= 3 {
        for table in TYPED.into_iter().filter(|table| found.contains_key(*table)) {
            if !connection.column_exists(None, table, SINCE_3)? {
                names.push(format!("{table}.{SINCE_3}"));
            }
        }
    }
    names.sort();
    Ok(names)
}
