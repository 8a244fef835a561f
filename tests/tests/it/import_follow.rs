//! A folder that another system fills, imported as its files appear.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::SMALL;
use jointrig::campaign::store::Store;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{Served, campaign, done};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Longest wait for anything, on a busy machine.
const LONGEST: Duration = Duration::from_mins(1);

/// `import --follow` as it runs. Dropping it ends the process.
struct Following {
    child: Child,
    lines: Receiver<String>,
    said: String,
}

impl Following {
    fn start(folder: &Path, file: &Path, more: &[&str]) -> Self {
        let mut command = jointrig();
        command.arg("import").arg(folder).arg("--into").arg(file).args(["--follow", "--settle", "0.5"]);
        let mut child = Self::spawn(command.args(more));
        let stderr: ChildStderr = child.stderr.take().unwrap();
        let (to, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                if to.send(line).is_err() {
                    break;
                }
            }
        });
        let mut following = Self { child, lines, said: String::new() };
        following.until("following");
        following
    }

    fn spawn(command: &mut Command) -> Child {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Waits for a line that contains this.
    fn until(&mut self, what: &str) -> String {
        let begun = Instant::now();
        while begun.elapsed() < LONGEST {
            if let Ok(line) = self.lines.recv_timeout(Duration::from_millis(200)) {
                self.said.extend([line.as_str(), "\n"]);
                if line.contains(what) {
                    return line;
                }
            }
        }
        panic!("nothing with `{what}` in:\n{}", self.said);
    }

    fn interrupt(&self) {
        let sent = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status();
        assert!(sent.unwrap().success());
    }

    /// Waits for the end; returns the exit code, stdout, and all of stderr.
    fn end(mut self) -> (Option<i32>, String, String) {
        let mut out = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        let status = self.child.wait().unwrap();
        self.said.extend(self.lines.iter().map(|line| line + "\n"));
        (status.code(), out, std::mem::take(&mut self.said))
    }
}

impl Drop for Following {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The files of a whole campaign, one for each cell, and where they are.
fn recorded() -> (tempfile::TempDir, Vec<PathBuf>) {
    let (folder, measured) = campaign(SMALL);
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&measured));
    let exported = folder.path().join("npz");
    done(jointrig().args(["export", "--format", "npz"]).arg(&measured).arg("--out").arg(&exported));
    let all = std::fs::read_dir(exported.join("records")).unwrap();
    let mut all: Vec<PathBuf> = all.map(|entry| entry.unwrap().path()).collect();
    all.sort();
    (folder, all)
}

fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

/// Cell, attempt and scans of every record.
fn content(file: &Path) -> Vec<(i64, u32, usize)> {
    let store = Store::open_read_only(file).unwrap();
    let all = store.records().unwrap();
    all.into_iter().map(Result::unwrap).map(|row| (row.cell, row.attempt, row.scans)).collect()
}

fn status(file: &Path) -> Value {
    serde_json::from_str(&done(jointrig().args(["campaign", "status", "--json"]).arg(file))).unwrap()
}

#[test]
fn files_are_taken_as_they_appear_until_the_campaign_is_complete() {
    let (_measured, source) = recorded();
    let (folder, file) = campaign(SMALL);
    let watched = folder.path().join("daq");
    std::fs::create_dir(&watched).unwrap();
    let (first, rest) = source.split_first().unwrap();
    // one is there before, with a file of the recorder that is no record
    std::fs::copy(first, watched.join(name(first))).unwrap();
    std::fs::write(watched.join("settings.xml"), "<gain/>").unwrap();
    let mut following = Following::start(&watched, &file, &[]);
    following.until(&format!("{}: hit 0: ", name(first)));
    following.until("good hits in the campaign");

    // the lock is held as during a run, and the live page shows the hits as they come
    let locked =
        jointrig().args(["campaign", "drop"]).arg(&file).args(["1", "--reason", "x"]).output().unwrap();
    assert_eq!(locked.status.code(), Some(1), "{}", String::from_utf8_lossy(&locked.stderr));
    let page = Served::of(&file);
    let hits = content(&file).len();
    assert!(hits > 0);

    // half a file is not taken, complete it is; the one beside it is bad
    let (second, rest) = rest.split_first().unwrap();
    let whole = std::fs::read(second).unwrap();
    std::fs::write(watched.join(name(second)), &whole[..whole.len() / 2]).unwrap();
    let (third, rest) = rest.split_first().unwrap();
    std::fs::write(watched.join(name(third)), "no record").unwrap();
    following.until(&format!("{}: not imported; it is tried again when it changes", name(third)));
    std::fs::write(watched.join(name(second)), &whole).unwrap();
    following.until(&format!("{}: hit 0: ", name(second)));
    // replaced by rename
    std::fs::copy(third, watched.join("writing.part")).unwrap();
    std::fs::rename(watched.join("writing.part"), watched.join(name(third))).unwrap();
    following.until(&format!("{}: hit 0: ", name(third)));
    let mut browser = jointrig_tests::browser::Browser::start();
    let mut shown = browser.open_url(&page.url, jointrig_tests::browser::Look::DESK);
    shown.until(&format!("live.state.whole?.hits.length === {}", content(&file).len()));
    for path in rest {
        std::fs::copy(path, watched.join(name(path))).unwrap();
    }
    let (code, out, said) = following.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(out.contains(&format!("{} files", source.len())), "{out}");
    assert!(said.contains("settings.xml: left out"), "{said}");
    assert_eq!(status(&file)["complete"], true);
    // each hit once, with all its scans
    let (mut stored, scans) = (content(&file), content(&file)[0].2);
    assert!(stored.iter().all(|(.., own)| *own == scans), "{stored:?}");
    stored.sort_unstable();
    stored.dedup();
    assert_eq!(stored.len(), content(&file).len());
    shown.until(&format!("live.state.whole.hits.length === {}", stored.len()));
    assert!(done(jointrig().args(["campaign", "verify", "--deep"]).arg(&file)).contains("all intact"));
}

#[test]
fn killed_and_started_again_it_stores_nothing_twice() {
    let (_measured, source) = recorded();
    let (folder, file) = campaign(SMALL);
    let watched = folder.path().join("daq");
    std::fs::create_dir(&watched).unwrap();
    for path in &source[..3] {
        std::fs::copy(path, watched.join(name(path))).unwrap();
    }
    let mut following = Following::start(&watched, &file, &[]);
    // in the middle of its work
    following.until("hit 0: ");
    following.child.kill().unwrap();
    drop(following);
    assert!(!content(&file).is_empty());

    let mut following = Following::start(&watched, &file, &[]);
    following.until("stored by an earlier import");
    // with a name that says nothing it is named, and taken when it has another
    let next = &source[3];
    std::fs::copy(next, watched.join("unnamed.csv")).unwrap();
    following.until("unnamed.csv: left out");
    std::fs::rename(watched.join("unnamed.csv"), watched.join(name(next))).unwrap();
    following.until(&format!("{}: hit 0: ", name(next)));
    // one that is written again after it was taken is not stored a second time
    std::fs::copy(&source[4], watched.join(name(next))).unwrap();
    following.until("it has changed after it was imported");
    following.interrupt();
    let (code, out, said) = following.end();
    assert_eq!(code, Some(1), "it was not complete: {out}{said}");
    assert!(said.contains("stopped before the campaign was complete"), "{said}");
    assert!(said.contains("stopping after the current file"), "{said}");

    let (_other, whole) = campaign(SMALL);
    let others = folder.path().join("others");
    std::fs::create_dir(&others).unwrap();
    for path in &source[..4] {
        std::fs::copy(path, others.join(name(path))).unwrap();
    }
    done(jointrig().arg("import").arg(&others).arg("--into").arg(&whole));
    assert_eq!(status(&file)["cells"], status(&whole)["cells"]);
    assert_eq!(content(&file).len(), content(&whole).len());
}

#[test]
fn a_table_may_be_extended_while_the_folder_is_followed() {
    let (_measured, source) = recorded();
    let (folder, file) = campaign(SMALL);
    let watched = folder.path().join("daq");
    std::fs::create_dir(&watched).unwrap();
    let table = watched.join("names.csv");
    let row = |number: usize| {
        let stem = source[number].file_stem().unwrap().to_str().unwrap().replace('_', ",");
        format!("shot {number}.npz,{stem}\n")
    };
    let head = "file,configuration,impact,response\n".to_owned();
    std::fs::write(&table, format!("{head}{}", row(0))).unwrap();
    let mut following = Following::start(&watched, &file, &["--names", table.to_str().unwrap()]);
    for number in [0, 1] {
        std::fs::copy(&source[number], watched.join(format!("shot {number}.npz"))).unwrap();
    }
    following.until("add a line for it");
    std::fs::write(&table, format!("{head}{}{}", row(0), row(1))).unwrap();
    following.until("shot 1.npz: hit 0: ");
    following.interrupt();
    let (code, out, said) = following.end();
    assert_eq!((code, out.contains("2 files")), (Some(1), true), "{out}{said}");
    // a folder that is none, and a table that does not exist
    let mut command = jointrig();
    command.arg("import").arg(&table).arg("--into").arg(&file).arg("--follow");
    assert_eq!(command.output().unwrap().status.code(), Some(2));
    let mut command = jointrig();
    command.arg("import").arg(&watched).arg("--into").arg(&file).args(["--follow", "--names", "none.csv"]);
    assert_eq!(command.output().unwrap().status.code(), Some(1));
}
