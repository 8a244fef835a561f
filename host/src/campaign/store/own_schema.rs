//! Whether a file's tables, triggers and indices are those that jointrig makes, and no others: asked before anything is read.
//!
//! A view that never ends, or a trigger that does more than refuse, would otherwise act with the first SELECT.

use std::collections::HashMap;
use std::sync::OnceLock;

use rusqlite::Connection;

use super::{schema, sync_table};

/// What stands in the schema under a name: its kind and its SQL.
type Objects = HashMap<String, (String, String)>;

fn objects(connection: &Connection) -> rusqlite::Result<Objects> {
    // what SQLite makes by itself for UNIQUE and PRIMARY KEY has no SQL
    let mut statement = connection
        .prepare("SELECT name, type, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite!_%' ESCAPE '!'")?;
    let read = |row: &rusqlite::Row<'_>| {
        let sql: Option<String> = row.get(2)?;
        Ok((row.get(0)?, (row.get(1)?, sql.unwrap_or_default())))
    };
    statement.query_map([], read)?.collect()
}

/// What jointrig makes. Asked for at every opening, so made once.
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

/// What is in the schema that jointrig does not put there, or puts there otherwise; none where all is ours.
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

/// What jointrig puts into the schema and is not there. A file of version 1 may lack what came later.
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
    // made when they are needed
    names.retain(|name| !["clocks", "edges"].contains(&name.as_str()));
    names.sort();
    Ok(names)
}
