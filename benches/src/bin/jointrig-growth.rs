//! Growth of time and memory with the size of the work. A separate program, because counting heap
//! use slows every allocation down.

use jointrig::cli::expect_signals;
use jointrig_benches::growth::{Growth, table};
use jointrig_benches::{campaign, substructuring};
use peak_alloc::PeakAlloc;
use std::error::Error;
use std::process::ExitCode;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

fn main() -> ExitCode {
    expect_signals();
    match run() {
        Ok(short) if short.is_empty() => ExitCode::SUCCESS,
        Ok(short) => {
            eprintln!("grows faster than wanted:\n  {}", short.join("\n  "));
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<Vec<String>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let mut all = campaign::growth(folder.path(), HEAP)?;
    all.push(substructuring::growth(HEAP)?);
    println!(
        "## Growth\n\nThe sizes take turns: none finds its data in the cache from its own last run.\n\n{}",
        table(&all)
    );
    Ok(all.iter().flat_map(Growth::short).collect())
}
