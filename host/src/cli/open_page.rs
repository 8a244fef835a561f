//! `--open`: the live page in the browser of whoever sits at this machine.
//!
//! A program's arguments are for every user of the machine to read, and the address holds a secret. So the browser is given the name of a file
//! that its owner alone can read; that file leads on to the address, and goes when the page does.

use crate::outside::tell_line;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The file that leads on, as long as the page is served.
pub struct Opened {
    file: PathBuf,
}

impl Opened {
    /// Has the browser open `url`. A machine without one is told so; the page is served all the same.
    pub fn new(url: &str) -> Option<Self> {
        match Self::try_new(url) {
            Ok(opened) => Some(opened),
            Err(error) => {
                tell_line!("no browser could be opened ({error}): open the address by hand");
                None
            }
        }
    }

    fn try_new(url: &str) -> io::Result<Self> {
        let mut random = [0; 8];
        getrandom::fill(&mut random).map_err(io::Error::other)?;
        let name = format!("jointrig-page-{:016x}.html", u64::from_le_bytes(random));
        // that of this session is cleared when it ends; a browser in a box of its own may see neither
        let folder = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| folder.is_dir());
        let opened = Self { file: folder.unwrap_or_else(std::env::temp_dir).join(name) };
        let mut file = private(&opened.file)?;
        // an address of ours: digits, letters and `:/#=.`
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

/// A new file that nobody else can read.
fn private(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)
}

/// What opens a file as its user would.
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
