//! `campaign show`: the records of one cell, why each was accepted or refused, and a figure of
//! them.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use crate::advice;
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_table::Overrule;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::report::cell_records::{Shown, records};
use crate::untrusted_text::tell_line;

/// Show a cell: its records, their verdicts, and a figure.
#[derive(Debug, Args)]
pub struct Show {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// The cell as CONFIGURATION/IMPACT/RESPONSE, for example AJB/AZ1/B2.
    #[arg(value_name = "CELL")]
    cell: String,
    /// Where to write the figure [default: FILE-CONFIGURATION-IMPACT-RESPONSE.svg in the current
    /// folder].
    #[arg(long, value_name = "FILE.svg", conflicts_with = "no_figure")]
    figure: Option<PathBuf>,
    /// Write no figure.
    #[arg(long)]
    no_figure: bool,
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

impl Show {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let cells = store.cells()?;
        let row = find(&cells, &self.cell)?;
        let records = store.records_for(row.id)?;
        let overrules = if records.is_empty() { Vec::new() } else { store.overrules()? };
        let drawn = if self.no_figure || records.is_empty() {
            Ok(None)
        } else {
            self.draw(&store, row, records.iter().flatten())
        };
        // the list is printed even if the figure cannot be written
        let figure = drawn.as_ref().ok().and_then(Option::as_ref);
        if self.json {
            let records: Vec<Value> = records
                .iter()
                .map(|record| match record {
                    Ok(record) => as_json(record, &overrules),
                    Err(Damaged { place, what }) => {
                        json!({ "record": place.id, "attempt": place.attempt, "kept": false, "damage": what })
                    }
                })
                .collect();
            output::json(&json!({
                "configuration": configuration_name(row.cell.configuration),
                "impact": row.cell.impact,
                "response": row.cell.response,
                "wanted": row.cell.wanted,
                "given_up": row.given_up,
                "settled": row.settled,
                "records": records,
                "figure": figure,
            }))?;
            return drawn.map(|_| ());
        }
        let mut lines =
            vec![format!("{}: {} records, {} good hits wanted", self.cell, records.len(), row.cell.wanted)];
        lines.extend(row.given_up.iter().map(|reason| format!("given up: {reason}")));
        lines.extend(row.settled.iter().map(|reason| format!("settled: {reason}")));
        for record in &records {
            let (id, line) = match record {
                Ok(record) => (record.id, line(record)),
                Err(Damaged { place, what }) => (place.id, format!("{:>6}  damaged: {what}", place.id)),
            };
            lines.push(line);
            lines.extend(overrules.iter().filter(|overrule| overrule.record == id).map(|overrule| {
                format!("        a person, {}: {} ({})", overrule.utc, overrule.verdict, overrule.reason)
            }));
        }
        lines.extend(figure.iter().map(|path| format!("figure: {}", path.display())));
        output::lines(lines)?;
        drawn.map(|_| ())
    }

    /// Draws the readable records; a damaged record is only listed.
    fn draw<'r>(
        &self,
        store: &Store,
        row: &CellRow,
        rows: impl Iterator<Item = &'r RecordRow>,
    ) -> Result<Option<PathBuf>, CliError> {
        let mut shown = Vec::new();
        for record in rows {
            match Shown::of(store, row.id, record) {
                Ok(one) => shown.extend(one),
                Err(error @ StoreError::Damaged { .. }) => tell_line!("{error}"),
                Err(error) => return Err(error.into()),
            }
        }
        let cell = &row.cell;
        let name = configuration_name(cell.configuration);
        let title = format!("{name}: hammer at {}, laser at {}", cell.impact, cell.response);
        let Some(figure) = records(&title, &shown) else { return Ok(None) };
        let path = self.figure.clone().unwrap_or_else(|| {
            let stem = self.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            PathBuf::from(format!("{stem}-{name}-{}-{}.svg", cell.impact, cell.response))
        });
        std::fs::write(&path, figure).map_err(|source| {
            let advice = advice::writing(&source);
            CliError::Bad(format!(
                "{}: writing the figure: {source}; {advice}, name another place with --figure FILE.svg, or leave it out with --no-figure",
                path.display()
            ))
        })?;
        Ok(Some(path))
    }
}

/// The cell with that name.
pub(super) fn find<'a>(cells: &'a [CellRow], name: &str) -> Result<&'a CellRow, CliError> {
    let called = |row: &CellRow| {
        let cell = &row.cell;
        format!("{}/{}/{}", configuration_name(cell.configuration), cell.impact, cell.response)
    };
    cells.iter().find(|row| called(row) == name).ok_or_else(|| {
        let example = cells.first().map(called).unwrap_or_default();
        CliError::Usage(format!(
            "there is no cell `{name}`: write CONFIGURATION/IMPACT/RESPONSE, for example {example}"
        ))
    })
}

fn line(record: &RecordRow) -> String {
    let error = record.utc_error_s.map_or("unknown error".into(), |error| format!("± {error:.3} s"));
    format!(
        "{:>6}  {:<10} {:6.2} N  {:5} us  {}  ({} {error})",
        record.id,
        record.verdict.name(),
        record.peak_n,
        record.shot.pulse_us,
        record.sentence,
        record.utc,
    )
}

fn as_json(record: &RecordRow, overrules: &[Overrule]) -> Value {
    let overruled: Vec<Value> = overrules
        .iter()
        .filter(|overrule| overrule.record == record.id)
        .map(
            |overrule| json!({ "utc": overrule.utc, "verdict": overrule.verdict, "reason": overrule.reason }),
        )
        .collect();
    json!({
        "record": record.id,
        "attempt": record.attempt,
        "session": record.session,
        "utc": record.utc,
        "utc_error_s": record.utc_error_s,
        "verdict": record.verdict.name(),
        "measure": record.measure,
        "limit": record.limit,
        "sentence": record.sentence,
        "kept": record.kept(),
        "overruled": overruled,
        "damage": null,
        "peak_n": record.peak_n,
        "pulse_us": record.shot.pulse_us,
        "scans": record.scans,
    })
}
