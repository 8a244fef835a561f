//! Messages for people, composed without `core::fmt`, which takes 5 kB of flash as soon as one
//! number is formatted.

use core::fmt;

use heapless::String;
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::limits::SENTENCE_BYTES;

/// A message with the maximum length of an event's text; text that does not fit is dropped.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sentence(String<SENTENCE_BYTES>);

/// A value that can describe itself in words.
pub trait Tell {
    /// Appends its description.
    fn tell(&self, to: &mut Sentence);
}

impl Tell for str {
    fn tell(&self, to: &mut Sentence) {
        to.text(self);
    }
}

/// A refusal because the request is out of bounds or refers to something that does not exist.
pub(crate) fn out_of_bounds(sentence: &str) -> Refusal {
    let mut text = String::new();
    // text beyond 120 bytes is dropped
    let _ = text.push_str(sentence);
    Refusal::OutOfBounds(text)
}

impl Sentence {
    /// The description of a value.
    pub fn of(what: &(impl Tell + ?Sized)) -> Self {
        let mut sentence = Self::default();
        what.tell(&mut sentence);
        sentence
    }

    /// Appends text, cut at a character boundary where the message is full.
    pub fn text(&mut self, text: &str) -> &mut Self {
        let room = self.0.capacity() - self.0.len();
        // at most three bytes back to the start of a character
        let fits = (0..=text.len().min(room)).rev().find(|end| text.is_char_boundary(*end));
        // it fits: the length was determined above
        let _ = self.0.push_str(text.get(..fits.unwrap_or(0)).unwrap_or(""));
        self
    }

    /// Appends a number.
    pub fn number(&mut self, value: u32) -> &mut Self {
        self.in_base(value, 10, 1)
    }

    /// Appends a number that may be negative.
    pub fn signed(&mut self, value: i32) -> &mut Self {
        if value < 0 {
            self.text("-");
        }
        self.number(value.unsigned_abs())
    }

    /// Appends `0x` and a number with at least `digits` digits.
    pub fn hex(&mut self, value: u32, digits: usize) -> &mut Self {
        self.text("0x").in_base(value, 16, digits)
    }

    fn in_base(&mut self, mut value: u32, base: u32, digits: usize) -> &mut Self {
        // a 32-bit number has at most ten digits
        let mut written = [b'0'; 10];
        let mut first = written.len();
        while value > 0 {
            first -= 1;
            written[first] = b"0123456789abcdef"[(value % base) as usize];
            value /= base;
        }
        let first = first.min(written.len() - digits.min(written.len()));
        self.text(core::str::from_utf8(&written[first..]).unwrap_or("?"))
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }

    /// The text, for an event.
    #[must_use]
    pub fn into_string(self) -> String<SENTENCE_BYTES> {
        self.0
    }
}

impl fmt::Display for Sentence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_numbers_are_put_together() {
        let mut sentence = Sentence::default();
        sentence.text("ID ").hex(0xff, 2).text(", ").hex(0x1_0002, 2).text(", ").hex(0, 1).text(" at ");
        sentence.number(u32::MAX).text(", ").signed(i32::MIN).text(", ").signed(0).text(", ").hex(0x40, 8);
        assert_eq!(sentence.as_str(), "ID 0xff, 0x10002, 0x0 at 4294967295, -2147483648, 0, 0x00000040");
    }

    #[test]
    fn a_sentence_is_cut_at_a_whole_character() {
        let accents: String<200> = core::iter::repeat_n('é', 100).collect();
        let mut long = Sentence::of("a");
        long.text(accents.as_str()).text("b");
        assert_eq!(long.as_str().len(), SENTENCE_BYTES, "119 bytes of whole characters, and one more");
        assert!(long.as_str().ends_with("éb"));
    }
}
