//! Files of the wrong kind, and folders without write permission: the errors state what is wrong
//! and what to do.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::SMALL;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{campaign, done};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn said(out: &Output, code: i32) -> String {
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(code), "{text}");
    text
}

fn status(path: &Path) -> Output {
    jointrig().args(["campaign", "status"]).arg(path).output().unwrap()
}

#[test]
fn a_folder_is_called_one_and_its_campaigns_are_named() {
    let (folder, _file) = campaign(SMALL);
    let text = said(&status(folder.path()), 1);
    assert!(text.contains("is a folder") && text.contains("campaign.jrig"), "{text}");
    let empty = tempfile::tempdir().unwrap();
    let text = said(&status(empty.path()), 1);
    assert!(text.contains("no campaign file"), "{text}");
    let text = said(&jointrig().args(["analyse", "--out", "x"]).arg(folder.path()).output().unwrap(), 1);
    assert!(text.contains("is a folder"), "{text}");
}

/// Whether file permissions apply here: for root they do not.
#[cfg(unix)]
fn rights_count(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o000)).unwrap();
    std::fs::File::open(path).is_err()
}

#[cfg(unix)]
#[test]
fn a_file_that_may_not_be_read_is_called_so() {
    let (_folder, file) = campaign(SMALL);
    if !rights_count(&file) {
        println!("LEFT OUT: this user may read everything");
        return;
    }
    let text = said(&status(&file), 1);
    assert!(text.contains("cannot be read") && text.contains("ask for the right"), "{text}");
}

#[test]
fn a_campaign_that_is_copied_while_it_is_measured_lacks_its_last_records_and_verify_says_so() {
    let (folder, file) = campaign(SMALL);
    let mut run = jointrig()
        .args(["campaign", "run", "--yes", "--device", "sim:"])
        .arg(&file)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let log = folder.path().join("campaign.jrig-wal");
    let begun = Instant::now();
    while !std::fs::metadata(&log).is_ok_and(|log| log.len() > 100_000) {
        assert!(begun.elapsed() < Duration::from_mins(1), "nothing was ever written");
        std::thread::sleep(Duration::from_millis(1));
    }
    let alone = folder.path().join("copied.jrig");
    std::fs::copy(&file, &alone).unwrap();
    let whole = folder.path().join("backup.jrig");
    done(jointrig().args(["campaign", "backup"]).arg(&file).arg(&whole));
    assert!(run.wait().unwrap().success());

    let verify = |path: &Path| jointrig().args(["campaign", "verify"]).arg(path).output().unwrap();
    let out = verify(&alone);
    assert_eq!(out.status.code(), Some(1));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(
        text.contains("copied.jrig-wal is not next to it") && text.contains("jointrig campaign backup"),
        "{text}"
    );
    for file in [&file, &whole] {
        let out = verify(file);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stdout));
    }
}

#[test]
fn a_figure_that_cannot_be_written_costs_nobody_the_list() {
    let (folder, file) = campaign(SMALL);
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&file));
    let mut show = jointrig();
    show.args(["campaign", "show"])
        .arg(&file)
        .args(["A/AZ1/A1", "--figure"])
        .arg(folder.path().join("not there/x.svg"));
    let out = show.output().unwrap();
    let text = said(&out, 1);
    assert!(text.contains("writing the figure") && text.contains("--no-figure"), "{text}");
    assert!(String::from_utf8_lossy(&out.stdout).contains("2 good hits wanted"));
}

/// A folder on a separate file system of limited size; `None` if this user may not mount one.
#[cfg(target_os = "linux")]
struct Disk(tempfile::TempDir);

#[cfg(target_os = "linux")]
impl Disk {
    fn of(size: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(folder.path())
            .stderr(Stdio::null());
        mount.status().is_ok_and(|status| status.success()).then_some(Self(folder))
    }
}

#[cfg(target_os = "linux")]
impl Drop for Disk {
    fn drop(&mut self) {
        // a folder that is still mounted is left behind, which is harmless
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_called_so_by_every_export() {
    let (_folder, file) = campaign(SMALL);
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&file));
    let Some(disk) = Disk::of("1m") else {
        println!("LEFT OUT: this user may not mount a small disk");
        return;
    };
    for format in ["csv", "npz", "uff58"] {
        let mut export = jointrig();
        export.args(["export", "--format", format]).arg(&file).arg("--out").arg(disk.0.path().join(format));
        let text = said(&export.output().unwrap(), 1);
        assert!(text.contains("free some space") && text.contains("records"), "{format}: {text}");
        std::fs::remove_dir_all(disk.0.path().join(format)).unwrap();
    }
}

#[test]
fn without_hits_there_is_no_result_and_the_exit_code_says_so() {
    let (folder, file) = campaign(SMALL);
    let out =
        jointrig().arg("analyse").arg(&file).arg("--out").arg(folder.path().join("out")).output().unwrap();
    let text = said(&out, 1);
    assert!(text.contains("no stiffness could be found"), "{text}");
}

#[test]
fn a_stderr_that_is_closed_ends_no_campaign() {
    let (_folder, file) = campaign(SMALL);
    let mut run = jointrig();
    run.args(["-vv", "campaign", "run", "--yes", "--bell", "--device", "sim:"]).arg(&file);
    let mut run = run.stdin(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    drop(run.stderr.take());
    assert!(run.wait().unwrap().success());
    let text = String::from_utf8_lossy(&status(&file).stdout).into_owned();
    assert!(text.contains("complete"), "{text}");
}
