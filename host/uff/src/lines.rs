//! Lines, columns and words of a universal file: read, each with its position, and written, with
//! texts and integers that fit their columns.

use crate::number;
use std::borrow::Cow;

/// Maximum number of bytes of a line that are read as text: a line of the format has 80 columns.
pub(super) const LONGEST_LINE: usize = 1000;

/// Bytes of a file, and their offset in it.
#[derive(Clone, Copy, Default)]
pub(super) struct Span<'a> {
    pub bytes: &'a [u8],
    pub offset: usize,
}

/// An error and its byte offset in the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wrong {
    pub offset: usize,
    pub reason: String,
}

/// Lines with the byte offset of each; ended by LF, CR LF or CR.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    base: usize,
    ended: bool,
}

impl<'a> Lines<'a> {
    /// The lines of a part of the file.
    pub fn of(Span { bytes, offset }: Span<'a>) -> Self {
        Lines { bytes, at: 0, base: offset, ended: true }
    }

    /// Offset in the file of the first byte that has not been read.
    pub fn offset(&self) -> usize {
        self.base + self.at
    }

    /// Whether the last line read had a line end; the last one of a file may have none.
    pub fn ended(&self) -> bool {
        self.ended
    }

    /// The bytes that have not been read.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// Continues at this offset of the file.
    pub fn jump(&mut self, offset: usize) {
        self.at = offset.saturating_sub(self.base).min(self.bytes.len());
    }

    /// The next line; if `stop` returns true for it, nothing is read.
    pub fn next_unless(&mut self, stop: impl Fn(&[u8]) -> bool) -> Option<(usize, &'a [u8])> {
        let mut ahead = self.clone();
        let line = ahead.next().filter(|(_, line)| !stop(line))?;
        self.at = ahead.at;
        Some(line)
    }

    /// The next line as text, or an error that names `what` is missing.
    pub fn text(&mut self, what: &str) -> Result<Record<'a>, Wrong> {
        let offset = self.offset();
        let (offset, line) =
            self.next().ok_or_else(|| Wrong { offset, reason: format!("the line of {what} is missing") })?;
        Ok(Record::of(offset, line))
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let offset = self.offset();
        let end = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
        let width = match rest.get(end..) {
            Some([b'\r', b'\n', ..]) => 2,
            Some([_, ..]) => 1,
            _ => 0,
        };
        self.at += end + width;
        self.ended = width > 0;
        Some((offset, &rest[..end]))
    }
}

/// Whether a line is `-1` in the first six columns; missing blanks before it are accepted.
pub(super) fn is_delimiter(line: &[u8]) -> bool {
    let end = line.iter().rposition(|b| !b.is_ascii_whitespace()).map_or(0, |at| at + 1);
    end <= 6 && line[..end].ends_with(b"-1") && line[..end - 2].iter().all(|b| *b == b' ')
}

/// At most `most` bytes of `line`, without a partial character at the end.
fn shortened(line: &[u8], most: usize) -> &[u8] {
    let Some(part) = line.get(..most) else { return line };
    match std::str::from_utf8(part) {
        Err(error) if error.error_len().is_none() => &part[..error.valid_up_to()],
        _ => part,
    }
}

/// Decodes UTF-8 if it is valid, otherwise Latin-1.
fn decode(line: &[u8]) -> Cow<'_, str> {
    std::str::from_utf8(line)
        .map_or_else(|_| Cow::Owned(line.iter().map(|b| char::from(*b)).collect()), Cow::Borrowed)
}

/// One line as text, cut by columns.
pub(super) struct Record<'a> {
    pub offset: usize,
    text: Cow<'a, str>,
}

impl<'a> Record<'a> {
    /// A line that begins at this offset of the file.
    pub fn of(offset: usize, line: &'a [u8]) -> Self {
        Record { offset, text: decode(shortened(line, LONGEST_LINE)) }
    }

    /// The whole line without surrounding blanks; empty for `NONE`.
    pub fn label(&self) -> String {
        unless_none(self.text.trim())
    }

    /// The fields of these widths (in characters), without surrounding blanks; missing ones are
    /// empty.
    pub fn columns<const N: usize>(&self, widths: [usize; N]) -> [String; N] {
        let mut chars = self.text.chars();
        widths.map(|width| chars.by_ref().take(width).collect::<String>().trim().to_string())
    }

    /// The words.
    pub fn words(&self) -> Vec<&str> {
        self.text.split_whitespace().collect()
    }

    /// An error at this line.
    pub fn wrong(&self, reason: impl Into<String>) -> Wrong {
        Wrong { offset: self.offset, reason: reason.into() }
    }
}

/// A label; empty for `NONE`.
pub(super) fn unless_none(label: &str) -> String {
    if label == "NONE" { String::new() } else { label.to_string() }
}

/// An integer; an empty field is 0, as in Fortran, and `3.` is 3.
pub(super) fn integer(field: &str) -> Option<i64> {
    if field.is_empty() {
        return Some(0);
    }
    field.parse().ok().or_else(|| {
        let value = number::parse(field.as_bytes())?;
        (value.fract() == 0.0 && value.abs() < 1e15).then_some(value as i64)
    })
}

/// A real number; an empty field is 0.
pub(super) fn real(field: &str) -> Option<f64> {
    if field.is_empty() { Some(0.0) } else { number::parse(field.as_bytes()) }
}

/// Words of consecutive lines, each with its offset: for data sets that consist only of numbers.
pub(super) struct Words<'a> {
    lines: Lines<'a>,
    line: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    pub fn new(lines: Lines<'a>) -> Self {
        let at = lines.offset();
        Words { lines, line: &[], at }
    }

    /// The next word and its offset.
    pub fn next_word(&mut self) -> Option<(usize, &'a [u8])> {
        loop {
            let blanks = self.line.iter().take_while(|b| b.is_ascii_whitespace()).count();
            let (line, at) = (&self.line[blanks..], self.at + blanks);
            if line.is_empty() {
                (self.at, self.line) = self.lines.next()?;
                continue;
            }
            let length = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
            (self.line, self.at) = (&line[length..], at + length);
            return Some((at, &line[..length]));
        }
    }

    /// The next number.
    pub fn real(&mut self, what: &str) -> Result<f64, Wrong> {
        let Some((offset, word)) = self.next_word() else {
            let offset = self.lines.offset();
            return Err(Wrong { offset, reason: format!("{what} is missing") });
        };
        number::parse(word).ok_or_else(|| Wrong {
            offset,
            reason: format!(
                "`{}` is not a number, but {what} is expected",
                String::from_utf8_lossy(shortened(word, 40))
            ),
        })
    }

    /// The next integer.
    pub fn integer(&mut self, what: &str) -> Result<i64, Wrong> {
        let offset = self.at;
        let value = self.real(what)?;
        if value.fract() == 0.0 && value.abs() < 1e15 {
            Ok(value as i64)
        } else {
            Err(Wrong { offset, reason: format!("{what} is {value}, a whole number is expected") })
        }
    }

    /// Whether only blanks are left.
    pub fn is_empty(&mut self) -> bool {
        let (lines, line, at) = (self.lines.clone(), self.line, self.at);
        let empty = self.next_word().is_none();
        (self.lines, self.line, self.at) = (lines, line, at);
        empty
    }
}

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
