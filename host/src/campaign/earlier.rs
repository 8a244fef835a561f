//! What earlier runs left behind of a cell: its records, and what the good ones have in common.

use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};

use super::others::Others;
use super::plan::Plan;
use super::rows::RecordRow;
use super::store::Store;
use super::store_error::StoreError;
use crate::device::channels::ChannelMap;

/// The records of earlier runs, by cell.
pub(super) struct Earlier {
    path: PathBuf,
    records: HashMap<i64, Vec<RecordRow>>,
}

impl Earlier {
    /// Those of the file at `path`.
    pub(super) fn new(path: &Path, rows: Vec<RecordRow>) -> Self {
        let mut records: HashMap<i64, Vec<RecordRow>> = HashMap::new();
        for row in rows {
            records.entry(row.cell).or_default().push(row);
        }
        Self { path: path.into(), records }
    }

    /// A cell's good records count no more.
    pub(super) fn forget(&mut self, cell: i64) {
        self.records.remove(&cell);
    }

    /// What the cell's good records have in common, and its attempts from the first on, so that they can be struck once more;
    /// none of those if one is missing or damaged.
    pub(super) fn of(
        &self,
        cell: i64,
        plan: &Plan,
        channels: &ChannelMap,
    ) -> Result<(Others, VecDeque<RecordRow>), StoreError> {
        let mut others = Others::default();
        let Some(records) = self.records.get(&cell) else { return Ok((others, VecDeque::new())) };
        // the writer is on a thread of its own; a cell's earlier records are in the file since before it began
        let store = Store::open_read_only(&self.path)?;
        for record in records.iter().filter(|record| record.kept() && record.channels == channels.len()) {
            match store.samples(record) {
                Ok(samples) => others.learn(plan, channels, &samples),
                Err(error @ StoreError::Damaged { .. }) => log::warn!("{error}"),
                Err(error) => return Err(error),
            }
        }
        let mut again: Vec<RecordRow> = records.clone();
        again.sort_by_key(|record| record.attempt);
        let whole = again.iter().zip(0..).all(|(record, n)| record.attempt == n && record.damage.is_none());
        Ok((others, if whole { again.into() } else { VecDeque::new() }))
    }
}
