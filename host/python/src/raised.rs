//! What is raised: the command's own sentences, as classes that Python code can tell apart (`jointrig._errors`).

use jointrig::analyse::AnalyseError;
use jointrig::campaign::store::error::StoreError;
use pyo3::prelude::*;

fn raised(py: Python<'_>, class: &str, sentence: &str) -> PyErr {
    let made = py
        .import("jointrig._errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((sentence,)));
    match made {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// The file cannot be read.
pub fn file(py: Python<'_>, error: &StoreError) -> PyErr {
    match error {
        StoreError::Damaged { .. } | StoreError::Content { .. } | StoreError::Plan(_) => {
            data(py, &error.to_string())
        }
        other => raised(py, "FileError", &other.to_string()),
    }
}

/// A file cannot be written.
pub fn writing(py: Python<'_>, sentence: &str) -> PyErr {
    raised(py, "FileError", sentence)
}

/// What was asked for cannot be done with what is there.
pub fn refused(py: Python<'_>, sentence: &str) -> PyErr {
    raised(py, "Refused", sentence)
}

/// The numbers make no sense.
pub fn data(py: Python<'_>, sentence: &str) -> PyErr {
    raised(py, "DataError", sentence)
}

/// The analysis cannot be done.
pub fn analysis(py: Python<'_>, error: &AnalyseError) -> PyErr {
    match error {
        AnalyseError::Store(error) => file(py, error),
        other => refused(py, &other.to_string()),
    }
}
