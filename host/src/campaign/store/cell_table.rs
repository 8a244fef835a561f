//! The cells of the plan in the campaign file, and their state.

use jointrig_protocol::request::Configuration;
use rusqlite::{Connection, params};

use super::Store;
use super::error::StoreError;
use super::table::{Row, table};
use crate::campaign::plan::{Cell, MOST_CELLS, configuration_name};

table! {
    /// The columns of the cell table.
    pub(super) struct CellColumns {
        "cells" {
            /// Its id in this file.
            id: i64 = "id INTEGER PRIMARY KEY",
            /// The configuration.
            configuration: Configuration = "configuration TEXT NOT NULL",
            /// Where the hammer strikes.
            impact: String = "impact TEXT NOT NULL",
            /// Where the laser measures.
            response: String = "response TEXT NOT NULL",
            /// Good hits wanted.
            wanted: u32 = "wanted INTEGER NOT NULL",
            /// Why it was given up, if it was.
            given_up: Option<String> = "given_up TEXT",
            /// Why it was settled with fewer good hits than wanted, if it was.
            settled: Option<String> = "settled TEXT",
            "UNIQUE (configuration, impact, response)",
        }
    }
}

/// A cell of the plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellRow {
    /// Its id in this file.
    pub id: i64,
    /// The plan's cell.
    pub cell: Cell,
    /// Why it was given up, if it was.
    pub given_up: Option<String>,
    /// Why it was settled with fewer good hits than wanted, if it was.
    pub settled: Option<String>,
}

impl From<CellColumns> for CellRow {
    fn from(columns: CellColumns) -> Self {
        let CellColumns { id, configuration, impact, response, wanted, given_up, settled } = columns;
        Self { id, cell: Cell { configuration, impact, response, wanted }, given_up, settled }
    }
}

/// Adds a cell; an existing one is reopened, with the number of hits that is wanted now.
pub(super) fn write_cell(connection: &Connection, cell: &Cell) -> rusqlite::Result<()> {
    connection
        .prepare_cached(
            "INSERT INTO cells (configuration, impact, response, wanted) VALUES (?1, ?2, ?3, ?4) \
             ON CONFLICT (configuration, impact, response) \
             DO UPDATE SET wanted = excluded.wanted, given_up = NULL, settled = NULL",
        )?
        .execute(params![configuration_name(cell.configuration), cell.impact, cell.response, cell.wanted])
        .map(|_| ())
}

impl Store {
    /// Every cell, in the order of the plan. A file with more cells than a plan may have is
    /// refused.
    pub fn cells(&self) -> Result<Vec<CellRow>, StoreError> {
        let count = |row: &rusqlite::Row<'_>| row.get::<_, usize>(0);
        let there = self
            .connection
            .query_row("SELECT count(*) FROM cells", [], count)
            .map_err(self.failed("counting cells"))?;
        if there > MOST_CELLS {
            return Err(self.content(format!(
                "it has {there} cells, but a plan makes at most {MOST_CELLS}: `jointrig campaign verify` lists what was added"
            )));
        }
        let sql = format!("SELECT {} FROM cells ORDER BY id", CellColumns::list());
        self.all(&sql, [], |row| CellColumns::read(row).map(CellRow::from), "reading cells")
    }

    /// Gives a cell up, with the reason.
    pub fn give_up(&self, cell: i64, reason: &str) -> Result<(), StoreError> {
        self.change("giving a cell up", |connection| {
            connection
                .execute("UPDATE cells SET given_up = ?2 WHERE id = ?1", params![cell, reason])
                .map(|_| ())
        })
    }

    /// Marks a cell as done with fewer good hits than wanted, with the reason.
    pub fn settle(&self, cell: i64, reason: &str) -> Result<(), StoreError> {
        self.change("closing a cell", |connection| {
            connection
                .execute("UPDATE cells SET settled = ?2 WHERE id = ?1", params![cell, reason])
                .map(|_| ())
        })
    }
}
