//! Why an npz file cannot be read or written, in words.

use crate::advice;
use std::io;
use std::path::PathBuf;

/// Why an npz file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// The file is not there, not readable, or no npz archive.
    #[error("{}: cannot be opened as npz: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
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
        /// Names of the arrays that are there.
        available: String,
    },
    /// An array is not what it should be.
    #[error("{}: array `{array}` {found}; expected {expected}", path.display())]
    Unexpected {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// Arrays are well formed, but what they say is not an FRF or a record.
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
        /// Why.
        source: io::Error,
    },
}
