//! Progress of a campaign, as shown by `campaign status --json`.

use serde_json::{Map, Value, json};

use super::tally::{Count, Tally};
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::sync_table::ClockRow;

/// For each cell the hits wanted, kept and refused, and why; and the imported FRFs.
///
/// # Errors
/// The file cannot be read.
pub fn document(store: &Store) -> Result<Value, StoreError> {
    let (cells, records) = (store.cells()?, store.records()?);
    let tally = Tally::new(&cells, store.rows()?, &records);
    let frf = |row: &crate::campaign::store::frf_table::FrfRow| json!({ "configuration": row.configuration, "file": row.source, "imported": row.utc });
    let frfs: Vec<Value> = store.frf_rows()?.iter().map(frf).collect();
    let clock = |row: &ClockRow| json!({ "session": row.session, "source": row.source, "rate_hz": row.rate_hz, "ppm": row.ppm });
    let clocks: Vec<Value> = store.clocks()?.iter().map(clock).collect();
    let all: Vec<Value> = cells.iter().map(|row| of_cell(row, &tally.cell(row.id))).collect();
    Ok(json!({
        "wanted": tally.wanted(),
        "kept": tally.kept(),
        "complete": tally.complete(),
        "records": records.len(),
        "imported_frf": frfs,
        "clocks": clocks,
        "edges": store.edges()?.len(),
        "cells": all,
    }))
}

/// Number of good hits that count, and of those wanted.
///
/// # Errors
/// The file cannot be read.
pub fn counts(store: &Store) -> Result<(u64, u64), StoreError> {
    let tally = Tally::new(&store.cells()?, store.rows()?, &store.records()?);
    Ok((tally.kept(), tally.wanted()))
}

/// Number of refused hits of a cell, by verdict.
pub fn refusals(count: &Count) -> impl Iterator<Item = (&'static str, u32)> + '_ {
    count.refused.iter().map(|(kind, number)| (kind.name(), *number))
}

fn of_cell(row: &CellRow, count: &Count) -> Value {
    let refused: Map<String, Value> =
        refusals(count).map(|(kind, number)| (kind.into(), number.into())).collect();
    json!({
        "configuration": configuration_name(row.cell.configuration),
        "impact": row.cell.impact,
        "response": row.cell.response,
        "wanted": count.wanted,
        "kept": count.kept,
        "refused": refused,
        "given_up": row.given_up,
        "settled": row.settled,
        "damaged": count.damaged,
    })
}
