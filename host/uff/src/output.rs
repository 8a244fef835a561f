//! Output lines of a universal file: texts and integers that fit their columns.

use super::lines::is_delimiter;

/// Output lines.
#[derive(Default)]
pub(super) struct Output {
    pub bytes: Vec<u8>,
}

impl Output {
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Opens a data set; `after` follows the number.
    pub fn open(&mut self, number: u32, after: &str) {
        self.line(&format!("{:>6}", -1));
        self.line(&format!("{number:>6}{after}"));
    }

    pub fn close(&mut self) {
        self.line(&format!("{:>6}", -1));
    }

    pub fn line(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(b'\n');
    }

    /// A line of text, `NONE` if empty.
    pub fn label(&mut self, what: &str, text: &str) -> Result<(), String> {
        let line = label(what, text, 80)?;
        if is_delimiter(line.as_bytes()) {
            return Err(format!("{what} is `{text}`, which would end the data set: use another text"));
        }
        self.line(&line);
        Ok(())
    }
}

/// A text that fits `width` characters, `NONE` if empty, padded with blanks.
pub(super) fn label(what: &str, text: &str, width: usize) -> Result<String, String> {
    let text = if text.is_empty() { "NONE" } else { text };
    if text.chars().count() > width {
        return Err(format!("{what} `{text}` is longer than {width} characters: shorten it"));
    }
    if text.chars().any(char::is_control) {
        return Err(format!("{what} {text:?} has a control character: remove it"));
    }
    Ok(format!("{text:<width$}"))
}

/// Integers right-justified in columns of one width.
pub(super) fn integers(what: &str, values: &[i64], width: usize) -> Result<String, String> {
    let mut line = String::new();
    for value in values {
        let text = value.to_string();
        // a full column would leave no blank before its neighbour
        if text.len() >= width {
            return Err(format!("{what} is {value}: at most {} characters are possible", width - 1));
        }
        line.extend(std::iter::repeat_n(' ', width - text.len()));
        line.push_str(&text);
    }
    Ok(line)
}
