//! Printing on stdout: one JSON document, or lines of text; a closed pipe is no error.

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;

use serde::Serialize;

use super::error::CliError;
use crate::outside::{printed_json, visible};

/// Prints one JSON document.
pub fn json<T: Serialize>(value: &T) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| CliError::Bad(format!("the answer could not be written as JSON: {error}")))?;
    print([printed_json(&text)])
}

/// Prints lines, with the names in them made printable.
pub fn lines(lines: impl IntoIterator<Item = String>) -> Result<(), CliError> {
    print(lines.into_iter().map(|line| visible(&line).into_owned()))
}

fn print(lines: impl IntoIterator<Item = impl Display>) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    for line in lines {
        match writeln!(out, "{line}") {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(()),
            Err(source) => {
                return Err(CliError::File { path: PathBuf::from("stdout"), doing: "printing", source });
            }
            Ok(()) => {}
        }
    }
    Ok(())
}
