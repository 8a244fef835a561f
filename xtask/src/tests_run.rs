//! Building and running the tests and examples of the root workspace.
//!
//! Everything uses the release profile. The whole-system scenarios simulate minutes of sixteen
//! channels and need its speed, and a second profile would compile every dependency twice. Binaries
//! and tests are built by one command, because only then do their dependencies have the same
//! features and are compiled once.

use crate::jobs::{self, Ended};
use crate::project::Project;
use crate::{command, test_programs};
use anyhow::{Context, Result, bail};
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
        cargo.envs(programs(project)?);
        cargo.args(["test", "--release", "--workspace"]).args(left_out(scope)).args(extra);
        let (counts, success) = watched(&mut cargo, &mut std::io::stdout())?;
        if !success {
            bail!("the tests failed ({counts}): the lines above name them");
        }
        return Ok(counts);
    }
    let mut jobs = test_programs::tests(project, left_out(scope))?;
    jobs.extend(test_programs::examples(project)?);
    for job in &mut jobs {
        job.command.envs(programs(project)?);
    }
    concluded(&jobs::run(jobs, jobs::at_once(), &mut std::io::stdout())?)
}

/// Adds up the programs' reports, or fails with the names of the failed tests.
fn concluded(ended: &[Ended]) -> Result<Counts> {
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
fn programs(project: &Project) -> Result<Vec<(&'static str, PathBuf)>> {
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
    cargo.env(IMAGE, image).envs(programs(project)?);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::Job;

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
            jobs::run(vec![Job { name: "host demo".into(), command }], 1, &mut Vec::new())
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
