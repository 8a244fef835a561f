//! The campaign file: one SQLite file that holds everything, and is never left in an unclear state.
//!
//! WAL with `synchronous=FULL` while it is written: once [`Store::insert`] returns, the record survives a power cut. Raw
//! records are append-only (triggers refuse changes). Others may read while one writes; a second writer is refused, and so is a
//! network share. A file that was closed in order is in no WAL mode any more: reading it leaves nothing beside it, even from
//! read-only media. All that analysis needs is in the file: plan with geometry, channels with scales, every record with
//! verdict and provenance.

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, OpenFlags, OptionalExtension, Row, params};

use super::lock::WriteLock;
use super::plan::{Cell, Plan, configuration_name, configuration_named};
use super::rows::CellRow;
use super::schema;
use super::share;
use super::store_error::{StoreError, sqlite};

/// How long to wait for another process's lock on the file.
const PATIENCE: Duration = Duration::from_secs(5);

/// Columns of a cell, in the order of the tables.
type CellColumns = (i64, String, String, String, u32, Option<String>, Option<String>);

/// An open campaign file.
#[derive(Debug)]
pub struct Store {
    pub(super) connection: Connection,
    pub(super) path: PathBuf,
    /// Of its tables, as long as they are not brought up.
    pub(super) version: i32,
    /// Held as long as it is open for writing; let go after the connection.
    lock: Option<WriteLock>,
}

/// Now, as it stands in the file: RFC 3339, UTC.
pub fn utc_now() -> String {
    jiff::Timestamp::now().to_string()
}

impl Store {
    /// Creates a campaign file for the plan in `text`, which errors call `source`.
    ///
    /// # Errors
    /// The file exists, cannot be written, or the plan is wrong.
    pub fn create(path: &Path, text: &str, source: &str) -> Result<Self, StoreError> {
        let plan = Plan::parse(text, source)?;
        if path.exists() {
            return Err(StoreError::Exists { path: path.into() });
        }
        share::refuse(path)?;
        let lock = Some(WriteLock::take(path)?);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let connection =
            Connection::open_with_flags(path, flags).map_err(|error| sqlite(path, "creating", error))?;
        let mut store = Self { connection, path: path.into(), version: schema::VERSION, lock };
        store.begin_writing()?;
        store.fill(&plan, text, source).map_err(|error| sqlite(path, "creating", error))?;
        Ok(store)
    }

    fn fill(&mut self, plan: &Plan, text: &str, source: &str) -> rusqlite::Result<()> {
        let transaction = self.connection.transaction()?;
        transaction.pragma_update(None, "application_id", schema::APPLICATION_ID)?;
        for step in schema::STEPS {
            transaction.execute_batch(step)?;
        }
        transaction.pragma_update(None, "user_version", schema::VERSION)?;
        transaction.execute(
            "INSERT INTO plan (utc, source, text) VALUES (?1, ?2, ?3)",
            params![utc_now(), source, text],
        )?;
        transaction
            .execute("INSERT INTO meta VALUES ('software_version', ?1)", [env!("CARGO_PKG_VERSION")])?;
        for cell in plan.cells() {
            transaction.execute(
                "INSERT INTO cells (configuration, impact, response, wanted) VALUES (?1, ?2, ?3, ?4)",
                params![configuration_name(cell.configuration), cell.impact, cell.response, cell.wanted],
            )?;
        }
        transaction.commit()
    }

    /// Opens a campaign file to continue it; one of an older version is brought up.
    ///
    /// # Errors
    /// It is not there, not ours, too new, in use, on a network share, or cannot be written.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing { path: path.into() });
        }
        share::refuse(path)?;
        let lock = WriteLock::take(path)?;
        let mut store = Self::connect(path, path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
        store.lock = Some(lock);
        store.begin_writing()?;
        store.bring_up().map_err(|error| sqlite(path, "bringing it up to this version", error))?;
        Ok(store)
    }

    /// Opens a campaign file to read it; another program may be writing it, and its folder may be
    /// read-only.
    ///
    /// # Errors
    /// It is not there, not ours or too new; it was not closed in order and cannot be recovered where it is.
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
        if number("application_id").map_err(open)? != schema::APPLICATION_ID {
            return Err(StoreError::Foreign { path: path.into() });
        }
        let version = number("user_version").map_err(open)?;
        if version > schema::VERSION {
            return Err(StoreError::Newer { path: path.into(), found: version, known: schema::VERSION });
        }
        Ok(Self { connection, path: path.into(), version, lock: None })
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

    pub(super) fn failed(&self, doing: &'static str) -> impl Fn(rusqlite::Error) -> StoreError + '_ {
        move |error| sqlite(&self.path, doing, error)
    }

    pub(super) fn content(&self, what: String) -> StoreError {
        StoreError::Content { path: self.path.clone(), what }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The plan.
    pub fn plan(&self) -> Result<Plan, StoreError> {
        let (text, source) = self.plan_text()?;
        Ok(Plan::parse(&text, &source)?)
    }

    /// The plan's text and the name of the file that it came from.
    pub fn plan_text(&self) -> Result<(String, String), StoreError> {
        self.connection
            .query_row("SELECT text, source FROM plan ORDER BY id DESC LIMIT 1", [], |row| {
                Ok((row.get(0)?, row.get(1)?))
            })
            .map_err(self.failed("reading the plan"))
    }

    /// A note on the whole campaign.
    pub fn meta(&self, key: &str) -> Result<Option<String>, StoreError> {
        self.connection
            .query_row("SELECT value FROM meta WHERE key = ?1", [key], |row| row.get(0))
            .optional()
            .map_err(self.failed("reading notes"))
    }

    /// Writes a note on the whole campaign.
    pub fn set_meta(&self, key: &str, value: &str) -> Result<(), StoreError> {
        self.connection
            .execute("INSERT OR REPLACE INTO meta VALUES (?1, ?2)", [key, value])
            .map(|_| ())
            .map_err(self.failed("writing notes"))
    }

    /// Adds a line to the campaign's log.
    pub fn log(&self, text: &str) -> Result<(), StoreError> {
        self.connection
            .execute("INSERT INTO log (utc, text) VALUES (?1, ?2)", params![utc_now(), text])
            .map(|_| ())
            .map_err(self.failed("writing the log"))
    }

    /// Every cell, in the order of the plan.
    pub fn cells(&self) -> Result<Vec<CellRow>, StoreError> {
        let settled = if self.version > 1 { "settled" } else { "NULL" };
        let sql = format!(
            "SELECT id, configuration, impact, response, wanted, given_up, {settled} FROM cells ORDER BY id"
        );
        let read = |row: &Row<'_>| {
            let configuration: String = row.get(1)?;
            Ok((row.get(0)?, configuration, row.get(2)?, row.get(3)?, row.get(4)?, row.get(5)?, row.get(6)?))
        };
        let rows: Vec<CellColumns> = self.all(&sql, [], read, "reading cells")?;
        rows.into_iter()
            .map(|(id, configuration, impact, response, wanted, given_up, settled)| {
                let configuration = configuration_named(&configuration)
                    .ok_or_else(|| self.content(format!("cell {id} has no known configuration")))?;
                Ok(CellRow { id, cell: Cell { configuration, impact, response, wanted }, given_up, settled })
            })
            .collect()
    }

    pub(super) fn all<T, P: rusqlite::Params>(
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
