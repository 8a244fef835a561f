//! `analyse`: results and report from a campaign file alone.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};

use super::error::CliError;
use super::number::{not_negative, positive};
use super::output;
use crate::analyse::{KnownContact, Wanted};
use crate::campaign::store::Store;
use crate::report::{self, words};
use crate::results::Results;

/// Analyse a campaign file: results.json and report.html.
#[derive(Debug, Args)]
pub struct Analyse {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Folder for results.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Effective mass of the static arm at the contact, kg; identified from the records without it.
    #[arg(long, value_name = "KG", value_parser = not_negative)]
    effective_mass: Option<f64>,
    /// Stiffness to ground beside the load cells, over theirs [default: the plan's].
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    parallel_path: Option<f64>,
    /// Normal load, N, for the friction coefficient [default: the plan's].
    #[arg(long, value_name = "N", value_parser = positive)]
    normal_load: Option<f64>,
    /// Draw the hits of every interface cell anew this often, for an interval that needs no model of the noise (1000 is usual).
    #[arg(long, value_name = "N", default_value_t = 0)]
    bootstrap: usize,
    /// Print every method, check and loop too.
    #[arg(long)]
    details: bool,
    /// Print results.json on stdout too.
    #[arg(long)]
    json: bool,
}

impl Analyse {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let known = KnownContact {
            normal_load_n: self.normal_load,
            parallel_path: self.parallel_path,
            effective_mass_kg: self.effective_mass,
        };
        let found = analyse_into(&store, Wanted { replicates: self.bootstrap, known }, &self.out, &[])?;
        if self.json {
            return output::json(&found);
        }
        if self.details {
            output::lines(words::summary(&found))?;
            output::lines([String::new()])?;
        }
        ending(&found, &self.out)
    }
}

/// The answer in a few lines, and where the report is.
pub fn ending(found: &Results, folder: &Path) -> Result<(), CliError> {
    let last = format!("Open {} for figures and tables.", folder.join(report::REPORT_FILE).display());
    output::lines(words::brief::terminal(found, 1))?;
    output::lines([last])
}

/// Analyses what the file holds, with a bar for whoever waits.
pub fn analysed(store: &Store, wanted: Wanted) -> Result<Results, CliError> {
    let bar = if std::io::stderr().is_terminal() {
        ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr())
    } else {
        ProgressBar::hidden()
    };
    let results = report::analysed(store, wanted, &|progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    })?;
    bar.finish_and_clear();
    Ok(results)
}

/// Analyses what the file holds and writes `results.json`, `report.html` and the figures asked for into `folder`.
pub fn analyse_into(
    store: &Store,
    wanted: Wanted,
    folder: &Path,
    formats: &[report::Format],
) -> Result<Results, CliError> {
    let results = analysed(store, wanted)?;
    report::write(&results, folder, formats).map_err(|source| CliError::File {
        path: folder.into(),
        doing: "writing results and report",
        source,
    })?;
    Ok(results)
}
