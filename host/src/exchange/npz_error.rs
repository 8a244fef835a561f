//! Errors of reading and writing npz files.

use crate::advice;
use std::io;
use std::path::PathBuf;

/// Why an npz file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// The file does not exist, cannot be read or is not an npz archive.
    #[error("{}: cannot be opened as npz: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// An array is missing.
    #[error("{}: there is no array `{array}` ({expected}); the file has: {available}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What it should hold.
        expected: String,
        /// Names of the arrays in the file.
        available: String,
    },
    /// An array does not have the expected type, shape or value.
    #[error("{}: array `{array}` {found}; expected {expected}", path.display())]
    Unexpected {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The arrays are well formed, but do not make an FRF or a record.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}; {}", path.display(), advice::writing(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}
