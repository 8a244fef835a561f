//! Table of run times, compared with the programs that laboratories use and with the minimum that
//! this machine needs.
//!
//! `cargo xtask bench` prepares Python with numpy, pyFRF and pyuff, runs this program, and writes
//! docs/performance.md. Without `JOINTRIG_PYTHON` the peers' columns stay empty. It prints the
//! table and then fails if something is slower than its target.

use jointrig::cli::expect_signals;
use jointrig_benches::peers::Peers;
use jointrig_benches::{campaign, frames, loops, row, simulator, spectra, substructuring, universal};
use std::error::Error;
use std::process::ExitCode;

fn main() -> ExitCode {
    expect_signals();
    match run() {
        Ok(short) if short.is_empty() => ExitCode::SUCCESS,
        Ok(short) => {
            eprintln!("slower than wanted:\n  {}", short.join("\n  "));
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The parts that can be measured, by the words that select them.
const PARTS: [&str; 7] =
    ["spectra", "substructuring", "loops", "universal", "frames", "simulator", "campaign"];

/// Prints the tables of the parts named as arguments, or of all; returns what is slower than its
/// target.
fn run() -> Result<Vec<String>, Box<dyn Error>> {
    let named: Vec<String> = std::env::args().skip(1).collect();
    if let Some(unknown) = named.iter().find(|name| !PARTS.contains(&name.as_str())) {
        return Err(format!("there is no part {unknown:?}: known are {}", PARTS.join(", ")).into());
    }
    let peers = Peers::found();
    if !peers.are_there() {
        eprintln!(
            "JOINTRIG_PYTHON names no interpreter: the peers are left out (`cargo xtask bench` prepares one)"
        );
    }
    let folder = tempfile::tempdir()?;
    let (mut rows, mut short) = (Vec::new(), Vec::new());
    for part in PARTS.into_iter().filter(|part| named.is_empty() || named.iter().any(|name| name == part)) {
        eprintln!("{part} ...");
        let (of_part, slow) = match part {
            "spectra" => (spectra::rows(&peers)?, Vec::new()),
            "substructuring" => substructuring::rows(&peers)?,
            "loops" => (loops::rows(&peers)?, Vec::new()),
            "universal" => (universal::rows(&peers)?, Vec::new()),
            "frames" => (frames::rows()?, Vec::new()),
            "simulator" => simulator::rows()?,
            _ => (campaign::rows(folder.path())?, Vec::new()),
        };
        rows.extend(of_part);
        short.extend(slow);
    }
    short.extend(rows.iter().flat_map(row::Row::short));
    println!("{}", machine());
    println!("{}", row::table(&rows));
    Ok(short)
}

/// The machine on which the times were measured.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or("unknown processor", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{model}, {cores} cores, {}.\n", std::env::consts::OS)
}
