//! What an analysis of the campaign so far found, as far as a page asks for it. The process that analyses writes it, the one that serves reads
//! it: what an analysis takes of memory is gone with its process, and the one that measures stays as small as it was.

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

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The estimate.
    pub estimate: Estimate,
    /// How every cell was heard.
    pub cells: Vec<CellHeard>,
    /// All figures that there are data for, by name: each as the page gets it.
    pub figures: BTreeMap<String, String>,
}

impl Found {
    /// Analyses a campaign file, whose newest record is `last`. An analysis that fails says why, and what is missing.
    pub fn of(path: &Path, last: i64) -> Self {
        let results = Store::open_read_only(path)
            .map_err(AnalyseError::from)
            .and_then(|store| report::analysed(&store, Wanted::default(), &|_| {}));
        match results {
            Ok(results) => Self::of_results(&results, last),
            Err(error) => Self::none(last, error.to_string()),
        }
    }

    /// Nothing, and why.
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

/// A figure as the page gets it: as data, and as the drawing that stands there until the data are alive.
pub fn drawn(figure: &Figure) -> String {
    shown_json(&json!({ "figure": figure, "html": figure_fragment(figure) }).to_string()).into_owned()
}
