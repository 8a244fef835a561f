//! `analyse-for-page`: what the live page's process starts to have a campaign analysed beside it. Hidden: nobody types it.

use std::path::PathBuf;

use clap::Args;

use super::error::CliError;
use crate::live::forming::analyse_for_another;

/// Print what an analysis found, for the live page; end when the input is closed.
#[derive(Debug, Args)]
pub struct AnalyseForPage {
    /// The campaign file.
    file: PathBuf,
    /// The newest record's id.
    last: i64,
}

impl AnalyseForPage {
    pub fn run(self) -> Result<(), CliError> {
        analyse_for_another(&self.file, self.last, &mut std::io::stdout().lock()).map_err(|source| {
            CliError::File { path: self.file, doing: "analysing for the live page", source }
        })
    }
}
