//! `--serve`: the live page beside a command that measures.

use std::path::Path;
#[cfg(feature = "dashboard")]
use std::sync::Arc;

use clap::Args;

use super::error::CliError;
use crate::campaign::watch::Watchers;
#[cfg(feature = "dashboard")]
use crate::dashboard::Dashboard;
use crate::device::tap::Tap;

/// Whether a page shows what is measured.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Page {
    /// Show a live page on this port of 127.0.0.1 meanwhile [default port: a free one].
    #[cfg(feature = "dashboard")]
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    serve: Option<u16>,
}

/// Who looks on while a command measures. Without a page nobody does.
#[derive(Default)]
pub struct Onlooker {
    /// What it is told of the campaign.
    pub watch: Watchers,
    /// Its look at the stream.
    pub tap: Option<Tap>,
    #[cfg(feature = "dashboard")]
    _page: Option<Dashboard>,
}

impl Page {
    /// Serves the page of this file as long as the value lives, if it was asked for.
    ///
    /// # Errors
    /// The port cannot be had: nothing is measured then.
    #[cfg(feature = "dashboard")]
    pub fn start(self, file: Option<&Path>) -> Result<Onlooker, CliError> {
        let Some(port) = self.serve else { return Ok(Onlooker::default()) };
        let (page, hooks) = Dashboard::of_measuring(file, port)?;
        eprintln!("live page: {}", page.url());
        Ok(Onlooker {
            watch: Watchers::default().and(hooks.eye as Arc<_>),
            tap: Some(hooks.tap),
            _page: Some(page),
        })
    }

    /// Nobody looks on: this build has no page.
    #[cfg(not(feature = "dashboard"))]
    #[allow(clippy::unnecessary_wraps, reason = "with a page it may fail")]
    pub fn start(self, _file: Option<&Path>) -> Result<Onlooker, CliError> {
        Ok(Onlooker::default())
    }
}
