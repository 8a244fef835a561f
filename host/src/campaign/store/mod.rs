//! The campaign file: one SQLite file that holds everything, and is never left in an inconsistent
//! state.
//!
//! It uses WAL with `synchronous=FULL` while it is written: once [`Store::insert`] returns, the
//! record survives a power cut. Raw records are append-only (triggers refuse changes). Others may
//! read while one process writes; a second writer is refused, and so is a network share. A properly
//! closed file is no longer in WAL mode: reading it creates no other files, even on read-only
//! media. The file holds everything that the analysis needs: plan with geometry, channels with
//! scales, every record with verdict and provenance.
//!
//! Each table's columns are declared once, with the `table!` macro of `table.rs`, next to the type
//! of its row: a new column is one new line there (and its value where the row is constructed). A
//! new table is a new `*_table.rs` and a line in `schema.rs`. The rows are: `record_row.rs`
//! (records and their seals), `overrules.rs`, `cell_table.rs`, `session_table.rs` (sessions,
//! channels, sensors), `level_table.rs`, `frf_table.rs`, `notes.rs` (plans, log).

mod backup;
pub mod calibration_table;
pub mod cell_table;
mod chain;
pub mod codec;
pub mod error;
pub mod frf_table;
mod identity;
pub mod level_table;
mod lock;
pub mod notes;
pub mod overrules;
mod own_schema;
pub mod record_row;
mod record_table;
mod replan;
mod row_seal;
pub mod rows;
mod schema;
pub mod session_table;
mod share;
pub mod simulated;
pub mod stored;
pub mod sync_table;
mod table;
pub mod temperature_table;
pub mod verify;

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, OpenFlags, Row};

use error::{StoreError, sqlite};
use identity::Identity;
use lock::WriteLock;

/// Identifies a campaign file (`JRIG`).
const APPLICATION_ID: i32 = i32::from_be_bytes(*b"JRIG");

/// Version of the tables (`schema.rs`), in SQLite's `user_version`.
const VERSION: i32 = 2;

/// The oldest version that can be read: without the chain.
const OLDEST: i32 = 1;

/// How long to wait for another process's lock on the file.
const PATIENCE: Duration = Duration::from_secs(5);

/// An open campaign file.
#[derive(Debug)]
pub struct Store {
    connection: Connection,
    path: PathBuf,
    /// Held as long as the file is open for writing; released after the connection is closed.
    lock: Option<WriteLock>,
    /// Whether everything has been written into the one file.
    tidy: bool,
    /// Rows written over the connection.
    watch: chain::Watch,
    /// Identity of the file when it was opened for writing.
    identity: Option<Identity>,
}

impl Store {
    /// Creates a new, empty file, open for writing.
    fn empty(path: &Path) -> Result<Self, StoreError> {
        if path.exists() {
            return Err(StoreError::Exists { path: path.into() });
        }
        share::refuse(path)?;
        let lock = Some(WriteLock::take(path)?);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let mut connection =
            Connection::open_with_flags(path, flags).map_err(|error| sqlite(path, "creating", error))?;
        let watch = chain::Watch::new(&mut connection).map_err(|error| sqlite(path, "creating", error))?;
        let mut store = Self { connection, path: path.into(), lock, tidy: false, watch, identity: None };
        store.begin_writing()?;
        store.identity = Some(Identity::of(path));
        Ok(store)
    }

    /// Opens a campaign file to continue it.
    ///
    /// # Errors
    /// It does not exist, is not a campaign file, has another version, is in use, is on a network
    /// share, or cannot be written.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        error::refuse_what_is_no_file(path)?;
        share::refuse(path)?;
        let lock = WriteLock::take(path)?;
        let mut store = Self::connect(path, path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
        (store.lock, store.tidy) = (Some(lock), false);
        store.identity = Some(Identity::of(path));
        store.begin_writing()?;
        store.bring_up().map_err(store.failed("bringing the file up to date"))?;
        store.mark_written()?;
        Ok(store)
    }

    /// Opens a campaign file to read it; another program may be writing it, and its folder may be
    /// read-only.
    ///
    /// # Errors
    /// It does not exist, is not a campaign file or has another version; or it was not closed
    /// properly and cannot be recovered in place.
    pub fn open_read_only(path: &Path) -> Result<Self, StoreError> {
        error::refuse_what_is_no_file(path)?;
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY;
        let waiting = has_log(path);
        let opened = Self::connect(path, path, flags).or_else(|error| match error {
            StoreError::Sqlite { .. } if waiting => Err(StoreError::Unfinished { path: path.into() }),
            // if no shared memory can be created, no process can be writing either
            StoreError::Sqlite { .. } => {
                let plain = path.display().to_string();
                let escaped = plain.replace('%', "%25").replace('?', "%3f").replace('#', "%23");
                let name = PathBuf::from(format!("file:{escaped}?immutable=1"));
                Self::connect(path, &name, flags | OpenFlags::SQLITE_OPEN_URI)
            }
            other => Err(other),
        });
        if let Ok(store) = &opened
            && let Some(what) = store.lacks_its_log()?
        {
            log::warn!("{}: {what}", path.display());
        }
        opened
    }

    fn connect(path: &Path, name: &Path, flags: OpenFlags) -> Result<Self, StoreError> {
        let open = |error| match error {
            rusqlite::Error::SqliteFailure(failure, _) if failure.code == ErrorCode::NotADatabase => {
                StoreError::Foreign { path: path.into() }
            }
            other => sqlite(path, "opening", other),
        };
        let mut connection = Connection::open_with_flags(name, flags).map_err(open)?;
        connection.busy_timeout(PATIENCE).map_err(open)?;
        let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i32>(0));
        if number("application_id").map_err(open)? != APPLICATION_ID {
            return Err(StoreError::Foreign { path: path.into() });
        }
        let found = number("user_version").map_err(open)?;
        if found > VERSION {
            return Err(StoreError::Newer { path: path.into(), found, known: VERSION });
        }
        if found < OLDEST {
            return Err(StoreError::Older { path: path.into(), found, known: OLDEST });
        }
        connection.pragma_update(None, "trusted_schema", false).map_err(open)?;
        // otherwise SQLite prepares the query plan again for each record
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_QPSG, true).map_err(open)?;
        if let Some(what) = own_schema::strange(&connection).map_err(open)? {
            return Err(StoreError::Content {
                path: path.into(),
                what: format!("{what}. Nothing of it is read"),
            });
        }
        let watch = chain::Watch::new(&mut connection).map_err(open)?;
        Ok(Self { connection, path: path.into(), lock: None, tidy: true, watch, identity: None })
    }

    /// Writes in one transaction, and adds every row that it touches to the chain.
    fn change<T>(
        &self,
        doing: &'static str,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        let write = || {
            let transaction = self.connection.unchecked_transaction()?;
            self.watch.begin();
            let done = work(&transaction)?;
            self.watch.extend(&transaction)?;
            transaction.commit()?;
            Ok(done)
        };
        let done = write().map_err(self.failed(doing))?;
        self.still_there()?;
        Ok(done)
    }

    /// Fails if the open file no longer has its name, so that no record is reported as stored
    /// without being in that file. The open file's content is copied next to it, if that is still
    /// possible.
    fn still_there(&self) -> Result<(), StoreError> {
        // a new file has no log before its first transaction has ended
        let Some(what) = self.identity.as_ref().and_then(Identity::lost) else { return Ok(()) };
        let to = rescued(&self.path);
        let rescue = match self.back_up(&to) {
            Ok(records) => {
                format!("all that was measured ({records} records) was copied to {}", to.display())
            }
            // the log was emptied while being read: only the content of the file itself is left
            Err(error) => match std::fs::copy(&self.path, &to) {
                Ok(_) => format!("what stood in the file without its log was copied to {}", to.display()),
                Err(_) => format!("and what it held could not be copied ({error})"),
            },
        };
        Err(StoreError::Gone { path: self.path.clone(), what, rescue })
    }

    fn begin_writing(&self) -> Result<(), StoreError> {
        let set = || {
            self.connection.busy_timeout(PATIENCE)?;
            self.connection.pragma_update(None, "journal_mode", "WAL")?;
            self.connection.pragma_update(None, "synchronous", "FULL")?;
            // checkpoint after every record, so that nothing is lost if the log is emptied or
            // removed
            self.connection.pragma_update(None, "wal_autocheckpoint", 1)?;
            self.connection.pragma_update(None, "foreign_keys", true)
        };
        set().map_err(|error| sqlite(&self.path, "opening for writing", error))
    }

    fn failed(&self, doing: &'static str) -> impl Fn(rusqlite::Error) -> StoreError + '_ {
        move |error| sqlite(&self.path, doing, error)
    }

    pub(in crate::campaign) fn content(&self, what: String) -> StoreError {
        StoreError::Content { path: self.path.clone(), what }
    }

    /// The file's path.
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

    /// Notes in the file itself that it is being written: a copy without its log can then be
    /// recognised as incomplete.
    fn mark_written(&self) -> Result<(), StoreError> {
        self.set_meta(WRITTEN, &notes::utc_now())?;
        self.connection
            .query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |_| Ok(()))
            .map_err(self.failed("opening for writing"))
    }

    /// Error message if the file was copied while it was being written, without its log.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn lacks_its_log(&self) -> Result<Option<String>, StoreError> {
        if self.lock.is_some() || has_log(&self.path) {
            return Ok(None);
        }
        Ok(self.meta(WRITTEN)?.map(|since| {
            let log = log_of(&self.path);
            format!(
                "it was being written (since {since}), and its log {} is not beside it: if this is a copy, the last records are \
                 missing. Copy the log too, or use `jointrig campaign backup`, which copies a campaign that runs",
                log.display()
            )
        }))
    }

    /// Writes everything into the one file and closes it.
    pub fn close(mut self) -> Result<(), StoreError> {
        self.put_in_order()
    }

    fn put_in_order(&mut self) -> Result<(), StoreError> {
        if self.tidy {
            return Ok(());
        }
        self.tidy = true;
        let failed = self.failed("closing");
        self.connection.execute("DELETE FROM meta WHERE key = ?1", [WRITTEN]).map_err(&failed)?;
        self.connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(())).map_err(&failed)?;
        // a reader keeps it in WAL mode, which is just as safe; the next writer's close ends it
        if let Err(error) = self.connection.pragma_update(None, "journal_mode", "DELETE") {
            log::debug!("{}: still in WAL mode: {error}", self.path.display());
        }
        Ok(())
    }
}

impl Drop for Store {
    /// After an early return, the file is closed properly as well, as far as the disk permits.
    fn drop(&mut self) {
        if let Err(error) = self.put_in_order() {
            log::debug!("{error}");
        }
    }
}

/// Key of the note that the file is being written, and since when.
const WRITTEN: &str = "written_since";

/// Whether a non-empty log exists next to the file.
fn has_log(path: &Path) -> bool {
    std::fs::metadata(log_of(path)).is_ok_and(|log| log.len() > 0)
}

/// SQLite's write-ahead log of a file.
fn log_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    name.into()
}

/// Where the content of a file that lost its name is copied: next to it, under an unused name.
fn rescued(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let named = |number: u32| path.with_file_name(format!("{stem}-rescued-{number}.jrig"));
    (1..1000).map(named).find(|name| !name.exists()).unwrap_or_else(|| named(0))
}
