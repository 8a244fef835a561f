//! Exceptions: the command's messages, in classes that Python code can distinguish
//! (`jointrig._errors`).

use std::io;
use std::path::Path;

use jointrig::analyse::AnalyseError;
use jointrig::campaign::store::error::StoreError;
use pyo3::prelude::*;

/// An error of this class: the message, the path, and whether the message ends with advice.
fn raised(py: Python<'_>, class: &str, sentence: &str, place: Option<&Path>, with_advice: bool) -> PyErr {
    let place = place.map(|path| path.display().to_string());
    let made = py
        .import("jointrig._errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((sentence, place, with_advice)));
    match made {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// The file at `place` cannot be read.
pub fn file(py: Python<'_>, place: &Path, error: &StoreError) -> PyErr {
    let sentence = error.to_string();
    match error {
        StoreError::Content { .. } | StoreError::Plan(_) => {
            raised(py, "DataError", &sentence, Some(place), false)
        }
        StoreError::Damaged { .. } => raised(py, "DataError", &sentence, Some(place), true),
        StoreError::Exists { .. }
        | StoreError::Missing { .. }
        | StoreError::Folder { .. }
        | StoreError::Unreadable { .. }
        | StoreError::Foreign { .. }
        | StoreError::Newer { .. }
        | StoreError::Older { .. }
        | StoreError::Busy { .. }
        | StoreError::Lock { .. }
        | StoreError::Share { .. }
        | StoreError::Unfinished { .. } => raised(py, "FileError", &sentence, Some(place), true),
        _ => raised(py, "FileError", &sentence, Some(place), false),
    }
}

/// A file that is not a campaign cannot be read.
pub fn reading(py: Python<'_>, place: &Path, sentence: &str) -> PyErr {
    raised(py, "FileError", sentence, Some(place), false)
}

/// A file or folder cannot be written.
pub fn writing(py: Python<'_>, place: &Path, error: &io::Error) -> PyErr {
    let sentence =
        format!("{}: {error}; choose a folder that exists and that you may write to", place.display());
    raised(py, "FileError", &sentence, Some(place), true)
}

/// The request cannot be carried out with the available data.
pub fn refused(py: Python<'_>, sentence: &str) -> PyErr {
    raised(py, "Refused", sentence, None, false)
}

/// The numbers are invalid.
pub fn data(py: Python<'_>, sentence: &str) -> PyErr {
    raised(py, "DataError", sentence, None, false)
}

/// An internal error of jointrig.
pub fn panicked(py: Python<'_>, told: &str) -> PyErr {
    let sentence = format!("jointrig has a fault ({told}): report it with what you called");
    raised(py, "Error", &sentence, None, true)
}

/// The analysis of the file at `place` cannot be done.
pub fn analysis(py: Python<'_>, place: &Path, error: &AnalyseError) -> PyErr {
    match error {
        AnalyseError::Store(error) => file(py, place, error),
        other => raised(py, "Refused", &other.to_string(), Some(place), false),
    }
}
