//! COBS encoding: removes zeros from a frame's content.
//!
//! Each word is copied to the wire buffer at an offset of one byte. Afterwards only the zeros have
//! to be replaced by the distance to the next zero. Small samples around zero contain many zero
//! bytes, so each zero must cost only a few instructions. When a run without zeros approaches 254
//! bytes, it is copied byte by byte until its extra code byte is written.

use core::cell::Cell;

/// Longest run without a zero that one code byte can represent.
const LONGEST_RUN: usize = 254;

/// Position of the next byte, and of the code byte of the current run.
struct Place {
    out: usize,
    code: usize,
}

impl Place {
    /// Writes one byte; `None` when the wire is full.
    fn push(&mut self, wire: &[Cell<u8>], byte: u8) -> Option<()> {
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
    /// Writes whole words and returns the number of bytes consumed: all whole words, or only those
    /// before the current run approaches the longest length that one code byte can represent.
    fn push_words(&mut self, wire: &[Cell<u8>], plain: &[u8]) -> Option<usize> {
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

    /// Writes bytes until a code byte has been written, and returns the remaining input.
    fn push_bytes<'a>(&mut self, wire: &[Cell<u8>], mut plain: &'a [u8]) -> Option<&'a [u8]> {
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

/// Encodes `plain` into `wire` with COBS and a terminating zero. Returns the number of bytes
/// written, or `None` when they do not fit.
#[must_use]
#[inline(never)]
pub fn stuff(plain: &[u8], wire: &mut [u8]) -> Option<usize> {
    let wire = Cell::from_mut(wire).as_slice_of_cells();
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
    use proptest::prelude::*;

    /// Longest content of a frame, and its longest encoding.
    const PLAIN: usize = 500;
    const WIRE: usize = 503;

    /// Compares with the `cobs` crate.
    fn agrees(plain: &[u8]) {
        let mut expected = [0; WIRE];
        let used = cobs::encode(plain, &mut expected);
        expected[used] = 0;
        let mut wire = [0xAA; WIRE];
        assert_eq!(stuff(plain, &mut wire), Some(used + 1));
        assert_eq!(wire[..=used], expected[..=used]);
    }

    #[test]
    fn runs_of_every_length_agree_with_the_usual_crate() {
        let mut plain = [7; PLAIN];
        for length in 0..=plain.len() {
            agrees(&plain[..length]);
        }
        for at in 0..plain.len() {
            plain[at] = 0;
            agrees(&plain);
            plain[at] = 7;
        }
        agrees(&[0; PLAIN]);
    }

    #[test]
    fn what_does_not_fit_is_not_written_beyond_the_end() {
        assert_eq!(stuff(&[1; WIRE], &mut [0; WIRE]), None);
        assert_eq!(stuff(&[0; WIRE - 1], &mut [0; WIRE]), None);
        assert_eq!(stuff(&[0; WIRE - 2], &mut [0; WIRE]), Some(WIRE));
    }

    proptest! {
        #[test]
        fn any_content_agrees_with_the_usual_crate(
            plain in prop::collection::vec(prop_oneof![Just(0_u8), Just(255), any::<u8>()], 0..=PLAIN),
        ) {
            agrees(&plain);
        }

        #[test]
        fn few_zeros_agree_too(
            mut plain in prop::collection::vec(1_u8.., 0..=PLAIN),
            zero in any::<prop::sample::Index>(),
        ) {
            agrees(&plain);
            if !plain.is_empty() {
                let at = zero.index(plain.len());
                plain[at] = 0;
                agrees(&plain);
            }
        }
    }
}
