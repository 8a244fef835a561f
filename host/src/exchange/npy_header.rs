//! Parses the header of one array: `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }`,
//! and nothing else.
//!
//! A general parser of Python expressions would also accept nested brackets, each level of which
//! may double its work. All tools write these three keys with values no deeper than a row of
//! numbers, so nothing else is accepted.

use std::io::Read;

/// Largest header, bytes; numpy's bound for untrusted files is 10 000.
const MOST_BYTES: usize = 1 << 16;

/// Most axes of an array, as in numpy.
const MOST_AXES: usize = 64;

/// Type, byte order, memory order and shape of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    /// The type letter: `f`, `c`, `i`, `u`, `U`, `S` are supported.
    pub kind: char,
    /// Bytes of an element.
    pub width: usize,
    /// Whether the values are big-endian.
    pub big: bool,
    /// Whether the first index runs fastest.
    pub fortran: bool,
    /// Length of each axis; empty for a scalar.
    pub shape: Vec<usize>,
}

impl Header {
    /// Reads the header; `from` is then at the first value.
    ///
    /// # Errors
    /// What is wrong, as the end of a sentence whose subject is the array.
    pub fn read(from: &mut impl Read) -> Result<Self, String> {
        let damaged = |what: &str| format!("is damaged ({what})");
        let mut exactly = |count: usize| {
            let mut bytes = vec![0; count];
            from.read_exact(&mut bytes).map(|()| bytes).map_err(|error| damaged(&error.to_string()))
        };
        let start = exactly(8)?;
        if !start.starts_with(b"\x93NUMPY") {
            return Err(damaged("it does not begin as numpy's arrays do"));
        }
        let length = match start[6] {
            1 => exactly(2)?.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte)),
            2 | 3 => exactly(4)?.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte)),
            version => return Err(damaged(&format!("version {version} of numpy's format is not known"))),
        };
        if length > MOST_BYTES {
            return Err(damaged(&format!("its header has {length} bytes, at most {MOST_BYTES} are allowed")));
        }
        let text = String::from_utf8(exactly(length)?).map_err(|_| damaged("its header is not text"))?;
        Words { rest: &text }.header()
    }

    /// Number of elements; `None` if it overflows.
    pub fn elements(&self) -> Option<usize> {
        self.shape.iter().try_fold(1usize, |product, length| product.checked_mul(*length))
    }
}

/// The rest of a header while it is parsed.
struct Words<'t> {
    rest: &'t str,
}

impl<'t> Words<'t> {
    fn header(mut self) -> Result<Header, String> {
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        self.sign('{')?;
        while !self.takes('}') {
            let key = self.quoted()?;
            self.sign(':')?;
            match key {
                "descr" if self.rest.starts_with(['[', '(', '{']) => {
                    return Err("is a structured array".into());
                }
                "descr" => descr = Some(self.quoted()?),
                "fortran_order" => fortran = Some(self.truth()?),
                "shape" => shape = Some(self.numbers()?),
                _ => return Err(self.wrong(&format!("`{}` is not a key of a header", key.escape_debug()))),
            }
            if !self.takes(',') {
                self.sign('}')?;
                break;
            }
        }
        let (Some(descr), Some(fortran), Some(shape)) = (descr, fortran, shape) else {
            return Err(self.wrong("one of descr, fortran_order and shape is missing"));
        };
        let kind = descr.trim_start_matches(['<', '>', '|', '=']);
        let (Some(letter), Some(Ok(width))) = (kind.chars().next(), kind.get(1..).map(str::parse::<usize>))
        else {
            return Err(format!("has elements of type `{}`", descr.escape_debug()));
        };
        // numpy gives the width of a text in characters, not in bytes
        let width = if letter == 'U' { width.saturating_mul(4) } else { width };
        Ok(Header { kind: letter, width, big: descr.starts_with('>'), fortran, shape })
    }

    fn wrong(&self, what: &str) -> String {
        let next: String = self.rest.chars().take(20).collect();
        format!("is damaged (its header: {what}, before `{}`)", next.escape_debug())
    }

    fn takes(&mut self, sign: char) -> bool {
        self.rest = self.rest.trim_start();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest).trim_start();
        rest.is_some()
    }

    fn sign(&mut self, sign: char) -> Result<(), String> {
        if self.takes(sign) { Ok(()) } else { Err(self.wrong(&format!("`{sign}` is missing"))) }
    }

    fn quoted(&mut self) -> Result<&'t str, String> {
        let quote = ['\'', '"'].into_iter().find(|quote| self.takes(*quote));
        let found = quote.and_then(|quote| self.rest.split_once(quote));
        let Some((word, rest)) = found else { return Err(self.wrong("a word in quotes is missing")) };
        self.rest = rest.trim_start();
        Ok(word)
    }

    fn truth(&mut self) -> Result<bool, String> {
        for (word, value) in [("False", false), ("True", true)] {
            if let Some(rest) = self.rest.strip_prefix(word) {
                self.rest = rest.trim_start();
                return Ok(value);
            }
        }
        Err(self.wrong("True or False is missing"))
    }

    fn numbers(&mut self) -> Result<Vec<usize>, String> {
        let close = if self.takes('[') { ']' } else { ')' };
        if close == ')' {
            self.sign('(')?;
        }
        let mut numbers = Vec::new();
        while !self.takes(close) {
            let digits = self.rest.bytes().take_while(u8::is_ascii_digit).count();
            let (number, rest) = self.rest.split_at(digits);
            let Ok(number) = number.parse() else { return Err(self.wrong("a length of an axis is missing")) };
            // Python 2 wrote long integers with an L
            self.rest = rest.strip_prefix('L').unwrap_or(rest).trim_start();
            numbers.push(number);
            if numbers.len() > MOST_AXES {
                return Err(self.wrong(&format!("more than {MOST_AXES} axes")));
            }
            if !self.takes(',') {
                self.sign(close)?;
                break;
            }
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Header, String> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        Header::read(&mut bytes.as_slice())
    }

    #[test]
    fn what_numpy_writes_is_understood() {
        let of = |kind, width, big, fortran, shape: &[usize]| {
            Ok(Header { kind, width, big, fortran, shape: shape.to_vec() })
        };
        let pad = " ".repeat(40);
        let read = |text: &str| read(&format!("{text}{pad}\n"));
        assert_eq!(
            read("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }"),
            of('f', 8, false, false, &[3, 4])
        );
        assert_eq!(
            read("{\"shape\":(5L,),\"fortran_order\":True,\"descr\":\">c16\"}"),
            of('c', 16, true, true, &[5])
        );
        assert_eq!(
            read("{'descr': '<U7', 'fortran_order': False, 'shape': (), }"),
            of('U', 28, false, false, &[])
        );
        assert_eq!(
            read("{'descr': '|S0', 'fortran_order': False, 'shape': [2], }"),
            of('S', 0, false, false, &[2])
        );
    }

    #[test]
    fn everything_else_is_refused_at_once() {
        let nested = |open: &str, close: &str| {
            format!(
                "{{'descr': '<f8', 'fortran_order': False, 'shape': {}1{}, }}",
                open.repeat(9000),
                close.repeat(9000)
            )
        };
        for text in [
            nested("(", ",)"),
            nested("[", "]"),
            "{".repeat(60_000),
            "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }".into(),
            "{'descr': '<f8', 'fortran_order': False, 'shape': (-3,), }".into(),
            "{'descr': '<f8', 'fortran_order': 1, 'shape': (3,), }".into(),
            "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999999,), }".into(),
            format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}", "1,".repeat(65)),
            "{'descr': 'é', 'fortran_order': False, 'shape': (3,), }".into(),
            "{'shape': (3,), }".into(),
            String::new(),
        ] {
            let begun = std::time::Instant::now();
            let said = read(&text).expect_err("no header");
            assert!(said.starts_with("is ") || said.starts_with("has "), "{said}");
            assert!(begun.elapsed().as_secs() < 1, "{said}");
        }
    }
}
