use super::*;
use crate::campaign::judge::by_summary::ByShotSummary;
use crate::campaign::plan::SMALL;
use crate::device::fake::Fake;
use crate::device::faulty::{Faults, Faulty};
use crate::device::transport::Transport;
use std::path::Path;

fn plan() -> String {
    SMALL
        .replace("length_s = 2.0", "length_s = 0.1")
        .replace("listen_s = 0.15", "listen_s = 0.02")
        // far from the force wanted, so that the loop has something to do
        .replace("pulse_us = 3500", "pulse_us = 2000")
        .replace("pulse_bounds_us = [2500, 6000]", "pulse_bounds_us = [500, 8000]")
}

fn options() -> Options {
    Options { stage: Stage::Auto, yes: true, progress: false, stop: Arc::default() }
}

fn run_on(
    path: &Path,
    transport: impl Transport + 'static,
    options: &Options,
    judge: &mut dyn Judge,
) -> Result<Summary, RunError> {
    let store = Store::open(path).expect("opens");
    let mut session = Session::open(Box::new(transport), "fake:").expect("answers");
    run(store, &mut session, judge, options)
}

fn create(folder: &tempfile::TempDir, name: &str, text: &str) -> std::path::PathBuf {
    let path = folder.path().join(name);
    Store::create(&path, text, "test.toml").expect("created").close().expect("closed");
    path
}

/// What two equal runs have in common: everything but absolute scans and times.
fn content(path: &Path) -> Vec<(i64, u32, Kind, usize, u32, Vec<i16>)> {
    let store = Store::open_read_only(path).expect("opens");
    assert_eq!(store.verify().expect("checked"), []);
    let rows = store.records().expect("rows");
    rows.iter()
        .map(|row| {
            let codes = store.samples(row).expect("samples").codes;
            (row.cell, row.attempt, row.verdict, row.trigger_index, row.shot.pulse_us, codes)
        })
        .collect()
}

fn distances(path: &Path) -> Vec<(i64, u64)> {
    let rows = Store::open_read_only(path).expect("opens").records().expect("rows");
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
fn a_bolt_that_does_not_arrive_is_weak_and_the_pulse_grows() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = create(&folder, "a.jrig", &plan());
    let fake = Fake::scripted(|fake| fake.reach_us = 2_300);
    let summary = run_on(&path, fake, &options(), &mut ByShotSummary).expect("runs");
    assert_eq!(summary.kept, 14);
    let records = content(&path);
    assert_eq!((records[0].2, records[0].5.len()), (Kind::Weak, 0));
    assert!(records[0].4 < records[1].4);
}

#[test]
fn a_cell_that_never_succeeds_is_given_up_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = plan().replace("weak_n = 30.0", "weak_n = 74.0").replace("most = 8", "most = 3");
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
