//! Numbers for the live page from an analysis of the campaign so far: the estimates, and for the
//! matrix view each cell's hammer force, the random error of its FRF, and its coherence.
//!
//! The analysis is that of `jointrig analyse`. It runs again whenever more data are stored, in a
//! process separate from the measuring one: that process writes the results that a page needs, and
//! the serving process reads them. The memory of the analysis is released with its process, so that
//! the measuring process does not grow. After the last hit the numbers are those of `results.json`.

use super::bus::Bus;
use super::message::{Estimate, Message};
use crate::analyse::next_cell::{Averaged, Times, outlook};
use crate::analyse::{AnalyseError, Wanted};
use crate::campaign::plan::configuration_name;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::campaign::store::rows::Rows;
use crate::report;
use crate::report::figure::Figure;
use crate::report::figure_fragment;
use crate::report::words::{brief, next_sentences};
use crate::results::{Cells, MAIN_BAND, Results};
use crate::untrusted_text::shown_json;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::io;
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
            Ok(results) => {
                let mut found = Self::of_results(&results, last);
                let known = results.answer.as_ref().is_some_and(|own| own.contact.k_t_n_per_m.is_some());
                found.estimate.lines.extend(known.then(|| next_cell(path)).flatten());
                found
            }
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

/// The present interval of k_T and the cell that shrinks it most, as a line for the page; `None`
/// without a prediction.
fn next_cell(path: &Path) -> Option<[String; 2]> {
    let store = Store::open_read_only(path).ok()?;
    let times = Times::of(&store.plan().ok()?);
    let found = outlook(&store, times, &mut Averaged::default()).ok()?;
    Some(["Next cell".into(), next_sentences::best(&found, found.each_cell().first()?)])
}

/// A figure as JSON for the page: its data, and the static drawing that is shown until the page has
/// rendered the data.
pub fn drawn(figure: &Figure) -> String {
    shown_json(&json!({ "figure": figure, "html": figure_fragment(figure) }).to_string()).into_owned()
}

/// The analysis pauses for this many times its own duration, so that it takes at most a sixth of
/// one core from the measurement.
const REST: u32 = 5;
/// Shortest pause; more frequent results could not be read.
const SHORTEST: Duration = Duration::from_secs(2);
/// If nothing new was stored for this long, nothing is being measured that the analysis could
/// disturb.
const QUIET: Duration = Duration::from_secs(4);
/// The hidden subcommand of the analysing process.
pub const COMMAND: &str = "analyse-for-page";
/// Interval between two checks for new data.
const LOOK: Duration = Duration::from_millis(200);

/// The newest analysis.
#[derive(Debug, Default)]
pub struct Formed {
    found: std::sync::Mutex<Arc<Found>>,
}

impl Formed {
    /// Its results.
    pub fn found(&self) -> Arc<Found> {
        self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    fn set(&self, found: Found) {
        *self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Arc::new(found);
    }
}

/// Analyses the file repeatedly while it grows, until `stop`.
pub fn form(path: &Path, bus: &Bus, formed: &Formed, stop: &AtomicBool) {
    let (mut known, mut seen) = (None, None);
    let (mut rest_until, mut changed) = (Instant::now(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK);
        let newest = match newest(path) {
            Ok(newest) => newest,
            Err(error) => {
                log::debug!("the page's estimate is delayed: {error}");
                continue;
            }
        };
        if seen != Some(newest) {
            (seen, changed) = (Some(newest), Instant::now());
        }
        let rests = Instant::now() < rest_until && changed.elapsed() < QUIET;
        if rests || known == Some(newest) || newest.records == 0 {
            continue;
        }
        known = Some(newest);
        let begun = Instant::now();
        let mut found = analysed_elsewhere(path, newest.last)
            .unwrap_or_else(|why| Found::none(newest.last, format!("no estimate is made: {why}")));
        let took = begun.elapsed();
        found.estimate.took_s = took.as_secs_f64();
        bus.say(Message::Estimate(Box::new(found.estimate.clone())));
        formed.set(found);
        rest_until = Instant::now() + (took * REST).max(SHORTEST);
    }
}

/// Starts this program as a separate process that analyses the file.
fn analysed_elsewhere(path: &Path, last: i64) -> io::Result<Found> {
    // the program that is running, even if its file was replaced meanwhile
    let itself = Path::new("/proc/self/exe");
    let program = if itself.exists() { itself.to_owned() } else { std::env::current_exe()? };
    let mut child = Command::new(program)
        .arg(COMMAND)
        .arg(path)
        .arg(last.to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    // the child ends when this end of its stdin is closed, which also happens when this process
    // dies
    let alive = child.stdin.take();
    let mut text = String::new();
    let read = child.stdout.take().map_or(Ok(0), |mut out| out.read_to_string(&mut text));
    let status = child.wait()?;
    drop(alive);
    read?;
    if !status.success() {
        return Err(io::Error::other(format!("the analysis ended with {status}")));
    }
    Ok(serde_json::from_str(&text)?)
}

/// Main function of the analysing process: writes the results for the file as JSON, and ends early
/// when its stdin is closed.
///
/// # Errors
/// The result cannot be written.
pub fn analyse_for_another(path: &Path, last: i64, out: &mut impl io::Write) -> io::Result<()> {
    // the other cores are for the measurement
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().map_err(io::Error::other)?;
    std::thread::Builder::new().name("wanted still".into()).spawn(|| {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        std::process::exit(0);
    })?;
    serde_json::to_writer(&mut *out, &Found::of(path, last))?;
    out.flush()
}

/// What an analysis depends on: it is repeated when one of these changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Newest {
    records: usize,
    levels: usize,
    overruled: usize,
    last: i64,
}

fn newest(path: &Path) -> Result<Newest, crate::campaign::store::error::StoreError> {
    let store = Store::open_read_only(path)?;
    let places = store.places()?;
    Ok(Newest {
        records: places.len(),
        levels: store.levels()?.len(),
        overruled: store.overrules()?.len(),
        last: places.iter().map(|place| place.id).max().unwrap_or(0),
    })
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
