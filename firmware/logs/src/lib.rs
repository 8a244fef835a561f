//! A controller's log lines: identification of their image, storage of its string table, and
//! decoding of bytes into lines.
//!
//! A controller sends its log as numbers (defmt). The strings remain in the image's ELF file, in a
//! table that matches only this build. The linker writes a hash of the whole image into the file
//! (`.note.gnu.build-id`); its first eight bytes are the *build id*. The controller reports it in
//! `Info`, and a table is stored as [`FOLDER`]`/`[`file_name`]. Therefore, after a change of a log
//! line and flashing, text of another build can never be shown.
#![forbid(unsafe_code)]

use log::Level;
use object::Object;
use std::path::{Path, PathBuf};
use strings::Strings;

#[cfg(feature = "example")]
pub mod example;

/// The folder for tables filled by `cargo xtask firmware`, inside cargo's target directory.
pub const FOLDER: &str = "log-tables";

/// File name of a build's table.
pub fn file_name(build: u64) -> String {
    format!("{build:016x}.elf")
}

/// The build id of an image; `None` when these bytes are not an ELF image or contain no id.
pub fn build_id(image: &[u8]) -> Option<u64> {
    let file = object::File::parse(image).ok()?;
    let id = file.build_id().ok()??;
    Some(u64::from_be_bytes(*id.first_chunk()?))
}

/// One line of a controller's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Severity; a line without a level counts as information.
    pub level: Level,
    /// The device's time in seconds, if the image contains it, followed by the text.
    pub text: String,
}

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file could not be read.
    #[error("{} cannot be read: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// It is not a controller image with log strings.
    #[error("{} holds no table of log strings: {why}", path.display())]
    NoTable {
        /// The file.
        path: PathBuf,
        /// What is missing in it.
        why: String,
    },
}

/// The log strings of one build.
pub struct Table {
    build: u64,
    strings: Strings,
}

impl Table {
    /// Reads the table of the image at `path`.
    ///
    /// # Errors
    /// [`TableError`], which names the file.
    pub fn read(path: &Path) -> Result<Self, TableError> {
        let image =
            std::fs::read(path).map_err(|source| TableError::File { path: path.to_path_buf(), source })?;
        Self::of_image(&image).map_err(|why| TableError::NoTable { path: path.to_path_buf(), why })
    }

    /// Extracts the table from an image.
    ///
    /// # Errors
    /// A sentence: no ELF image, no build id, or no table.
    pub fn of_image(image: &[u8]) -> Result<Self, String> {
        let build = crate::build_id(image).ok_or("it is no ELF image with a build id")?;
        Ok(Self { build, strings: Strings::of_image(image)? })
    }

    /// The build to which the table belongs.
    pub fn build(&self) -> u64 {
        self.build
    }

    /// Passes every line in `bytes` to `each`. Each line ends with a zero byte, so that a damaged
    /// line does not affect others. Returns the number of bytes that could not be decoded.
    pub fn lines(&self, bytes: &[u8], mut each: impl FnMut(Line)) -> usize {
        let mut lost = 0;
        for encoded in bytes.split_inclusive(|byte| *byte == 0).filter(|encoded| *encoded != [0]) {
            match self.strings.line(encoded) {
                Some(line) => each(line),
                None => lost += encoded.len(),
            }
        }
        lost
    }
}

/// The decoder, based on defmt's.
#[cfg(feature = "decode")]
mod strings {
    use super::Line;
    use log::Level;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// The strings of one image.
    pub struct Strings(defmt_decoder::Table);

    impl Strings {
        pub fn of_image(image: &[u8]) -> Result<Self, String> {
            let table = defmt_decoder::Table::parse(image).map_err(|error| error.to_string())?;
            let table = table.ok_or("it logs nothing")?;
            // for such a slice, defmt's decoder reserves as many elements as a four-byte count
            // specifies, even in damaged data
            if let Some(symbol) = table.raw_symbols().find(|symbol| symbol.contains("=[?]")) {
                return Err(format!(
                    "it logs slices of values, which damaged bytes would make endless: {symbol}"
                ));
            }
            Ok(Self(table))
        }

        /// Decodes one line; the bytes include the terminating zero.
        pub fn line(&self, encoded: &[u8]) -> Option<Line> {
            // a panic of the third-party decoder on damaged bytes must not end a campaign
            let decoded = catch_unwind(AssertUnwindSafe(|| {
                let mut decoder = self.0.new_stream_decoder();
                decoder.received(encoded);
                let frame = decoder.decode().ok()?;
                let at = frame.display_timestamp().map(|at| format!("{at} ")).unwrap_or_default();
                let level =
                    frame.level().and_then(|level| level.as_str().parse().ok()).unwrap_or(Level::Info);
                Some(Line { level, text: format!("{at}{}", frame.display_message()) })
            }));
            decoded.ok().flatten()
        }
    }
}

/// Replacement for the decoder when it is disabled.
#[cfg(not(feature = "decode"))]
mod strings {
    use super::Line;

    /// Never constructed.
    pub enum Strings {}

    impl Strings {
        pub fn of_image(_image: &[u8]) -> Result<Self, String> {
            Err("this program was built without the feature `device-logs`, which reads it".into())
        }

        pub fn line(&self, _encoded: &[u8]) -> Option<Line> {
            match *self {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_has_no_build_id() {
        assert_eq!(build_id(b""), None);
        assert_eq!(build_id(b"\x7fELF and then nothing of the kind"), None);
    }

    #[test]
    fn a_build_id_is_written_as_it_is_shown() {
        assert_eq!(file_name(0x00ab_cdef_0123_4567), "00abcdef01234567.elf");
    }
}
