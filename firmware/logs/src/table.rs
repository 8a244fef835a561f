//! The string table of one image, and decoding of bytes into lines.

use std::path::{Path, PathBuf};

use crate::line::Line;
use crate::strings::Strings;

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
