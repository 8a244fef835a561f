//! `cargo xtask parity`: compares results with those of pyFRF, pyuff and pyFBS.
//!
//! Python and its packages are only for this check, in a folder under `target/`; jointrig itself
//! does not need them.

use crate::command;
use crate::project::Project;
use crate::python;
use crate::python::environment;
use anyhow::{Result, bail};
use std::path::PathBuf;

/// Prepares Python and runs the comparison.
pub fn run(project: &Project) -> Result<()> {
    let python = python(project)?;
    let mut cargo = command::cargo(&project.root);
    cargo.args(["bench", "-p", "jointrig-benches", "--bench", "parity"]);
    cargo.env("JOINTRIG_PYTHON", python);
    command::run(&mut cargo)
}

/// The interpreter of an environment with the packages; created if necessary.
fn python(project: &Project) -> Result<PathBuf> {
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
