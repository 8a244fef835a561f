//! Finds the start and end of each data set: by its lines of `-1`, and by byte counts if the data
//! are binary.

use super::lines::{LONGEST_LINE, Lines, Record, Span, Wrong, is_delimiter};
use super::{Outside, set58_values};

/// One data set's bytes.
pub(super) struct Block<'a> {
    /// Its number.
    pub number: u32,
    /// Byte offset of its opening `-1`.
    pub offset: usize,
    /// The text after the number on its line.
    pub identifier: Span<'a>,
    /// All lines after that, without the closing one; for 58b without the binary data.
    pub body: Span<'a>,
    /// The binary data of 58b.
    pub binary: Option<Span<'a>>,
}

/// A position at which a data set is expected but not found.
pub(super) struct Unusable {
    pub number: u32,
    pub wrong: Wrong,
}

/// The data sets of a file, one after the other.
pub(super) struct Blocks<'a> {
    bytes: &'a [u8],
    lines: Lines<'a>,
    /// Text outside the data sets read so far.
    pub outside: Vec<Outside>,
}

/// UTF-8's byte order mark, which some editors put before the text.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Maximum number of places of text outside the data sets that are kept: a file with more has
/// probably lost its lines of `-1`.
const MOST_OUTSIDE: usize = 100;

impl<'a> Blocks<'a> {
    /// The data sets in these bytes.
    pub fn of(bytes: &'a [u8]) -> Self {
        let mut lines = Lines::of(Span { bytes, offset: 0 });
        if bytes.starts_with(MARK) {
            lines.jump(MARK.len());
        }
        Blocks { bytes, lines, outside: Vec::new() }
    }

    /// Where the search for the next one starts.
    pub fn offset(&self) -> usize {
        self.lines.offset()
    }
}

impl<'a> Iterator for Blocks<'a> {
    type Item = Result<Block<'a>, Unusable>;

    fn next(&mut self) -> Option<Self::Item> {
        let (bytes, lines) = (self.bytes, &mut self.lines);
        let mut passed_over = None;
        let (offset, identifier_offset, identifier) = loop {
            let Some((offset, line)) = lines.next() else {
                note(&mut self.outside, passed_over);
                return None;
            };
            if !is_delimiter(line) {
                let opened = before_delimiter(line, lines);
                add(&mut passed_over, offset, opened.map_or(line, |length| &line[..length]));
                let Some(length) = opened else { continue };
                if let Some((at, identifier)) = lines.next_unless(is_delimiter) {
                    break (offset + length, at, identifier);
                }
                continue;
            }
            // immediately followed by a second `-1`: the first one closed a data set that had not
            // been opened
            if let Some((at, identifier)) = lines.next_unless(is_delimiter) {
                break (offset, at, identifier);
            }
        };
        note(&mut self.outside, passed_over);
        let digits = identifier.iter().skip_while(|b| **b == b' ').take_while(|b| b.is_ascii_digit()).count();
        let blanks = identifier.iter().take_while(|b| **b == b' ').count();
        let number =
            std::str::from_utf8(&identifier[blanks..blanks + digits]).ok().and_then(|t| t.parse().ok());
        let Some(number) = number else {
            let reason = "after a line of -1 there is no number of a data set".to_string();
            skip_to_end(lines);
            return Some(Err(Unusable { number: 0, wrong: Wrong { offset: identifier_offset, reason } }));
        };
        let identifier = &identifier[blanks + digits..];
        // a line of the format has 80 columns
        let identifier =
            Span { bytes: &identifier[..identifier.len().min(LONGEST_LINE)], offset: identifier_offset };
        let start = lines.offset();
        let body = |end: usize| Span { bytes: &bytes[start..end], offset: start };
        let mut block = Block { number, offset, identifier, body: body(start), binary: None };
        let closed = if number == 58 && set58_values::is_binary(identifier.bytes) {
            let header_end = (0..set58_values::LINES).all(|_| lines.next_unless(is_delimiter).is_some());
            // where lines end with CR alone, an LF after the header is the first byte of the data
            let before_data = lines.offset();
            if bytes[..start].ends_with(b"\r") && bytes[..before_data].ends_with(b"\r\n") {
                lines.jump(before_data - 1);
            }
            block.body = body(lines.offset());
            if header_end { close_binary(bytes, lines, &mut block) } else { skip_to_end(lines).is_some() }
        } else {
            let end = skip_to_end(lines);
            block.body = body(end.unwrap_or(bytes.len()));
            end.is_some()
        };
        Some(if closed {
            Ok(block)
        } else {
            let reason = "the file ends within this data set (there is no closing -1): it was cut off, copy or export it again".to_string();
            Err(Unusable { number, wrong: Wrong { offset: bytes.len(), reason } })
        })
    }
}

/// Adds a line to the text outside the data sets, unless it is blank.
fn add(passed_over: &mut Option<Outside>, offset: usize, line: &[u8]) {
    if line.trim_ascii().is_empty() {
        return;
    }
    let text = || Record::of(offset, line).label().chars().take(MOST_SHOWN).collect();
    let outside = passed_over.get_or_insert_with(|| Outside { offset, text: text(), lines: 0 });
    outside.lines += 1;
}

fn note(all: &mut Vec<Outside>, passed_over: Option<Outside>) {
    all.extend(passed_over.filter(|_| all.len() < MOST_OUTSIDE));
}

/// Number of characters that are kept of a text outside the data sets.
const MOST_SHOWN: usize = 60;

/// Number of bytes before a `-1` that ends a line of other text, if the next line is the number of
/// a data set: a program wrote its own text before the file without an end of line.
fn before_delimiter(line: &[u8], lines: &Lines<'_>) -> Option<usize> {
    let text = line.trim_ascii_end().strip_suffix(b"    -1")?;
    let (_, next) = lines.clone().next()?;
    let number = next.trim_ascii_start();
    let digits = number.iter().take_while(|b| b.is_ascii_digit()).count();
    let rest = &number[digits..];
    let is_number =
        (1..=6).contains(&digits) && (rest.trim_ascii().is_empty() || set58_values::is_binary(rest));
    is_number.then_some(text.len())
}

/// Moves past the next line of `-1` and returns the offset where that line begins. At the very end
/// of a file, without an end of line, it must be in its columns: ` -1` there may be the rest of a
/// truncated number.
fn skip_to_end(lines: &mut Lines<'_>) -> Option<usize> {
    while let Some((offset, line)) = lines.next() {
        if is_delimiter(line) && (lines.ended() || line.starts_with(b"    -1")) {
            return Some(offset);
        }
    }
    None
}

/// Finds the end of the binary data and moves past the closing `-1`. False if the file ends before
/// it.
fn close_binary<'a>(bytes: &'a [u8], lines: &mut Lines<'a>, block: &mut Block<'a>) -> bool {
    let start = lines.offset();
    // counts that the header allows, each checked against the bytes that follow
    for count in set58_values::byte_counts(block.identifier, block.body) {
        let Some(end) = start.checked_add(count).filter(|end| *end <= bytes.len()) else { continue };
        if let Some(after) = delimiter_at(bytes, end) {
            block.binary = Some(Span { bytes: &bytes[start..end], offset: start });
            lines.jump(after);
            return true;
        }
    }
    // none fits: the next `-1` that ends a line and is followed by the end of the file or another
    // `-1`
    let mut from = start;
    while let Some(at) = memchr::memmem::find(&bytes[from..], b"    -1").map(|at| from + at) {
        if let Some(after) = delimiter_at(bytes, at) {
            let next = Lines::of(Span { bytes: ahead(bytes, after), offset: after }).next();
            if next.is_none_or(|(_, line)| is_delimiter(line)) {
                block.binary = Some(Span { bytes: &bytes[start..at], offset: start });
                lines.jump(after);
                return true;
            }
        }
        from = at + 1;
    }
    lines.jump(bytes.len());
    false
}

/// The bytes from `at` on, limited to the longest line of `-1`: a caller that checks many positions
/// must not scan the rest of the file each time.
fn ahead(bytes: &[u8], at: usize) -> &[u8] {
    &bytes[at..bytes.len().min(at + LONGEST_LINE)]
}

/// The offset after a line of `-1` that begins at `at`, or after one extra line end there.
fn delimiter_at(bytes: &[u8], at: usize) -> Option<usize> {
    let rest = ahead(bytes, at);
    let blank =
        [&b"\r\n"[..], b"\n", b"\r"].iter().find(|end| rest.starts_with(end)).map_or(0, |end| end.len());
    [0, blank].into_iter().find_map(|skipped| {
        let mut lines = Lines::of(Span { bytes: &rest[skipped..], offset: at + skipped });
        let (_, line) = lines.next()?;
        is_delimiter(line).then(|| lines.offset())
    })
}
