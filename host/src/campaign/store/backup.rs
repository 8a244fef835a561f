//! A copy of a campaign file, taken even while the file is being written.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use rusqlite::Connection;

use super::error::{StoreError, sqlite};
use super::{Store, WRITTEN};

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
        let mut copy = Connection::open(to).map_err(failed)?;
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
            return Err(
                copy.content(format!("the copy is damaged ({record}: {}); is the original?", damage.what))
            );
        }
        Ok(copy.records()?.len())
    }
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}
