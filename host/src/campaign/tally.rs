//! How far a campaign is: per cell wanted, kept, tried.

use std::collections::{BTreeMap, HashMap};

use super::judge::Kind;
use super::rows::{CellRow, RecordRow};

/// How far one cell is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Good hits wanted.
    pub wanted: u32,
    /// Good hits there.
    pub kept: u32,
    /// Hits tried.
    pub attempts: u32,
    /// Whether it was given up.
    pub given_up: bool,
    /// Refused records by verdict.
    pub refused: BTreeMap<Kind, u32>,
}

/// How far a campaign is.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    cells: HashMap<i64, Count>,
}

impl Tally {
    /// Counts what a file holds.
    pub fn new(cells: &[CellRow], records: &[RecordRow]) -> Self {
        let mut counts: HashMap<i64, Count> = cells
            .iter()
            .map(|row| {
                let given_up = row.given_up.is_some();
                (row.id, Count { wanted: row.cell.wanted, given_up, ..Count::default() })
            })
            .collect();
        for record in records {
            let count = counts.entry(record.cell).or_default();
            count.attempts = count.attempts.max(record.attempt + 1);
            if record.kept() {
                count.kept += 1;
            } else {
                *count.refused.entry(record.standing()).or_default() += 1;
            }
        }
        Self { cells: counts }
    }

    /// One cell's count.
    pub fn cell(&self, id: i64) -> Count {
        self.cells.get(&id).cloned().unwrap_or_default()
    }

    /// Whether the cell needs more hits.
    pub fn open(&self, id: i64) -> bool {
        self.cells.get(&id).is_some_and(|count| count.kept < count.wanted && !count.given_up)
    }

    /// Hits tried in the cell: the number of its next attempt.
    pub fn attempts(&self, id: i64) -> u32 {
        self.cells.get(&id).map_or(0, |count| count.attempts)
    }

    /// Good hits in the cell.
    pub fn kept_in(&self, id: i64) -> u32 {
        self.cells.get(&id).map_or(0, |count| count.kept)
    }

    /// Counts one more hit; returns its attempt number.
    pub fn add(&mut self, id: i64, good: bool) -> u32 {
        let count = self.cells.entry(id).or_default();
        count.attempts += 1;
        count.kept += u32::from(good);
        count.attempts - 1
    }

    /// Gives a cell up.
    pub fn give_up(&mut self, id: i64) {
        self.cells.entry(id).or_default().given_up = true;
    }

    /// Good hits wanted in all.
    pub fn wanted(&self) -> u64 {
        self.cells.values().map(|count| u64::from(count.wanted)).sum()
    }

    /// Good hits there in all, those beyond a cell's wish not counted.
    pub fn kept(&self) -> u64 {
        self.cells.values().map(|count| u64::from(count.kept.min(count.wanted))).sum()
    }

    /// Cells given up.
    pub fn given_up(&self) -> u64 {
        self.cells.values().filter(|count| count.given_up).count() as u64
    }

    /// Whether every cell has what it wants.
    pub fn complete(&self) -> bool {
        self.cells.values().all(|count| count.kept >= count.wanted)
    }
}
