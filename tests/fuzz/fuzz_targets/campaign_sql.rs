//! A campaign file that was edited by SQL. The input is a list of statements, eight bytes each: the
//! operation, the table, column and row, and the value; statements that SQLite refuses are skipped.
#![no_main]

mod base_campaign;

use base_campaign::base;
use libfuzzer_sys::fuzz_target;
use rusqlite::Connection;

const VANDALS: &str = "PRAGMA foreign_keys = OFF; PRAGMA recursive_triggers = OFF; PRAGMA journal_mode = DELETE;";

fn names(connection: &Connection, sql: &str) -> Vec<String> {
    let Ok(mut statement) = connection.prepare(sql) else { return Vec::new() };
    statement.query_map([], |row| row.get(0)).map(|rows| rows.flatten().collect()).unwrap_or_default()
}

fn one(of: &[String], byte: u8) -> Option<&String> {
    of.get(usize::from(byte) % of.len().max(1))
}

fn statement(connection: &Connection, edit: &[u8]) -> Option<String> {
    let tables = names(connection, "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY name");
    let table = one(&tables, edit[1])?;
    let columns = names(connection, &format!("SELECT name FROM pragma_table_info('{table}')"));
    let column = one(&columns, edit[2])?;
    let rows = names(connection, &format!("SELECT CAST(rowid AS TEXT) FROM {table}"));
    let row = one(&rows, edit[3]).cloned().unwrap_or_else(|| "1".into());
    let (small, large) = (i64::from(edit[5].cast_signed()), i64::from_le_bytes([edit[4], edit[5], edit[6], edit[7], edit[5], 0, edit[4], edit[6]]));
    let value = match edit[6] % 12 {
        0 => "NULL".into(),
        1 => small.to_string(),
        2 => large.to_string(),
        3 => format!("{:e}", f64::from_bits(large.cast_unsigned())).replace("inf", "9e999").replace("NaN", "NULL"),
        4 => "-9223372036854775808".into(),
        5 => format!("zeroblob({})", u32::from(edit[7]) * 257),
        6 => format!("{column} || '{}'", char::from(edit[7] % 94 + 33)).replace("'''", "''''"),
        7 => format!("{column} * 1.01"),
        8 => format!("{column} + {small}"),
        9 => format!("replace({column}, '{}', '{}')", edit[4] % 10, edit[7] % 10),
        10 => format!("substr({column}, {})", edit[7]),
        _ => format!("'{}'", "9".repeat(edit[7].into())),
    };
    Some(match edit[0] % 16 {
        0..=7 => format!("UPDATE {table} SET {column} = {value} WHERE rowid = {row}"),
        8 => format!("DELETE FROM {table} WHERE rowid = {row}"),
        9 => format!("INSERT OR REPLACE INTO {table} SELECT * FROM {table} WHERE rowid = {row}"),
        10 => {
            let triggers = names(connection, "SELECT name FROM sqlite_schema WHERE type = 'trigger' ORDER BY name");
            format!("DROP TRIGGER {}", one(&triggers, edit[2])?)
        }
        11 => format!("PRAGMA user_version = {small}"),
        12 => format!("DELETE FROM {table}"),
        13 => format!("ALTER TABLE {table} RENAME TO old; CREATE VIEW {table} AS SELECT * FROM old"),
        14 => format!("DROP TABLE {table}"),
        _ => format!("UPDATE {table} SET rowid = {small} WHERE rowid = {row}"),
    })
}

fuzz_target!(|edits: &[u8]| {
    let base = base();
    let path = base.copy(&base.bytes);
    let connection = Connection::open(&path).expect("the base is sound");
    connection.execute_batch(VANDALS).expect("the base is sound");
    // triggers that prevent a statement are dropped in any case: they would not protect the file
    // for long
    for trigger in names(&connection, "SELECT name FROM sqlite_schema WHERE type = 'trigger'") {
        if edits.len() % 2 == 0 {
            let _ = connection.execute_batch(&format!("DROP TRIGGER {trigger}"));
        }
    }
    let mut done = Vec::new();
    for edit in edits.chunks_exact(8).take(8) {
        let Some(sql) = statement(&connection, edit) else { continue };
        if connection.execute_batch(&sql).is_ok() {
            done.push(sql);
        }
    }
    drop(connection);
    base.hold(&path, &done);
});
