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

/// A path as this system's shells accept it, quoted where needed.
pub fn quoted(path: &Path) -> String {
    quoted_word(&path.to_string_lossy())
}

/// A word, such as a device's address, as this system's shells accept it.
pub(crate) fn quoted_word(text: &str) -> String {
    if cfg!(windows) { quoted_for_windows(text) } else { quoted_for_sh(text) }
}

fn quoted_for_sh(text: &str) -> String {
    // only a path with a NUL byte cannot be quoted, and no file has one
    shlex::try_quote(text).map_or_else(|_| text.to_owned(), |quoted| quoted.to_string())
}

/// Quotation marks that both cmd and PowerShell understand. A `$` or a backtick in them would mean
/// something else to PowerShell, which is the default shell: such a path gets its apostrophes,
/// which cmd does not understand.
fn quoted_for_windows(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "\\/:._-+=~".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text.to_owned();
    }
    // typographic marks are quotation marks to PowerShell
    if text.contains(['$', '`', '\u{201c}', '\u{201d}', '\u{201e}']) {
        let apostrophe = |c: char| matches!(c, '\'' | '\u{2018}'..='\u{201b}');
        let doubled: String =
            text.chars().flat_map(|c| std::iter::repeat_n(c, if apostrophe(c) { 2 } else { 1 })).collect();
        return format!("'{doubled}'");
    }
    // programs read a backslash before a quotation mark as part of it
    let end = &text[text.trim_end_matches('\\').len()..];
    format!("\"{text}{end}\"")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_can_be_pasted_into_cmd_and_powershell() {
        for (path, quoted) in [
            (r"C:\lab\a.jrig", r"C:\lab\a.jrig"),
            (r"C:\Users\Jürgen\Пётр\測定.jrig", r"C:\Users\Jürgen\Пётр\測定.jrig"),
            (r"C:\my lab\a.jrig", r#""C:\my lab\a.jrig""#),
            (r"a&b.jrig", r#""a&b.jrig""#),
            (r"it's (1).jrig", r#""it's (1).jrig""#),
            (r"C:\my lab\", r#""C:\my lab\\""#),
            (r"\\nas\my lab$\it's.jrig", r"'\\nas\my lab$\it''s.jrig'"),
            ("a\u{2019}s `b`", "'a\u{2019}\u{2019}s `b`'"),
            ("", r#""""#),
        ] {
            assert_eq!(quoted_for_windows(path), quoted, "{path}");
        }
    }

    #[test]
    fn a_path_can_be_pasted_into_sh() {
        assert_eq!(quoted_for_sh("lab/a.jrig"), "lab/a.jrig");
        assert_eq!(quoted_for_sh("my lab/a.jrig"), "'my lab/a.jrig'");
    }
}
