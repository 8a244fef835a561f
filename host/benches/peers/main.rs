//! jointrig beside the programs that laboratories use: the same numbers (`parity`), and the time both take (`speed`).
//!
//! `cargo xtask parity` and `cargo xtask parity --speed` prepare Python with pyFRF, pyuff and pyFBS and start this. Without
//! `JOINTRIG_PYTHON` the speed of our own side is printed alone.

mod parity;
mod pyfbs_parity;
mod speed;
mod substructuring_speed;

use std::process::{Command, ExitCode};

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> ExitCode {
    let python = std::env::var("JOINTRIG_PYTHON").ok();
    let parity_wanted = std::env::args().any(|word| word == "parity");
    let done = match (parity_wanted, &python) {
        (true, Some(python)) => both(parity::run(python), pyfbs_parity::run(python)),
        (true, None) => Err("JOINTRIG_PYTHON names no interpreter: run `cargo xtask parity`".into()),
        (false, _) => both(substructuring_speed::run(python.as_deref()), speed::run(python.as_deref())),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// One room's failure does not hide the other's.
fn both(first: Outcome, second: Outcome) -> Outcome {
    match (first, second) {
        (Err(one), Err(other)) => Err(format!("{one}\n  {other}").into()),
        (one, other) => one.and(other),
    }
}

/// Runs a script of the folder `peers` and gives what it prints.
fn script(python: &str, name: &str, argument: &str) -> Result<String, Box<dyn std::error::Error>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/");
    let output = Command::new(python).arg(format!("{path}{name}")).arg(argument).output()?;
    if !output.status.success() {
        return Err(format!("{name} failed:\n{}", String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// The quickest of several runs, s: whatever else a machine does can only add to it, so that both sides are compared at their best.
fn quickest(seconds: &[f64]) -> f64 {
    seconds.iter().copied().reduce(f64::min).unwrap_or(f64::NAN)
}
