//! Runs the peers' scripts with the Python given by `JOINTRIG_PYTHON`.

use super::row::{RUNS, SPELL};
use serde_json::Value;
use std::error::Error;
use std::process::Command;

/// A Python with the peers' packages, if one is configured.
pub struct Peers(Option<String>);

impl Peers {
    /// Reads the environment variable.
    pub fn found() -> Self {
        Peers(std::env::var("JOINTRIG_PYTHON").ok())
    }

    /// Whether there is one.
    pub fn are_there(&self) -> bool {
        self.0.is_some()
    }

    /// Runs a script of the folder `peers` and returns the document that it prints; `None` without
    /// a Python. The script receives the number and duration of our own runs.
    pub fn run(&self, script: &str, job: &str) -> Result<Option<Value>, Box<dyn Error>> {
        let Some(python) = &self.0 else { return Ok(None) };
        let path = format!("{}/peers/{script}", env!("CARGO_MANIFEST_DIR"));
        let output = Command::new(python)
            .env("JOINTRIG_BENCH_RUNS", RUNS.to_string())
            .env("JOINTRIG_BENCH_SECONDS", SPELL.as_secs_f64().to_string())
            .arg("-B")
            .arg(path)
            .arg(job)
            .output()?;
        if !output.status.success() {
            return Err(format!("{script} failed:\n{}", String::from_utf8_lossy(&output.stderr)).into());
        }
        Ok(Some(serde_json::from_slice(&output.stdout)?))
    }
}

/// The fastest of the runs that a script reports, s.
pub fn quickest(seconds: &Value) -> Option<f64> {
    seconds.as_array()?.iter().filter_map(Value::as_f64).reduce(f64::min)
}
