//! Numbers of every cell for the matrix view: its hammer force, the random error of its FRF, and
//! its coherence.
//!
//! The results of an analysis of the campaign so far that a page needs. A separate process runs the
//! analysis and writes them; the serving process reads them. The memory of the analysis is released
//! with its process, so that the measuring process does not grow.

use super::message::Estimate;
use crate::analyse::{AnalyseError, Wanted};
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::campaign::store::rows::Rows;
use crate::report;
use crate::report::figure::Figure;
use crate::report::figure_fragment;
use crate::report::words::brief;
use crate::results::{Cells, MAIN_BAND, Results};
use crate::untrusted_text::shown_json;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

/// A cell's numbers; `None` where not known yet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellNumbers {
    /// The cell's id.
    pub cell: i64,
    /// Mean peak force of its good hits, N.
    pub force_n: Option<f64>,
    /// Good hits in that mean.
    pub hits: usize,
    /// Random error of its FRF, %: median over the main band.
    pub random_error_percent: Option<f64>,
    /// Coherence: median over the main band.
    pub coherence: Option<f64>,
}

/// Data quality of one cell, from an analysis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellQuality {
    configuration: String,
    impact: String,
    response: String,
    /// Random error of its FRF, relative: median over the main band.
    random_error: Option<f64>,
    /// Coherence: median over the main band.
    coherence: Option<f64>,
}

/// Extracts the data quality of every cell from the results.
pub fn cell_quality(found: &Cells) -> Vec<CellQuality> {
    let one = found.cells.iter().map(|cell| CellQuality {
        configuration: cell.configuration.clone(),
        impact: cell.impact.clone(),
        response: cell.response.clone(),
        random_error: cell.random_error,
        coherence: median(&found.frequency_hz, &cell.coherence),
    });
    one.collect()
}

/// Numbers of every cell, in the plan's order; `found` holds the data quality from the last
/// analysis.
pub fn of_cells(
    cells: &[CellRow],
    rows: &Rows,
    records: &[Result<RecordRow, Damaged>],
    found: &[CellQuality],
) -> Vec<CellNumbers> {
    let of_cell = |row: &CellRow| {
        let counts = |record: &&RecordRow| [Some(row.id), rows.lead(row.id)].contains(&Some(record.cell));
        let kept = records.iter().flatten().filter(counts).filter(|record| record.kept());
        let peaks: Vec<f64> = kept.map(|record| record.peak_n).filter(|peak| *peak > 0.0).collect();
        let mean = peaks.iter().sum::<f64>() / peaks.len() as f64;
        let name = configuration_name(row.cell.configuration);
        let cell_quality = found.iter().find(|own| {
            own.configuration == name && own.impact == row.cell.impact && own.response == row.cell.response
        });
        CellNumbers {
            cell: row.id,
            force_n: (!peaks.is_empty()).then_some(mean),
            hits: peaks.len(),
            random_error_percent: cell_quality.and_then(|own| Some(100.0 * own.random_error?)),
            coherence: cell_quality.and_then(|own| own.coherence),
        }
    };
    cells.iter().map(of_cell).collect()
}

/// The median of the coherence over the main band.
fn median(frequency_hz: &[f64], coherence: &[f64]) -> Option<f64> {
    let inside = frequency_hz.iter().zip(coherence).filter(|(f, c)| MAIN_BAND.contains(**f) && c.is_finite());
    let mut inside: Vec<f64> = inside.map(|(_, c)| *c).collect();
    inside.sort_by(f64::total_cmp);
    inside.get(inside.len() / 2).copied()
}

/// Results of an analysis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The estimate.
    pub estimate: Estimate,
    /// Data quality of each cell.
    pub cells: Vec<CellQuality>,
    /// All figures for which there are data, by name, as JSON for the page.
    pub figures: BTreeMap<String, String>,
}

impl Found {
    /// Analyses a campaign file whose newest record is `last`. If the analysis fails, the result
    /// contains the reason and what is missing.
    pub fn of(path: &Path, last: i64) -> Self {
        let results = Store::open_read_only(path)
            .map_err(AnalyseError::from)
            .and_then(|store| report::analysed(&store, Wanted::default(), &|_| {}));
        match results {
            Ok(results) => Self::of_results(&results, last),
            Err(error) => Self::none(last, error.to_string()),
        }
    }

    /// Empty results with a reason.
    pub fn none(last: i64, why: String) -> Self {
        let estimate = Estimate { after_record: last, missing: vec![why], ..Estimate::default() };
        Found { estimate, ..Self::default() }
    }

    fn of_results(results: &Results, last: i64) -> Self {
        let figures = report::all_figures(results);
        let estimate = Estimate {
            after_record: last,
            hits: results.hits.iter().filter(|hit| hit.kept).count(),
            took_s: 0.0,
            answer: json!(results.answer),
            lines: brief::answer(results).into_iter().map(|line| [line.head, line.text]).collect(),
            missing: results.missing.clone(),
            figures: figures.iter().map(|figure| figure.name.to_owned()).collect(),
        };
        Found {
            estimate,
            cells: results.cells.as_ref().map(cell_quality).unwrap_or_default(),
            figures: figures.iter().map(|figure| (figure.name.to_owned(), drawn(figure))).collect(),
        }
    }
}

/// A figure as JSON for the page: its data, and the static drawing that is shown until the page has
/// rendered the data.
pub fn drawn(figure: &Figure) -> String {
    shown_json(&json!({ "figure": figure, "html": figure_fragment(figure) }).to_string()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::Plan;
    use crate::campaign::store::Store;
    use crate::results;
    use std::collections::BTreeMap;

    #[test]
    fn numbers_are_those_of_the_report_and_belong_to_their_cell() {
        let text = include_str!("../../../docs/plans/small.toml");
        Plan::parse(text, "plan").expect("a good plan");
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::create(&folder.path().join("c.jrig"), text, "plan").expect("a file");
        let cells = store.cells().expect("cells");
        assert!(cells.iter().all(|row| row.id > 0) && cells.len() > 3);
        // the third cell has no result; cell n has the error (n + 1) ‰ and the coherence 0.9 +
        // n/1000
        let rows = cells.iter().enumerate().map(|(n, row)| results::CellRow {
            configuration: configuration_name(row.cell.configuration).into(),
            impact: row.cell.impact.clone(),
            response: row.cell.response.clone(),
            wanted: 2,
            kept: 2,
            refused: BTreeMap::new(),
            coherence: if n == 2 { vec![] } else { vec![0.1, 0.9 + 1e-3 * n as f64, 0.2] },
            random_error: (n != 2).then(|| 1e-3 * (n + 1) as f64),
        });
        let cells_found = Cells { frequency_hz: vec![100.0, 400.0, 900.0], cells: rows.collect() };
        let numbers = of_cells(&cells, &Rows::default(), &[], &cell_quality(&cells_found));
        for (n, (own, row)) in numbers.iter().zip(&cells).enumerate() {
            assert_eq!((own.cell, own.force_n, own.hits), (row.id, None, 0));
            if n == 2 {
                assert_eq!((own.random_error_percent, own.coherence), (None, None));
                continue;
            }
            let (error, coherence) =
                (own.random_error_percent.expect("known"), own.coherence.expect("known"));
            assert!((error - 0.1 * (n + 1) as f64).abs() < 1e-5, "{own:?}");
            assert!((coherence - 0.9 - 1e-3 * n as f64).abs() < 1e-5, "{own:?}");
        }
        let nothing = of_cells(&cells, &Rows::default(), &[], &[]);
        assert!(nothing.iter().all(|own| own.random_error_percent.is_none() && own.coherence.is_none()));
    }
}
