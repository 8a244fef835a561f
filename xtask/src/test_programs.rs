//! The programs that cargo built from the tests and examples, to be started without cargo.

use crate::command;
use crate::jobs::Job;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The programs that take longest, by package and target, the longest first. They start first, so
/// that none of them runs alone at the end.
const LONGEST: [(&str, &str); 3] = [("jointrig-tests", "it"), ("jointrig", "it"), ("jointrig-tests", "qemu")];

/// One test program.
#[derive(Debug, PartialEq, Eq)]
struct Program {
    package: String,
    target: String,
    /// The folder of its package, in which `cargo test` would start it.
    folder: PathBuf,
    path: PathBuf,
}

/// Every test program, and the documentation tests, the longest first. `selection` is passed to
/// cargo.
pub fn tests(project: &Project, selection: &[&str]) -> Result<Vec<Job>> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["test", "--no-run", "--release", "--workspace", "--message-format=json-render-diagnostics"]);
    let mut programs = programs(&command::output(cargo.args(selection))?)?;
    if programs.is_empty() {
        bail!("cargo built no test program");
    }
    programs.sort_by_key(|program| place(&program.package, &program.target));
    let mut jobs = vec![documentation(project, selection)];
    jobs.extend(programs.into_iter().map(|program| {
        let mut command = command::without_own_package(&program.path);
        command.current_dir(&program.folder);
        command.env("CARGO_MANIFEST_DIR", &program.folder).env("CARGO_PKG_NAME", &program.package);
        Job { name: format!("{} {}", program.package, program.target), command }
    }));
    Ok(jobs)
}

/// The documentation tests, which only cargo can compile and run.
fn documentation(project: &Project, selection: &[&str]) -> Job {
    let mut command = command::cargo(&project.root);
    command.args(["test", "--doc", "--release", "--workspace"]).args(selection);
    Job { name: "documentation tests".into(), command }
}

/// Every example of the workspace, started without arguments in the repository's root, as a new
/// user would.
pub fn examples(project: &Project) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for package in &project.packages {
        for example in &package.examples {
            let path = project
                .target
                .join("release/examples")
                .join(example)
                .with_extension(std::env::consts::EXE_EXTENSION);
            if !path.is_file() {
                bail!("the example {example} of {} was not built as {}", package.name, path.display());
            }
            let mut command = command::without_own_package(&path);
            command.current_dir(&project.root);
            jobs.push(Job { name: format!("{} example {example}", package.name), command });
        }
    }
    Ok(jobs)
}

/// Position of a program in the order.
fn place(package: &str, target: &str) -> usize {
    LONGEST.iter().position(|long| *long == (package, target)).unwrap_or(LONGEST.len())
}

/// The test programs in cargo's messages, one JSON object per line.
fn programs(messages: &str) -> Result<Vec<Program>> {
    let mut programs = Vec::new();
    for line in messages.lines() {
        let message: Value = serde_json::from_str(line).with_context(|| format!("cargo said: {line}"))?;
        let Some(path) = message["executable"].as_str().filter(|_| message["profile"]["test"] == true) else {
            continue;
        };
        let text =
            |value: &Value| value.as_str().map(String::from).with_context(|| format!("cargo said: {line}"));
        let manifest = text(&message["manifest_path"])?;
        let folder = Path::new(&manifest).parent().context("a manifest stands in a folder")?.to_path_buf();
        programs.push(Program {
            package: package(&text(&message["package_id"])?),
            target: text(&message["target"]["name"])?,
            folder,
            path: PathBuf::from(path),
        });
    }
    Ok(programs)
}

/// The name in `path+file:///folder/name#0.1.0` or `path+file:///folder#name@0.1.0`.
fn package(id: &str) -> String {
    let (address, end) = id.rsplit_once('#').unwrap_or((id, ""));
    let name = match end.split_once('@') {
        Some((name, _)) => name,
        None => address.rsplit('/').next().unwrap_or(address),
    };
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_programs_are_found_among_the_messages() {
        let messages = concat!(
            r#"{"reason":"compiler-artifact","package_id":"registry#serde@1.0.0","profile":{"test":false},"executable":null}"#,
            "\n",
            r#"{"reason":"compiler-artifact","package_id":"path+file:///r/tests#jointrig-tests@0.1.0","#,
            r#""manifest_path":"/r/tests/Cargo.toml","target":{"name":"demo","kind":["test"]},"#,
            r#""profile":{"test":true},"executable":"/t/demo-1"}"#,
            "\n",
            r#"{"reason":"build-finished","success":true}"#,
        );
        let expected = Program {
            package: "jointrig-tests".into(),
            target: "demo".into(),
            folder: "/r/tests".into(),
            path: "/t/demo-1".into(),
        };
        assert_eq!(programs(messages).expect("messages of cargo"), [expected]);
        assert!(programs("warning: no JSON").is_err());
    }

    #[test]
    fn a_package_is_named_by_its_id_in_both_forms() {
        assert_eq!(package("path+file:///r/xtask#0.1.0"), "xtask");
        assert_eq!(package("path+file:///r/host#jointrig@0.1.0"), "jointrig");
    }

    #[test]
    fn the_longest_come_first() {
        assert_eq!(place("jointrig-tests", "it"), 0);
        assert!(place("jointrig", "it") < place("jointrig", "jointrig"));
        assert_eq!(place("jointrig-protocol", "it"), LONGEST.len());
    }
}
