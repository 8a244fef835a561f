//! Rows of cells that one hit fills: cells of one structure and impact whose responses have fixed
//! sensors, which all measure simultaneously. Their hits are stored with the first cell of the row.

use std::collections::HashMap;

use super::Store;
use super::cell_table::CellRow;
use super::error::StoreError;
use super::record_table::{Damaged, RecordRow};
use crate::campaign::plan::{Cell, Plan, configuration_name};
use crate::device::channels::ChannelMap;

/// The cells that are filled by the hits of another one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rows {
    lead: HashMap<i64, i64>,
}

impl Rows {
    /// The rows of a campaign.
    pub fn new(plan: &Plan, cells: &[CellRow]) -> Self {
        let mut first: HashMap<(&str, &str), i64> = HashMap::new();
        let mut lead = HashMap::new();
        for row in cells {
            let Cell { configuration, impact, response, .. } = &row.cell;
            if plan.own_channels(response).is_none() {
                continue;
            }
            let of_row =
                *first.entry((configuration_name(*configuration), impact.as_str())).or_insert(row.id);
            if of_row != row.id {
                lead.insert(row.id, of_row);
            }
        }
        Self { lead }
    }

    /// The cell whose hits fill this one; `None` if it is struck itself.
    pub fn lead(&self, cell: i64) -> Option<i64> {
        self.lead.get(&cell).copied()
    }

    /// The cells that are filled by the hits of this one.
    pub fn followers(&self, cell: i64) -> impl Iterator<Item = i64> + '_ {
        self.lead.iter().filter(move |(_, lead)| **lead == cell).map(|(follower, _)| *follower)
    }

    /// Every cell that a record of `cell` counts for.
    pub fn filled(&self, cell: i64) -> impl Iterator<Item = i64> + '_ {
        std::iter::once(cell).chain(self.followers(cell))
    }
}

/// Channel indices of the response of `cell` in a record with the channels of `map`, measured in
/// the cell itself or in the first cell of its row; `None` if the record does not contain it.
pub fn places(plan: &Plan, cell: &CellRow, record: &RecordRow, map: &ChannelMap) -> Option<Vec<usize>> {
    if record.cell == cell.id {
        plan.response_places(&cell.cell.response, map)
    } else {
        plan.own_places(&cell.cell.response, map)
    }
}

impl Store {
    /// Channel indices of a cell's response in a record that counts for it; `None` if the record
    /// does not contain it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn response_places(
        &self,
        cell: i64,
        record: &RecordRow,
        map: &ChannelMap,
    ) -> Result<Option<Vec<usize>>, StoreError> {
        let (plan, cells) = (self.plan()?, self.cells()?);
        let row = cells.iter().find(|row| row.id == cell);
        Ok(row.and_then(|row| places(&plan, row, record, map)))
    }

    /// The cells that are filled by the hits of another one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn rows(&self) -> Result<Rows, StoreError> {
        Ok(Rows::new(&self.plan()?, &self.cells()?))
    }

    /// The records that count for a cell, its own and those of the first cell of its row, in order
    /// of measurement.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn records_for(&self, cell: i64) -> Result<Vec<Result<RecordRow, Damaged>>, StoreError> {
        let mut records = self.records_of(cell)?;
        if let Some(lead) = self.rows()?.lead(cell) {
            records.extend(self.records_of(lead)?);
            records
                .sort_by_key(|record| record.as_ref().map_or_else(|damaged| damaged.place.id, |row| row.id));
        }
        Ok(records)
    }
}
