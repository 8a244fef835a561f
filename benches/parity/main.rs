//! Comparison of results with the programs that laboratories use. `cargo xtask bench` compares the
//! run times.
//!
//! `cargo xtask parity` prepares Python with pyFRF, pyuff and pyFBS and starts this program.

mod pyfbs;
mod pyfrf_pyuff;

use std::process::{Command, ExitCode};

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> ExitCode {
    let Ok(python) = std::env::var("JOINTRIG_PYTHON") else {
        eprintln!("nothing compared: JOINTRIG_PYTHON names no interpreter; run `cargo xtask parity`");
        return ExitCode::SUCCESS;
    };
    match both(pyfrf_pyuff::run(&python), pyfbs::run(&python)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Combines two outcomes so that one failure does not hide the other.
fn both(first: Outcome, second: Outcome) -> Outcome {
    match (first, second) {
        (Err(one), Err(other)) => Err(format!("{one}\n  {other}").into()),
        (one, other) => one.and(other),
    }
}

/// Runs a script of this folder and returns its output.
fn script(python: &str, name: &str, argument: &str) -> Result<String, Box<dyn std::error::Error>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/parity/");
    let output = Command::new(python).arg(format!("{path}{name}")).arg(argument).output()?;
    if !output.status.success() {
        return Err(format!("{name} failed:\n{}", String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(String::from_utf8(output.stdout)?)
}
