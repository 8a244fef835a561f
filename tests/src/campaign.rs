//! A small campaign over any transport, and its records in a comparable form.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use jointrig::campaign::run::error::RunError;
use jointrig::campaign::run::runner::{self, Options, Summary};
use jointrig::campaign::run::stage::Stage;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::campaign::verdict::judge::ByRecord;
use jointrig::campaign::watch::Watchers;
use jointrig::device::samples::Samples;
use jointrig::device::session::Session;
use jointrig::device::transport::Transport;

/// A plan of few cells: geometry and limits of the demo plan, with other cells and hits.
#[must_use]
pub fn plan(wanted: u32, cells: &[(&str, &[&str], &[&str])]) -> String {
    let demo = include_str!("../../docs/plans/demo.toml");
    with_cells(&demo.replace("wanted = 3", &format!("wanted = {wanted}")), cells)
}

/// As [`plan`], for a hammer by hand.
#[must_use]
pub fn by_hand(wanted: u32, cells: &[(&str, &[&str], &[&str])]) -> String {
    plan(wanted, cells) + "\n[hammer]\nby = \"hand\"\n"
}

/// The small plan with only these cells.
#[must_use]
pub fn small_plan(cells: &[(&str, &[&str], &[&str])]) -> String {
    with_cells(include_str!("../../docs/plans/small.toml"), cells)
}

/// The plan `whole` with other cells.
fn with_cells(whole: &str, cells: &[(&str, &[&str], &[&str])]) -> String {
    let (head, rest) = whole.split_once("[[configuration]]").unwrap();
    let geometry = &rest[rest.find("[geometry").or_else(|| rest.find("[[geometry")).unwrap()..];
    let mut text = head.to_owned();
    for (name, impacts, responses) in cells {
        // writing to a string cannot fail
        writeln!(
            text,
            "[[configuration]]\nname = {name:?}\nimpacts = {impacts:?}\nresponses = {responses:?}\n"
        )
        .unwrap();
    }
    text + geometry
}

/// One record, reduced to what must be the same in two runs.
#[derive(Debug, PartialEq)]
pub struct Kept {
    /// Cell and attempt.
    pub place: (i64, u32),
    /// Its verdict.
    pub verdict: &'static str,
    /// The samples of every channel.
    pub samples: Samples,
}

/// Runs the plan over `transport`, to its end or to the first error.
pub fn attempt(file: &Path, plan: &str, transport: Box<dyn Transport>) -> Result<Summary, RunError> {
    let store = Store::create(file, plan, "test plan").unwrap();
    let mut session = Session::open(transport, "test").unwrap();
    let options = Options {
        stage: Stage::Auto,
        yes: true,
        new_structure: false,
        watch: Watchers::default(),
        edits: None,
        answers: None,
        stop: Arc::new(AtomicBool::new(false)),
    };
    runner::run(store, &mut session, &mut ByRecord, &options)
}

/// Runs the plan to its end: the summary and all records.
pub fn run(file: &Path, plan: &str, transport: Box<dyn Transport>) -> (Summary, Vec<Kept>) {
    (attempt(file, plan, transport).unwrap(), records(file))
}

/// For each record, the first scan of the first record of its cell: scans are only comparable
/// within a cell, because a cell is staged when the order for it arrives.
pub fn origins<'a>(rows: impl IntoIterator<Item = &'a RecordRow>) -> Vec<u64> {
    let mut origin = (0, 0);
    let of = |row: &RecordRow| {
        if origin.0 != row.cell {
            origin = (row.cell, row.first_scan);
        }
        origin.1
    };
    rows.into_iter().map(of).collect()
}

/// The rows of all records, in order; every one must be intact.
pub fn rows(store: &Store) -> Vec<RecordRow> {
    store.records().unwrap().into_iter().collect::<Result<_, _>>().unwrap()
}

/// All records of a campaign file, in order.
pub fn records(file: &Path) -> Vec<Kept> {
    let store = Store::open_read_only(file).unwrap();
    rows(&store)
        .iter()
        .map(|row| Kept {
            place: (row.cell, row.attempt),
            verdict: row.standing().name(),
            samples: store.samples(row).unwrap(),
        })
        .collect()
}
