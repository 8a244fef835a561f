//! Finds damage in a campaign file.
//!
//! Continuing with an edited plan: measured records stay valid, or the plan is refused.

use super::cell_table::{CellRow, write_cell};
use super::error::StoreError;
use super::notes::{write_log, write_plan};
use super::{Store, chain, schema};
use crate::campaign::plan::{Cell, Plan, configuration_name};
use std::collections::HashSet;

/// One finding of damage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The record; `None` for the file as a whole.
    pub record: Option<i64>,
    /// What is wrong.
    pub what: String,
}

impl Damage {
    fn of_file(what: String) -> Self {
        Self { record: None, what }
    }
}

/// Rows already reported as damaged, by table and key.
type Named = HashSet<(String, String)>;

impl Store {
    /// Checks the file's structure, every checksum, and every row against the chain; returns the
    /// damage found.
    pub fn verify(&self) -> Result<Vec<Damage>, StoreError> {
        let mut damage: Vec<Damage> = self.lacks_its_log()?.map(Damage::of_file).into_iter().collect();
        match self.all("PRAGMA integrity_check", [], |row| row.get::<_, String>(0), "checking") {
            Ok(said) if said == ["ok"] => {}
            Ok(said) => damage.extend(said.into_iter().map(Damage::of_file)),
            Err(error) => damage.push(Damage::of_file(error.to_string())),
        }
        let missing = schema::missing(&self.connection).map_err(self.failed("checking"))?;
        damage.extend(missing.into_iter().map(|name| Damage::of_file(format!("it lacks `{name}`"))));
        let mut named = Named::new();
        damage.extend(self.damaged_samples(&mut named)?);
        damage.extend(self.behind_our_back(&named)?);
        Ok(damage)
    }

    /// Records, levels and FRFs whose own checksums do not match.
    fn damaged_samples(&self, named: &mut Named) -> Result<Vec<Damage>, StoreError> {
        let mut damage = Vec::new();
        let mut name = |tables: &[&str], id: i64| {
            named.extend(tables.iter().map(|table| ((*table).to_owned(), id.to_string())));
        };
        for record in self.records()? {
            let (id, what) = match record {
                Err(damaged) => (damaged.place.id, damaged.what),
                Ok(row) => match self.samples(&row) {
                    Ok(_) => continue,
                    Err(StoreError::Damaged { what, .. }) => (row.id, what),
                    Err(other) => (row.id, other.to_string()),
                },
            };
            name(&["records", "seals"], id);
            damage.push(Damage { record: Some(id), what });
        }
        for row in self.frf_rows()? {
            if let Err(error) = self.frf_of(row.id) {
                name(&["frfs"], row.id);
                damage.push(Damage::of_file(error.to_string()));
            }
        }
        for level in self.levels()? {
            let (id, what) = match level {
                Err(damaged) => (damaged.id, Some(damaged.to_string())),
                Ok(row) => (row.id, self.level_samples(&row).err().map(|error| error.to_string())),
            };
            if let Some(what) = what {
                name(&["levels"], id);
                damage.push(Damage::of_file(what));
            }
        }
        for wear in self.damaged_wear()? {
            name(&[wear.table], wear.id);
            damage.push(Damage::of_file(wear.to_string()));
        }
        Ok(damage)
    }

    /// Rows that were changed outside jointrig, except those already reported. A file of version 1
    /// has no chain.
    fn behind_our_back(&self, named: &Named) -> Result<Vec<Damage>, StoreError> {
        if !self.has_chain()? {
            return Ok(Vec::new());
        }
        Ok(match chain::check(&self.connection) {
            Ok(wrong) => wrong
                .into_iter()
                .filter(|behind| behind.row.as_ref().is_none_or(|row| !named.contains(row)))
                .map(|behind| Damage::of_file(behind.what))
                .collect(),
            Err(error) => vec![Damage::of_file(format!("the chain of rows cannot be read: {error}"))],
        })
    }

    /// Table and key of every row, in the order in which they were stored; empty for a file without
    /// a chain.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn history(&self) -> Result<Vec<(String, String)>, StoreError> {
        if !self.has_chain()? {
            return Ok(Vec::new());
        }
        chain::history(&self.connection).map_err(self.failed("reading the chain"))
    }

    /// Whether rows are chained: in files from version 2 onwards.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn has_chain(&self) -> Result<bool, StoreError> {
        let version: i32 = self
            .connection
            .pragma_query_value(None, "user_version", |row| row.get(0))
            .map_err(self.failed("checking"))?;
        let there = self.connection.table_exists(None, "chain").map_err(self.failed("checking"))?;
        Ok(there || version > super::OLDEST)
    }
}

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
                    "`{point}` has records and must stay where it is; give another place another name, or, if the same place was \
                     measured again, enter it with `campaign places`"
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
