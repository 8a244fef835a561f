//! `--serve`: a live page for a command that measures.

use super::error::CliError;
#[cfg(feature = "dashboard")]
use super::open_page::Opened;
use crate::campaign::run::answers::{Answers, Edits};
use crate::campaign::watch::Watchers;
#[cfg(feature = "dashboard")]
use crate::dashboard::{Dashboard, Measuring};
use crate::device::tap::Tap;
#[cfg(feature = "dashboard")]
use crate::untrusted_text::tell_line;
use clap::Args;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Options for the live page.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Page {
    /// Show a live page on this port of 127.0.0.1 during the measurement [default port: a free
    /// one].
    #[cfg(feature = "dashboard")]
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    pub serve: Option<u16>,
    /// Open the page in the browser.
    #[cfg(feature = "dashboard")]
    #[arg(long, requires = "serve")]
    pub open: bool,
}

/// The live page's connections to a command that measures. Empty without a page.
#[derive(Default)]
pub struct Onlooker {
    /// Receives the events of the campaign.
    pub watch: Watchers,
    /// Receives the stream.
    pub tap: Option<Tap>,
    /// Edits of the file that it requests.
    pub edits: Option<Edits>,
    /// Its answers to prompts for hammer and laser.
    pub answers: Option<Answers>,
    #[cfg(feature = "dashboard")]
    _page: Option<(Dashboard, Option<Opened>)>,
}

impl Page {
    /// If requested, serves the page of this file (or of a device's channels alone) as long as the
    /// returned value exists. `stop` is set by a page that ends the run after the current shot;
    /// `control` states whether a page may answer the prompts for hammer and laser.
    ///
    /// # Errors
    /// The port is not available: nothing is measured then.
    #[cfg(feature = "dashboard")]
    pub fn start(
        self,
        file: Option<&Path>,
        stop: &Arc<AtomicBool>,
        control: bool,
    ) -> Result<Onlooker, CliError> {
        let Some(port) = self.serve else { return Ok(Onlooker::default()) };
        let measuring = Measuring { file, stop: stop.clone(), control };
        let (page, hooks) = Dashboard::of_measuring(&measuring, port)?;
        tell_line!("live page: {}", page.url());
        if let Some(url) = page.edit_url() {
            tell_line!("to take notes and to keep or drop hits: {url}");
        }
        let opened = self.open.then(|| Opened::new(&page.edit_url().unwrap_or_else(|| page.url()))).flatten();
        Ok(Onlooker {
            watch: Watchers::default().and(hooks.watcher as Arc<_>),
            tap: Some(hooks.tap),
            edits: hooks.edits,
            answers: hooks.answers,
            _page: Some((page, opened)),
        })
    }

    /// No live page: this build does not contain it.
    #[cfg(not(feature = "dashboard"))]
    #[allow(clippy::unnecessary_wraps, clippy::unused_self, reason = "with a page it may fail")]
    pub fn start(
        self,
        _file: Option<&Path>,
        _stop: &Arc<AtomicBool>,
        _control: bool,
    ) -> Result<Onlooker, CliError> {
        Ok(Onlooker::default())
    }
}
