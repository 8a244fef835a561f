//! `report`: writes every figure and table of a campaign file.

use std::path::PathBuf;

use clap::Args;

use super::analyse::{analyse_into, ending};
use super::error::CliError;
use crate::analyse::Wanted;
use crate::campaign::store::Store;
use crate::report::Format;

/// Write the report of a campaign file: results.json, report.html, and optionally each figure as a
/// separate file.
#[derive(Debug, Args)]
pub struct Report {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Folder for results.json, report.html and figures/.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Also write each figure as figures/NAME, in these formats.
    #[arg(long, value_name = "FORMAT", value_delimiter = ',')]
    figures: Vec<Format>,
}

impl Report {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let found = analyse_into(&store, Wanted::default(), &self.out, &self.figures)?;
        ending(&found, &self.out)
    }
}
