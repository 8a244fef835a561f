//! The controller's log: decodes its bytes from the link into lines of this program's log.
//!
//! Decoding needs the table of strings of the build that the controller runs ([`jointrig_logs`]).
//! The table is searched for once, when the first line arrives: in the image with which an emulator
//! was started, then in folders. Lines that arrive before the controller has reported its build
//! wait. Without a table, one warning states where to put it, and the bytes are counted.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use jointrig_logs::{FOLDER, Line, Table, file_name};

/// Environment variable that names a folder of tables.
pub const FOLDER_VARIABLE: &str = "JOINTRIG_LOG_TABLES";

/// Most bytes that wait for the build to be known.
const WAITING_BYTES: usize = 65_536;

/// Most lines kept for the caller; the oldest are dropped.
const LINES_KEPT: usize = 256;

/// Folders in which tables of log strings are searched for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tables {
    folders: Vec<PathBuf>,
}

impl Tables {
    /// Searches in `folder`, or else in the folder named by [`FOLDER_VARIABLE`]; and always in
    /// [`FOLDER`] next to this program's folder, which is `target/log-tables` for a program built
    /// by cargo.
    pub fn new(folder: Option<PathBuf>) -> Self {
        let named = folder.or_else(|| std::env::var_os(FOLDER_VARIABLE).map(PathBuf::from));
        let program = std::env::current_exe().ok();
        let beside = program.as_deref().and_then(Path::parent).and_then(Path::parent);
        Self { folders: named.into_iter().chain(beside.map(|folder| folder.join(FOLDER))).collect() }
    }

    /// Searches in these folders only.
    pub fn in_folders(folders: Vec<PathBuf>) -> Self {
        Self { folders }
    }

    /// The table of this build: from `image` if it is that build, or from one of the folders.
    ///
    /// # Errors
    /// A sentence with the places searched and what was wrong with each.
    fn find(&self, build: u64, image: Option<&Path>) -> Result<Table, String> {
        if image.is_none() && self.folders.is_empty() {
            return Err("no folder to search was named".into());
        }
        let mut looked = Vec::new();
        let places = image.map(Path::to_path_buf).into_iter();
        for path in places.chain(self.folders.iter().map(|folder| folder.join(file_name(build)))) {
            if !path.is_file() {
                looked.push(format!("no {}", path.display()));
                continue;
            }
            match Table::read(&path) {
                Ok(table) if table.build() == build => return Ok(table),
                Ok(table) => looked.push(format!("{} is build {:016x}", path.display(), table.build())),
                Err(error) => looked.push(error.to_string()),
            }
        }
        Err(looked.join("; "))
    }
}

/// State of decoding.
#[derive(Default)]
enum LogDecoder {
    /// The controller has not reported its build.
    #[default]
    BuildUnknown,
    /// The build is known; no log bytes have arrived since.
    NotLooked(u64),
    With(Box<Table>),
    Without,
}

/// The log of one controller.
#[derive(Default)]
pub(super) struct DeviceLog {
    /// The device's name in messages.
    address: String,
    pub tables: Tables,
    /// The image with which an emulator was started.
    image: Option<PathBuf>,
    reading: LogDecoder,
    waiting: Vec<u8>,
    lines: VecDeque<Line>,
    undecoded: u64,
}

impl DeviceLog {
    /// A log for the device named `address` in messages, started with `image` where that is known.
    pub fn of(address: &str, image: Option<&Path>) -> Self {
        Self { address: address.into(), image: image.map(Into::into), ..Self::default() }
    }

    /// Takes the payload of a log frame.
    pub fn take(&mut self, payload: &[u8]) {
        if let LogDecoder::NotLooked(build) = self.reading {
            self.reading = match self.tables.find(build, self.image.as_deref()) {
                Ok(table) => LogDecoder::With(Box::new(table)),
                Err(looked) => {
                    log::warn!(
                        "{}: the controller's log cannot be shown, because the table of build {build:016x} is missing ({looked}): \
                         put the image that it runs into one of these folders as {} (`cargo xtask firmware` \
                         does this with what it builds), or name another folder with --log-tables or {FOLDER_VARIABLE}",
                        self.address,
                        file_name(build)
                    );
                    LogDecoder::Without
                }
            };
        }
        match &self.reading {
            LogDecoder::BuildUnknown if self.waiting.len() + payload.len() <= WAITING_BYTES => {
                self.waiting.extend_from_slice(payload);
            }
            LogDecoder::With(table) => {
                let lost = table.lines(payload, |line| {
                    log::log!(target: "controller", line.level, "{}", line.text);
                    if self.lines.len() == LINES_KEPT {
                        self.lines.pop_front();
                    }
                    self.lines.push_back(line);
                });
                if lost > 0 {
                    log::debug!("{lost} bytes of the controller's log could not be decoded");
                }
                self.undecoded += lost as u64;
            }
            _ => self.undecoded += payload.len() as u64,
        }
    }

    /// Sets the build that the controller reported, and decodes the bytes that waited for it.
    pub fn know_build(&mut self, build: u64) {
        if matches!(self.reading, LogDecoder::BuildUnknown) {
            self.reading = LogDecoder::NotLooked(build);
            let waiting = std::mem::take(&mut self.waiting);
            if !waiting.is_empty() {
                self.take(&waiting);
            }
        }
    }

    /// The lines since the last call, each with level and text.
    pub fn lines(&mut self) -> Vec<String> {
        self.lines.drain(..).map(|line| format!("{} {}", line.level, line.text)).collect()
    }

    /// Bytes that could not be decoded.
    pub fn undecoded(&self) -> u64 {
        self.undecoded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_wait_for_the_build_and_are_counted_without_a_table() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join(file_name(7)), b"no image").expect("written");
        let tables = Tables::in_folders(vec![folder.path().into()]);
        assert!(tables.find(7, None).err().is_some_and(|why| why.contains("no ELF image")));
        assert!(tables.find(8, None).err().is_some_and(|why| why.contains(&file_name(8))));
        let mut log = DeviceLog { tables, ..DeviceLog::default() };
        log.take(&[1; 100]);
        assert_eq!(log.undecoded(), 0, "they wait");
        log.know_build(8);
        assert_eq!(log.undecoded(), 100);
        log.take(&[1, 2, 0]);
        assert_eq!((log.undecoded(), log.lines().len()), (103, 0));
    }

    #[test]
    fn what_waits_is_bounded() {
        let mut log = DeviceLog::default();
        for _ in 0..1_000 {
            log.take(&[1; 400]);
        }
        assert!(log.waiting.len() <= WAITING_BYTES);
        assert_eq!(log.waiting.len() as u64 + log.undecoded(), 400_000);
    }
}
