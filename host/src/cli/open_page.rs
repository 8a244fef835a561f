//! `--open`: opens the live page in the browser on this machine.
//!
//! A program's arguments are readable by every user of the machine, and the address contains a
//! secret. Therefore the browser is given the name of a file that only its owner can read; that
//! file redirects to the address, and is removed with the page.

use crate::untrusted_text::tell_line;
use std::fs::{File, OpenOptions};
use std::io;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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
