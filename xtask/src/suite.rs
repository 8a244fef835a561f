//! `cargo xtask test`: all checks, in order, with a table at the end.

use crate::firmware;
use crate::packages::Consent;
use crate::project::{EMULATED_BOARD, Project};
use crate::setup::Toolchain;
use crate::tests_run::{self, Scope};
use crate::{book, budgets, emulator, layout, lint, python, setup};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::fmt::Write;
use std::time::{Duration, Instant};

/// Options of `cargo xtask test`.
#[derive(Args, Debug, Default)]
pub struct Options {
    /// Leave out the slow steps; the list of steps and the table state which.
    #[arg(long)]
    quick: bool,
    /// Continue after a failed step; the exit code still indicates the failure.
    #[arg(long)]
    keep_going: bool,
    /// Do not ask before installing system packages.
    #[arg(long)]
    yes: bool,
    /// Passed to `cargo test`, for example `-- wire` or `-- -- --nocapture`.
    #[arg(last = true)]
    extra: Vec<String>,
}

/// Results of the steps that later ones need.
struct Run<'a> {
    project: &'a Project,
    options: &'a Options,
    toolchain: Option<Toolchain>,
}

/// One step: its name in the table, its description, whether `--quick` leaves it out, and its
/// function, which returns a remark for the table.
struct Step {
    name: &'static str,
    purpose: &'static str,
    slow: bool,
    action: fn(&mut Run) -> Result<String>,
}

/// The steps. The cheap ones come first, so that a mistake is found early.
const STEPS: [Step; 10] = [
    Step {
        name: "setup",
        purpose: "the microcontroller target and QEMU are available",
        slow: false,
        action: set_up,
    },
    Step { name: "fmt-check", purpose: "the code is formatted", slow: false, action: formatting },
    Step {
        name: "layout",
        purpose: "crate graph, import cycles, equations, licences, links",
        slow: false,
        action: layout_rules,
    },
    // Clippy on the boards compiles the no_std libraries for the microcontroller, with the features
    // of each board.
    Step {
        name: "lint",
        purpose: "clippy is content with host and boards, the locks agree",
        slow: false,
        action: lints,
    },
    Step { name: "build", purpose: "binaries and tests, in release", slow: false, action: build },
    Step {
        name: "test",
        purpose: "unit, property and whole-system tests, and the examples",
        slow: false,
        action: tests,
    },
    Step {
        name: "python",
        purpose: "the Python wheel, from an empty environment",
        slow: true,
        action: wheel,
    },
    Step { name: "docs", purpose: "the documentation builds without warnings", slow: true, action: docs },
    Step { name: "boards", purpose: "the board images, and their sizes", slow: true, action: boards },
    Step {
        name: "emulator",
        purpose: "the image in QEMU: golden vectors, records, faults, budgets",
        slow: true,
        action: emulated,
    },
];

/// How a step ended.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Outcome {
    Passed(String),
    Failed,
    LeftOut(&'static str),
}

impl Run<'_> {
    fn scope(&self) -> Scope {
        if self.options.quick { Scope::WithoutScenarios } else { Scope::Everything }
    }

    /// The toolchain of the set-up step, or an error if it is missing (with `--keep-going`).
    fn toolchain(&self) -> Result<&Toolchain> {
        self.toolchain
            .as_ref()
            .context("there is no compiler for the microcontroller, because the set-up failed")
    }
}

/// Runs the steps.
pub fn run(project: &Project, options: &Options) -> Result<()> {
    println!("cargo xtask test runs, in this order:");
    for step in &STEPS {
        let remark = if options.quick && step.slow { " (left out by --quick)" } else { "" };
        println!("  {:<15} {}{remark}", step.name, step.purpose);
    }
    if options.quick {
        println!("  --quick also leaves out the whole-system scenarios ({})", tests_run::SCENARIOS);
    }

    let start = Instant::now();
    let mut run = Run { project, options, toolchain: None };
    let mut results = Vec::new();
    let mut stopped = false;
    for step in &STEPS {
        if stopped || (options.quick && step.slow) {
            let why = if stopped { "after a failure" } else { "--quick" };
            results.push((step.name, Outcome::LeftOut(why), Duration::ZERO));
            continue;
        }
        println!("\n== {}: {}", step.name, step.purpose);
        let begin = Instant::now();
        let outcome = match (step.action)(&mut run) {
            Ok(remark) => Outcome::Passed(remark),
            Err(error) => {
                eprintln!("error: {}: {error:#}", step.name);
                stopped = !options.keep_going;
                Outcome::Failed
            }
        };
        results.push((step.name, outcome, begin.elapsed()));
    }
    print!("\n{}", table(&results));
    conclude(&results, start.elapsed())
}

fn conclude(results: &[(&str, Outcome, Duration)], elapsed: Duration) -> Result<()> {
    let failed: Vec<&str> = results
        .iter()
        .filter(|(_, outcome, _)| *outcome == Outcome::Failed)
        .map(|(name, ..)| *name)
        .collect();
    if !failed.is_empty() {
        bail!("cargo xtask test failed at {} after {}", failed.join(", "), shown(elapsed));
    }
    let left_out = results.iter().filter(|(_, outcome, _)| matches!(outcome, Outcome::LeftOut(_))).count();
    let (run, remark) =
        (results.len() - left_out, if left_out > 0 { ", the slow ones left out" } else { "" });
    println!("cargo xtask test: {run} steps passed in {}{remark}", shown(elapsed));
    Ok(())
}

fn table(results: &[(&str, Outcome, Duration)]) -> String {
    let mut text = format!("{:<15} {:<9} {:>9}  remark\n", "step", "result", "time");
    for (name, outcome, duration) in results {
        let (result, remark) = match outcome {
            Outcome::Passed(remark) => ("passed", remark.as_str()),
            Outcome::Failed => ("FAILED", "see above"),
            Outcome::LeftOut(why) => ("left out", *why),
        };
        let line = format!("{name:<15} {result:<9} {:>9}  {remark}", shown(*duration));
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

fn shown(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    if seconds < 60.0 {
        format!("{seconds:.1} s")
    } else {
        format!("{} min {:02} s", duration.as_secs() / 60, duration.as_secs() % 60)
    }
}

fn set_up(run: &mut Run) -> Result<String> {
    let consent = Consent::new(run.options.yes);
    // The quick run has no step that needs the emulator.
    let set_up = if run.options.quick { setup::target } else { setup::everything };
    let toolchain = set_up(run.project, consent)?;
    let remark = match toolchain {
        Toolchain::Installed => "the target is installed in rustup's compiler",
        Toolchain::Private { .. } => "the target is built from the distribution's compiler",
    };
    run.toolchain = Some(toolchain);
    Ok(remark.to_owned())
}

fn formatting(run: &mut Run) -> Result<String> {
    lint::formatting(run.project)?;
    Ok(String::new())
}

fn layout_rules(run: &mut Run) -> Result<String> {
    layout::check(run.project)?;
    Ok(String::new())
}

fn lints(run: &mut Run) -> Result<String> {
    lint::all(run.project)?;
    Ok(String::new())
}

fn build(run: &mut Run) -> Result<String> {
    tests_run::build(run.project, run.scope())?;
    Ok(String::new())
}

fn tests(run: &mut Run) -> Result<String> {
    let counts = tests_run::run(run.project, run.scope(), &run.options.extra)?;
    Ok(counts.to_string())
}

fn wheel(run: &mut Run) -> Result<String> {
    python::run(run.project, python::Jointrig::Built)
}

fn docs(run: &mut Run) -> Result<String> {
    book::code(run.project)?;
    Ok(String::new())
}

fn boards(run: &mut Run) -> Result<String> {
    let boards = run.project.boards()?;
    if boards.is_empty() {
        println!("  firmware/boards does not exist yet");
        return Ok("no boards yet".to_owned());
    }
    firmware::build_boards(run.project, run.toolchain()?, None)?;
    Ok(format!("{} images", boards.len()))
}

fn emulated(run: &mut Run) -> Result<String> {
    let (project, toolchain) = (run.project, run.toolchain()?);
    if firmware::board(project, EMULATED_BOARD)?.is_none() {
        println!("  firmware/boards/{EMULATED_BOARD} does not exist yet");
        return Ok("no image yet".to_owned());
    }
    let checks = firmware::build_checks(project, toolchain)?;
    print!("{}", emulator::listen(&checks, "golden", false)?);
    let image = firmware::build_board(project, toolchain, EMULATED_BOARD)?;
    let counts = tests_run::run_in_emulator(project, &image)?;
    let cost = budgets::check(project, toolchain)?;
    Ok(format!("{counts}; {cost}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_tells_each_step_and_its_time() {
        let results = [
            ("setup", Outcome::Passed("ready".into()), Duration::from_millis(340)),
            ("lint", Outcome::Failed, Duration::from_secs(75)),
            ("docs", Outcome::LeftOut("after a failure"), Duration::ZERO),
        ];
        let expected = "step            result         time  remark\n\
                        setup           passed        0.3 s  ready\n\
                        lint            FAILED    1 min 15 s  see above\n\
                        docs            left out      0.0 s  after a failure\n";
        assert_eq!(table(&results), expected);
    }

    #[test]
    fn one_failure_fails_the_run_and_is_named() {
        let failed =
            [("lint", Outcome::Failed, Duration::ZERO), ("docs", Outcome::LeftOut("x"), Duration::ZERO)];
        let message = conclude(&failed, Duration::from_secs(2)).expect_err("lint failed").to_string();
        assert_eq!(message, "cargo xtask test failed at lint after 2.0 s");
        assert!(
            conclude(&[("lint", Outcome::Passed(String::new()), Duration::ZERO)], Duration::ZERO).is_ok()
        );
    }

    #[test]
    fn quick_keeps_the_lints_which_compile_for_the_microcontroller() {
        let kept: Vec<&str> = STEPS.iter().filter(|step| !step.slow).map(|step| step.name).collect();
        assert_eq!(kept, ["setup", "fmt-check", "layout", "lint", "build", "test"]);
    }
}
