//! `jointrig self-test`, as a user runs it on a new PC, and the commands of docs/install.md.
#![allow(clippy::unwrap_used)]

use jointrig_tests::command::jointrig;
use serde_json::Value;
use std::path::Path;

fn entries(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().flatten();
    names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// The check with this name.
fn check<'v>(answer: &'v Value, name: &str) -> &'v Value {
    let checks = answer["checks"].as_array().unwrap();
    checks.iter().find(|check| check["name"] == name).unwrap_or_else(|| panic!("no check `{name}`: {answer}"))
}

#[test]
fn it_measures_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let run = jointrig()
        .args(["self-test", "--quick", "--json", "--folder"])
        .arg(folder.path())
        .env("PATH", folder.path().join("no programs"))
        .output()
        .unwrap();
    let answer: Value = serde_json::from_slice(&run.stdout).unwrap();
    let failed = answer["checks"].as_array().unwrap().iter().any(|check| check["state"] == "failed");
    assert_eq!(answer["ok"], !failed, "{answer}");
    assert_eq!(run.status.code(), Some(i32::from(failed)), "{answer}");
    assert_eq!(entries(folder.path()), Vec::<String>::new(), "its folder is removed");

    let measuring = check(&answer, "measuring");
    assert_eq!(measuring["state"], "works", "{measuring}");
    assert_eq!(measuring["measured"]["kept"], 14, "two hits in each of seven cells: {measuring}");
    let scans = measuring["measured"]["scans"].as_f64().unwrap();
    // 14 records of two seconds at 51.2 kHz
    assert!(scans > 14.0 * 2.0 * 51_200.0, "{measuring}");

    let speed = &check(&answer, "speed")["measured"];
    let seconds = measuring["measured"]["seconds"].as_f64().unwrap();
    let factor = speed["times_real_time"].as_f64().unwrap();
    assert!((factor / (scans / 51_200.0 / seconds) - 1.0).abs() < 1e-6, "{speed}");

    let storing = &check(&answer, "storing")["measured"];
    let [median, slowest] = ["median_s", "slowest_s"].map(|name| storing[name].as_f64().unwrap());
    assert!(0.0 < median && median <= slowest, "{storing}");
    // ten channels of 16 bits for two seconds
    assert!((storing["record_bytes"].as_f64().unwrap() / (10.0 * 2.0 * 2.0 * 51_200.0) - 1.0).abs() < 0.1);

    assert_eq!(check(&answer, "live page")["state"], "works");
    if cfg!(target_os = "linux") {
        assert!(check(&answer, "disk")["measured"]["free_bytes"].as_u64().unwrap() > 0);
        let browser = check(&answer, "browser");
        assert_eq!(browser["state"], "advice", "PATH is empty: {browser}");
        assert!(browser["advice"].as_str().unwrap().contains("install one"), "{browser}");
    }
}

#[cfg(unix)]
#[test]
fn it_finds_the_browser_on_path_and_says_what_opens_it() {
    use std::os::unix::fs::PermissionsExt;
    if cfg!(target_os = "macos") {
        eprintln!("left out: macOS has its browsers elsewhere");
        return;
    }
    let [folder, programs] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    for (name, expected) in [("firefox", "note"), ("xdg-open", "works")] {
        let path = programs.path().join(name);
        std::fs::write(&path, "#!/bin/sh\n").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        let run = jointrig()
            .args(["self-test", "--quick", "--folder"])
            .arg(folder.path())
            .env("PATH", programs.path())
            .output()
            .unwrap();
        let said = String::from_utf8(run.stdout).unwrap();
        let line = said.lines().find(|line| line.starts_with("browser")).unwrap();
        assert_eq!(line.split_whitespace().nth(1), Some(expected), "{said}");
        assert!(line.contains("firefox"), "{said}");
    }
}

#[test]
fn a_folder_that_cannot_be_used_is_named_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    let run = jointrig().args(["self-test", "--quick", "--folder"]).arg(&missing).output().unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert!(
        said.contains("missing") && said.contains("--folder DIR") && said.contains("make the folder"),
        "{said}"
    );
    assert!(run.stdout.is_empty());
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_and_removes_its_folder() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let folder = tempfile::tempdir().unwrap();
    let child = jointrig()
        .args(["self-test", "--folder"])
        .arg(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let is_measuring = || {
        let own = entries(folder.path()).pop().map(|name| folder.path().join(name).join("campaign.jrig"));
        own.is_some_and(|file| file.exists())
    };
    while !is_measuring() {
        assert!(begun.elapsed() < Duration::from_mins(1), "it never began to measure");
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("stopped before the test was complete"), "{said}");
    assert_eq!(entries(folder.path()), Vec::<String>::new(), "its folder is removed");
}

#[test]
fn the_printed_udev_rule_is_the_file_of_the_repository() {
    let run = jointrig().args(["devices", "--udev-rule"]).output().unwrap();
    assert!(run.status.success());
    assert_eq!(String::from_utf8(run.stdout).unwrap(), include_str!("../../../docs/udev/70-jointrig.rules"));
}
