//! Campaigns on a scripted device: complete, interrupted, over a bad link, with a device that fails
//! or restarts.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

use crate::scripted_device::by_summary::ByShotSummary;
use crate::scripted_device::fake::Fake;
use crate::scripted_device::faulty::{Faults, Faulty};
use jointrig::campaign::plan::SMALL;
use jointrig::campaign::plan::{Cell, Plan};
use jointrig::campaign::run::answers::{Edit, EditQueue, edits};
use jointrig::campaign::run::error::RunError;
use jointrig::campaign::run::runner::{Options, Summary, run};
use jointrig::campaign::run::stage::Stage;
use jointrig::campaign::run::tally::Tally;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::campaign::verdict::judge::Judge;
use jointrig::campaign::verdict::others::Others;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::campaign::watch::Watchers;
use jointrig::device::channels::ChannelMap;
use jointrig::device::logs::Tables;
use jointrig::device::samples::Samples;
use jointrig::device::session::Session;
use jointrig::device::stream::Recording;
use jointrig::device::transport::Transport;
use jointrig_logs::example::{WARNING, image, line};
use jointrig_logs::file_name;

pub fn plan() -> String {
    SMALL
        .replace("length_s = 2.0", "length_s = 0.1")
        .replace("listen_s = 0.15", "listen_s = 0.02")
        // far from the target force, so that the pulse must be adjusted
        .replace("pulse_us = 3500", "pulse_us = 2000")
        .replace("pulse_bounds_us = [2500, 6000]", "pulse_bounds_us = [500, 8000]")
}

pub fn options() -> Options {
    Options {
        stage: Stage::Auto,
        yes: true,
        new_structure: false,
        watch: Watchers::default(),
        edits: None,
        answers: None,
        further: None,
        stop: Arc::default(),
    }
}

pub fn run_on(
    path: &Path,
    transport: impl Transport + 'static,
    options: &Options,
    judge: &mut dyn Judge,
) -> Result<Summary, RunError> {
    let store = Store::open(path).expect("opens");
    let mut session = Session::open(Box::new(transport), "fake:").expect("answers");
    run(store, &mut session, judge, options)
}

pub fn create(folder: &tempfile::TempDir, name: &str, text: &str) -> std::path::PathBuf {
    let path = folder.path().join(name);
    Store::create(&path, text, "test.toml").expect("created").close().expect("closed");
    path
}

/// The rows of all records, every one intact.
pub fn rows(store: &Store) -> Vec<RecordRow> {
    store.records().expect("rows").into_iter().collect::<Result<_, _>>().expect("whole")
}

/// What two equal runs have in common: everything except absolute scans and times.
pub fn content(path: &Path) -> Vec<(i64, u32, Verdict, usize, u32, Samples)> {
    let store = Store::open_read_only(path).expect("opens");
    assert_eq!(store.verify().expect("checked"), []);
    let rows = self::rows(&store);
    rows.iter()
        .map(|row| {
            let samples = store.samples(row).expect("samples");
            (row.cell, row.attempt, row.verdict, row.trigger_index, row.shot.pulse_us, samples)
        })
        .collect()
}

fn distances(path: &Path) -> Vec<(i64, u64)> {
    let rows = self::rows(&Store::open_read_only(path).expect("opens"));
    rows.windows(2)
        .filter(|pair| pair[0].cell == pair[1].cell)
        .map(|pair| (pair[0].cell, pair[1].first_scan - pair[0].first_scan))
        .collect()
}

#[test]
fn a_campaign_is_complete_and_the_same_over_any_link() {
    let folder = tempfile::tempdir().expect("a folder");
    let clean = create(&folder, "clean.jrig", &plan());
    let summary = run_on(&clean, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    assert_eq!((summary.kept, summary.wanted, summary.interrupted), (14, 14, false));
    assert_eq!(summary.accounts.unexplained(), 0);
    assert!(summary.hits > 14, "the first pulses are too weak: {summary:?}");
    for seed in 0..2 {
        let spoilt = create(&folder, &format!("spoilt{seed}.jrig"), &plan());
        let faults = Faults { drop: 0.02, corrupt: 0.01, duplicate: 0.01, truncate: 0.01 };
        let link = Faulty::new(Fake::default(), faults, seed);
        let summary = run_on(&spoilt, link, &options(), &mut ByShotSummary).expect("runs");
        assert_eq!((summary.accounts.unexplained(), summary.accounts.lost), (0, 0));
        assert!(content(&clean) == content(&spoilt), "seed {seed}: other records");
        assert_eq!(distances(&clean), distances(&spoilt), "hits of a cell are at fixed distances");
    }
}

#[test]
fn what_the_controller_logs_is_kept_with_the_campaign() {
    let folder = tempfile::tempdir().expect("a folder");
    // the build that the scripted device names
    std::fs::write(folder.path().join(file_name(1)), image(1)).expect("written");
    let path = create(&folder, "c.jrig", &plan());
    let fake = Fake::scripted(|fake| fake.says = vec![line(WARNING, 3, &[7, 0, 0, 0])]);
    let mut session = Session::open(Box::new(fake), "fake:").expect("answers");
    session.look_for_log_tables(Tables::in_folders(vec![folder.path().into()]));
    let store = Store::open(&path).expect("opens");
    let summary = run(store, &mut session, &mut ByShotSummary, &options()).expect("runs");
    let file = rusqlite::Connection::open(&path).expect("opens");
    let sql = "SELECT count(*) FROM log WHERE text = 'controller: WARN 0.000003 pressure 7'";
    let kept: u64 = file.query_row(sql, [], |row| row.get(0)).expect("counted");
    // a shot takes at least two requests, and each answer is preceded by a log line
    assert!(kept >= 2 * summary.hits, "{kept} lines of {} hits", summary.hits);
}

/// Judges as usual, and stops the run after some records.
struct StopAfter(u32, Arc<AtomicBool>);

impl Judge for StopAfter {
    fn judge(
        &mut self,
        cell: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 {
            self.1.store(true, Ordering::Relaxed);
        }
        ByShotSummary.judge(cell, plan, channels, recording, others)
    }
}

#[test]
fn an_interrupted_campaign_resumes_to_the_same_records() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = create(&folder, "whole.jrig", &plan());
    run_on(&whole, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    let parts = create(&folder, "parts.jrig", &plan());
    let mut kept = 0;
    for _ in 0..30 {
        let options = options();
        let mut judge = StopAfter(3, options.stop.clone());
        let summary = run_on(&parts, Fake::default(), &options, &mut judge).expect("runs");
        assert!(summary.kept >= kept, "nothing accepted is lost");
        kept = summary.kept;
        if !summary.interrupted {
            break;
        }
    }
    assert_eq!(kept, 14);
    assert!(content(&whole) == content(&parts));
}

/// Judges as usual when all earlier records are stored, drops a good hit of the first cell once
/// there are three, and records how many hits it is given.
struct DropsOne {
    edit_queue: Option<EditQueue>,
    path: PathBuf,
    judged: usize,
    given: Vec<usize>,
}

impl Judge for DropsOne {
    fn judge(
        &mut self,
        cell: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement {
        let store = Store::open_read_only(&self.path).unwrap();
        while store.places().unwrap().len() < self.judged {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.judged += 1;
        self.given.push(others.hits());
        if others.hits() == 3
            && let Some(edit_queue) = self.edit_queue.take()
        {
            let good = rows(&store).into_iter().find(RecordRow::kept).unwrap();
            let edit = Edit::Overrule { record: good.id, verdict: Verdict::Dropped, reason: "test".into() };
            let (tell, told) = channel();
            edit_queue.hand_in(edit, move |outcome| tell.send(outcome).unwrap()).unwrap();
            told.recv().unwrap().unwrap();
        }
        ByShotSummary.judge(cell, plan, channels, recording, others)
    }
}

#[test]
fn a_hit_dropped_meanwhile_is_no_measure_for_those_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = plan().replace("wanted = 2", "wanted = 8").replace("most = 8", "most = 30");
    let path = create(&folder, "a.jrig", &text);
    let (edit_queue, edits) = edits();
    let options = Options { edits: Some(edits), ..options() };
    let mut judge =
        DropsOne { edit_queue: Some(edit_queue), path: path.clone(), judged: 0, given: Vec::new() };
    run_on(&path, Fake::default(), &options, &mut judge).unwrap();
    let store = Store::open_read_only(&path).unwrap();
    let first = store.cells().unwrap()[0].id;
    let of_first: Vec<RecordRow> = rows(&store).into_iter().filter(|row| row.cell == first).collect();
    assert_eq!(of_first.iter().filter(|row| row.kept()).count(), 8, "another one in its place");
    // the last one is judged with the seven others that count; including the dropped one there
    // would be eight
    assert_eq!(judge.given[of_first.len() - 1], 7, "{:?}", &judge.given[..of_first.len()]);
}

#[test]
fn a_vanished_device_is_an_error_that_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = create(&folder, "a.jrig", &plan());
    let fake = Fake::scripted(|fake| fake.dies_after = Some(30));
    let error = run_on(&path, fake, &options(), &mut ByShotSummary).expect_err("it is gone");
    assert!(error.to_string().contains("fake:"), "{error}");
    let before = content(&path);
    assert!(!before.is_empty());
    let summary = run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    assert_eq!(summary.kept, 14);
    assert!(content(&path)[..before.len()] == before[..]);
}

#[test]
fn a_device_that_restarts_in_mid_record_is_an_error_that_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = create(&folder, "whole.jrig", &plan());
    run_on(&whole, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    for after in [25, 33, 41] {
        let path = create(&folder, &format!("{after}.jrig"), &plan());
        let fake = Fake::scripted(|fake| fake.restarts_after = Some(after));
        let error = run_on(&path, fake, &options(), &mut ByShotSummary).expect_err("its stream is gone");
        assert!(error.to_string().contains("fake:"), "{error}");
        let before = content(&path);
        assert!(before[..] == content(&whole)[..before.len()]);
        run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
        assert!(content(&path) == content(&whole), "after {after} requests");
    }
}

#[test]
fn attempts_that_run_out_settle_a_cell_with_enough_good_hits() {
    let folder = tempfile::tempdir().expect("a folder");
    // the first pulses are too weak
    let text = plan().replace("wanted = 2", "wanted = 8");
    let path = create(&folder, "a.jrig", &text);
    let summary = run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    let store = Store::open_read_only(&path).expect("opens");
    let (cells, records) = (store.cells().expect("cells"), store.records().expect("records"));
    let first = cells[0].settled.clone().expect("not all of its eight hits were good");
    assert!(first.contains("of 8 good after 8 hits"), "{first}");
    assert_eq!(summary.given_up, 0);
    assert!(Tally::new(&cells, store.rows().expect("rows"), &records).complete());
    assert!(cells[1..].iter().all(|cell| cell.settled.is_none()));
}

#[test]
fn a_cell_ends_early_when_its_frfs_are_good_enough() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = plan().replace("wanted = 2", "wanted = 8").replace("minimum = 1", "minimum = 3");
    let text = text.replace("pulse_us = 2000", "pulse_us = 3000");
    let kept = |name: &str, error: f64| {
        let more = format!("{text}\n[enough]\nrandom_error = {error}\nband_hz = [200.0, 2000.0]\n");
        let path = create(&folder, name, &more);
        let summary = run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
        let cells = Store::open_read_only(&path).expect("opens").cells().expect("cells");
        (summary.kept, cells.iter().filter(|cell| cell.settled.is_some()).count())
    };
    let (all, few) = (kept("strict.jrig", 1e-9), kept("lax.jrig", 0.5));
    assert_eq!(all, (56, 0));
    assert_eq!(few, (21, 7), "three good hits are enough everywhere");
}

#[test]
fn a_sensor_that_is_not_the_plans_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    for (n, (more, word)) in [
        ("name = \"ch9\"", "no channel `ch9`"),
        ("name = \"ch0\"\npolarity = -1", "channel.polarity"),
        ("name = \"ch0\"\nsensitivity_v = 0.02", "channel.sensitivity_v"),
        ("name = \"ch0\"\nrange = 50.0", "channel.range"),
    ]
    .into_iter()
    .enumerate()
    {
        let path = create(&folder, &format!("{n}.jrig"), &format!("{}\n[[channel]]\n{more}\n", plan()));
        let error = run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect_err("unfit");
        assert!(error.to_string().contains(word), "{error}");
    }
    let good = "[[channel]]\nname = \"ch0\"\nmodel = \"M\"\nserial = \"S7\"\ncalibrated = \"2026-01-31\"\nrange = 327.68";
    let path = create(&folder, "good.jrig", &format!("{}\n{good}\n", plan()));
    run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    let sensors = Store::open_read_only(&path).expect("opens").sensors(1).expect("sensors");
    assert_eq!(sensors[0].serial.as_deref(), Some("S7"));
    assert_eq!(sensors[1].serial, None);
}

#[test]
fn a_bolt_that_does_not_arrive_is_weak_and_the_pulse_grows() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = create(&folder, "a.jrig", &plan());
    let fake = Fake::scripted(|fake| fake.reach_us = 2_300);
    let summary = run_on(&path, fake, &options(), &mut ByShotSummary).expect("runs");
    assert_eq!(summary.kept, 14);
    let records = content(&path);
    assert_eq!((records[0].2, records[0].5.scans()), (Verdict::Weak, 0));
    assert!(records[0].4 < records[1].4);
}

#[test]
fn a_cell_that_never_succeeds_is_given_up_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    // a pulse that may not be lengthened never reaches the target force
    let text = plan()
        .replace("weak_n = 30.0", "weak_n = 74.0")
        .replace("target_n = 50.0", "target_n = 74.5")
        .replace("[2500, 6000]", "[3500, 3500]")
        .replace("most = 8", "most = 3");
    let path = create(&folder, "a.jrig", &text);
    let summary = run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect("runs");
    assert_eq!((summary.kept, summary.given_up), (0, 7));
    let cells = Store::open_read_only(&path).expect("opens").cells().expect("cells");
    assert_eq!(cells[0].given_up.as_deref(), Some("0 of 2 good after 3 hits, at least 1 needed"));
}

#[test]
fn a_device_that_does_not_fit_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = create(&folder, "a.jrig", &plan().replace("rate_hz = 51200", "rate_hz = 25600"));
    let error = run_on(&path, Fake::default(), &options(), &mut ByShotSummary).expect_err("another rate");
    assert!(error.to_string().contains("record.rate_hz"), "{error}");
}

#[test]
fn a_person_may_move_hammer_and_laser() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = create(&folder, "a.jrig", &plan());
    let fake = Fake::scripted(|fake| fake.stage_known = false);
    let summary = run_on(&path, fake, &options(), &mut ByShotSummary).expect("runs");
    assert_eq!(summary.kept, 14);
}

#[test]
fn a_coil_whose_pulses_are_too_short_for_the_plan_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = create(&folder, "c.jrig", &plan());
    let device = Fake::scripted(|fake| fake.coil_cap_us = 400);
    let refused = run_on(&path, device, &options(), &mut ByShotSummary).expect_err("500 µs is the shortest");
    let said = refused.to_string();
    assert!(said.contains("at most 400 µs") && said.contains("pulse_bounds_us"), "{said}");
    assert!(Store::open_read_only(&path).expect("opens").records().expect("rows").is_empty());
    // a limit between the plan's bounds is respected
    let device = Fake::scripted(|fake| fake.coil_cap_us = 2_500);
    let summary = run_on(&path, device, &options(), &mut ByShotSummary).expect("runs");
    assert!(summary.hits > 0);
    let store = Store::open_read_only(&path).expect("opens");
    assert!(rows(&store).iter().all(|row| row.shot.pulse_us <= 2_500));
}
