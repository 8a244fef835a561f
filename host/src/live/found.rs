//! The results of an analysis of the campaign so far that a page needs. A separate process runs the
//! analysis and writes them; the serving process reads them. The memory of the analysis is released
//! with its process, so that the measuring process does not grow.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::message::Estimate;
use super::numbers::{CellHeard, heard};
use crate::analyse::{AnalyseError, Wanted};
use crate::campaign::store::Store;
use crate::outside::shown_json;
use crate::report::figure::Figure;
use crate::report::words::brief;
use crate::report::{self, figure_fragment};
use crate::results::Results;

/// Results of an analysis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The estimate.
    pub estimate: Estimate,
    /// Data quality of each cell.
    pub cells: Vec<CellHeard>,
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
            cells: results.cells.as_ref().map(heard).unwrap_or_default(),
            figures: figures.iter().map(|figure| (figure.name.to_owned(), drawn(figure))).collect(),
        }
    }
}

/// A figure as JSON for the page: its data, and the static drawing that is shown until the page has
/// rendered the data.
pub fn drawn(figure: &Figure) -> String {
    shown_json(&json!({ "figure": figure, "html": figure_fragment(figure) }).to_string()).into_owned()
}
