//! Makes untrusted names harmless: names from a device, a campaign file or a file of another
//! program.
//!
//! A terminal executes escape sequences, a browser reorders text after a bidirectional control
//! character, and a file system treats a slash as a folder separator. The names stay unchanged in
//! the files; they pass through this module before they reach a terminal, a page or a file name.
//! The removed characters stay visible: ESC is shown as `\u{1b}`.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Write as _;

use crc32fast::hash;

/// Whether a character has an effect instead of being displayed.
fn acts(letter: char) -> bool {
    letter.is_control()
        || matches!(letter,
            // bidirectional marks, embeddings, overrides and isolates; line and paragraph
            // separators
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
            // byte order mark and interlinear annotation characters, which are invisible; tags
            | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

fn shown(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    let harmful = |letter| acts(letter) && !stays(letter);
    if !text.contains(harmful) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for letter in text.chars() {
        if harmful(letter) {
            out.extend(letter.escape_unicode());
        } else {
            out.push(letter);
        }
    }
    Cow::Owned(out)
}

/// Escapes text for a terminal or a page. Line feeds stay, because our own messages have several
/// lines.
pub(crate) fn visible(text: &str) -> Cow<'_, str> {
    shown(text, |letter| letter == '\n')
}

/// Escapes control characters in a JSON document that is printed; a program reads the same text
/// from it.
pub(crate) fn printed_json(document: &str) -> Cow<'_, str> {
    in_json(document, "\\u")
}

/// Escapes control characters in a JSON document so that a page that displays its strings shows the
/// escapes.
pub(crate) fn shown_json(document: &str) -> Cow<'_, str> {
    let mut units = in_json(document, "\\\\u");
    // control characters that the document has already escaped are shown as well
    let mut from = 0;
    while let Some(at) = units[from..].find('\\').map(|at| from + at) {
        let code = units.get(at + 2..at + 6).and_then(|code| u32::from_str_radix(code, 16).ok());
        let is_escape = units.as_bytes().get(at + 1) == Some(&b'u');
        from = at + 2;
        if is_escape && code.and_then(char::from_u32).is_some_and(acts) {
            units.to_mut().insert(at, '\\');
            from += 1;
        }
    }
    units
}

/// Writes every raw control character of a document as `escape` and four hexadecimal digits. Line
/// feeds between its values stay.
fn in_json<'d>(document: &'d str, escape: &str) -> Cow<'d, str> {
    let harmful = |letter: char| acts(letter) && letter != '\n';
    if !document.contains(harmful) {
        return Cow::Borrowed(document);
    }
    let mut out = String::with_capacity(document.len() + 16);
    for letter in document.chars() {
        if harmful(letter) {
            for unit in letter.encode_utf16(&mut [0; 2]) {
                // writing to a String cannot fail
                let _ = write!(out, "{escape}{unit:04x}");
            }
        } else {
            out.push(letter);
        }
    }
    Cow::Owned(out)
}

/// Longest file name made of an untrusted name, bytes. Systems allow 255, and an extension is
/// appended.
const LONGEST: usize = 180;

/// Makes a file name of a name: characters with a meaning for a file system are written as `%2F`
/// and so on, so that different names stay different. A very long name is cut and ends with a
/// checksum of the whole.
pub(crate) fn file_name(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for letter in name.chars() {
        let first = out.is_empty();
        let harmful = acts(letter)
            || matches!(letter, '/' | '\\' | ':' | '*' | '?' | '"' | '<' | '>' | '|' | '%')
            // hidden files, `.` and `..`, and names that a command would take for an option
            || (first && matches!(letter, '.' | '-' | '~'));
        if harmful {
            for byte in letter.encode_utf8(&mut [0; 4]).bytes() {
                let _ = write!(out, "%{byte:02X}");
            }
        } else {
            out.push(letter);
        }
    }
    if out.len() > LONGEST {
        let sum = hash(out.as_bytes());
        let end = (0..=LONGEST - 10).rev().find(|end| out.is_char_boundary(*end)).unwrap_or(0);
        out.truncate(end);
        let _ = write!(out, "%~{sum:08x}");
    }
    if out.is_empty() { "%00".into() } else { out }
}

/// Prints a message on stderr. Errors are ignored, so that a closed stderr does not end a
/// measurement.
pub(crate) fn tell(text: &str) {
    let _ = std::io::stderr().lock().write_all(visible(text).as_bytes());
}

/// Prints a line on stderr through [`tell`].
macro_rules! tell_line {
    () => { $crate::untrusted_text::tell("\n") };
    ($($part:tt)*) => { $crate::untrusted_text::tell(&(format!($($part)*) + "\n")) };
}
pub(crate) use tell_line;

#[cfg(test)]
mod tests {
    use super::*;

    /// A name that clears the screen, sets the window's title and reverses the direction of
    /// writing.
    const NAME: &str = "A\u{1b}[2J\u{1b}]0;x\u{7}\u{202e}1Z\u{9b}";

    #[test]
    fn a_terminal_and_a_page_are_told_nothing_but_letters() {
        let said = visible(NAME);
        assert_eq!(said, "A\\u{1b}[2J\\u{1b}]0;x\\u{7}\\u{202e}1Z\\u{9b}");
        assert!(!said.contains(acts));
        assert!(matches!(visible("Müller’s 25 µm – ±1\nnext"), Cow::Borrowed(_)));
        assert_eq!(visible("a\rb"), "a\\u{d}b");
    }

    #[test]
    fn a_document_says_the_same_to_a_program_and_shows_it_to_a_person() {
        let document = serde_json::to_string(&[NAME, "\\u001b", "\u{e0041}"]).expect("a document");
        let printed = printed_json(&document);
        assert!(!printed.contains(acts));
        let back: [String; 3] = serde_json::from_str(&printed).expect("a document");
        assert_eq!(back, [NAME, "\\u001b", "\u{e0041}"]);
        let shown: [String; 3] = serde_json::from_str(&shown_json(&document)).expect("a document");
        assert!(!shown.concat().contains(acts), "{shown:?}");
        assert!(shown[0].starts_with("A\\u001b[2J") && shown[1] == "\\u001b", "{shown:?}");
    }

    #[test]
    fn names_become_files_in_their_folder_and_stay_different() {
        for (name, file) in [
            ("AJB_AZ1_B2", "AJB_AZ1_B2"),
            ("../../etc/passwd", "%2E.%2F..%2Fetc%2Fpasswd"),
            ("A/B", "A%2FB"),
            ("A%2FB", "A%252FB"),
            ("-rf", "%2Drf"),
            ("C:\\x", "C%3A%5Cx"),
            ("tüte.1", "tüte.1"),
            ("", "%00"),
        ] {
            assert_eq!(file_name(name), file);
        }
        let (one, other) = ("ü".repeat(300) + "1", "ü".repeat(300) + "2");
        assert!(file_name(&one).len() <= LONGEST && file_name(&one) != file_name(&other));
    }
}
