//! `analyse`: results and report from a campaign file alone.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};

use super::error::CliError;
use super::output;
use crate::campaign::store::Store;
use crate::results::{self, Results, Wanted};

/// Analyse a campaign file: results.json and report.html.
#[derive(Debug, Args)]
pub struct Analyse {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Folder for results.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Draw the hits of every interface cell anew this often, for an interval that needs no model of the noise (1000 is usual).
    #[arg(long, value_name = "N", default_value_t = 0)]
    bootstrap: usize,
    /// Print results.json on stdout too.
    #[arg(long)]
    json: bool,
}

impl Analyse {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let found = analyse_with(&store, &self.out, Wanted { replicates: self.bootstrap })?;
        if self.json { output::json(&found) } else { output::lines(results::words::summary(&found)) }
    }
}

/// Analyses what the file holds and writes `results.json` and `report.html` into `folder`.
pub fn analyse_into(store: &Store, folder: &Path) -> Result<Results, CliError> {
    analyse_with(store, folder, Wanted::default())
}

fn analyse_with(store: &Store, folder: &Path, wanted: Wanted) -> Result<Results, CliError> {
    let bar = if std::io::stderr().is_terminal() {
        ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr())
    } else {
        ProgressBar::hidden()
    };
    let found = results::analyse(store, wanted, &|progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    })?;
    bar.finish_and_clear();
    crate::report::write(&found, folder).map_err(|source| CliError::File {
        path: folder.into(),
        doing: "writing results and report",
        source,
    })?;
    Ok(found)
}
