//! Checks whether the open file is still the one with its name. A file that was replaced, removed
//! or emptied while it is open accepts every record without an error, but the records are lost.

use std::fs::{File, Metadata};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::log_of;

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
        let file = std::fs::metadata(&path).ok().and_then(|file| inode(&file));
        Self { path, file }
    }

    /// What happened to the file or its log since; `None` if both are present. To be called after a
    /// transaction in WAL mode.
    pub(super) fn lost(&self) -> Option<String> {
        let Ok(now) = std::fs::metadata(&self.path) else { return Some("it was removed or renamed".into()) };
        if self.file.is_some() && inode(&now) != self.file {
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

/// Device and inode, on systems that have them.
#[cfg(unix)]
#[allow(clippy::unnecessary_wraps, reason = "other systems have none")]
fn inode(file: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((file.dev(), file.ino()))
}

/// On other systems an open file can be neither removed nor replaced.
#[cfg(not(unix))]
fn inode(_: &Metadata) -> Option<(u64, u64)> {
    None
}

#[cfg(test)]
#[path = "identity_tests.rs"]
mod tests;
