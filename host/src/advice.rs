//! Advice that completes an operating system's error message with what to do next, and quoting of
//! paths for a shell.

use std::io::{Error, ErrorKind};
use std::path::Path;

/// Advice for a file that could not be read.
pub(crate) fn reading(error: &Error) -> &'static str {
    match error.kind() {
        ErrorKind::NotFound => "check the name and the folder",
        ErrorKind::PermissionDenied => "ask for the right to read it",
        ErrorKind::IsADirectory => "name a file in this folder",
        ErrorKind::InvalidData | ErrorKind::UnexpectedEof => {
            "it is damaged, cut off or of another kind: copy or export it again"
        }
        ErrorKind::Unsupported => "copy its content into a file, and name that file",
        ErrorKind::FileTooLarge => "check that it is the right file; if it is, split it",
        _ => "is the disk healthy and connected?",
    }
}

/// Advice for a file or folder that could not be created or written.
pub(crate) fn writing(error: &Error) -> &'static str {
    match error.kind() {
        ErrorKind::NotFound => "make the folder that it lies in first",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose a folder that you may write to"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "free some space, then run the same command again"
        }
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory | ErrorKind::IsADirectory => {
            "something else has this name: choose another"
        }
        _ => "is the disk healthy and connected?",
    }
}

/// A path as a shell accepts it, quoted where needed.
pub fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    // only a path with a NUL byte cannot be quoted, and no file has one
    shlex::try_quote(&text).map_or_else(|_| text.to_string(), |quoted| quoted.to_string())
}
