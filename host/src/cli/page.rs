//! `--serve`: a live page for a command that measures.
//!
//! `--open`: opens the live page in the browser on this machine.
//!
//! A program's arguments are readable by every user of the machine, and the address contains a
//! secret. Therefore the browser is given the name of a file that only its owner can read; that
//! file redirects to the address, and is removed with the page.

use super::error::CliError;
use crate::campaign::run::answers::{Answers, Edits};
use crate::campaign::watch::Watchers;
#[cfg(feature = "dashboard")]
use crate::dashboard::{Dashboard, Measuring};
use crate::device::tap::Tap;
use crate::untrusted_text::tell_line;
use clap::Args;
use std::fs::{File, OpenOptions};
use std::io;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
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

/// The redirecting file, which exists as long as the page is served.
pub struct Opened {
    file: PathBuf,
}

impl Opened {
    /// Opens `url` in the browser. If that fails, a message is printed, and the page is served
    /// anyway.
    pub fn new(url: &str) -> Option<Self> {
        match Self::try_new(url) {
            Ok(opened) => Some(opened),
            Err(error) => {
                tell_line!("no browser could be opened ({error}): open the address yourself");
                None
            }
        }
    }

    fn try_new(url: &str) -> io::Result<Self> {
        let mut random = [0; 8];
        getrandom::fill(&mut random).map_err(io::Error::other)?;
        let name = format!("jointrig-page-{:016x}.html", u64::from_le_bytes(random));
        // the session's folder is cleared when the session ends; a sandboxed browser may see
        // neither folder
        let folder = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| folder.is_dir());
        let opened = Self { file: folder.unwrap_or_else(std::env::temp_dir).join(name) };
        let mut file = private(&opened.file)?;
        // our own address contains only digits, letters and `:/#=.`, so no escaping is needed
        write!(
            file,
            "<!doctype html><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">\
             <meta http-equiv=\"refresh\" content=\"0;url={url}\"><title>jointrig</title>"
        )?;
        file.sync_all()?;
        opener(&opened.file).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
        Ok(opened)
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_file(&self.file) {
            log::debug!("{}: {error}", self.file.display());
        }
    }
}

/// Creates a new file that only its owner can read.
fn private(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)
}

/// The system's command for opening a file.
fn opener(file: &Path) -> Command {
    let mut command = if cfg!(windows) {
        let mut command = Command::new("explorer");
        command.arg(file);
        return command;
    } else if cfg!(target_os = "macos") {
        Command::new("open")
    } else {
        Command::new("xdg-open")
    };
    command.arg(file);
    command
}
