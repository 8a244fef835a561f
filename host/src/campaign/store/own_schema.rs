//! Checks, before anything is read, that a file's tables, triggers and indices are exactly those
//! that jointrig creates.
//!
//! Otherwise a view that never ends, or a trigger that does more than refuse, would take effect
//! with the first SELECT.

use std::collections::HashMap;
use std::sync::OnceLock;

use rusqlite::Connection;

use super::{schema, sync_table};

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
    empty.execute_batch(&schema::tables())?;
    empty.execute_batch(&sync_table::tables())?;
    let made = objects(&empty)?;
    Ok(OURS.get_or_init(|| made))
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
                    "it has a {kind} `{name}`, which jointrig does not make: if you know who put it there, take it out with a program for \
                     SQLite (DROP {} {name})",
                    kind.to_uppercase()
                )));
            }
            Some((own, made)) if own != kind || made != sql => {
                return Ok(Some(format!(
                    "its {kind} `{name}` is not as jointrig makes it: take a backup from before that was changed"
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
    names.sort();
    Ok(names)
}
