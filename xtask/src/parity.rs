//! `cargo xtask parity`: the same numbers as pyFRF, pyuff and pyFBS, and how long both take.
//!
//! Python and its packages are the check's alone, in a folder under `target/`; no part of jointrig needs them.

use crate::command;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::PathBuf;
use std::process::Command;

/// What is compared with, and in which versions the comparison was last seen to hold.
const PACKAGES: [&str; 7] = ["numpy", "pyFRF==1.5.0", "pyuff==2.5.8", "scipy", "pandas", "openpyxl", "tqdm"];

/// Installed without its dependencies: virtual points and SEMM need only what is named above, while the rest (3D views over
/// pyvista and Qt, Ansys readers) takes a gigabyte and often does not install.
const ALONE: [&str; 1] = ["pyFBS==1.0.7"];

/// Options of `cargo xtask parity`.
#[derive(Args)]
pub struct Options {
    /// Compare times instead of numbers, and fail where we are not as much faster as promised.
    #[arg(long)]
    speed: bool,
}

/// Prepares Python and runs the comparison.
pub fn run(project: &Project, options: &Options) -> Result<()> {
    let python = python(project)?;
    let mut cargo = command::cargo(&project.root);
    cargo.args(["bench", "-p", "jointrig", "--bench", "peers", "--"]);
    cargo.arg(if options.speed { "speed" } else { "parity" });
    cargo.env("JOINTRIG_PYTHON", python);
    command::run(&mut cargo)
}

/// The interpreter of an environment that has the packages; made when it is not there.
fn python(project: &Project) -> Result<PathBuf> {
    let folder = project.root.join("target/parity-python");
    let interpreter = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if !interpreter.is_file() {
        let Some(system) = ["python3", "python"].into_iter().find_map(command::find_program) else {
            bail!(
                "there is no Python: install python3 with its venv module, or leave the parity check to others"
            );
        };
        command::run(Command::new(system).args(["-m", "venv"]).arg(&folder))
            .context("the environment cannot be made: on Debian, install python3-venv")?;
    }
    command::run(Command::new(&interpreter).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES))
        .context("the packages cannot be installed")?;
    println!("pyFBS is installed without its dependencies: of it, only virtual points and SEMM are compared");
    let alone = ["-m", "pip", "install", "--quiet", "--no-deps"];
    command::run(Command::new(&interpreter).args(alone).args(ALONE)).context("pyFBS cannot be installed")?;
    Ok(interpreter)
}
