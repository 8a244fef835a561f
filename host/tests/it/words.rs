//! Control characters in external text have no effect on a terminal, a page or a folder.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Clears the screen, and reverses the writing direction.
const ACTS: &str = "\u{1b}[2J\u{202e}";

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_jointrig")).current_dir(folder).args(arguments).output().expect("runs")
}

/// The output of a command that succeeds, without any control characters.
fn harmless(folder: &Path, arguments: &[&str]) -> String {
    let out = run(folder, arguments);
    let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).expect("text")).concat();
    assert!(out.status.success(), "{arguments:?}: {said}");
    assert!(!said.contains(acts), "{arguments:?}: {said:?}");
    said
}

fn acts(letter: char) -> bool {
    (letter.is_control() && letter != '\n')
        || matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[test]
fn the_name_of_an_imported_file_is_shown_and_not_obeyed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    harmless(at, &["campaign", "new", "c.jrig", "--paper"]);
    for name in ["A", "B", "AJB"] {
        let called = format!("{name}{ACTS}.npz");
        std::fs::copy(data(&format!("frf_rigid/{name}.npz")), at.join(&called)).expect("test data");
        let said = harmless(at, &["import", &called, "--into", "c.jrig", "--configuration", name]);
        // imported again, as after a power cut: nothing is stored twice
        let again = harmless(at, &["import", &called, "--into", "c.jrig", "--configuration", name]);
        assert!(again.contains("there already"), "{said}{again}");
    }
    let status = harmless(at, &["campaign", "status", "c.jrig"]);
    assert!(status.contains("A\\u{1b}[2J\\u{202e}.npz"), "{status}");
    let json = harmless(at, &["campaign", "status", "c.jrig", "--json"]);
    let document: serde_json::Value = serde_json::from_str(json.trim()).expect("one document");
    assert!(document.to_string().contains("\\u001b[2J\u{202e}.npz"), "a program reads the name as it is");
    harmless(at, &["analyse", "c.jrig", "--out", "o"]);
    let report = std::fs::read_to_string(at.join("o/report.html")).expect("a report");
    assert!(!report.contains(acts), "the report obeys a name");
    assert!(report.contains("\\u{1b}[2J"), "the report hides a name");
    let said = run(at, &["frf", &format!("gone{ACTS}.npz")]);
    assert!(!String::from_utf8_lossy(&said.stderr).contains(acts), "{said:?}");
}

#[test]
fn names_that_no_file_may_have_are_exported_and_come_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let plan = jointrig::campaign::plan::SMALL.replace("AZ1", "A?Z..1");
    std::fs::write(at.join("plan.toml"), plan).expect("written");
    for file in ["c.jrig", "d.jrig"] {
        harmless(at, &["campaign", "new", file, "--plan", "plan.toml"]);
    }
    // the same hits with the one response as all three axes
    let mut hits = jointrig::exchange::read_impacts(&data("impacts/good.npz")).expect("test data");
    for hit in &mut hits.response {
        *hit = vec![hit[0].clone(); 3];
    }
    let records = "hits.uff";
    jointrig::exchange::uff_output::write_records(&at.join(records), &hits, "A1", "AZ1").expect("written");
    let cell = ["--configuration", "A", "--impact", "A?Z..1", "--response", "A1"];
    harmless(at, &[&["import", records, "--into", "c.jrig"], &cell[..]].concat());
    let out = run(at, &["export", "c.jrig", "--format", "npz", "--out", "o"]);
    assert!(at.join("o/records/A_A%3FZ..1_A1.npz").is_file(), "{}", String::from_utf8_lossy(&out.stderr));
    let back = harmless(at, &["import", "o/records", "--into", "d.jrig"]);
    assert!(back.contains("in 1 cells"), "{back}");
}
