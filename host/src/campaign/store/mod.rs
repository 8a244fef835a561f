//! The campaign file: one SQLite file that holds everything, and is never left in an unclear state.
//!
//! WAL with `synchronous=FULL` while it is written: once [`Store::insert`] returns, the record survives a power cut. Raw
//! records are append-only (triggers refuse changes). Others may read while one writes; a second writer is refused, and so is a
//! network share. A file that was closed in order is in no WAL mode any more: reading it leaves nothing beside it, even from
//! read-only media. All that analysis needs is in the file: plan with geometry, channels with scales, every record with
//! verdict and provenance.
//!
//! Each table's columns stand once, in `table.rs`, beside the type of its row: a new column is one new line there (and its value where
//! the row is made). A new table is a new `*_table.rs` and a line in `schema.rs`. The rows are: `record_row.rs` (records and their seals),
//! `overrules.rs`, `cell_table.rs`, `session_table.rs` (sessions, channels, sensors), `level_table.rs`, `frf_table.rs`, `notes.rs` (plans, log).

mod backup;
pub mod calibration_table;
pub mod cell_table;
pub mod codec;
pub mod error;
pub mod frf_table;
pub mod level_table;
mod lock;
pub mod notes;
pub mod overrules;
pub mod record_row;
mod record_table;
mod replan;
mod row_seal;
mod schema;
pub mod session_table;
mod share;
pub mod simulated;
pub mod stored;
mod table;
pub mod temperature_table;
pub mod verify;

use std::cmp::Ordering;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, OpenFlags, Row};

use error::{StoreError, sqlite};
use lock::WriteLock;

/// Marks the file as ours (`JRIG`).
const APPLICATION_ID: i32 = i32::from_be_bytes(*b"JRIG");

/// Version of the tables (`schema.rs`), in SQLite's `user_version`.
const VERSION: i32 = 1;

/// How long to wait for another process's lock on the file.
const PATIENCE: Duration = Duration::from_secs(5);

/// An open campaign file.
#[derive(Debug)]
pub struct Store {
    connection: Connection,
    path: PathBuf,
    /// Held as long as it is open for writing; let go after the connection.
    lock: Option<WriteLock>,
}

impl Store {
    /// A new, empty file, open for writing.
    fn empty(path: &Path) -> Result<Self, StoreError> {
        if path.exists() {
            return Err(StoreError::Exists { path: path.into() });
        }
        share::refuse(path)?;
        let lock = Some(WriteLock::take(path)?);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let connection =
            Connection::open_with_flags(path, flags).map_err(|error| sqlite(path, "creating", error))?;
        let store = Self { connection, path: path.into(), lock };
        store.begin_writing()?;
        Ok(store)
    }

    /// Opens a campaign file to continue it.
    ///
    /// # Errors
    /// It is not there, not ours, of another version, in use, on a network share, or cannot be written.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing { path: path.into() });
        }
        share::refuse(path)?;
        let lock = WriteLock::take(path)?;
        let mut store = Self::connect(path, path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
        store.lock = Some(lock);
        store.begin_writing()?;
        Ok(store)
    }

    /// Opens a campaign file to read it; another program may be writing it, and its folder may be
    /// read-only.
    ///
    /// # Errors
    /// It is not there, not ours or of another version; it was not closed in order and cannot be recovered where it is.
    pub fn open_read_only(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing { path: path.into() });
        }
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY;
        let waiting = std::fs::metadata(log_of(path)).is_ok_and(|log| log.len() > 0);
        Self::connect(path, path, flags).or_else(|error| match error {
            StoreError::Sqlite { .. } if waiting => Err(StoreError::Unfinished { path: path.into() }),
            // where no shared memory can be created, nobody can be writing either
            StoreError::Sqlite { .. } => {
                let plain = path.display().to_string();
                let escaped = plain.replace('%', "%25").replace('?', "%3f").replace('#', "%23");
                let name = PathBuf::from(format!("file:{escaped}?immutable=1"));
                Self::connect(path, &name, flags | OpenFlags::SQLITE_OPEN_URI)
            }
            other => Err(other),
        })
    }

    fn connect(path: &Path, name: &Path, flags: OpenFlags) -> Result<Self, StoreError> {
        let open = |error| match error {
            rusqlite::Error::SqliteFailure(failure, _) if failure.code == ErrorCode::NotADatabase => {
                StoreError::Foreign { path: path.into() }
            }
            other => sqlite(path, "opening", other),
        };
        let connection = Connection::open_with_flags(name, flags).map_err(open)?;
        connection.busy_timeout(PATIENCE).map_err(open)?;
        let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i32>(0));
        if number("application_id").map_err(open)? != APPLICATION_ID {
            return Err(StoreError::Foreign { path: path.into() });
        }
        let found = number("user_version").map_err(open)?;
        match found.cmp(&VERSION) {
            Ordering::Greater => Err(StoreError::Newer { path: path.into(), found, known: VERSION }),
            Ordering::Less => Err(StoreError::Older { path: path.into(), found, known: VERSION }),
            Ordering::Equal => Ok(Self { connection, path: path.into(), lock: None }),
        }
    }

    fn begin_writing(&self) -> Result<(), StoreError> {
        let set = || {
            self.connection.busy_timeout(PATIENCE)?;
            self.connection.pragma_update(None, "journal_mode", "WAL")?;
            self.connection.pragma_update(None, "synchronous", "FULL")?;
            self.connection.pragma_update(None, "foreign_keys", true)
        };
        set().map_err(|error| sqlite(&self.path, "opening for writing", error))
    }

    fn failed(&self, doing: &'static str) -> impl Fn(rusqlite::Error) -> StoreError + '_ {
        move |error| sqlite(&self.path, doing, error)
    }

    fn content(&self, what: String) -> StoreError {
        StoreError::Content { path: self.path.clone(), what }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn all<T, P: rusqlite::Params>(
        &self,
        sql: &str,
        params: P,
        read: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
        doing: &'static str,
    ) -> Result<Vec<T>, StoreError> {
        let run = || {
            let mut statement = self.connection.prepare_cached(sql)?;
            statement.query_map(params, read)?.collect::<rusqlite::Result<Vec<T>>>()
        };
        run().map_err(self.failed(doing))
    }

    /// Writes everything into the one file and closes it.
    pub fn close(self) -> Result<(), StoreError> {
        let Self { connection, path, lock, .. } = self;
        if lock.is_some() {
            connection
                .query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))
                .map_err(|error| sqlite(&path, "closing", error))?;
            // somebody who reads keeps it in WAL mode, in which it is as safe: the next writer's close will do
            if let Err(error) = connection.pragma_update(None, "journal_mode", "DELETE") {
                log::debug!("{}: still in WAL mode: {error}", path.display());
            }
        }
        connection.close().map_err(|(_, error)| sqlite(&path, "closing", error))
    }
}

/// SQLite's write-ahead log of a file.
fn log_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    name.into()
}
