//! A cell's records from earlier runs, and the statistics of the good ones.

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
    /// The records of the file at `path`.
    pub(super) fn new(path: &Path, rows: Vec<Result<RecordRow, Damaged>>) -> Self {
        let mut records: HashMap<i64, Vec<Result<RecordRow, Damaged>>> = HashMap::new();
        for row in rows {
            let cell = row.as_ref().map_or_else(|damaged| damaged.place.cell, |row| row.cell);
            records.entry(cell).or_default().push(row);
        }
        Self { path: path.into(), records }
    }

    /// Drops a cell's records.
    pub(super) fn forget(&mut self, cell: i64) {
        self.records.remove(&cell);
    }

    /// Statistics of the cell's good records, and its attempts from the first onwards so that they
    /// can be repeated; no attempts if one is missing or damaged.
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
        // the writer runs on another thread; a cell's earlier records were in the file before it
        // started
        let store = Store::open_read_only(&self.path)?;
        let others = learnt(&store, records, responses, plan, channels)?;
        let mut again: Vec<RecordRow> = records.iter().flatten().cloned().collect();
        again.sort_by_key(|record| record.attempt);
        let whole =
            again.len() == records.len() && again.iter().zip(0..).all(|(record, n)| record.attempt == n);
        Ok((others, if whole { again.into() } else { VecDeque::new() }))
    }

    /// Statistics of a cell's good records that are in the file at present.
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

/// Statistics of the good ones among these records.
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
