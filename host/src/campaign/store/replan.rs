//! Continuing with an edited plan: measured records stay valid, or the plan is refused.

use std::collections::HashSet;

use super::Store;
use super::cell_table::{CellRow, write_cell};
use super::error::StoreError;
use super::notes::{write_log, write_plan};
use crate::campaign::plan::{Cell, Plan, configuration_name};

impl Store {
    /// Takes over the plan in `text`, which errors call `source`. Hits, force, limits and settling
    /// may change, and cells may be added; cells without records may be removed. Cells that were
    /// given up or settled are reopened. The earlier plans stay in the file.
    ///
    /// # Errors
    /// The plan is wrong, or existing records would not fit it.
    pub fn take_over(&mut self, text: &str, source: &str) -> Result<(), StoreError> {
        let (new, old) = (Plan::parse_new(text, source)?, self.plan()?);
        let refuse = |what: String| {
            Err(StoreError::PlanChange { path: self.path.clone(), source_name: source.into(), what })
        };
        let rows = self.cells()?;
        let struck: HashSet<i64> = self.places()?.iter().map(|place| place.cell).collect();
        let shared = self.rows()?;
        let measured: HashSet<i64> = struck.iter().flat_map(|cell| shared.filled(*cell)).collect();
        if !measured.is_empty() && new.record.get_ref() != old.record.get_ref() {
            return refuse(
                "[record] must stay as it is, because records were measured with it; create a new campaign"
                    .into(),
            );
        }
        let cells = new.cells();
        for row in rows.iter().filter(|row| measured.contains(&row.id)) {
            let Cell { configuration, impact, response, .. } = &row.cell;
            if !cells.iter().any(|cell| same(cell, &row.cell)) {
                let name = configuration_name(*configuration);
                return refuse(format!(
                    "the cell {name}/{impact}/{response} has records and must stay in it"
                ));
            }
            if let Some(point) = moved(&old, &new, impact, response) {
                return refuse(format!(
                    "`{point}` has records and must stay where it is; give the other place another name"
                ));
            }
        }
        if let Some(name) = filled_late(&new, &cells, &rows, &measured) {
            return refuse(format!(
                "the cell {name} would be filled by hits that were measured without its sensor; give the impact another name for it"
            ));
        }
        self.change("taking over the plan", |connection| {
            for row in rows.iter().filter(|row| !measured.contains(&row.id)) {
                if !cells.iter().any(|cell| same(cell, &row.cell)) {
                    connection.execute("DELETE FROM cells WHERE id = ?1", [row.id])?;
                }
            }
            for cell in &cells {
                write_cell(connection, cell)?;
            }
            write_plan(connection, text, source)?;
            write_log(connection, &format!("the plan {source} took over"))
        })
    }
}

/// A new cell whose response has a fixed sensor, in a row that was struck before.
fn filled_late(plan: &Plan, cells: &[Cell], rows: &[CellRow], measured: &HashSet<i64>) -> Option<String> {
    let fixed = |cell: &Cell| plan.own_channels(&cell.response).is_some();
    let struck = |cell: &Cell| {
        rows.iter().any(|row| {
            let own = &row.cell;
            measured.contains(&row.id)
                && fixed(own)
                && (own.configuration, &own.impact) == (cell.configuration, &cell.impact)
        })
    };
    let new = |cell: &&Cell| fixed(cell) && !rows.iter().any(|row| same(&row.cell, cell));
    let found = cells.iter().filter(new).find(|cell| struck(cell))?;
    Some(format!("{}/{}/{}", configuration_name(found.configuration), found.impact, found.response))
}

fn same(one: &Cell, other: &Cell) -> bool {
    (one.configuration, &one.impact, &one.response) == (other.configuration, &other.impact, &other.response)
}

/// The first of the two points that the new plan changes.
fn moved<'a>(old: &Plan, new: &Plan, impact: &'a str, response: &'a str) -> Option<&'a str> {
    let impact_of = |plan: &Plan| {
        plan.geometry.impact.iter().map(toml::Spanned::get_ref).find(|point| point.name == impact).cloned()
    };
    let response_of = |plan: &Plan| {
        plan.geometry
            .response
            .iter()
            .map(toml::Spanned::get_ref)
            .find(|point| point.name == response)
            .cloned()
    };
    if impact_of(old) != impact_of(new) {
        Some(impact)
    } else if response_of(old) != response_of(new) {
        Some(response)
    } else {
        None
    }
}
