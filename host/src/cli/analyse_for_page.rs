//! `analyse-for-page`: started by the live page's process to analyse a campaign in a separate
//! process. Hidden, since users do not call it.

use super::error::CliError;
use crate::live::forming::analyse_for_another;
use clap::Args;
use std::path::PathBuf;

/// Print the result of an analysis, for the live page; ends when the input is closed.
#[derive(Debug, Args)]
pub struct AnalyseForPage {
    /// The campaign file.
    file: PathBuf,
    /// The newest record's id.
    last: i64,
}

impl AnalyseForPage {
    pub(super) fn run(self) -> Result<(), CliError> {
        analyse_for_another(&self.file, self.last, &mut std::io::stdout().lock()).map_err(|source| {
            CliError::File { path: self.file, doing: "analysing for the live page", source }
        })
    }
}
