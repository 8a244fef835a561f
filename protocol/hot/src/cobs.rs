//! COBS: a frame's content without zeros.
//!
//! Each word moves onto the wire, one byte further on than it stood, and then only the zeros must be replaced by the distance to
//! the next one: small samples around zero are half zeros, so a zero costs a handful of instructions. A run without zeros
//! that nears 254 bytes is taken byte by byte until its extra code is written.

use core::cell::Cell;

/// The longest run without a zero, and the code that says so.
const LONGEST_RUN: usize = 254;

/// Where the next byte goes, and where the code of the run in hand will.
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
    /// Writes whole words and returns how many bytes it took: all whole words, or those before a run
    /// nears the longest that one code can say.
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

    /// Writes bytes until a code was written, and returns what is left.
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

/// Writes `plain` to the wire, in COBS and ended by zero; how many bytes that took, or `None` when they
/// do not fit.
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

    /// A frame's longest content, and what it may become.
    const PLAIN: usize = 500;
    const WIRE: usize = 503;

    /// What the usual crate makes of it.
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
