//! Python environments and their packages: only for checks, in folders under `target/`; jointrig
//! itself does not need them.

use crate::command;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The packages with which jointrig is compared, in the versions of the last successful comparison,
/// and their dependencies.
const PEERS: [&str; 7] = ["numpy", "pyFRF==1.5.0", "pyuff==2.5.8", "scipy", "pandas", "openpyxl", "tqdm"];

/// Installed without its dependencies: virtual points and SEMM need only the packages named above,
/// while the rest (3D views with pyvista and Qt, Ansys readers) takes a gigabyte and often cannot
/// be installed.
const ALONE: [&str; 1] = ["pyFBS==1.0.7"];

/// Installs the peers.
pub fn with_peers(python: &Path) -> Result<()> {
    pip(python, &["install", "--quiet"], &PEERS)?;
    pip(python, &["install", "--quiet", "--no-deps"], &ALONE)
}

/// The interpreter of an environment with these packages; creates the environment if necessary.
pub fn environment(system: &Path, folder: &Path, packages: &[&str]) -> Result<PathBuf> {
    let interpreter = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if !interpreter.is_file() {
        command::run(Command::new(system).args(["-m", "venv"]).arg(folder))
            .context("the environment cannot be made: on Debian, install python3-venv")?;
    }
    if !packages.is_empty() {
        pip(&interpreter, &["install", "--quiet"], packages)?;
    }
    Ok(interpreter)
}

/// Runs pip.
pub fn pip<T: AsRef<std::ffi::OsStr>>(python: &Path, how: &[&str], packages: &[T]) -> Result<()> {
    command::run(
        Command::new(python).args(["-m", "pip", "--disable-pip-version-check"]).args(how).args(packages),
    )
    .context("the packages cannot be installed")
}
