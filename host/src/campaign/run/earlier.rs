//! What earlier runs left behind of a cell: its records, and what the good ones have in common.

use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};

use crate::campaign::plan::Plan;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_row::{Damaged, RecordRow};
use crate::campaign::verdict::others::Others;
use crate::device::channels::ChannelMap;

/// The records of earlier runs, by cell.
pub(super) struct Earlier {
    path: PathBuf,
    records: HashMap<i64, Vec<Result<RecordRow, Damaged>>>,
}

impl Earlier {
    /// Those of the file at `path`.
    pub(super) fn new(path: &Path, rows: Vec<Result<RecordRow, Damaged>>) -> Self {
        let mut records: HashMap<i64, Vec<Result<RecordRow, Damaged>>> = HashMap::new();
        for row in rows {
            let cell = row.as_ref().map_or_else(|damaged| damaged.place.cell, |row| row.cell);
            records.entry(cell).or_default().push(row);
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
        responses: &[usize],
        plan: &Plan,
        channels: &ChannelMap,
    ) -> Result<(Others, VecDeque<RecordRow>), StoreError> {
        let Some(records) = self.records.get(&cell) else {
            return Ok((Others::of(responses.into()), VecDeque::new()));
        };
        // the writer is on a thread of its own; a cell's earlier records are in the file since before it began
        let store = Store::open_read_only(&self.path)?;
        let others = learnt(&store, records, responses, plan, channels)?;
        let mut again: Vec<RecordRow> = records.iter().flatten().cloned().collect();
        again.sort_by_key(|record| record.attempt);
        let whole =
            again.len() == records.len() && again.iter().zip(0..).all(|(record, n)| record.attempt == n);
        Ok((others, if whole { again.into() } else { VecDeque::new() }))
    }

    /// What the good records of a cell that are in the file by now have in common.
    pub(super) fn others_now(
        &self,
        cell: i64,
        responses: &[usize],
        plan: &Plan,
        channels: &ChannelMap,
    ) -> Result<Others, StoreError> {
        let store = Store::open_read_only(&self.path)?;
        learnt(&store, &store.records_of(cell)?, responses, plan, channels)
    }
}

/// What the good ones of these records have in common.
fn learnt(
    store: &Store,
    records: &[Result<RecordRow, Damaged>],
    responses: &[usize],
    plan: &Plan,
    channels: &ChannelMap,
) -> Result<Others, StoreError> {
    let mut others = Others::of(responses.into());
    let kept = |record: &&RecordRow| record.kept() && record.channels == channels.len();
    for record in records.iter().flatten().filter(kept) {
        match store.samples(record) {
            Ok(samples) => others.learn(plan, channels, samples.view()),
            Err(error @ StoreError::Damaged { .. }) => log::warn!("{error}"),
            Err(error) => return Err(error),
        }
    }
    Ok(others)
}
