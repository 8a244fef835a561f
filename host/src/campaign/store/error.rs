//! Errors of a campaign file, with advice.

use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;

use crate::advice;
use crate::campaign::plan::PlanError;

/// An error of a campaign file.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A new file was requested, but the path exists.
    #[error("{path} exists already: choose another name, or continue it with `jointrig campaign run`")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// There is no such file.
    #[error("there is no campaign file {path}: create one with `jointrig campaign new`")]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// A folder was given where a file is needed.
    #[error("{path} is a folder: {}", holding(path))]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// It cannot be read.
    #[error("{path} cannot be read: {source}; {}", advice::reading(source))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// It is not a campaign file.
    #[error("{path} is not a campaign file: give the .jrig file that `jointrig campaign new` made")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Written by a newer program.
    #[error(
        "{path} has schema version {found}, this program reads versions up to {known}: use a newer jointrig"
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i32,
        /// The newest version that can be read.
        known: i32,
    },
    /// Written by an older program.
    #[error(
        "{path} has schema version {found}, this program reads versions from {known} on: use the jointrig that wrote it"
    )]
    Older {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i32,
        /// The oldest version that can be read.
        known: i32,
    },
    /// Another process is writing it.
    #[error(
        "{path} is being written by another jointrig ({holder}): end that one first; reading it is always possible"
    )]
    Busy {
        /// The file.
        path: PathBuf,
        /// The process that is writing it.
        holder: String,
    },
    /// It cannot be locked for writing.
    #[error("{path} cannot be opened for writing: {source}; the folder must exist and be writable")]
    Lock {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// It lies on a network share.
    #[error(
        "{path} lies on a network share ({kind}), where a record that was accepted could be lost: run the campaign on a \
         local disk and copy it with `jointrig campaign backup`"
    )]
    Share {
        /// The file.
        path: PathBuf,
        /// The kind of file system.
        kind: String,
    },
    /// The file's log contains records, but the file cannot be written.
    #[error(
        "{path} was not closed properly and lies where nothing can be written: copy it to a local disk together with \
         {path}-wal, which holds its last records"
    )]
    Unfinished {
        /// The file.
        path: PathBuf,
    },
    /// The file disappeared while it was being written.
    #[error(
        "{path} disappeared while it was being written: {what}; {rescue}. Put the file back, or continue with the copy"
    )]
    Gone {
        /// The file.
        path: PathBuf,
        /// What happened to it.
        what: String,
        /// What could be saved of its content.
        rescue: String,
    },
    /// It has several names.
    #[error(
        "{path} has {links} names (hard links): two programs could measure into it at the same time; copy it with `jointrig \
         campaign backup`, or remove the other names"
    )]
    Links {
        /// The file.
        path: PathBuf,
        /// Number of names.
        links: u64,
    },
    /// A record cannot be read.
    #[error("{path}: record {record} is damaged ({what}); `jointrig campaign verify` lists all damage")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The record's id.
        record: i64,
        /// What is wrong with it.
        what: String,
    },
    /// Some content of the file is invalid.
    #[error("{path}: {what}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The invalid content.
        what: String,
    },
    /// The plan cannot be read.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A new plan is incompatible with what was measured.
    #[error("{source_name} cannot take over from the plan in {path}: {what}")]
    PlanChange {
        /// The file.
        path: PathBuf,
        /// The new plan.
        source_name: String,
        /// What does not fit, and what to do.
        what: String,
    },
    /// SQLite failed.
    #[error("{path}: {doing}: {source}{hint}")]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// The operation that failed.
        doing: &'static str,
        /// SQLite's error.
        source: rusqlite::Error,
        /// Advice; empty if there is none.
        hint: &'static str,
    },
}

/// Refuses a path that is missing, is not a regular file, or cannot be read; SQLite's own messages
/// for these cases state neither what is wrong nor why.
pub(super) fn refuse_what_is_no_file(path: &Path) -> Result<(), StoreError> {
    match std::fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Err(StoreError::Missing { path: path.into() }),
        Ok(there) if there.is_dir() => Err(StoreError::Folder { path: path.into() }),
        Ok(there) if !there.is_file() => Err(StoreError::Foreign { path: path.into() }),
        _ => File::open(path)
            .map(|_| ())
            .map_err(|source| StoreError::Unreadable { path: path.into(), source }),
    }
}

/// Lists the campaign files of a folder, for a user who gave the folder.
fn holding(folder: &Path) -> String {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<String> = names
        .filter(|path| path.extension().is_some_and(|ending| ending == "jrig"))
        .map(|path| advice::quoted(&path))
        .collect();
    files.sort();
    match files.len() {
        0 => "it holds no campaign file (.jrig)".into(),
        1 => format!("give the campaign file {}", files[0]),
        n if n > MOST_NAMED => {
            format!("give one of its {n} campaign files, for example {}", files[..MOST_NAMED].join(", "))
        }
        _ => format!("give one of its campaign files: {}", files.join(", ")),
    }
}

/// Maximum number of files named in a message.
const MOST_NAMED: usize = 5;

/// SQLite's error with the operation that failed and, if known, advice.
pub(super) fn sqlite(path: &Path, doing: &'static str, source: rusqlite::Error) -> StoreError {
    let hint = match source.sqlite_error_code() {
        Some(ErrorCode::DiskFull) => {
            "; free some space, then run the same command again: nothing accepted is lost"
        }
        Some(ErrorCode::SystemIoFailure) => {
            "; is the disk healthy, and is there space on it? nothing accepted is lost: run the same command again"
        }
        Some(ErrorCode::DatabaseCorrupt) => {
            "; the file was cut off or damaged: go on from a copy that `jointrig campaign backup` made"
        }
        Some(ErrorCode::ReadOnly) => "; the file or its folder is read-only",
        Some(ErrorCode::CannotOpen) => "; does the folder exist, and may you write there?",
        Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => {
            "; another program writes this file: end it first"
        }
        _ => "",
    };
    StoreError::Sqlite { path: path.into(), doing, source, hint }
}
