//! The table of one image, and the lines that it makes of bytes.

use std::path::{Path, PathBuf};

use crate::line::Line;
use crate::strings::Strings;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file could not be read.
    #[error("{} cannot be read: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// It is not what a controller runs.
    #[error("{} holds no table of log strings: {why}", path.display())]
    NoTable {
        /// Which file.
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

    /// Takes the table out of an image; says what is missing when it cannot.
    ///
    /// # Errors
    /// A sentence: no ELF image, no build id, or no table.
    pub fn of_image(image: &[u8]) -> Result<Self, String> {
        let build = crate::build_id(image).ok_or("it is no ELF image with a build id")?;
        Ok(Self { build, strings: Strings::of_image(image)? })
    }

    /// The build that it belongs to.
    pub fn build(&self) -> u64 {
        self.build
    }

    /// Hands every line in `bytes` to `each`. Each line ends with a zero byte, so that a damaged
    /// one costs no other. Returns how many bytes made no line.
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
