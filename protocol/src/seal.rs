//! CRC-32 and COBS over a frame's content: the hottest loops of the controller.
//!
//! Both take four bytes at a time, one after the other, because together they want more registers than a
//! Cortex-M has. The CRC looks each byte of a word up in a table of its own. COBS moves each word onto the
//! wire, one byte further on than it stood, and then only has to replace the zeros by the distance to the
//! next one: small samples around zero are half zeros, so a zero costs a handful of instructions. A run
//! without zeros that nears 254 bytes is taken byte by byte until its extra code is written.

use core::cell::Cell;

use crate::limits::MAX_WIRE;

/// CRC-32/ISO-HDLC, reflected.
const POLYNOMIAL: u32 = 0xEDB8_8320;
/// The longest run without a zero, and the code that says so.
const LONGEST_RUN: usize = 254;

/// What a byte does to the CRC, at once and after one to three further zero bytes. Four tables and not one
/// of four rows: each then has its address in a register.
static AT_ONCE: [u32; 256] = table(0);
static AFTER_1: [u32; 256] = table(1);
static AFTER_2: [u32; 256] = table(2);
static AFTER_3: [u32; 256] = table(3);

const fn table(zeros_after: u32) -> [u32; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 * (1 + zeros_after) {
            crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
}

/// The CRC of some bytes.
pub fn checksum(bytes: &[u8]) -> u32 {
    let (words, rest) = bytes.as_chunks::<4>();
    let mut crc = u32::MAX;
    for word in words {
        let [a, b, c, d] = (crc ^ u32::from_le_bytes(*word)).to_le_bytes();
        crc = AFTER_3[usize::from(a)]
            ^ AFTER_2[usize::from(b)]
            ^ AFTER_1[usize::from(c)]
            ^ AT_ONCE[usize::from(d)];
    }
    for byte in rest {
        crc = (crc >> 8) ^ AT_ONCE[usize::from(crc as u8 ^ byte)];
    }
    !crc
}

/// Where the next byte goes, and where the code of the run in hand will.
struct Place {
    out: usize,
    code: usize,
}

impl Place {
    /// Writes one byte; `None` when the wire is full.
    fn push(&mut self, wire: &[Cell<u8>; MAX_WIRE], byte: u8) -> Option<()> {
        if self.out - self.code > LONGEST_RUN {
            wire.get(self.code)?.set(u8::MAX);
            self.code = self.out;
            self.out += 1;
        }
        wire.get(self.out)?.set(byte);
        if byte == 0 {
            wire.get(self.code)?.set((self.out - self.code) as u8);
            self.code = self.out;
        }
        self.out += 1;
        Some(())
    }
}

impl Place {
    /// Writes whole words and returns how many bytes it took: all whole words, or those before a run
    /// nears the longest that one code can say.
    fn push_words(&mut self, wire: &[Cell<u8>; MAX_WIRE], plain: &[u8]) -> Option<usize> {
        let Self { mut out, code: mut code_at } = *self;
        let mut code = wire.get(code_at)?;
        let room = wire.get(out..)?.as_chunks::<4>().0;
        for (to, word) in room.iter().zip(plain.as_chunks::<4>().0) {
            if out - code_at > LONGEST_RUN - 4 {
                break;
            }
            let word = u32::from_le_bytes(*word);
            for (cell, byte) in to.iter().zip(word.to_le_bytes()) {
                cell.set(byte);
            }
            for (place, cell) in to.iter().enumerate() {
                if word & (0xFF << (8 * place)) == 0 {
                    code.set((out + place - code_at) as u8);
                    (code, code_at) = (cell, out + place);
                }
            }
            out += 4;
        }
        let taken = out - self.out;
        *self = Self { out, code: code_at };
        Some(taken)
    }

    /// Writes bytes until a code was written, and returns what is left.
    fn push_bytes<'a>(&mut self, wire: &[Cell<u8>; MAX_WIRE], mut plain: &'a [u8]) -> Option<&'a [u8]> {
        let code = self.code;
        while self.code == code
            && let Some((byte, rest)) = plain.split_first()
        {
            self.push(wire, *byte)?;
            plain = rest;
        }
        Some(plain)
    }
}

/// Writes `plain` to the wire, in COBS and ended by zero; how many bytes that took, or `None` when they
/// do not fit.
pub fn stuff(plain: &[u8], wire: &mut [u8; MAX_WIRE]) -> Option<usize> {
    let wire = Cell::from_mut(wire).as_array_of_cells();
    let mut place = Place { out: 1, code: 0 };
    let mut rest = plain;
    while !rest.is_empty() {
        let taken = place.push_words(wire, rest)?;
        rest = place.push_bytes(wire, rest.get(taken..)?)?;
    }
    wire.get(place.code)?.set((place.out - place.code) as u8);
    wire.get(place.out)?.set(0);
    Some(place.out + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{CRC_BYTES, MAX_FRAME};
    use proptest::prelude::*;

    /// What the two usual crates make of it.
    fn reference(content: &[u8]) -> ([u8; MAX_WIRE], usize) {
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(content);
        let mut plain = [0; MAX_FRAME];
        plain[..content.len()].copy_from_slice(content);
        plain[content.len()..content.len() + CRC_BYTES].copy_from_slice(&crc.to_le_bytes());
        let mut wire = [0; MAX_WIRE];
        let used = cobs::encode(&plain[..content.len() + CRC_BYTES], &mut wire);
        wire[used] = 0;
        (wire, used + 1)
    }

    fn agrees(content: &[u8]) {
        let (expected, length) = reference(content);
        let mut plain = [0; MAX_FRAME];
        plain[..content.len()].copy_from_slice(content);
        plain[content.len()..content.len() + CRC_BYTES].copy_from_slice(&checksum(content).to_le_bytes());
        let mut wire = [0xAA; MAX_WIRE];
        assert_eq!(stuff(&plain[..content.len() + CRC_BYTES], &mut wire), Some(length));
        assert_eq!(wire[..length], expected[..length]);
    }

    #[test]
    fn runs_of_every_length_agree_with_the_usual_crates() {
        let mut content = [7; MAX_FRAME - CRC_BYTES];
        for length in 0..=content.len() {
            agrees(&content[..length]);
        }
        for at in 0..content.len() {
            content[at] = 0;
            agrees(&content);
            content[at] = 7;
        }
        agrees(&[0; MAX_FRAME - CRC_BYTES]);
    }

    #[test]
    fn what_does_not_fit_is_not_written_beyond_the_end() {
        assert_eq!(stuff(&[1; MAX_WIRE], &mut [0; MAX_WIRE]), None);
        assert_eq!(stuff(&[0; MAX_WIRE - 1], &mut [0; MAX_WIRE]), None);
        assert_eq!(stuff(&[0; MAX_WIRE - 2], &mut [0; MAX_WIRE]), Some(MAX_WIRE));
    }

    proptest! {
        #[test]
        fn any_content_agrees_with_the_usual_crates(
            content in prop::collection::vec(prop_oneof![Just(0_u8), Just(255), any::<u8>()], 0..=MAX_FRAME - CRC_BYTES),
        ) {
            agrees(&content);
        }

        #[test]
        fn few_zeros_agree_too(
            mut content in prop::collection::vec(1_u8.., 0..=MAX_FRAME - CRC_BYTES),
            zero in any::<prop::sample::Index>(),
        ) {
            agrees(&content);
            if !content.is_empty() {
                let at = zero.index(content.len());
                content[at] = 0;
                agrees(&content);
            }
        }
    }
}
