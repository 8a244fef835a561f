//! A small campaign over any transport, and its records in a comparable form.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use jointrig::campaign::plan::CONTACT;
use jointrig::campaign::run::error::RunError;
use jointrig::campaign::run::further::Further;
use jointrig::campaign::run::runner::{self, Options, Summary};
use jointrig::campaign::run::stage::Stage;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::campaign::verdict::judge::ByRecord;
use jointrig::campaign::watch::Watchers;
use jointrig::device::address::Address;
use jointrig::device::samples::{SampleType, Samples};
use jointrig::device::session::Session;
use jointrig::device::transport::Transport;
use num_complex::Complex;

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

/// The plan with records of one second instead of two, and the window that belongs to them: half the
/// samples to simulate, store and transform, for tests of something else than accuracy.
#[must_use]
pub fn one_second(plan: &str) -> String {
    let mut text = plan.to_owned();
    for (old, new) in
        [("length_s = 2.0", "length_s = 1.0"), ("exponential_per_s = 2.3", "exponential_per_s = 4.6")]
    {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    text
}

/// The contact plan without the hits on the known mass: k_T then depends on the hammer's gain.
#[must_use]
pub fn without_known_mass(plan: &str) -> String {
    let mut text = plan.to_owned();
    for cut in [
        "[known_mass]\nmass_kg = 3.0\nsigma = 0.002\n",
        "[[configuration]]\nname = \"B\"\nimpacts = [\"MASS\"]\nresponses = [\"MASS\"]\n",
    ] {
        assert!(text.contains(cut), "{cut}");
        text = text.replace(cut, "");
    }
    text
}

/// The contact plan with 42 hits of one second, without the known mass and the open joint.
#[must_use]
pub fn short_contact_plan() -> String {
    let mut text = without_known_mass(&one_second(CONTACT));
    for (old, new) in [
        ("[[configuration]]\nname = \"AJB\"\nimpacts = [\"OPEN\"]\nresponses = [\"OPEN\"]\n", ""),
        ("[[configuration]]\nname = \"AJB\"\nimpacts = [\"AZ3\"]\nresponses = [\"A3\"]\n", ""),
        ("\"BZ3\", \"BY1\", \"BY2\", \"BY3\", \"BX1\", \"BX2\", \"BX3\"]", "\"BZ3\"]"),
        ("impacts = [\"AZ1\", \"AZ2\", \"AZ3\"]", "impacts = [\"AZ1\", \"AZ3\"]"),
        ("\"C4\", \"D1\", \"D2\", \"D3\", \"B1\"", "\"B1\""),
        ("wanted = 6", "wanted = 2"),
    ] {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    text
}

/// A hit as measured.
pub struct MeasuredHit {
    /// The hammer's force, N.
    pub force_n: Vec<f64>,
    /// The response along z, m/s.
    pub velocity_z: Vec<f64>,
    /// Type of the samples.
    pub of: SampleType,
}

/// The second of two hits at AZ3 on A, with the response at A3, on the simulated rig that this TOML
/// describes.
#[must_use]
pub fn second_hit_on_a(rig: &str) -> MeasuredHit {
    let folder = tempfile::tempdir().unwrap();
    let (description, file) = (folder.path().join("rig.toml"), folder.path().join("c.jrig"));
    std::fs::write(&description, rig).unwrap();
    let address: Address = format!("sim:{}", description.display()).parse().unwrap();
    let (summary, _) = run(&file, &plan(2, &[("A", &["AZ3"], &["A3"])]), address.open(5).unwrap());
    assert_eq!(summary.kept, 2);
    let store = Store::open_read_only(&file).unwrap();
    let row = rows(&store).swap_remove(1);
    let (channels, samples) = (store.channels(row.session).unwrap(), store.samples(&row).unwrap());
    let of = |name: &str| {
        let place = channels.named(name).unwrap();
        (channels.to_si(place, samples.channel(place)), samples.channel(place).of())
    };
    let ((force_n, _), (velocity_z, of)) = (of("force"), of("vib_z"));
    MeasuredHit { force_n, velocity_z, of }
}

impl MeasuredHit {
    /// The mobility at the complex frequency `s`, 1/s, where the transforms of force and velocity
    /// converge; the rectangular window of the force is 8 ms.
    #[must_use]
    pub fn mobility(&self, s: Complex<f64>) -> Complex<f64> {
        let transform = |signal: &[f64]| -> Complex<f64> {
            signal.iter().enumerate().map(|(i, x)| *x * (-s * (i as f64 / 51_200.0)).exp()).sum()
        };
        transform(&self.velocity_z) / transform(&self.force_n[..410])
    }
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

/// Runs the plan over `transport`, to its end or to the first error; a campaign file that exists is
/// continued.
pub fn attempt(file: &Path, plan: &str, transport: Box<dyn Transport>) -> Result<Summary, RunError> {
    let store = if file.exists() {
        Store::open(file).unwrap()
    } else {
        Store::create(file, plan, "test plan").unwrap()
    };
    measure(store, transport, None)
}

/// Continues a campaign with the cells that are chosen after those of the plan.
pub fn run_further(
    file: &Path,
    transport: Box<dyn Transport>,
    further: Further,
) -> Result<Summary, RunError> {
    measure(Store::open(file).unwrap(), transport, Some(further))
}

fn measure(
    store: Store,
    transport: Box<dyn Transport>,
    further: Option<Further>,
) -> Result<Summary, RunError> {
    let mut session = Session::open(transport, "test").unwrap();
    let options = Options {
        stage: Stage::Auto,
        yes: true,
        new_structure: false,
        watch: Watchers::default(),
        edits: None,
        answers: None,
        further,
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
