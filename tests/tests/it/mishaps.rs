//! Faults during a campaign in a laboratory: a full disk, a read-only folder, a device that
//! disappears or restarts, an edited plan, a second writer. Each ends with a clear error or
//! continues, and no accepted data is lost.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use jointrig::campaign::store::Store;
use jointrig_tests::campaign::rows;
use jointrig_tests::command::{Served, binary, jointrig};
use serde_json::Value;

const SMALL: &str = include_str!("../../../docs/plans/small.toml");

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn new(folder: &Path, plan: &str) -> PathBuf {
    let (file, text) = (folder.join("a.jrig"), folder.join("plan.toml"));
    std::fs::write(&text, plan).unwrap();
    let made = jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&text).output().unwrap();
    assert!(made.status.success(), "{}", said(&made));
    file
}

fn run(file: &Path, more: &[&str]) -> Output {
    jointrig()
        .args(["campaign", "run"])
        .arg(file)
        .args(["--device", "sim:", "--seed", "4"])
        .args(more)
        .output()
        .unwrap()
}

fn kept(file: &Path) -> u64 {
    let status = jointrig().args(["campaign", "status", "--json"]).arg(file).output().unwrap();
    let status: Value = serde_json::from_slice(&status.stdout).unwrap();
    status["kept"].as_u64().unwrap()
}

fn verified(file: &Path) {
    let verified = jointrig().args(["campaign", "verify"]).arg(file).output().unwrap();
    assert!(verified.status.success(), "{}", said(&verified));
}

/// Runs a shell in a separate mount namespace, where a small file system can be mounted; `None`
/// where that is not allowed.
fn namespace(script: &str) -> Option<Output> {
    let run = |arguments: &[&str]| {
        Command::new("unshare").args(arguments).args(["sh", "-ec", script]).stdin(Stdio::null()).output().ok()
    };
    let allowed = |arguments: &[&str]| {
        let probe =
            Command::new("unshare").args(arguments).args(["sh", "-c", "mount -t tmpfs none /mnt"]).output();
        probe.is_ok_and(|probe| probe.status.success())
    };
    [["-m"].as_slice(), ["-r", "-m"].as_slice()].into_iter().find(|way| allowed(way)).and_then(run)
}

#[test]
fn a_full_disk_ends_it_in_words_and_with_space_it_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    // 4 MB hold about five records
    let script = format!(
        "mount -t tmpfs -o size=4m none /mnt; cp {file} /mnt/a.jrig; \
         if {jointrig} campaign run /mnt/a.jrig --device sim: --seed 4; then echo it ended well; exit 9; fi; \
         cp /mnt/a.jrig* {folder}/",
        file = file.display(),
        jointrig = binary("JOINTRIG_BIN").display(),
        folder = folder.path().display(),
    );
    let Some(output) = namespace(&script) else {
        eprintln!("left out: no file system can be mounted here");
        return;
    };
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("free some space"), "{}", said(&output));
    let before = kept(&file);
    assert!((2..14).contains(&before), "{before}");
    verified(&file);
    let rest = run(&file, &[]);
    assert!(rest.status.success(), "{}", said(&rest));
    assert_eq!(kept(&file), 14);
    verified(&file);
}

#[test]
fn a_quota_ends_it_in_words_and_without_it_it_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    // a file may grow to 4 MB: 8192 blocks of 512 bytes
    let script = format!(
        "trap '' XFSZ; ulimit -f 8192; exec {} campaign run {} --device sim: --seed 4",
        binary("JOINTRIG_BIN").display(),
        file.display()
    );
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("space"), "{}", said(&output));
    let before = kept(&file);
    assert!((1..14).contains(&before), "{before}");
    verified(&file);
    assert!(run(&file, &[]).status.success());
    assert_eq!(kept(&file), 14);
}

#[test]
fn a_read_only_folder_is_refused_in_words_and_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    assert!(run(&file, &[]).status.success());
    let script = format!(
        "mkdir -p {folder}/out; mount -t tmpfs -o size=32m none /mnt; cp {file} /mnt/a.jrig; mount -o remount,ro /mnt; \
         if {jointrig} campaign run /mnt/a.jrig --device sim:; then exit 9; fi; \
         if {jointrig} campaign new /mnt/b.jrig --paper; then exit 9; fi; \
         {jointrig} campaign verify /mnt/a.jrig; {jointrig} analyse /mnt/a.jrig --out {folder}/out; ls /mnt",
        file = file.display(),
        jointrig = binary("JOINTRIG_BIN").display(),
        folder = folder.path().display(),
    );
    let Some(output) = namespace(&script) else {
        eprintln!("left out: no file system can be mounted here");
        return;
    };
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(said(&output).matches("cannot be opened for writing").count(), 2, "{}", said(&output));
    assert!(folder.path().join("out/results.json").is_file());
}

#[test]
fn reading_leaves_nothing_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    assert!(run(&file, &[]).status.success());
    for command in ["status", "verify"] {
        assert!(jointrig().args(["campaign", command]).arg(&file).output().unwrap().status.success());
    }
    let mut left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["a.jrig", "plan.toml"]);
}

#[test]
fn a_device_that_vanishes_in_mid_record_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    let served = Served::start(&["--tcp", "127.0.0.1:0", "--seed", "4"]);
    let child = jointrig()
        .args(["campaign", "run"])
        .arg(&file)
        .args(["--device", &served.address])
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = std::time::Instant::now();
    while kept(&file) < 2 {
        assert!(begun.elapsed() < Duration::from_mins(1));
        std::thread::sleep(Duration::from_millis(20));
    }
    // power cut
    drop(served);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("tcp:127.0.0.1"), "{}", said(&output));
    verified(&file);
    let before = kept(&file);
    assert!(before >= 2);

    // it restarts, and the same command continues: the same records as without the interruption
    let again = Served::start(&["--tcp", "127.0.0.1:0", "--seed", "4"]);
    let rest =
        jointrig().args(["campaign", "run"]).arg(&file).args(["--device", &again.address]).output().unwrap();
    assert!(rest.status.success(), "{}", said(&rest));
    let other = tempfile::tempdir().unwrap();
    let whole = new(other.path(), SMALL);
    assert!(run(&whole, &[]).status.success());
    let codes = |file: &Path| jointrig_tests::campaign::records(file);
    assert_eq!(codes(&file), codes(&whole));
}

#[test]
fn an_edited_plan_is_told_taken_over_when_asked_and_refused_where_it_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    assert!(run(&file, &[]).status.success());
    let plan = folder.path().join("plan.toml");
    // one more cell, and one more hit in each
    let edited =
        SMALL.replace("responses = [\"A1\", \"A2\"]", "responses = [\"A1\", \"A2\", \"A3\"]").replace(
            "    { name = \"B1\"",
            "    { name = \"A3\", grouping = 1, position_m = [0.0, 0.045, 0.03] },\n    { name = \"B1\"",
        );
    let edited = edited.replace("wanted = 2", "wanted = 3");
    std::fs::write(&plan, &edited).unwrap();
    let told = run(&file, &[]);
    assert!(told.status.success() && said(&told).contains("was edited since"), "{}", said(&told));
    assert_eq!(kept(&file), 14);
    let path = plan.to_str().unwrap();
    let taken = run(&file, &["--plan", path]);
    assert!(taken.status.success(), "{}", said(&taken));
    assert_eq!(kept(&file), 24, "eight cells of three");
    verified(&file);

    for (from, to, word) in [
        ("length_s = 2.0", "length_s = 1.0", "[record]"),
        ("impacts = [\"BZ1\"]", "impacts = [\"AZ1\"]", "B/BZ1/B1"),
        ("[-0.015, 0.028, 0.03]", "[-0.016, 0.028, 0.03]", "`AZ1`"),
        ("noise_ratio = 3.0", "noise_ratio = \"x\"", "plan.toml:"),
    ] {
        assert!(edited.contains(from), "{from}");
        std::fs::write(&plan, edited.replace(from, to)).unwrap();
        let refused = run(&file, &["--plan", path]);
        assert_eq!(refused.status.code(), Some(1), "{to}");
        assert!(said(&refused).contains(word), "{to}: {}", said(&refused));
        assert_eq!(kept(&file), 24);
    }
}

#[test]
fn a_second_writer_is_refused_while_others_read_and_back_up() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), &SMALL.replace("wanted = 2", "wanted = 8"));
    let mut first = jointrig()
        .args(["campaign", "run"])
        .arg(&file)
        .args(["--device", "sim:", "--seed", "4"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while kept(&file) < 2 {
        assert!(first.try_wait().unwrap().is_none(), "it has begun");
        std::thread::sleep(Duration::from_millis(10));
    }
    let second = run(&file, &[]);
    assert_eq!(second.status.code(), Some(1));
    assert!(said(&second).contains(&format!("process {}", first.id())), "{}", said(&second));
    let copy = folder.path().join("copy.jrig");
    let copied = jointrig().args(["campaign", "backup"]).arg(&file).arg(&copy).output().unwrap();
    assert!(copied.status.success(), "{}", said(&copied));
    assert!(first.try_wait().unwrap().is_none(), "it still runs: all of this happened meanwhile");
    verified(&copy);
    let in_copy = rows(&Store::open_read_only(&copy).unwrap());
    assert!(first.wait().unwrap().success());
    let in_all = rows(&Store::open_read_only(&file).unwrap());
    assert!(!in_copy.is_empty() && in_all.len() > in_copy.len());
    assert!(in_copy[..] == in_all[..in_copy.len()]);
}

#[test]
fn a_person_overrules_and_both_verdicts_stay() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    assert!(run(&file, &[]).status.success());
    let show = || -> Value {
        let shown = jointrig()
            .args(["campaign", "show"])
            .arg(&file)
            .args(["A/AZ1/A1", "--json", "--no-figure"])
            .output()
            .unwrap();
        serde_json::from_slice(&shown.stdout).unwrap()
    };
    let record = show()["records"][0].clone();
    let id = record["record"].to_string();
    assert_eq!((&record["verdict"], &record["kept"]), (&"good".into(), &true.into()));
    assert!(record["utc_error_s"].as_f64().unwrap() < 10.0, "{record}");
    let drop = |command: &str| {
        jointrig()
            .args(["campaign", command])
            .arg(&file)
            .args([&id, "--reason", "somebody spoke"])
            .output()
            .unwrap()
    };
    assert!(drop("drop").status.success());
    let dropped = show()["records"][0].clone();
    assert_eq!((&dropped["verdict"], &dropped["kept"]), (&"good".into(), &false.into()));
    assert_eq!(dropped["overruled"][0]["reason"], "somebody spoke");
    assert_eq!(kept(&file), 13);
    // the campaign requests another one instead
    assert!(run(&file, &[]).status.success());
    assert_eq!((kept(&file), show()["records"].as_array().unwrap().len() > 2), (14, true));
    assert!(drop("keep").status.success());
    assert_eq!(show()["records"][0]["overruled"].as_array().unwrap().len(), 2);
    let wrong = jointrig().args(["campaign", "drop"]).arg(&file).arg("9999").output().unwrap();
    assert!(!wrong.status.success() && said(&wrong).contains("no record 9999"), "{}", said(&wrong));
}

#[test]
fn the_papers_plan_has_252_cells_and_2016_hits() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.jrig");
    assert!(
        jointrig().args(["campaign", "new"]).arg(&file).arg("--paper").output().unwrap().status.success()
    );
    let status = jointrig().args(["campaign", "status", "--json"]).arg(&file).output().unwrap();
    let status: Value = serde_json::from_slice(&status.stdout).unwrap();
    assert_eq!((status["cells"].as_array().unwrap().len(), &status["wanted"]), (252, &2016.into()));
}

#[test]
fn the_signs_of_all_channels_are_right_on_the_simulated_rig() {
    let cells = SMALL.replace(
        "impacts = [\"AZ1\"]\nresponses = [\"A1\", \"A2\"]",
        "impacts = [\"AZ1\", \"AY1\"]\nresponses = [\"A1\", \"A2\"]",
    );
    let check = |rig: Option<&str>| {
        let folder = tempfile::tempdir().unwrap();
        let file = new(folder.path(), &cells);
        let mut address = "sim:".to_owned();
        if let Some(rig) = rig {
            let description = folder.path().join("rig.toml");
            std::fs::write(&description, rig).unwrap();
            address += description.to_str().unwrap();
        }
        let ran =
            jointrig().args(["campaign", "run"]).arg(&file).args(["--device", &address]).output().unwrap();
        assert!(ran.status.success(), "{}", said(&ran));
        jointrig().args(["campaign", "check"]).arg(&file).output().unwrap()
    };
    // a reversed sensor with the matching declaration is right as well
    for rig in [None, Some("[sensors.vibrometer]\npolarity = [1, -1, 1]\n")] {
        let checked = check(rig);
        assert!(checked.status.success(), "{}", said(&checked));
        for channel in ["force", "vib_y", "vib_z", "ldv_a", "ldv_b", "lc_1"] {
            assert!(said(&checked).contains(&format!("{channel:<12} right")), "{}", said(&checked));
        }
    }
}

#[test]
fn somebody_who_closes_stderr_in_mid_run_ends_no_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let file = new(folder.path(), SMALL);
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--seed", "4"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert!(child.wait().unwrap().success());
    assert_eq!(kept(&file), 14);
    verified(&file);
}
