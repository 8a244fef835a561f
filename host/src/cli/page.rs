//! `--serve`: the live page beside a command that measures.

use std::path::Path;

use clap::Args;

use super::error::CliError;
use crate::dashboard::Dashboard;

/// Whether a page shows what is measured.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Page {
    /// Show a live page on this port of 127.0.0.1 meanwhile [default port: a free one].
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    serve: Option<u16>,
}

impl Page {
    /// Serves the page of this file as long as the value lives, if it was asked for.
    ///
    /// # Errors
    /// The port cannot be had: nothing is measured then.
    pub fn start(self, file: &Path) -> Result<Option<Dashboard>, CliError> {
        let Some(port) = self.serve else { return Ok(None) };
        let page = Dashboard::start(file, port)?;
        eprintln!("live page: {}", page.url());
        Ok(Some(page))
    }
}
