//! Environments of Python, and the packages in them: checks' alone, in folders under `target/`; no part of jointrig needs them.

use crate::command;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The packages that jointrig is compared with, in the versions in which the comparison was last seen to hold, and what they need.
const PEERS: [&str; 7] = ["numpy", "pyFRF==1.5.0", "pyuff==2.5.8", "scipy", "pandas", "openpyxl", "tqdm"];

/// Installed without its dependencies: virtual points and SEMM need only what is named above, while the rest (3D views over
/// pyvista and Qt, Ansys readers) takes a gigabyte and often does not install.
const ALONE: [&str; 1] = ["pyFBS==1.0.7"];

/// Installs the peers.
pub fn with_peers(python: &Path) -> Result<()> {
    pip(python, &["install", "--quiet"], &PEERS)?;
    pip(python, &["install", "--quiet", "--no-deps"], &ALONE)
}

/// The interpreter of an environment that has these packages; made where it is not there.
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
