//! Malformed input at every entry point of the command line: exit code 1 or 2, with a message that
//! states the file, the position and what to do.

use std::path::{Path, PathBuf};
use std::process::Command;

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// A folder with valid files, and some damaged ones.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Folder(tempfile::tempdir().expect("a temporary folder"));
        for name in ["A.npz", "B.npz", "AJB.npz"] {
            folder.copy(&format!("frf_rigid/{name}"), name);
        }
        folder.copy("positions/positions.xlsx", "positions.xlsx");
        folder.copy("impacts/good.npz", "records.npz");
        folder.copy("hysteresis/stuck/record.npz", "loop.npz");
        folder.write("empty", b"");
        folder.write("text", b"hello\n");
        folder.write(
            "noise",
            &(0..4000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect::<Vec<_>>(),
        );
        folder.write("rig.toml", b"name = \"x\"\n[mass]\n");
        folder.write("plan.toml", b"version = 1\nname = \"x\"\n[record]\nrate_hz = \"fast\"\n");
        folder.write("geometry.toml", b"[a]\nchannels = 3\n");
        std::fs::create_dir(folder.0.path().join("bare")).expect("a folder");
        assert!(folder.run("campaign new c.jrig --paper").0 == 0, "a good campaign file");
        for name in ["A.npz", "records.npz", "loop.npz", "positions.xlsx", "c.jrig"] {
            let bytes = std::fs::read(folder.0.path().join(name)).expect("there");
            folder.write(&format!("cut-{name}"), &bytes[..bytes.len() / 3]);
        }
        folder
    }

    fn copy(&self, from: &str, name: &str) {
        std::fs::copy(data(from), self.0.path().join(name)).expect("test data");
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.path().join(name), bytes).expect("written");
    }

    /// Exit code and stderr.
    fn run(&self, line: &str) -> (i32, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_jointrig"));
        let out =
            command.current_dir(self.0.path()).args(line.split(' ')).output().expect("the command runs");
        (out.status.code().unwrap_or(-1), String::from_utf8_lossy(&out.stderr).into_owned())
    }

    /// The command ends with 1, and its message contains all of these.
    fn refuses(&self, line: &str, parts: &[&str]) {
        let (code, said) = self.run(line);
        assert_eq!(code, 1, "{line}: {said}");
        for part in parts {
            assert!(said.contains(part), "{line} says nothing of `{part}`: {said}");
        }
        assert!(!said.contains("panicked") && said.lines().count() <= 12, "{line}: {said}");
    }
}

/// The instruction that our messages give.
const AGAIN: &str = "copy or export it again";

#[test]
fn frf_files_and_records() {
    let folder = Folder::new();
    for name in ["empty", "text", "noise"] {
        folder.refuses(&format!("frf {name}"), &[name, "give an npz of impact records"]);
        folder.refuses(&format!("import {name} --out o.npz"), &[name, "give an npz FRF file"]);
        folder.refuses(
            &format!("import {name} --into c.jrig --configuration A --impact AZ1 --response A1"),
            &[name, "give an npz of impact records"],
        );
    }
    folder.refuses("frf cut-records.npz", &["cut-records.npz", AGAIN]);
    folder.refuses("import cut-A.npz --out o.npz", &["cut-A.npz", AGAIN]);
    folder.refuses("frf bare", &["bare", "name a file"]);
    folder.refuses("frf gone.npz", &["gone.npz", "check the name"]);
    folder.refuses("frf A.npz", &["A.npz", "`fs`", "the file has"]);
    folder.refuses("import records.npz --out o.npz", &["records.npz", "`frequency`", "the file has"]);
    folder.refuses("import A.npz --out gone/o.npz", &["gone/o.npz", "make the folder"]);
    folder.refuses("frf records.npz --out gone/o.npz", &["gone/o.npz", "make the folder"]);
}

#[test]
fn identification() {
    let folder = Folder::new();
    let identify =
        |a: &str, geometry: &str| format!("identify --a {a} --b B.npz --ajb AJB.npz --geometry {geometry}");
    for name in ["cut-A.npz", "gone.npz"] {
        folder.refuses(
            &identify(name, "positions.xlsx"),
            &[name, "again"]
                .map(|part| if name == "gone.npz" && part == "again" { "check the name" } else { part }),
        );
    }
    folder
        .refuses(&identify("records.npz", "positions.xlsx"), &["records.npz", "`frequency`", "the file has"]);
    for name in ["cut-positions.xlsx", "text", "empty", "gone.xlsx"] {
        folder.refuses(&identify("A.npz", name), &[name, "give the .xlsx workbook"]);
    }
    folder.refuses(&identify("A.npz", "bare"), &["bare", "Channels_A.csv"]);
    folder.refuses(&identify("A.npz", "geometry.toml"), &["geometry.toml, line 2", "`channels`"]);
    folder.refuses(
        &format!("{} --band 5000:6000", identify("A.npz", "positions.xlsx")),
        &["5000–6000 Hz", "choose a band within"],
    );
}

#[test]
fn campaigns() {
    let folder = Folder::new();
    for command in ["campaign status", "campaign verify", "analyse --out o", "export --format npz --out o"] {
        for name in ["empty", "noise", "A.npz"] {
            folder.refuses(&format!("{command} {name}"), &[name, "give the .jrig file"]);
        }
        folder.refuses(&format!("{command} gone.jrig"), &["gone.jrig", "jointrig campaign new"]);
        folder.refuses(&format!("{command} cut-c.jrig"), &["cut-c.jrig", "campaign backup"]);
    }
    folder.refuses("campaign new d.jrig --plan plan.toml", &["plan.toml:4", "rate_hz", "docs/campaigns.md"]);
    folder.refuses("campaign new d.jrig --plan gone.toml", &["gone.toml", "check the name"]);
    folder.refuses("campaign new c.jrig --paper", &["c.jrig", "choose another name"]);
    folder.refuses("campaign new gone/d.jrig --paper", &["gone/d.jrig", "the folder must exist"]);
    folder.refuses("campaign run c.jrig --device sim:gone.toml", &["gone.toml", "cannot be read"]);
    folder.refuses("campaign run c.jrig --device sim:rig.toml", &["line 2", "`mass`", "expected one of"]);
    folder.refuses("demo --rig gone.toml --out d", &["gone.toml", "check the name"]);
    folder.refuses("campaign drop c.jrig 5 --reason x", &["record 5", "jointrig campaign show"]);
    folder.refuses("analyse c.jrig --out text/o", &["text/o"]);
}

#[test]
fn a_wrong_command_line_is_told_from_bad_data() {
    let folder = Folder::new();
    for (line, part) in [
        ("frf records.npz --band 5:1", "the lower first"),
        ("frf records.npz --outputs a,b", "one for each"),
        (
            "identify --a A.npz --b B.npz --ajb AJB.npz --geometry positions.xlsx --method nope",
            "choose among",
        ),
        ("import A.npz", "--out"),
        ("info --device foo:", "known are"),
        ("completions foo", "bash"),
    ] {
        let (code, said) = folder.run(line);
        assert!(code == 2 && said.contains(part), "{line}: {code}, {said}");
    }
}
