//! Comparisons with other programs. `cargo xtask bench`: a table of run times, compared with those
//! of peers and with the machine's limit. `cargo xtask parity`: compares results with those of
//! pyFRF, pyuff and pyFBS.
//!
//! Python and its packages are only for these, in a folder under `target/`; jointrig itself does
//! not need them.

use crate::project::Project;
use crate::python::environment;
use crate::{command, python};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// Text above the tables in docs/performance.md.
const ABOUT: &str = "\
# How fast it is

`cargo xtask bench` writes this page; do not edit it. Every row was measured in one run: our time, the time of a program that laboratories use
for the same work, and the time of what no program can do without on this machine (the limit). We and the limit take turns for fifteen seconds
at least, longer than most busy spells of a shared machine; the peer runs as long. The quickest run of each counts. *times as fast* is the peer's
time over ours; *times as long* is ours over the limit's. The run fails where a ratio misses what is wanted or allowed.

";

/// Measures all parts and writes the page; if parts are named, measures only these and prints the
/// result.
pub fn run(project: &Project, parts: &[String]) -> Result<()> {
    let Some(system) = ["python3", "python"].into_iter().find_map(command::find_program) else {
        bail!("there is no Python for the peers: install python3 with its venv module");
    };
    let python = environment(&system, &project.target.join("parity-python"), &[])?;
    python::with_peers(&python)?;
    let only_growth = parts == ["growth"];
    let times = if only_growth { None } else { Some(measured(project, &python, "jointrig-benches", parts)?) };
    let growth =
        (only_growth || parts.is_empty()).then(|| measured(project, &python, "jointrig-growth", &[]));
    let growth = growth.transpose()?;
    if let (Some((times, _)), Some((growth, _))) = (&times, &growth) {
        let page = project.root.join("docs/performance.md");
        fs::write(&page, format!("{ABOUT}{}\n\n{}\n", times.trim(), growth.trim()))
            .with_context(|| format!("{} cannot be written", page.display()))?;
        println!("written: {}", page.display());
    }
    if times.into_iter().chain(growth).all(|(_, good)| good) {
        Ok(())
    } else {
        bail!("something is slower than wanted, or could not be measured: see above")
    }
}

/// Runs a program of the benchmark package: the tables that it prints, and whether all targets are
/// met.
fn measured(project: &Project, python: &Path, program: &str, parts: &[String]) -> Result<(String, bool)> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["run", "--release", "--quiet", "--package", "jointrig-benches", "--features", "table"]);
    cargo.args(["--bin", program, "--"]).args(parts);
    cargo.env("JOINTRIG_PYTHON", python).stdout(Stdio::piped());
    let output = cargo.spawn().context("cargo cannot be started")?.wait_with_output()?;
    let tables = String::from_utf8(output.stdout).context("the tables are not text")?;
    if tables.is_empty() {
        bail!("{program} measured nothing");
    }
    println!("{tables}");
    Ok((tables, output.status.success()))
}

/// Runs the benchmarks of the hot paths, of every package that has some.
pub fn hot_paths(project: &Project, extra: &[String]) -> Result<()> {
    let mut cargo = command::cargo(&project.root);
    // `--workspace` compiles the dependencies with the same features as the tests do.
    cargo.args(["bench", "--workspace", "--bench", "*"]);
    if !extra.is_empty() {
        cargo.arg("--").args(extra);
    }
    command::run(&mut cargo)
}

/// Prepares Python and runs the comparison.
pub fn parity(project: &Project) -> Result<()> {
    let python = parity_python(project)?;
    let mut cargo = command::cargo(&project.root);
    cargo.args(["bench", "-p", "jointrig-benches", "--bench", "parity"]);
    cargo.env("JOINTRIG_PYTHON", python);
    command::run(&mut cargo)
}

/// The interpreter of an environment with the packages; created if necessary.
fn parity_python(project: &Project) -> Result<PathBuf> {
    let Some(system) = ["python3", "python"].into_iter().find_map(command::find_program) else {
        bail!(
            "there is no Python: install python3 with its venv module, or leave the parity check to others"
        );
    };
    let python = environment(&system, &project.target.join("parity-python"), &[])?;
    println!("pyFBS is installed without its dependencies: of it, only virtual points and SEMM are compared");
    python::with_peers(&python)?;
    Ok(python)
}
