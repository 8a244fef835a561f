//! The binaries, run as a user runs them.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// Path of the binary that `cargo xtask test` built, from the environment variable `variable`.
///
/// # Panics
/// When the variable is not set: run the scenarios through `cargo xtask test`.
#[must_use]
pub fn binary(variable: &str) -> PathBuf {
    PathBuf::from(std::env::var_os(variable).unwrap_or_else(|| {
        panic!("{variable} is not set: run `cargo xtask test`, which builds the binaries first")
    }))
}

/// The `jointrig` command.
#[must_use]
pub fn jointrig() -> Command {
    Command::new(binary("JOINTRIG_BIN"))
}

/// A served virtual board. Dropping it ends the process.
pub struct Served {
    child: Child,
    /// The address that the host opens.
    pub address: String,
}

impl Served {
    /// Starts `jointrig-hil-sim serve` with these arguments and waits for its address.
    pub fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(binary("JOINTRIG_HIL_SIM_BIN"))
            .arg("serve")
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { child, address: address.trim().into() }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // it may already have ended, which the test has noticed by then
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
