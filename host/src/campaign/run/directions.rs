//! Instructions for the person at the rig: where hammer and laser go for a cell, and how much is
//! left to do.

use super::runner::Runner;
use crate::campaign::plan::{Cell, configuration_name};
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::watch::{Left, Standing};

impl Runner<'_> {
    /// Text shown to a person before a cell: where hammer and laser go, and the cell's progress.
    pub(super) fn directions(&self, row: &CellRow) -> String {
        let millimetres =
            |at: [f64; 3]| format!("x {:.1}, y {:.1}, z {:.1} mm", 1e3 * at[0], 1e3 * at[1], 1e3 * at[2]);
        let (cell, geometry) = (&row.cell, &self.plan.geometry);
        let impact =
            geometry.impact.iter().map(toml::Spanned::get_ref).find(|point| point.name == cell.impact);
        let response =
            geometry.response.iter().map(toml::Spanned::get_ref).find(|point| point.name == cell.response);
        let hammer = impact.map_or(String::new(), |point| {
            let [x, y, z] = point.direction;
            format!(" ({}; pushing along {x} {y} {z})", millimetres(point.position_m))
        });
        let laser = response.map_or(String::new(), |point| format!(" ({})", millimetres(point.position_m)));
        let place = 1 + self.cells.iter().position(|other| other.id == row.id).unwrap_or(0);
        format!(
            "cell {place} of {}, structure {}: {} of {} good\n  hammer to {}{hammer}\n  laser to {}{laser}",
            self.cells.len(),
            configuration_name(cell.configuration),
            self.tally.kept_in(row.id),
            cell.wanted,
            cell.impact,
            cell.response,
        )
    }

    /// A cell's progress.
    pub(super) fn standing(&self, row: &CellRow) -> Standing {
        Standing { kept: self.tally.kept_in(row.id), attempts: self.tally.attempts(row.id) }
    }

    /// Good hits still wanted in this cell, in this structure, and in total.
    pub(super) fn left(&self, row: &CellRow) -> Left {
        let mut left = Left::default();
        for other in self.cells.iter().filter(|other| self.tally.open(other.id)) {
            let missing = u64::from(other.cell.wanted.saturating_sub(self.tally.kept_in(other.id)));
            left.campaign += missing;
            left.configuration +=
                if other.cell.configuration == row.cell.configuration { missing } else { 0 };
            left.cell += if other.id == row.id { missing } else { 0 };
        }
        left
    }
}

/// A cell's name in a line of the log.
pub(super) fn name(cell: &Cell) -> String {
    format!("{} {}, {}", configuration_name(cell.configuration), cell.impact, cell.response)
}
