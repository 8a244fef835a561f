//! The chain: every row that was ever stored, changed or removed, in order, each entry sealed
//! together with the previous one.
//!
//! A record's own seal reveals a damaged record. It does not reveal a changed scale, a plan with
//! other limits, a forged verdict or a missing record. Therefore every write adds an entry for each
//! row that it touched, in the same transaction: the table, the row's key, and SHA-256 over all its
//! columns; and SHA-256 over that and the previous entry. The rows touched are those that SQLite
//! reports for the transaction, so no writer can omit one. `verify` compares every row with its
//! newest entry.
//!
//! It reveals what was changed, added or removed outside jointrig, by a damaged disk or manually.
//! It is not a signature: anybody who knows this file can write a new chain.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rusqlite::hooks::Action;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OptionalExtension, Row, params};
use sha2::{Digest, Sha256};

use super::{WRITTEN, row_seal};

/// Tables of the chain itself.
pub(super) const TABLES: &str = "
CREATE TABLE chain (
    id INTEGER PRIMARY KEY,
    in_table TEXT NOT NULL,
    row_key TEXT NOT NULL,
    digest BLOB,
    link BLOB NOT NULL
) STRICT;
CREATE TABLE chain_head (id INTEGER PRIMARY KEY CHECK (id = 1), entries INTEGER NOT NULL, link BLOB NOT NULL) STRICT;
";

/// Names of these tables: they are not chained themselves.
pub(super) const OWN: [&str; 2] = ["chain", "chain_head"];

/// The rows that the current transaction has touched so far, by table and rowid.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch(Arc<Mutex<BTreeSet<(String, i64)>>>);

impl Watch {
    /// Watches all writes over this connection.
    pub(super) fn new(connection: &mut Connection) -> rusqlite::Result<Self> {
        let watch = Self::default();
        let seen = watch.clone();
        connection.update_hook(Some(move |_: Action, _: &str, table: &str, rowid| {
            if !OWN.contains(&table) {
                seen.touched().insert((table.to_owned(), rowid));
            }
        }))?;
        Ok(watch)
    }

    fn touched(&self) -> MutexGuard<'_, BTreeSet<(String, i64)>> {
        // the set stays valid even after a poisoned lock
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Discards the rows touched by an earlier transaction, which was rolled back.
    pub(super) fn begin(&self) {
        self.touched().clear();
    }

    /// Adds the entries of the rows touched since [`Watch::begin`].
    pub(super) fn extend(&self, connection: &Connection) -> rusqlite::Result<()> {
        // a row that was touched twice has one final state
        let touched = std::mem::take(&mut *self.touched());
        let mut entries = Vec::new();
        for (table, rowid) in touched {
            match read(connection, &table, rowid)? {
                Some((key, _)) if table == "meta" && key == WRITTEN => {}
                Some((key, digest)) => entries.push((table, key, Some(digest))),
                // the only row ever removed from `meta` is the note that the file is being written
                None if table == "meta" => {}
                None => entries.push((table, rowid.to_string(), None)),
            }
        }
        append(connection, &entries)
    }
}

/// A row's key and digest; `None` if the row no longer exists.
fn read(connection: &Connection, table: &str, rowid: i64) -> rusqlite::Result<Option<(String, [u8; 32])>> {
    let keys = keys(connection, table)?;
    let sql = format!("SELECT * FROM \"{table}\" WHERE rowid = ?1");
    connection
        .prepare_cached(&sql)?
        .query_row([rowid], |row| Ok((key_of(row, &keys)?, digest(row)?)))
        .optional()
}

/// Indices of the columns of a table's primary key.
fn keys(connection: &Connection, table: &str) -> rusqlite::Result<Vec<usize>> {
    let mut statement =
        connection.prepare_cached("SELECT cid FROM pragma_table_info(?1) WHERE pk > 0 ORDER BY pk")?;
    statement.query_map([table], |row| row.get(0))?.collect()
}

fn key_of(row: &Row<'_>, keys: &[usize]) -> rusqlite::Result<String> {
    let one = |place: &usize| {
        Ok(match row.get_ref(*place)? {
            ValueRef::Integer(number) => number.to_string(),
            ValueRef::Text(text) => String::from_utf8_lossy(text).into_owned(),
            other => format!("{other:?}"),
        })
    };
    Ok(keys.iter().map(one).collect::<rusqlite::Result<Vec<_>>>()?.join("/"))
}

/// SHA-256 over all columns of a row, each with its type and length; a null in a column that older
/// files lack contributes nothing.
fn digest(row: &Row<'_>) -> rusqlite::Result<[u8; 32]> {
    let mut hasher = Sha256::new();
    for (place, column) in row.as_ref().column_names().enumerate() {
        let value = row.get_ref(place)?;
        if row_seal::counts(column, value) {
            row_seal::each(value, |bytes| hasher.update(bytes));
        }
    }
    Ok(hasher.finalize().into())
}

/// An entry: table, key, and digest, or `None` if the row was removed.
type Entry = (String, String, Option<[u8; 32]>);

/// The chain's end: number of entries, and the last link.
fn head(connection: &Connection) -> rusqlite::Result<(i64, Vec<u8>)> {
    let found = connection
        .query_row("SELECT entries, link FROM chain_head WHERE id = 1", [], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .optional()?;
    Ok(found.unwrap_or_default())
}

fn linked(before: &[u8], id: i64, (table, key, digest): &Entry) -> [u8; 32] {
    let mut hasher = Sha256::new();
    hasher.update(before);
    hasher.update(id.to_le_bytes());
    for text in [table, key] {
        hasher.update((text.len() as u64).to_le_bytes());
        hasher.update(text);
    }
    hasher.update(digest.map_or_else(Vec::new, Vec::from));
    hasher.finalize().into()
}

fn append(connection: &Connection, entries: &[Entry]) -> rusqlite::Result<()> {
    if entries.is_empty() {
        return Ok(());
    }
    let (mut count, mut link) = head(connection)?;
    let mut insert = connection.prepare_cached("INSERT INTO chain VALUES (?1, ?2, ?3, ?4, ?5)")?;
    for entry in entries {
        count += 1;
        link = linked(&link, count, entry).into();
        insert.execute(params![count, entry.0, entry.1, entry.2.map(Vec::from), link])?;
    }
    connection
        .prepare_cached("INSERT INTO chain_head VALUES (1, ?1, ?2) ON CONFLICT (id) DO UPDATE SET entries = ?1, link = ?2")?
        .execute(params![count, link])
        .map(|_| ())
}

/// Chains all existing rows, in a file from before the chain was introduced.
pub(super) fn begin(connection: &Connection) -> rusqlite::Result<()> {
    for table in tables(connection)? {
        let entries = rows(connection, &table)?;
        let all: Vec<Entry> =
            entries.into_iter().map(|(key, digest)| (table.clone(), key, Some(digest))).collect();
        append(connection, &all)?;
    }
    Ok(())
}

/// The tables whose rows are chained.
fn tables(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let sql = "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite!_%' ESCAPE '!' ORDER BY name";
    let mut statement = connection.prepare(sql)?;
    let all: Vec<String> = statement.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?;
    Ok(all.into_iter().filter(|name| !OWN.contains(&name.as_str())).collect())
}

/// Key and digest of every chained row of a table.
fn rows(connection: &Connection, table: &str) -> rusqlite::Result<Vec<(String, [u8; 32])>> {
    let keys = keys(connection, table)?;
    let mut statement = connection.prepare(&format!("SELECT * FROM \"{table}\""))?;
    let all = statement.query_map([], |row| Ok((key_of(row, &keys)?, digest(row)?)))?;
    let all: Vec<(String, [u8; 32])> = all.collect::<rusqlite::Result<_>>()?;
    Ok(all.into_iter().filter(|(key, _)| table != "meta" || key != WRITTEN).collect())
}

/// Table and key of every row, in the order in which they were first stored.
pub(super) fn history(connection: &Connection) -> rusqlite::Result<Vec<(String, String)>> {
    let sql = "SELECT in_table, row_key FROM chain GROUP BY in_table, row_key ORDER BY min(id)";
    connection.prepare(sql)?.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
}

/// A modification made outside jointrig.
pub(super) struct Behind {
    /// The row, by table and key; `None` if it is the chain itself.
    pub(super) row: Option<(String, String)>,
    /// Description.
    pub(super) what: String,
}

impl Behind {
    fn row(table: &str, key: &str, done: &str) -> Self {
        let what = format!("row {key} of `{table}` was {done} outside jointrig");
        Self { row: Some((table.to_owned(), key.to_owned())), what }
    }

    fn chain(what: String) -> Self {
        Self { row: None, what }
    }
}

/// Rows that were changed, added or removed outside jointrig.
///
/// # Errors
/// The chain or a table cannot be read.
pub(super) fn check(connection: &Connection) -> rusqlite::Result<Vec<Behind>> {
    let (mut wrong, mut newest) = (Vec::new(), HashMap::<(String, String), Option<Vec<u8>>>::new());
    let (mut link, mut count) = (Vec::new(), 0);
    {
        let mut statement =
            connection.prepare("SELECT id, in_table, row_key, digest, link FROM chain ORDER BY id")?;
        let mut entries = statement.query([])?;
        while let Some(row) = entries.next()? {
            let (id, table, key): (i64, String, String) = (row.get(0)?, row.get(1)?, row.get(2)?);
            let (digest, stored): (Option<Vec<u8>>, Vec<u8>) = (row.get(3)?, row.get(4)?);
            count += 1;
            let sealed = digest.as_deref().map(<[u8; 32]>::try_from).transpose().unwrap_or_default();
            let entry = (table, key, sealed);
            if id != count || linked(&link, id, &entry).as_slice() != stored {
                let what =
                    format!("the chain of rows is broken at entry {id}: an entry was changed or is missing");
                return Ok(vec![Behind::chain(what)]);
            }
            link = stored;
            newest.insert((entry.0, entry.1), digest);
        }
    }
    if head(connection)? != (count, link) {
        wrong.push(Behind::chain(
            "the chain of rows does not end where it did: its last entries are missing".into(),
        ));
    }
    for table in tables(connection)? {
        for (key, digest) in rows(connection, &table)? {
            match newest.remove(&(table.clone(), key.clone())) {
                Some(Some(known)) if known == digest => {}
                Some(Some(_)) => wrong.push(Behind::row(&table, &key, "changed")),
                Some(None) | None => wrong.push(Behind::row(&table, &key, "added")),
            }
        }
    }
    let mut gone: Vec<(String, String)> =
        newest.into_iter().filter(|(_, digest)| digest.is_some()).map(|(row, _)| row).collect();
    gone.sort();
    wrong.extend(gone.iter().map(|(table, key)| Behind::row(table, key, "removed")));
    Ok(wrong)
}

#[cfg(test)]
#[path = "chain_tests.rs"]
mod tests;
