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
//! new table is a new `*_table.rs` and a line in `schema.rs`. The rows are: `record_table.rs`
//! (records, their seals, overrules), `cell_table.rs`, `session_table.rs` (sessions,
//! channels, sensors), `level_table.rs`, `frf_table.rs`, `wear_table.rs` (blocks of cycles),
//! `notes.rs` (plans, log).
//!
//! Checks whether the open file is still the one with its name. A file that was replaced, removed
//! or emptied while it is open accepts every record without an error, but the records are lost.
//!
//! One writer at a time: a lock file next to the campaign file, held as long as the campaign file
//! is open for writing.
//!
//! SQLite would let two writers alternate; two campaigns in one file would then strike the same
//! cells. The operating system releases the lock when the process that holds it ends, for whatever
//! reason, so a leftover lock file does not block anybody.
//!
//! A name does not identify a file: symbolic links are resolved first, and a file with several hard
//! links is refused. Where a lock on the campaign file itself can coexist with SQLite's locks
//! (Linux), that lock is held too, so that removing the lock file does not admit a second writer.
//!
//! On Windows the open lock file is itself the lock: no other program can write, rename or remove
//! it, but all can read the holder's name in it. `LockFileEx` would forbid
//! reading too.
//!
//! Network shares: SQLite's write-ahead log needs memory shared between processes, which network
//! file systems do not provide. Linux names them in its mount table; on Windows a path that leads
//! to a server has a form of its own once mapped drives are resolved.
//!
//! A copy of a campaign file, taken even while the file is being written.
//!
//! Data about the simulated rig, if the device was simulated in the process that ran the campaign.
//!
//! Two notes of the file: the rig, and the result that an ideal measurement of it would give. The
//! runner writes them from the rig's parameters; nothing of them crosses the protocol, and no
//! estimator may read them.

use crate::device::transport::Simulated;
use error::{StoreError, sqlite};
use jointrig_protocol::answer::Info;
use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, OpenFlags, Row};
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fs::File;
#[cfg(not(windows))]
use std::fs::TryLockError;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

pub mod calibration_table;
pub mod cell_table;
mod chain;
pub mod codec;
pub mod copied;
pub mod error;
pub mod frf_table;
pub mod level_table;
pub mod notes;
pub mod record_table;
mod row_seal;
pub mod rows;
mod schema;
pub mod session_table;
pub mod stored;
mod table;
pub mod verify;
pub mod wear_table;
#[cfg(test)]
mod wide_samples_tests;

/// Identifies a campaign file (`JRIG`).
const APPLICATION_ID: i32 = i32::from_be_bytes(*b"JRIG");

/// Version of the tables (`schema.rs`), in SQLite's `user_version`.
const VERSION: i32 = 3;

/// The oldest version that can be read: without the chain. Version 2 has 16-bit codes only.
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
        refuse(path)?;
        let lock = Some(WriteLock::take(path)?);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let mut connection = connected(path, flags).map_err(|error| sqlite(path, "creating", error))?;
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
        refuse(path)?;
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
                let plain = for_sqlite(path).0.display().to_string();
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
        let mut connection = connected(name, flags).map_err(open)?;
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
        if let Some(what) = schema::strange(&connection).map_err(open)? {
            return Err(StoreError::Content {
                path: path.into(),
                what: format!("{what}. None of the file is read"),
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
                Ok(_) => format!("the file's content without its log was copied to {}", to.display()),
                Err(_) => format!("and its content could not be copied ({error})"),
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
                "it was being written (since {since}), and its log {} is not next to it: if this is a copy, the last records are \
                 missing. Copy the log too, or use `jointrig campaign backup`, which can copy a campaign while it runs",
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

/// Opens a file with SQLite.
fn connected(path: &Path, flags: OpenFlags) -> rusqlite::Result<Connection> {
    match for_sqlite(path) {
        (path, None) => Connection::open_with_flags(path, flags),
        (path, Some(long)) => Connection::open_with_flags_and_vfs(path, flags, long),
    }
}

/// The name under which SQLite opens a file, and the variant of its file access unless it is the
/// default.
#[cfg(not(windows))]
fn for_sqlite(path: &Path) -> (PathBuf, Option<&'static str>) {
    (path.into(), None)
}

/// Windows refuses paths of 260 characters or more, unless they have the verbatim form `\\?\C:\…`,
/// which SQLite passes on in its variant for long paths. SQLite appends `-journal` to the name.
#[cfg(windows)]
fn for_sqlite(path: &Path) -> (PathBuf, Option<&'static str>) {
    const LONGEST: usize = 260 - "-journal".len() - 1;
    let Ok(absolute) = std::path::absolute(path) else { return (path.into(), None) };
    if absolute.as_os_str().len() <= LONGEST {
        return (path.into(), None);
    }
    // only existing paths have a verbatim form, and a new file does not exist yet
    match (absolute.parent().map(Path::canonicalize), absolute.file_name()) {
        (Some(Ok(folder)), Some(name)) => (folder.join(name), Some("win32-longpath")),
        _ => (path.into(), None),
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

/// First four bytes of SQLite's log, by the byte order of its checksums (SQLite's file format,
/// 4.1).
const LOGS: [u32; 2] = [0x377f_0682, 0x377f_0683];

/// Identifies the file that was opened.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    path: PathBuf,
    file: Option<(u64, u64)>,
}

impl Identity {
    /// Identity of the file that has this name now.
    pub(super) fn of(path: &Path) -> Self {
        // SQLite follows a symbolic link, and places its log next to the target
        let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
        let file = number(&path).ok().flatten();
        Self { path, file }
    }

    /// What happened to the file or its log since; `None` if both are present. To be called after a
    /// transaction in WAL mode.
    pub(super) fn lost(&self) -> Option<String> {
        let Ok(now) = number(&self.path) else { return Some("it was removed or renamed".into()) };
        if self.file.is_some() && now != self.file {
            return Some("another file has its name now".into());
        }
        let log = log_of(&self.path);
        // a log that was emptied and then written to has a hole at its beginning
        let mut begins = [0; 4];
        match File::open(&log).and_then(|mut log| log.read_exact(&mut begins)) {
            Ok(()) if LOGS.contains(&u32::from_be_bytes(begins)) => None,
            _ => Some(format!("its log {} was removed or emptied", log.display())),
        }
    }
}

/// Device and inode, which tell files apart whatever their names.
///
/// # Errors
/// There is no such file.
#[cfg(unix)]
fn number(path: &Path) -> std::io::Result<Option<(u64, u64)>> {
    use std::os::unix::fs::MetadataExt;
    let file = std::fs::metadata(path)?;
    Ok(Some((file.dev(), file.ino())))
}

/// On Windows an open file can be neither removed nor replaced. If its drive is pulled out, and
/// another one gets the same letter, writing to the open file fails.
///
/// # Errors
/// There is no such file.
#[cfg(windows)]
fn number(path: &Path) -> std::io::Result<Option<(u64, u64)>> {
    std::fs::metadata(path).map(|_| None)
}

/// Number of attempts if the lock file disappears while it is being locked, or (on Windows) may be
/// open in a program that only looks at it, such as a virus scanner.
const TRIES: usize = 10;

/// Result of one attempt to lock.
enum Claim {
    /// Locked.
    Held(File),
    /// Locked by this process; whether it may be free in a moment, or the lock file is gone.
    Busy { holder: String, again: bool },
}

/// The lock; released when dropped.
#[derive(Debug)]
pub(super) struct WriteLock {
    /// `None` only while it is being dropped.
    file: Option<File>,
    path: PathBuf,
    /// The campaign file itself. It is closed after SQLite has closed it: closing it sooner would
    /// release SQLite's own locks.
    #[cfg(target_os = "linux")]
    itself: Option<File>,
}

impl WriteLock {
    /// Locks `campaign` for writing.
    ///
    /// # Errors
    /// Another process holds it ([`StoreError::Busy`] says which), or nothing can be written there.
    pub(super) fn take(campaign: &Path) -> Result<Self, StoreError> {
        let real = std::fs::canonicalize(campaign).unwrap_or_else(|_| campaign.into());
        refuse_second_names(&real)?;
        let path = beside(&real);
        let failed = |source| StoreError::Lock { path: campaign.into(), source };
        let mut holder = String::new();
        for _ in 0..TRIES {
            let mut file = match claimed(&path).map_err(failed)? {
                Claim::Held(file) => file,
                Claim::Busy { holder, again: false } => {
                    return Err(StoreError::Busy { path: campaign.into(), holder });
                }
                Claim::Busy { holder: now, again: true } => {
                    holder = now;
                    continue;
                }
            };
            let noted = file
                .set_len(0)
                .and_then(|()| file.rewind())
                .and_then(|()| write!(file, "process {}", std::process::id()));
            if let Err(error) = noted {
                log::debug!("{}: {error}", path.display());
            }
            #[cfg(target_os = "linux")]
            return Ok(Self { itself: lock_itself(&real)?, file: Some(file), path });
            #[cfg(not(target_os = "linux"))]
            return Ok(Self { file: Some(file), path });
        }
        Err(StoreError::Busy { path: campaign.into(), holder })
    }
}

/// Opens and locks a lock file.
#[cfg(not(windows))]
fn claimed(path: &Path) -> std::io::Result<Claim> {
    let mut file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
    match file.try_lock() {
        // its previous holder may have removed it after we opened and before we locked it
        Ok(()) if !still_there(&file, path) => Ok(Claim::Busy { holder: String::new(), again: true }),
        Ok(()) => Ok(Claim::Held(file)),
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            // optional: the holder only improves the message
            let _ = file.read_to_string(&mut holder);
            Ok(Claim::Busy { holder: holder.trim().into(), again: false })
        }
        Err(TryLockError::Error(source)) => Err(source),
    }
}

/// Opens a lock file so that no other program can write, rename or remove it. As long as it is open,
/// this fails in every other process, so no second call is needed to lock it.
#[cfg(windows)]
fn claimed(path: &Path) -> std::io::Result<Claim> {
    use std::os::windows::fs::OpenOptionsExt;

    const FILE_SHARE_READ: u32 = 1;
    const ERROR_SHARING_VIOLATION: i32 = 32;
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(false).share_mode(FILE_SHARE_READ);
    match options.open(path) {
        Ok(file) => Ok(Claim::Held(file)),
        Err(error) if error.raw_os_error() == Some(ERROR_SHARING_VIOLATION) => {
            // a virus scanner opens new files for a moment
            std::thread::sleep(Duration::from_millis(20));
            // optional: the holder only improves the message
            let holder = std::fs::read_to_string(path).unwrap_or_default();
            Ok(Claim::Busy { holder: holder.trim().into(), again: true })
        }
        Err(error) => Err(error),
    }
}

impl Drop for WriteLock {
    fn drop(&mut self) {
        let file = self.file.take();
        // Where the open file is the lock, it can only be removed once it is closed; if the next
        // writer has opened it by then, removing it fails.
        #[cfg(windows)]
        drop(file);
        // elsewhere it is removed while locked: a process that has it open checks for this
        let _ = std::fs::remove_file(&self.path);
        #[cfg(not(windows))]
        let _ = file.map(|file| file.unlock());
        #[cfg(target_os = "linux")]
        if let Some(itself) = &self.itself {
            let _ = itself.unlock();
        }
    }
}

/// Locks the campaign file, if it exists: a new one is protected by the lock file until it is
/// opened again.
#[cfg(target_os = "linux")]
fn lock_itself(campaign: &Path) -> Result<Option<File>, StoreError> {
    let Ok(file) = File::open(campaign) else { return Ok(None) };
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(StoreError::Busy { path: campaign.into(), holder: "its lock file was removed".into() })
        }
        // a file system without such locks relies on the lock file
        Ok(()) | Err(TryLockError::Error(_)) => Ok(Some(file)),
    }
}

/// Refuses a file with a second name: that would have a separate lock file.
#[cfg(unix)]
fn refuse_second_names(campaign: &Path) -> Result<(), StoreError> {
    use std::os::unix::fs::MetadataExt;
    match std::fs::metadata(campaign) {
        Ok(file) if file.nlink() > 1 => Err(StoreError::Links { path: campaign.into(), links: file.nlink() }),
        _ => Ok(()),
    }
}

#[cfg(windows)]
fn refuse_second_names(campaign: &Path) -> Result<(), StoreError> {
    match File::open(campaign).and_then(winapi_util::file::information) {
        Ok(file) if file.number_of_links() > 1 => {
            Err(StoreError::Links { path: campaign.into(), links: file.number_of_links() })
        }
        _ => Ok(()),
    }
}

fn beside(campaign: &Path) -> PathBuf {
    let mut name = campaign.file_name().map(OsString::from).unwrap_or_default();
    name.push("-lock");
    campaign.with_file_name(name)
}

#[cfg(unix)]
fn still_there(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(ours), Ok(there)) => (ours.dev(), ours.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

/// Network file systems, by their names in Linux's mount table; these may have the prefix `fuse.`.
#[cfg(any(unix, test))]
const NETWORK: [&str; 22] = [
    "9p",
    "afs",
    "afpfs",
    "ceph",
    "cifs",
    "coda",
    "davfs",
    "drvfs",
    "glusterfs",
    "gvfsd-fuse",
    "lustre",
    "ncpfs",
    "nfs",
    "nfs4",
    "ocfs2",
    "rclone",
    "s3fs",
    "smb2",
    "smb3",
    "smbfs",
    "sshfs",
    "virtiofs",
];

/// Refuses to write a campaign on a network share. A mapped drive (`Z:`) is resolved to its share.
#[cfg(windows)]
pub(super) fn refuse(campaign: &Path) -> Result<(), StoreError> {
    let folder = campaign.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let forms = [folder.canonicalize(), std::path::absolute(folder)];
    match forms.iter().flatten().find_map(|folder| windows_share(&folder.to_string_lossy())) {
        Some(kind) => Err(StoreError::Share { path: campaign.into(), kind }),
        None => Ok(()),
    }
}

/// The share `\\server\share` to which an absolute path of Windows leads; `None` for a local disk.
#[cfg(any(windows, test))]
fn windows_share(path: &str) -> Option<String> {
    let path = path.replace('/', r"\");
    let rest = match path.strip_prefix(r"\\?\").or_else(|| path.strip_prefix(r"\\.\")) {
        // "UNC\server\share\…", or a disk: "C:\…", "Volume{…}\…"
        Some(verbatim) => {
            verbatim.split_at_checked(4).filter(|(unc, _)| unc.eq_ignore_ascii_case(r"UNC\"))?.1
        }
        None => path.strip_prefix(r"\\")?,
    };
    let mut names = rest.split('\\');
    Some(format!(r"\\{}\{}", names.next()?, names.next().unwrap_or_default()))
}

/// Refuses to write a campaign on a network share. Only Linux provides a mount table; on other
/// Unix systems nothing is refused.
#[cfg(unix)]
pub(super) fn refuse(campaign: &Path) -> Result<(), StoreError> {
    let folder = campaign.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (Ok(table), Ok(folder)) = (std::fs::read_to_string("/proc/self/mountinfo"), folder.canonicalize())
    else {
        return Ok(());
    };
    match network(&table, &folder) {
        Some(kind) => Err(StoreError::Share { path: campaign.into(), kind }),
        None => Ok(()),
    }
}

/// The kind of file system under `folder`, if it is a network file system. `table` is Linux's
/// `mountinfo`.
#[cfg(any(unix, test))]
fn network(table: &str, folder: &Path) -> Option<String> {
    let mounts = table.lines().filter_map(|line| {
        // "36 35 98:0 / /mnt rw,noatime shared:1 - ext3 /dev/root rw"
        let (before, after) = line.split_once(" - ")?;
        let point = unescaped(before.split(' ').nth(4)?);
        Some((point, after.split(' ').next()?.to_owned()))
    });
    // the longest mount point applies, and the last one mounted there
    let (_, kind) =
        mounts.filter(|(point, _)| folder.starts_with(point)).max_by_key(|(point, _)| point.len())?;
    NETWORK.contains(&kind.trim_start_matches("fuse.")).then_some(kind)
}

/// Decodes space, tab, newline and backslash, which the kernel writes as octal numbers.
#[cfg(any(unix, test))]
fn unescaped(text: &str) -> String {
    [("\\040", " "), ("\\011", "\t"), ("\\012", "\n"), ("\\134", "\\")]
        .into_iter()
        .fold(text.to_owned(), |text, (code, character)| text.replace(code, character))
}

impl Store {
    /// Copies everything accepted so far to `to`, checks the copy record by record, and only then
    /// gives it its name; returns the number of records. A running campaign continues meanwhile.
    ///
    /// # Errors
    /// The target exists already, it cannot be written, or the copy is damaged.
    pub fn back_up(&self, to: &Path) -> Result<usize, StoreError> {
        if to.exists() {
            return Err(StoreError::Exists { path: to.into() });
        }
        let partial = with_ending(to, ".partial");
        let copied = self.copy(&partial).and_then(|records| {
            std::fs::rename(&partial, to)
                .map_err(|source| StoreError::Lock { path: to.into(), source })
                .map(|()| records)
        });
        if copied.is_err() {
            for ending in ["", "-wal", "-shm", "-journal"] {
                // ignore an error: the file may not exist
                let _ = std::fs::remove_file(with_ending(&partial, ending));
            }
        }
        copied
    }

    fn copy(&self, to: &Path) -> Result<usize, StoreError> {
        let failed = |error| sqlite(to, "copying", error);
        let mut copy = connected(to, OpenFlags::default()).map_err(failed)?;
        {
            let backup = rusqlite::backup::Backup::new(&self.connection, &mut copy).map_err(failed)?;
            // all pages in one step: a reader's snapshot, unaffected by a writer
            backup.step(-1).map_err(failed)?;
        }
        copy.execute("DELETE FROM meta WHERE key = ?1", [WRITTEN]).map_err(failed)?;
        copy.pragma_update(None, "journal_mode", "DELETE").map_err(failed)?;
        copy.close().map_err(|(_, error)| failed(error))?;
        let copy = Self::open_read_only(to)?;
        if let Some(damage) = copy.verify()?.first() {
            let record = damage.record.map_or("the file".to_owned(), |id| format!("record {id}"));
            return Err(copy.content(format!(
                "the copy is damaged ({record}: {}): check the original with `jointrig campaign verify`",
                damage.what
            )));
        }
        Ok(copy.records()?.len())
    }
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}

/// Keys of the notes.
const RIG: &str = "simulated_rig";
const TRUTH: &str = "simulated_truth";

/// Identifies a simulated rig.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatedRig {
    /// The rig's name.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// SHA-256 of all its parameters, in base64; `None` in files from before this was stored.
    #[serde(default)]
    pub parameters: Option<String>,
}

/// Force law of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactLaw {
    /// Stuck, whatever the force.
    Linear,
    /// One slider: stuck, then gross slip.
    Jenkins,
    /// Many sliders in parallel: microslip, then gross slip.
    Iwan,
}

/// The result that an ideal measurement of the simulated rig would give. Stiffness along z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedTruth {
    /// The contact's own tangential stiffness k_T in full stick, N/m.
    pub contact_k_t_n_per_m: f64,
    /// The contact's own tangential damping c_T, N s/m.
    pub contact_c_t_n_s_per_m: f64,
    /// Stiffness between the arms as substructuring finds it at the virtual points: contact and
    /// clamps in series, N/m.
    pub between_arms_k_n_per_m: f64,
    /// Stiffness of the clamps alone, defined the same way, N/m; `None` if they are rigid.
    pub clamps_k_n_per_m: Option<f64>,
    /// The contact's force law.
    pub law: ContactLaw,
    /// μN, above which the contact is in gross slip, N; `None` for the linear law. An Iwan contact
    /// slips partially below it.
    pub slip_limit_n: Option<f64>,
}

/// Whether a board of this name measures a simulated rig.
pub fn is_simulated_board(name: &str) -> bool {
    [Info::VIRTUAL_BOARD, Info::EMULATED_BOARD].contains(&name)
}

impl Store {
    /// Stores which simulated rig the campaign is run on, and its truth; the last session's values
    /// count.
    pub(crate) fn note_simulated(&self, simulated: &Simulated) -> Result<(), StoreError> {
        let rig = SimulatedRig {
            name: simulated.rig.clone(),
            seed: simulated.seed,
            parameters: Some(simulated.parameters.clone()),
        };
        let rig = serde_json::to_string(&rig).map_err(|error| self.content(error.to_string()))?;
        self.set_meta(RIG, &rig)?;
        self.set_meta(TRUTH, &simulated.truth.to_string())
    }

    /// The simulated rig that the campaign was run on; `None` if the device was not simulated in
    /// the runner's own process.
    ///
    /// # Errors
    /// The note cannot be read.
    pub fn simulated_rig(&self) -> Result<Option<SimulatedRig>, StoreError> {
        self.json(RIG)
    }

    /// Whether any session's device was simulated, in the runner's own process or over a
    /// connection.
    ///
    /// # Errors
    /// The notes or sessions cannot be read.
    pub fn is_simulated(&self) -> Result<bool, StoreError> {
        let behind_a_wire = self.sessions()?.iter().any(|(_, info)| is_simulated_board(&info.board));
        Ok(behind_a_wire || self.simulated_rig()?.is_some())
    }

    /// The result that an ideal measurement of the simulated rig would give; `None` if the device
    /// was not simulated in the runner's own process, and in files from before this was stored.
    ///
    /// # Errors
    /// The note cannot be read.
    pub fn simulated_truth(&self) -> Result<Option<SimulatedTruth>, StoreError> {
        self.json(TRUTH)
    }

    fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> Result<Option<T>, StoreError> {
        let read = |text: String| {
            serde_json::from_str(&text).map_err(|error| self.content(format!("the note {key}: {error}")))
        };
        self.meta(key)?.map(read).transpose()
    }
}

#[cfg(test)]
#[path = "identity_tests.rs"]
mod tests;

#[cfg(test)]
mod lock_tests {
    use super::*;

    #[test]
    fn a_second_writer_is_refused_by_name_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        let campaign = folder.path().join("a.jrig");
        let lock = WriteLock::take(&campaign).expect("free");
        let said = WriteLock::take(&campaign).expect_err("held").to_string();
        assert!(said.contains(&format!("process {}", std::process::id())), "{said}");
        drop(lock);
        assert!(!beside(&campaign).exists());
        // left by a process that was killed
        std::fs::write(beside(&campaign), "process 1").expect("written");
        drop(WriteLock::take(&campaign).expect("nobody holds it"));
    }
}

#[cfg(test)]
mod share_tests {
    use super::*;

    const TABLE: &str = "22 1 254:0 / / rw,relatime - ext4 /dev/vda rw\n\
                         40 22 0:40 / /home rw - nfs4 server:/home rw,vers=4.2\n\
                         41 40 0:41 / /home/me/lab\\040disk rw shared:5 - ext4 /dev/sdb rw\n\
                         42 22 0:42 / /mnt/share rw - cifs //server/x rw\n\
                         43 22 0:43 / /mnt/ssh rw - fuse.sshfs me@there:/ rw\n";

    #[test]
    fn the_file_system_that_counts_is_the_innermost() {
        let of = |folder: &str| network(TABLE, Path::new(folder));
        assert_eq!(of("/var/data"), None);
        assert_eq!(of("/home/me").as_deref(), Some("nfs4"));
        assert_eq!(of("/home/me/lab disk/2026"), None);
        assert_eq!(of("/mnt/share").as_deref(), Some("cifs"));
        assert_eq!(of("/mnt/sharedisk"), None);
        assert_eq!(of("/mnt/ssh/x").as_deref(), Some("fuse.sshfs"));
    }

    #[test]
    fn a_path_of_windows_that_leads_to_a_server_is_a_share_in_every_form() {
        for (path, share) in [
            (r"\\nas\lab\2026\a.jrig", Some(r"\\nas\lab")),
            ("//nas/lab/a.jrig", Some(r"\\nas\lab")),
            (r"\\?\UNC\nas\lab\a.jrig", Some(r"\\nas\lab")),
            (r"\\?\unc\nas\lab", Some(r"\\nas\lab")),
            (r"\\.\UNC\nas\lab\a.jrig", Some(r"\\nas\lab")),
            (r"\\wsl.localhost\Debian\home", Some(r"\\wsl.localhost\Debian")),
            (r"\\cloud@SSL\DavWWWRoot\x", Some(r"\\cloud@SSL\DavWWWRoot")),
            (r"C:\lab\a.jrig", None),
            (r"C:\UNC\nas\lab", None),
            (r"\\?\C:\UNC\a.jrig", None),
            (r"\\?\Volume{0ba1}\a.jrig", None),
            (r"\\?\UNCLE\a.jrig", None),
            (r"\\?\Ü:", None),
            (r"\lab\a.jrig", None),
        ] {
            assert_eq!(windows_share(path).as_deref(), share, "{path}");
        }
    }
}
