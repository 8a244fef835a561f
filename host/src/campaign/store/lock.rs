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

use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::error::StoreError;

/// Number of attempts if the lock file disappears while it is being locked.
const TRIES: usize = 10;

/// The lock; released when dropped.
#[derive(Debug)]
pub(super) struct WriteLock {
    file: File,
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
        for _ in 0..TRIES {
            let mut file = File::options()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut holder = String::new();
                    // optional: the holder only improves the message
                    let _ = file.read_to_string(&mut holder);
                    return Err(StoreError::Busy { path: campaign.into(), holder: holder.trim().into() });
                }
                Err(TryLockError::Error(source)) => return Err(failed(source)),
            }
            // its previous holder may have removed it after we opened and before we locked it
            if !still_there(&file, &path) {
                continue;
            }
            let noted = file
                .set_len(0)
                .and_then(|()| file.rewind())
                .and_then(|()| write!(file, "process {}", std::process::id()));
            if let Err(error) = noted {
                log::debug!("{}: {error}", path.display());
            }
            #[cfg(target_os = "linux")]
            return Ok(Self { itself: lock_itself(&real)?, file, path });
            #[cfg(not(target_os = "linux"))]
            return Ok(Self { file, path });
        }
        Err(StoreError::Busy { path: campaign.into(), holder: String::new() })
    }
}

impl Drop for WriteLock {
    fn drop(&mut self) {
        // removed while locked: another process that has already opened it checks for this
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
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

#[cfg(not(unix))]
fn refuse_second_names(_: &Path) -> Result<(), StoreError> {
    Ok(())
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

/// On other systems an open file cannot be removed.
#[cfg(not(unix))]
fn still_there(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
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
