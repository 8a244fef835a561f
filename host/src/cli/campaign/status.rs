//! `campaign status`: progress of a campaign, and why records were refused.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::plan::configuration_name;
use crate::campaign::run::progress::{document, refusals};
use crate::campaign::run::tally::{Count, Tally};
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::cli::error::CliError;
use crate::cli::output;

/// Show, per cell, the hits wanted, kept and refused, and why; and the imported FRFs.
#[derive(Debug, Args)]
pub struct Status {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

impl Status {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        if self.json {
            return output::json(&document(&store)?);
        }
        let (cells, records) = (store.cells()?, store.records()?);
        let tally = Tally::new(&cells, store.rows()?, &records);
        let frfs = store.frf_rows()?;
        let (stored, raw) = store.sample_bytes()?;
        let size = std::fs::metadata(&self.file).map_or(0, |file| file.len());
        let started = cells.iter().filter(|row| tally.attempts(row.id) > 0);
        output::lines(
            frfs.iter().map(|row| {
                format!("FRFs of {} from {}, imported {}", row.configuration, row.source, row.utc)
            }),
        )?;
        let (clocks, edges) = (store.clocks()?, store.edges()?.len());
        let external = clocks.iter().filter(|row| row.rate_hz.is_some()).count();
        if !clocks.is_empty() {
            output::lines([format!(
                "synchronised with another recorder: {external} of {} sessions use its clock, {edges} edges of the sync input \
                 and output",
                clocks.len()
            )])?;
        }
        output::lines(started.map(|row| cell_line(row, &tally.cell(row.id))))?;
        output::lines([
            format!(
                "{} of {} hits kept in {} cells ({} records; {:.1} MB, samples {:.2} : 1)",
                tally.kept(),
                tally.wanted(),
                cells.len(),
                records.len(),
                size as f64 / 1e6,
                raw as f64 / stored.max(1) as f64
            ),
            match (tally.complete(), tally.given_up()) {
                (true, _) => "complete".into(),
                (false, 0) => "not complete: continue with `jointrig campaign run`".into(),
                (false, n) => format!("not complete; {n} cells were given up"),
            },
        ])
    }
}

fn cell_line(row: &CellRow, count: &Count) -> String {
    let cell = &row.cell;
    let name = configuration_name(cell.configuration);
    let kept = format!("{name:<4} {:<6} {:<4} {}/{}", cell.impact, cell.response, count.kept, count.wanted);
    let refused = refusals(count).map(|(kind, number)| format!("{number} {kind}"));
    let given_up = row.given_up.iter().map(|reason| format!("given up: {reason}"));
    let settled = row.settled.iter().map(|reason| format!("settled: {reason}"));
    let damaged = (count.damaged > 0).then(|| format!("{} damaged", count.damaged));
    std::iter::once(kept)
        .chain(refused)
        .chain(damaged)
        .chain(given_up)
        .chain(settled)
        .collect::<Vec<_>>()
        .join(", ")
}
