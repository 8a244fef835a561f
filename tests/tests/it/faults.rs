//! A disk that fails or loses power at any operation of a small campaign: `verify` is clean or
//! names what is lost, and the same command continues to the same records as an undisturbed run.
//!
//! `faults/disk.c` is preloaded under the program and counts its operations on its folder. Failures
//! are tested with one run per operation. Power cuts are replayed from one recorded run: data that
//! had not been synced by then is present, missing, or partly present, at random.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

use jointrig_tests::campaign::{Kept, records, small_plan};
use jointrig_tests::command::jointrig;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// An operation of the program on its folder, as recorded by `disk.c`.
#[derive(Clone, Debug)]
struct Deed {
    kind: char,
    file: String,
    at: usize,
    bytes: Vec<u8>,
}

fn deeds(log: &Path) -> Vec<Deed> {
    let bytes = fs::read(log).unwrap();
    let (mut rest, mut deeds) = (bytes.as_slice(), Vec::new());
    let mut take = |count: usize| {
        let (part, after) = rest.split_at(count);
        rest = after;
        part.to_vec()
    };
    let mut left = bytes.len();
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte));
    let name = |path: &[u8]| {
        let path = PathBuf::from(String::from_utf8(path.to_vec()).unwrap());
        path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    };
    while left > 0 {
        let kind = char::from(take(1)[0]);
        let length = number(&take(4));
        let path = take(length);
        let at = number(&take(8));
        let count = number(&take(4));
        left -= 17 + length + count;
        let file = if kind == 'd' { String::new() } else { name(&path) };
        let bytes = take(count);
        deeds.push(Deed {
            kind,
            file,
            at,
            bytes: if kind == 'r' { name(&bytes).into_bytes() } else { bytes },
        });
    }
    deeds
}

/// Compiles `disk.c` to a shared object; a C compiler is available, because SQLite is built with
/// it.
fn disk(folder: &Path) -> PathBuf {
    let out = folder.join("disk.so");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("faults/disk.c");
    let cc = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let built = Command::new(cc)
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .arg(&out)
        .arg(source)
        .args(["-ldl", "-lpthread"])
        .output();
    let built = built.expect("a C compiler, as for SQLite");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    out
}

/// A new campaign with few and short records, and its records after an undisturbed run.
struct Setting {
    folder: tempfile::TempDir,
    disk: PathBuf,
    new: Vec<u8>,
    undisturbed: Vec<Kept>,
    deeds: Vec<Deed>,
}

impl Setting {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let disk = disk(folder.path());
        let plan =
            small_plan(&[("AJB", &["AZ1"], &["A1", "B1"])]).replace("length_s = 2.0", "length_s = 0.1");
        fs::write(folder.path().join("plan.toml"), plan).unwrap();
        let place = folder.path().join("undisturbed");
        fs::create_dir(&place).unwrap();
        let file = place.join("a.jrig");
        let made = jointrig()
            .args(["campaign", "new"])
            .arg(&file)
            .arg("--plan")
            .arg(folder.path().join("plan.toml"))
            .output();
        assert!(made.unwrap().status.success());
        let new = fs::read(&file).unwrap();
        let log = folder.path().join("log");
        let out = run(&place).env("LD_PRELOAD", &disk).env("FAULT_LOG", &log).output().unwrap();
        assert!(out.status.success(), "{}", said(&out));
        let setting = Self { undisturbed: records(&file), deeds: deeds(&log), folder, disk, new };
        let count = |kind| setting.deeds.iter().filter(|deed| deed.kind == kind).count();
        assert!(
            setting.undisturbed.len() >= 4 && count('w') > 100 && count('s') > 10,
            "{} deeds",
            setting.deeds.len()
        );
        setting
    }

    /// A folder with the new campaign.
    fn fresh(&self, name: &str) -> PathBuf {
        let place = self.folder.path().join(name);
        fs::create_dir(&place).unwrap();
        fs::write(place.join("a.jrig"), &self.new).unwrap();
        place
    }

    /// After a fault: `verify` is clean or names what is lost, and the same command ends with the
    /// same records.
    fn holds(&self, place: &Path, what: &str) {
        let file = place.join("a.jrig");
        let verified = jointrig().args(["campaign", "verify", "--deep"]).arg(&file).output().unwrap();
        let words = said(&verified);
        assert!(!words.contains("panicked"), "{what}: {words}");
        assert!(verified.status.success() || words.contains("damaged"), "{what}: {words}");
        // the rescued file next to it is a separate campaign
        for rescued in fs::read_dir(place).unwrap().map(|entry| entry.unwrap().path()) {
            if rescued.to_string_lossy().contains("rescued")
                && rescued.extension().is_some_and(|end| end == "jrig")
            {
                let verified = jointrig().args(["campaign", "verify"]).arg(&rescued).output().unwrap();
                assert!(verified.status.success(), "{what}: {}", said(&verified));
            }
        }
        let again = run(place).output().unwrap();
        assert!(again.status.success(), "{what}: {}", said(&again));
        assert!(records(&file) == self.undisturbed, "{what}: other records");
        fs::remove_dir_all(place).unwrap();
    }

    /// One run in which the disk fails; returns whether the run failed.
    fn fails(&self, at: usize, how: &str) -> bool {
        let what = format!("{how} at {at} ({:?})", self.deeds.get(at).map(|deed| (deed.kind, &deed.file)));
        let place = self.fresh(&format!("{how}{at}"));
        let out = run(&place)
            .env("LD_PRELOAD", &self.disk)
            .env("FAULT_AT", at.to_string())
            .env("FAULT_HOW", how)
            .output()
            .unwrap();
        let words = said(&out);
        assert!(!words.contains("panicked"), "{what}: {words}");
        if out.status.success() {
            // no essential operation has failed
            assert!(records(&place.join("a.jrig")) == self.undisturbed, "{what}: exit 0 with other records");
        } else {
            assert_eq!(out.status.code(), Some(1), "{what}: {words}");
            assert!(words.contains("jointrig: "), "{what}: {words}");
        }
        self.holds(&place, &what);
        !out.status.success()
    }

    /// The folder after a power cut before operation `at`.
    fn cut(&self, at: usize, dice: u64) {
        let what = format!("power cut at {at}, dice {dice}");
        let mut dice = Xoshiro256PlusPlus::seed_from_u64(1000 * at as u64 + dice);
        let place = self.fresh(&format!("cut{at}_{}", dice.next_u32()));
        let past = &self.deeds[..at];
        // directory entries up to the last sync, and some of those after it
        let named = past.iter().rposition(|deed| deed.kind == 'd').unwrap_or(0);
        let named = named + dice.next_u64() as usize % (at - named + 1);
        // a file's bytes up to its own last sync, and some of those after it
        let safe: BTreeMap<&str, usize> = past
            .iter()
            .enumerate()
            .filter(|(_, deed)| deed.kind == 's')
            .map(|(n, deed)| (deed.file.as_str(), n))
            .collect();
        let mut files = BTreeMap::from([("a.jrig".to_owned(), self.new.clone())]);
        let mut lost = BTreeSet::new();
        for (n, deed) in past.iter().enumerate() {
            let kept = safe.get(deed.file.as_str()).is_some_and(|safe| n < *safe)
                || dice.next_u32().is_multiple_of(2);
            match deed.kind {
                'o' if n <= named => drop(files.entry(deed.file.clone()).or_default()),
                'o' => drop(lost.insert(deed.file.clone())),
                'u' if n <= named => drop(files.remove(&deed.file)),
                'r' if n <= named => {
                    if let Some(bytes) = files.remove(&deed.file) {
                        files.insert(String::from_utf8(deed.bytes.clone()).unwrap(), bytes);
                    }
                }
                'w' | 't' if !kept || lost.contains(&deed.file) => {}
                't' => {
                    if let Some(bytes) = files.get_mut(&deed.file) {
                        bytes.resize(deed.at, 0);
                    }
                }
                'w' => {
                    let Some(bytes) = files.get_mut(&deed.file) else { continue };
                    // of the last write, the sectors that were completed
                    let whole = n + 1 < at || safe.get(deed.file.as_str()).is_some_and(|safe| n < *safe);
                    let count = if whole {
                        deed.bytes.len()
                    } else {
                        deed.bytes.len().min(512 * (dice.next_u32() as usize % 9))
                    };
                    let end = deed.at + count;
                    if bytes.len() < end {
                        bytes.resize(end, 0);
                    }
                    bytes[deed.at..end].copy_from_slice(&deed.bytes[..count]);
                }
                _ => {}
            }
        }
        for (name, bytes) in files {
            // without shared memory, which SQLite recreates, and the lock of a process that has
            // ended
            if !name.ends_with("-shm") {
                fs::write(place.join(name), bytes).unwrap();
            }
        }
        self.holds(&place, &what);
    }
}

fn run(place: &Path) -> Command {
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(place.join("a.jrig")).args(["--device", "sim:", "--yes"]);
    command.env("FAULT_FOLDER", place);
    command
}

fn said(out: &Output) -> String {
    [&out.stdout, &out.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

/// Calls `deed` for all of these in parallel on all processors.
fn everywhere<T: Sync>(all: &[T], deed: impl Fn(&T) + Sync) {
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(one) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    deed(one);
                }
            });
        }
    });
}

fn failures(setting: &Setting, step: usize) {
    let places: Vec<(usize, &str)> =
        (0..setting.deeds.len()).step_by(step).flat_map(|at| [(at, "EIO"), (at, "ENOSPC")]).collect();
    let ended = AtomicUsize::new(0);
    everywhere(&places, |(at, how)| {
        ended.fetch_add(setting.fails(*at, how).into(), Ordering::Relaxed);
    });
    let ended = ended.into_inner();
    eprintln!("{} failures of {} deeds, {ended} of which ended the run", places.len(), setting.deeds.len());
    assert!(2 * ended > places.len(), "most failures cannot be gone on after: {ended} of {}", places.len());
}

fn power_cuts(setting: &Setting, step: usize, dice: u64) {
    let places: Vec<(usize, u64)> = (0..=setting.deeds.len())
        .step_by(step)
        .flat_map(|at| (0..dice).map(move |dice| (at, dice)))
        .collect();
    everywhere(&places, |(at, dice)| setting.cut(*at, *dice));
    eprintln!("{} power cuts of {} deeds", places.len(), setting.deeds.len());
}

#[test]
fn after_a_failure_or_a_power_cut_the_campaign_goes_on_to_the_same_records() {
    let setting = Setting::new();
    failures(&setting, setting.deeds.len() / 20);
    power_cuts(&setting, setting.deeds.len() / 40, 1);
}

/// Takes some minutes: `cargo test --release -p jointrig-tests --test it faults -- --ignored`.
#[test]
#[ignore = "every single one"]
fn every_single_one() {
    let setting = Setting::new();
    failures(&setting, 1);
    power_cuts(&setting, 1, 3);
}

#[test]
fn results_are_whole_or_not_there_whatever_fails() {
    let setting = Setting::new();
    let place = setting.folder.path().join("undisturbed");
    let analyse = |out: &Path| {
        let mut command = jointrig();
        command.arg("analyse").arg(place.join("a.jrig")).arg("--out").arg(out).env("FAULT_FOLDER", out);
        command
    };
    let log = setting.folder.path().join("log_of_results");
    let out = setting.folder.path().join("out");
    // two cells give no stiffness, which the exit code indicates; the documents are written
    let code =
        analyse(&out).env("LD_PRELOAD", &setting.disk).env("FAULT_LOG", &log).output().unwrap().status.code();
    let wanted = ["results.json", "report.html"].map(|name| fs::read(out.join(name)).unwrap());
    let count = deeds(&log).len();
    assert!(count > 4, "{count}");
    let places: Vec<(usize, &str)> = (0..count).flat_map(|at| [(at, "EIO"), (at, "ENOSPC")]).collect();
    everywhere(&places, |(at, how)| {
        let out = setting.folder.path().join(format!("out_{how}{at}"));
        let mut command = analyse(&out);
        command.env("LD_PRELOAD", &setting.disk).env("FAULT_AT", at.to_string()).env("FAULT_HOW", how);
        let run = command.output().unwrap();
        let words = said(&run);
        assert!(!words.contains("panicked"), "{how} at {at}: {words}");
        for (name, wanted) in ["results.json", "report.html"].iter().zip(&wanted) {
            if let Ok(found) = fs::read(out.join(name)) {
                assert_eq!(found.len(), wanted.len(), "{how} at {at}: a half {name}: {words}");
            }
        }
        if run.status.code() == code
            && !words.contains("No space left")
            && !words.contains("Input/output error")
        {
            assert!(
                out.join("results.json").is_file() && out.join("report.html").is_file(),
                "{how} at {at}: {words}"
            );
        }
    });
}
