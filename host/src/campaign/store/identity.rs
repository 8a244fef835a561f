//! Is the file that is written still the one that has its name? A file that was replaced, removed or emptied while it is open takes every
//! record without a word, and keeps none where anybody looks.

use std::fs::{File, Metadata};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::log_of;

/// How SQLite's log begins, by the order of the bytes in its checksums (SQLite's file format, 4.1).
const LOGS: [u32; 2] = [0x377f_0682, 0x377f_0683];

/// Which file it was when it was opened.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    path: PathBuf,
    file: Option<(u64, u64)>,
}

impl Identity {
    /// Of the file that has this name now.
    pub(super) fn of(path: &Path) -> Self {
        // SQLite follows a symbolic link, and puts its log beside what it finds
        let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
        let file = std::fs::metadata(&path).ok().and_then(|file| inode(&file));
        Self { path, file }
    }

    /// What happened to the file or its log since; none where both are there. To be asked after a transaction in WAL mode.
    pub(super) fn lost(&self) -> Option<String> {
        let Ok(now) = std::fs::metadata(&self.path) else { return Some("it was removed or renamed".into()) };
        if self.file.is_some() && inode(&now) != self.file {
            return Some("another file has its name now".into());
        }
        let log = log_of(&self.path);
        // one that was emptied and written on has a hole where its beginning was
        let mut begins = [0; 4];
        match File::open(&log).and_then(|mut log| log.read_exact(&mut begins)) {
            Ok(()) if LOGS.contains(&u32::from_be_bytes(begins)) => None,
            _ => Some(format!("its log {} was removed or emptied", log.display())),
        }
    }
}

/// Device and inode, where the system has them.
#[cfg(unix)]
#[allow(clippy::unnecessary_wraps, reason = "other systems have none")]
fn inode(file: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((file.dev(), file.ino()))
}

/// Elsewhere an open file can be neither removed nor replaced.
#[cfg(not(unix))]
fn inode(_: &Metadata) -> Option<(u64, u64)> {
    None
}

#[cfg(test)]
#[path = "identity_tests.rs"]
mod tests;
