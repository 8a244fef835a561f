//! Effects of the link on a campaign: a host that is killed while a shot waits, a stall of a
//! minute, lost scans, and announcements before data is stored.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::scripted_device::by_summary::ByShotSummary;
use crate::scripted_device::fake::{Fake, Shared};
use crate::scripted_device::runner::{content, create, options, plan, rows, run_on};
use jointrig::campaign::plan::{Cell, Plan};
use jointrig::campaign::run::runner::Options;
use jointrig::campaign::store::Store;
use jointrig::campaign::verdict::judge::Judge;
use jointrig::campaign::verdict::others::Others;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::campaign::watch::{Seen, Watch, Watchers};
use jointrig::device::channels::ChannelMap;
use jointrig::device::stream::Recording;

/// 56 hits in seven cells.
fn long_plan() -> String {
    plan().replace("wanted = 2", "wanted = 8").replace("most = 8", "most = 30")
}

fn kept(path: &Path) -> usize {
    let store = Store::open_read_only(path).unwrap();
    rows(&store).iter().filter(|row| row.kept()).count()
}

#[test]
fn a_host_that_ends_while_a_shot_waits_loses_and_repeats_no_hit() {
    let folder = tempfile::tempdir().unwrap();
    let whole = create(&folder, "whole.jrig", &long_plan());
    run_on(&whole, Fake::default(), &options(), &mut ByShotSummary).unwrap();
    assert!(kept(&whole) > 50);
    // a low number is used again by a host that counts from 1
    for waiting in [3, 37] {
        let path = create(&folder, &format!("at{waiting}.jrig"), &long_plan());
        let device = Shared::new(Fake::scripted(|fake| fake.cut_at_order = Some(waiting)));
        run_on(&path, device.clone(), &options(), &mut ByShotSummary).expect_err("the link broke");
        let before = content(&path);
        assert_eq!(before.len(), waiting as usize - 1);
        run_on(&path, device, &options(), &mut ByShotSummary).unwrap();
        let after = content(&path);
        assert!(after[..before.len()] == before[..], "shot {waiting}: what was stored has changed");
        let places: BTreeSet<(i64, u32)> = after.iter().map(|record| (record.0, record.1)).collect();
        assert_eq!(places.len(), after.len(), "shot {waiting}: no hit is stored twice");
        assert!(after == content(&whole), "shot {waiting}: not the records of an undisturbed run");
    }
}

#[test]
fn a_stall_of_a_minute_costs_no_hit_where_nothing_holds_the_device() {
    let folder = tempfile::tempdir().unwrap();
    for (name, waits) in [("waiting", true), ("between", false)] {
        let path = create(&folder, &format!("{name}.jrig"), &plan());
        let device = Fake::scripted(|fake| {
            fake.free_running = true;
            if waits {
                fake.stalls_at_order = Some(5);
            } else {
                fake.stalls_after_order = Some(5);
            }
        });
        let summary = run_on(&path, device, &options(), &mut ByShotSummary).unwrap();
        assert_eq!((summary.kept, summary.given_up), (14, 0), "{name}");
        assert_eq!((summary.accounts.lost, summary.accounts.unexplained()), (60 * 51_200, 0), "{name}");
        assert_eq!(kept(&path), 14, "{name}");
    }
}

/// Judges as usual, except that it reports the samples of some records as lost.
struct Loses {
    judged: u32,
    lost: [u32; 2],
}

impl Judge for Loses {
    fn judge(
        &mut self,
        cell: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement {
        self.judged += 1;
        if self.lost.contains(&self.judged) {
            return Judgement::without_pulse(Verdict::Gap, 480.0, 0.0, "480 samples are missing".into());
        }
        ByShotSummary.judge(cell, plan, channels, recording, others)
    }
}

#[test]
fn a_record_with_missing_samples_does_not_change_the_pulse() {
    let folder = tempfile::tempdir().unwrap();
    let path = create(&folder, "a.jrig", &plan());
    run_on(&path, Fake::default(), &options(), &mut Loses { judged: 0, lost: [4, 7] }).unwrap();
    let rows = rows(&Store::open_read_only(&path).unwrap());
    let lost: Vec<usize> = (0..rows.len()).filter(|at| rows[*at].verdict == Verdict::Gap).collect();
    assert_eq!(lost, [3, 6]);
    for at in lost {
        assert_eq!(rows[at].shot.pulse_us, rows[at + 1].shot.pulse_us, "hit {at}");
    }
}

/// Compares each announcement with the file.
struct Compares {
    path: PathBuf,
    /// Numbers of announced and stored hits, in the order of the announcements.
    seen: Mutex<Vec<(usize, usize)>>,
}

impl Watch for Compares {
    fn saw(&self, seen: &Seen<'_>) {
        if let Seen::Judged { .. } = seen {
            let stored = Store::open_read_only(&self.path).unwrap().places().unwrap().len();
            let mut seen = self.seen.lock().unwrap();
            let announced = seen.len() + 1;
            seen.push((announced, stored));
        }
    }
}

#[test]
fn a_hit_is_announced_when_it_is_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = create(&folder, "a.jrig", &plan());
    let compares = Arc::new(Compares { path: path.clone(), seen: Mutex::default() });
    let options = Options { watch: Watchers::default().and(compares.clone()), ..options() };
    let summary = run_on(&path, Fake::default(), &options, &mut ByShotSummary).unwrap();
    let seen = compares.seen.lock().unwrap();
    assert_eq!(seen.len() as u64, summary.hits);
    assert!(seen.iter().all(|(announced, stored)| stored >= announced), "{seen:?}");
}
