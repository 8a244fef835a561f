//! Building the tests and examples of the root workspace, and running the built programs without
//! cargo.
//!
//! Everything uses the release profile. The whole-system scenarios simulate minutes of sixteen
//! channels and need its speed, and a second profile would compile every dependency twice. Binaries
//! and tests are built by one command, because only then do their dependencies have the same
//! features and are compiled once.

use crate::command;
use crate::command::{Ended, Job};
use crate::project::Project;
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The package of the whole-system scenarios.
pub const SCENARIOS: &str = "jointrig-tests";

/// The programs the scenarios start, and the variables that carry their paths.
const PROGRAMS: [(&str, &str, &str); 2] = [
    ("jointrig", "jointrig", "JOINTRIG_BIN"),
    ("jointrig-hil-sim", "jointrig-hil-sim", "JOINTRIG_HIL_SIM_BIN"),
];

/// The packages to test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// All.
    Everything,
    /// All except the whole-system scenarios.
    WithoutScenarios,
}

/// How many tests passed, failed and were ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    passed: u64,
    failed: u64,
    ignored: u64,
}

impl std::fmt::Display for Counts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} passed, {} failed, {} ignored", self.passed, self.failed, self.ignored)
    }
}

/// Builds the binaries and the tests.
pub fn build(project: &Project, scope: Scope) -> Result<()> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["build", "--release", "--workspace", "--tests", "--examples"]);
    // Not all binaries: xtask's own is running, and some systems do not allow replacing a running
    // program's file.
    cargo.args(PROGRAMS.iter().flat_map(|(_, binary, _)| ["--bin", binary]));
    cargo.args(left_out(scope));
    command::run(&mut cargo).context("the binaries and tests do not compile")
}

/// Runs the tests with the paths of the binaries in their environment. All of them run in parallel,
/// with the examples; if `extra` selects some, or contains arguments of the test programs, it is
/// passed to plain `cargo test`, which runs them one after another.
pub fn run(project: &Project, scope: Scope, extra: &[String]) -> Result<Counts> {
    if !extra.is_empty() {
        let mut cargo = command::cargo(&project.root);
        cargo.envs(variables(project)?);
        cargo.args(["test", "--release", "--workspace"]).args(left_out(scope)).args(extra);
        let (counts, success) = watched(&mut cargo, &mut std::io::stdout())?;
        if !success {
            bail!("the tests failed ({counts}): the lines above name them");
        }
        return Ok(counts);
    }
    let mut jobs = tests(project, left_out(scope))?;
    jobs.extend(examples(project)?);
    for job in &mut jobs {
        job.command.envs(variables(project)?);
    }
    concluded(&command::run_all(jobs, command::at_once(), &mut std::io::stdout())?)
}

/// Adds up the programs' reports, or fails with the names of the failed tests.
pub fn concluded(ended: &[Ended]) -> Result<Counts> {
    let (mut counts, mut failures) = (Counts::default(), Vec::new());
    for ended in ended {
        let output = String::from_utf8_lossy(&ended.output);
        output.lines().for_each(|line| count(line, &mut counts));
        if ended.status.success() {
            continue;
        }
        let tests: Vec<&str> = output
            .lines()
            .filter_map(|line| line.strip_prefix("test ")?.split_once(" ... FAILED"))
            .map(|(test, _)| test)
            .collect();
        // A program may also end before it can report which test it was running.
        let what = if tests.is_empty() { ended.status.to_string() } else { tests.join(", ") };
        failures.push(format!("{}: {what}", ended.name));
    }
    if failures.is_empty() {
        return Ok(counts);
    }
    bail!(
        "the tests failed ({counts}):\n  {}\n  `cargo xtask test -- <part of a name>` runs fewer",
        failures.join("\n  ")
    )
}

/// The variables with the paths of the programs that scenarios start.
fn variables(project: &Project) -> Result<Vec<(&'static str, PathBuf)>> {
    let mut variables = Vec::new();
    for (package, binary, variable) in PROGRAMS {
        variables.extend(program(project, package, binary)?.map(|path| (variable, path)));
    }
    Ok(variables)
}

/// The variable with the path of the emulated board's image.
const IMAGE: &str = "JOINTRIG_MPS2_IMAGE";
/// The tests that need it, by the name of their file.
const IN_EMULATOR: &str = "qemu";

/// Runs the tests of the emulated board.
pub fn run_in_emulator(project: &Project, image: &Path) -> Result<Counts> {
    let mut cargo = command::cargo(&project.root);
    cargo.env(IMAGE, image).envs(variables(project)?);
    // `--workspace`, so that the dependencies have the features they were built with
    cargo.args(["test", "--release", "--workspace", "--test", IN_EMULATOR]);
    let (counts, success) = watched(&mut cargo, &mut std::io::stdout())?;
    if !success {
        bail!("the emulated board failed its tests ({counts}): the lines above name them");
    }
    Ok(counts)
}

fn left_out(scope: Scope) -> &'static [&'static str] {
    match scope {
        Scope::Everything => &[],
        Scope::WithoutScenarios => &["--exclude", SCENARIOS],
    }
}

/// The path of a built binary, or nothing when the package does not have it.
fn program(project: &Project, package: &str, binary: &str) -> Result<Option<PathBuf>> {
    if !project.package(package).is_some_and(|package| package.binaries.iter().any(|name| name == binary)) {
        return Ok(None);
    }
    let path = project.target.join("release").join(format!("{binary}{}", std::env::consts::EXE_SUFFIX));
    if !path.is_file() {
        bail!(
            "{binary} was built, but is not at {}: unset build.target in cargo's configuration, which moves it",
            path.display()
        );
    }
    Ok(Some(path))
}

/// Runs the command, passes its output unchanged to `shown`, and adds up the counts in its summary
/// lines.
fn watched(command: &mut Command, shown: &mut impl Write) -> Result<(Counts, bool)> {
    println!("  $ {}", command::line(command));
    let mut child = command.stdout(Stdio::piped()).spawn().context("could not start cargo")?;
    let output = child.stdout.take().context("the output was asked for, but is not there")?;
    let (mut counts, mut reader, mut line) = (Counts::default(), BufReader::new(output), Vec::new());
    while reader.read_until(b'\n', &mut line).context("could not read the output of cargo test")? > 0 {
        shown.write_all(&line).context("could not pass the output on")?;
        count(&String::from_utf8_lossy(&line), &mut counts);
        line.clear();
    }
    let status = child.wait().context("could not wait for cargo test")?;
    Ok((counts, status.success()))
}

/// Adds the counts of one summary line of a test program, such as `test result: ok. 12 passed; 0
/// failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.01s`.
fn count(line: &str, counts: &mut Counts) {
    let Some(result) = line.strip_prefix("test result: ") else { return };
    let numbers = result.split_once(". ").map_or("", |(_, numbers)| numbers);
    for part in numbers.split(';') {
        let Some((number, what)) = part.trim().split_once(' ') else { continue };
        let Ok(number) = number.parse::<u64>() else { continue };
        match what {
            "passed" => counts.passed += number,
            "failed" => counts.failed += number,
            "ignored" => counts.ignored += number,
            _ => {}
        }
    }
}

/// The programs that take longest, by package and target, the longest first. They start first, so
/// that none of them runs alone at the end.
const LONGEST: [(&str, &str); 3] = [("jointrig-tests", "it"), ("jointrig", "it"), ("jointrig-tests", "qemu")];

/// One test program.
#[derive(Debug, PartialEq, Eq)]
pub struct Program {
    /// The name of its package.
    pub package: String,
    target: String,
    /// The folder of its package, in which `cargo test` would start it.
    pub folder: PathBuf,
    /// The built file.
    pub path: PathBuf,
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
pub fn programs(messages: &str) -> Result<Vec<Program>> {
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
    use crate::command::Job;

    #[test]
    fn closing_lines_are_added_up_and_others_ignored() {
        let mut counts = Counts::default();
        for line in [
            "running 2 tests\n",
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.01s\n",
            "test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s\n",
            "test result_of_something ... ok\n",
        ] {
            count(line, &mut counts);
        }
        assert_eq!(counts, Counts { passed: 15, failed: 2, ignored: 1 });
        assert_eq!(counts.to_string(), "15 passed, 2 failed, 1 ignored");
    }

    #[test]
    fn what_failed_is_named_with_its_program() {
        let ended = |script: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            command::run_all(vec![Job { name: "host demo".into(), command }], 1, &mut Vec::new())
                .expect("sh is there")
        };
        let passed = ended("echo 'test a::b ... ok'; echo 'test result: ok. 1 passed; 0 failed; 0 ignored'");
        assert_eq!(concluded(&passed).expect("it passed").to_string(), "1 passed, 0 failed, 0 ignored");
        let failed =
            ended("echo 'test a::b ... FAILED'; echo 'test result: FAILED. 0 passed; 1 failed'; exit 101");
        let message = concluded(&failed).expect_err("it failed").to_string();
        assert!(
            message.starts_with("the tests failed (0 passed, 1 failed, 0 ignored):\n  host demo: a::b\n"),
            "{message}"
        );
        let message = concluded(&ended("kill -9 $$")).expect_err("it was killed").to_string();
        assert!(message.contains("host demo: signal: 9"), "{message}");
    }

    #[test]
    fn a_failing_command_is_reported_with_its_counts() {
        let mut command = Command::new("sh");
        command.args(["-c", "echo 'test result: FAILED. 1 passed; 1 failed; 0 ignored'; exit 101"]);
        let mut shown = Vec::new();
        let (counts, success) = watched(&mut command, &mut shown).expect("sh is there");
        assert_eq!(shown, b"test result: FAILED. 1 passed; 1 failed; 0 ignored\n");
        assert_eq!((counts.passed, counts.failed, success), (1, 1, false));
    }
}

#[cfg(test)]
mod test_programs_tests {
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
