//! Progress of a campaign: hits wanted, kept and tried per cell.

use std::collections::{BTreeMap, HashMap};

use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::campaign::store::rows::Rows;
use crate::campaign::verdict::Verdict;

/// Progress of one cell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Good hits wanted.
    pub wanted: u32,
    /// Good hits present.
    pub kept: u32,
    /// Hits tried.
    pub attempts: u32,
    /// Whether it was given up.
    pub given_up: bool,
    /// Whether it is done with fewer good hits than wanted, but enough.
    pub settled: bool,
    /// Records whose description is damaged.
    pub damaged: u32,
    /// Refused records by verdict.
    pub refused: BTreeMap<Verdict, u32>,
}

impl Count {
    /// Whether it has enough hits.
    pub fn done(&self) -> bool {
        self.kept >= self.wanted || self.settled
    }
}

/// Progress of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    cells: HashMap<i64, Count>,
    rows: Rows,
}

impl Tally {
    /// Counts the records of a file. A hit that fills a row of cells counts in each of them, and
    /// once in total.
    pub fn new(cells: &[CellRow], rows: Rows, records: &[Result<RecordRow, Damaged>]) -> Self {
        let ended: HashMap<i64, (bool, bool)> =
            cells.iter().map(|row| (row.id, (row.given_up.is_some(), row.settled.is_some()))).collect();
        let mut counts: HashMap<i64, Count> = cells
            .iter()
            .map(|row| {
                let of = rows.lead(row.id).unwrap_or(row.id);
                let (given_up, settled) = ended.get(&of).copied().unwrap_or_default();
                (row.id, Count { wanted: row.cell.wanted, given_up, settled, ..Count::default() })
            })
            .collect();
        for record in records {
            let place = record.as_ref().map_or_else(|damaged| damaged.place, RecordRow::place);
            for cell in rows.filled(place.cell) {
                let count = counts.entry(cell).or_default();
                if cell == place.cell {
                    count.attempts = count.attempts.max(place.attempt + 1);
                }
                match record {
                    Err(_) => count.damaged += 1,
                    Ok(record) if record.kept() => count.kept += 1,
                    Ok(record) => *count.refused.entry(record.standing()).or_default() += 1,
                }
            }
        }
        Self { cells: counts, rows }
    }

    /// Applies `change` to the count of every cell that a hit in this one fills.
    fn filled(&mut self, id: i64, change: impl Fn(&mut Count)) {
        for cell in self.rows.filled(id) {
            change(self.cells.entry(cell).or_default());
        }
    }

    /// The counts of the cells that are struck, not just filled by another cell's hits.
    fn struck(&self) -> impl Iterator<Item = &Count> {
        self.cells.iter().filter(|(id, _)| self.rows.lead(**id).is_none()).map(|(_, count)| count)
    }

    /// One cell's count.
    pub fn cell(&self, id: i64) -> Count {
        self.cells.get(&id).cloned().unwrap_or_default()
    }

    /// Whether the cell needs more hits.
    pub fn open(&self, id: i64) -> bool {
        self.cells.get(&id).is_some_and(|count| !count.given_up && !count.done())
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
        let attempt = self.attempts(id);
        self.filled(id, |count| count.kept += u32::from(good));
        self.cells.entry(id).or_default().attempts = attempt + 1;
        attempt
    }

    /// Adjusts the count after a person overruled a verdict: one good hit more, or less. A settled
    /// cell with fewer hits than it was settled with is open again.
    pub fn recount(&mut self, id: i64, more: bool) {
        self.filled(id, |count| {
            if more {
                count.kept += 1;
            } else {
                count.kept = count.kept.saturating_sub(1);
                count.settled = false;
                *count.refused.entry(Verdict::Dropped).or_default() += 1;
            }
        });
    }

    /// Wants this many good hits more than the cell has; returns how many that are in all.
    pub fn want(&mut self, id: i64, more: u32) -> u32 {
        let wanted = self.kept_in(id) + more;
        self.filled(id, |count| (count.wanted, count.settled) = (wanted, false));
        wanted
    }

    /// Good hits wanted in the cell.
    pub fn wanted_in(&self, id: i64) -> u32 {
        self.cells.get(&id).map_or(0, |count| count.wanted)
    }

    /// Marks a cell as done with the hits that it has.
    pub fn settle(&mut self, id: i64) {
        self.filled(id, |count| count.settled = true);
    }

    /// Restarts a cell: its good records are dropped.
    pub fn redo(&mut self, id: i64) {
        self.filled(id, |count| {
            *count.refused.entry(Verdict::Dropped).or_default() += count.kept;
            (count.kept, count.settled, count.given_up) = (0, false, false);
        });
    }

    /// Gives a cell up.
    pub fn give_up(&mut self, id: i64) {
        self.filled(id, |count| count.given_up = true);
    }

    /// Good hits wanted in total.
    pub fn wanted(&self) -> u64 {
        self.struck().map(|count| u64::from(count.wanted)).sum()
    }

    /// Good hits present in total; those beyond a cell's wanted number are not counted.
    pub fn kept(&self) -> u64 {
        self.struck().map(|count| u64::from(count.kept.min(count.wanted))).sum()
    }

    /// Cells given up.
    pub fn given_up(&self) -> u64 {
        self.struck().filter(|count| count.given_up).count() as u64
    }

    /// Whether every cell has all wanted hits, or enough of them.
    pub fn complete(&self) -> bool {
        self.cells.values().all(Count::done)
    }
}
