//! Two converter chips with eight channels each: checking their CRCs and joining their data into
//! scans.
//!
//! A chip sends eight codes followed by a 16-bit CRC over them (AD7606B Rev. 0, "Interface CRC
//! Checksum"). The words are in memory as the DMA leaves them, little-endian; the chip computes the
//! CRC over each word's upper byte first.

use core::sync::atomic::{AtomicBool, AtomicU16, Ordering};

/// Channels of one chip.
pub const CHANNELS: usize = 8;
/// Bytes of one chip's codes in a scan.
const CODES: usize = 2 * CHANNELS;
/// Bytes that a chip sends per scan: its codes and the CRC.
pub const CHIP_BYTES: usize = CODES + 2;

/// x¹⁶ + x¹⁴ + x¹³ + x¹² + x¹⁰ + x⁸ + x⁶ + x⁴ + x³ + x + 1; the initial value is zero.
const POLYNOMIAL: u16 = 0x755B;

// Effect of a byte on the CRC, immediately and after one to three further zero bytes (see crc32.rs
// for the reason for four tables).
static AT_ONCE: Table = [const { AtomicU16::new(0) }; 256];
static AFTER_1: Table = [const { AtomicU16::new(0) }; 256];
static AFTER_2: Table = [const { AtomicU16::new(0) }; 256];
static AFTER_3: Table = [const { AtomicU16::new(0) }; 256];
static FILLED: AtomicBool = AtomicBool::new(false);

type Table = [AtomicU16; 256];

/// Fills the tables, as in crc32.rs.
#[cold]
#[inline(never)]
fn fill() {
    let bits = core::hint::black_box(8);
    for byte in 0..256 {
        let mut crc = (byte as u16) << 8;
        for table in [&AT_ONCE, &AFTER_1, &AFTER_2, &AFTER_3] {
            for _ in 0..bits {
                crc = if crc >> 15 == 1 { (crc << 1) ^ POLYNOMIAL } else { crc << 1 };
            }
            table[byte].store(crc, Ordering::Relaxed);
        }
    }
    FILLED.store(true, Ordering::Release);
}

#[inline(always)]
fn ready() {
    if !FILLED.load(Ordering::Acquire) {
        fill();
    }
}

/// The CRC after four more bytes.
#[inline(always)]
fn after(crc: u16, bytes: u32) -> u16 {
    let word = u32::from(crc) ^ bytes;
    AFTER_2[(word & 0xFF) as usize].load(Ordering::Relaxed)
        ^ AFTER_3[(word >> 8 & 0xFF) as usize].load(Ordering::Relaxed)
        ^ AT_ONCE[(word >> 16 & 0xFF) as usize].load(Ordering::Relaxed)
        ^ AFTER_1[(word >> 24) as usize].load(Ordering::Relaxed)
}

/// The CRC that a chip sends after these codes.
#[must_use]
pub fn data_crc(codes: &[i16; CHANNELS]) -> u16 {
    ready();
    codes.as_chunks::<2>().0.iter().fold(0, |crc, two| {
        let [[a, b], [c, d]] = two.map(i16::to_le_bytes);
        after(crc, u32::from_le_bytes([a, b, c, d]))
    })
}

/// Result of [`join`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joined {
    /// Scans written: those before the first CRC error, and before either input or the output
    /// buffer ends.
    pub scans: usize,
    /// Whether any code may be beyond half of the range (its sign bit and the next bit differ).
    pub loud: bool,
}

/// Whether the CRCs of one scan are correct, checked for both chips in one division.
///
/// Let A and B be the words sent by the chips, CRC included. Each is a multiple of the polynomial
/// P, and so is x³²·A + B: two words of A, then the rest of A combined with B. An error in one
/// chip's data is detected as by its own CRC. The same error in both is detected too, because x³² +
/// 1 is a power of x + 1, and P, with its eleven terms, is not a multiple of x + 1. Of pairs of
/// different errors in one scan, one in 65 536 would go undetected.
#[inline(always)]
fn right(a: &[u8; CHIP_BYTES], b: &[u8; CHIP_BYTES]) -> bool {
    let [a_codes @ .., a_low, a_high] = a;
    let [b_codes @ .., b_low, b_high] = b;
    let (mut crc, mut before) = (0, 0);
    for (a, b) in a_codes.as_chunks().0.iter().zip(b_codes.as_chunks().0) {
        crc = after(crc, u32::from_le_bytes(*a) ^ before);
        before = u32::from_le_bytes(*b);
    }
    crc = after(crc, u32::from(u16::from_le_bytes([*a_low, *a_high])) ^ before);
    crc == u16::from_le_bytes([*b_low, *b_high])
}

/// Number of scans before the first CRC error.
#[inline(never)]
fn good(first: &[[u8; CHIP_BYTES]], second: &[[u8; CHIP_BYTES]]) -> usize {
    ready();
    let mut count = 0;
    for (a, b) in first.iter().zip(second) {
        if !right(a, b) {
            break;
        }
        count += 1;
    }
    count
}

/// Copies one chip's codes. Bits 15 and 31 of the result are set if a code may be beyond half of
/// the range.
#[inline(always)]
fn copied(chip: &[u8; CHIP_BYTES], to: &mut [u8]) -> u32 {
    let mut loud = 0;
    for (to, from) in to.as_chunks_mut::<4>().0.iter_mut().zip(chip.as_chunks::<4>().0) {
        let word = u32::from_le_bytes(*from);
        loud |= word ^ (word << 1);
        *to = *from;
    }
    loud
}

/// Writes the scans of two chips with `channels` (at most 16) channels in total: those of the first
/// chip, then those of the second.
#[inline(never)]
pub fn join(
    first: &[[u8; CHIP_BYTES]],
    second: &[[u8; CHIP_BYTES]],
    channels: usize,
    scans: &mut [u8],
) -> Joined {
    let (ours, theirs) = (2 * channels.min(CHANNELS), 2 * channels.clamp(CHANNELS, 2 * CHANNELS) - CODES);
    if ours == 0 {
        return Joined { scans: 0, loud: false };
    }
    let good = good(first, second).min(scans.len() / (ours + theirs));
    let chips = first[..good].iter().zip(&second[..good]);
    if theirs < CODES {
        for ((a, b), scan) in chips.zip(scans.chunks_exact_mut(ours + theirs)) {
            let (one, two) = scan.split_at_mut(ours);
            one.copy_from_slice(&a[..ours]);
            two.copy_from_slice(&b[..theirs]);
        }
        // amplitude not checked here: report `loud`, so that the caller checks
        return Joined { scans: good, loud: true };
    }
    // full scans of constant length: the usual case, and the one whose cost matters
    let mut loud = 0;
    for ((a, b), scan) in chips.zip(scans.as_chunks_mut::<{ 2 * CODES }>().0) {
        let (one, two) = scan.split_at_mut(CODES);
        loud |= copied(a, one) | copied(b, two);
    }
    Joined { scans: good, loud: loud & 0x8000_8000 != 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Polynomial division bit by bit, as the data sheet describes it.
    fn by_hand(codes: &[i16; CHANNELS]) -> u16 {
        let bytes = codes.iter().flat_map(|code| code.to_be_bytes());
        let bits = bytes.flat_map(|byte| (0..8).rev().map(move |i| byte >> i & 1));
        bits.fold(0, |crc: u16, bit| {
            let out = crc >> 15 ^ u16::from(bit);
            crc << 1 ^ if out == 1 { POLYNOMIAL } else { 0 }
        })
    }

    fn chip(base: i16) -> [u8; CHIP_BYTES] {
        let codes: [i16; CHANNELS] = core::array::from_fn(|i| base.wrapping_add_unsigned(i as u16));
        let mut bytes = [0; CHIP_BYTES];
        for (two, word) in
            bytes.as_chunks_mut().0.iter_mut().zip(codes.into_iter().chain([data_crc(&codes).cast_signed()]))
        {
            *two = word.to_le_bytes();
        }
        bytes
    }

    #[test]
    fn two_chips_make_scans_of_any_number_of_channels() {
        let (first, second) = ([chip(0x100), chip(-8), chip(3)], [chip(0x200), chip(0), chip(7)]);
        for channels in 1..=2 * CHANNELS {
            let mut scans = [0; 3 * 4 * CHANNELS];
            assert_eq!(join(&first, &second, channels, &mut scans[..6 * channels]).scans, 3);
            let codes = scans.as_chunks().0;
            for (scan, bases) in [(0x100, 0x200), (-8, 0), (3, 7)].into_iter().enumerate() {
                for i in 0..channels {
                    let base: i16 = if i < CHANNELS { bases.0 } else { bases.1 };
                    let due = base.wrapping_add_unsigned((i % CHANNELS) as u16);
                    assert_eq!(i16::from_le_bytes(codes[scan * channels + i]), due);
                }
            }
        }
        assert_eq!(join(&first, &second, 0, &mut [0; 96]).scans, 0);
        assert_eq!(join(&first, &second, 16, &mut [0; 95]).scans, 2, "no half scans");
        for (base, loud) in
            [(0x3FF8, false), (0x3FF9, true), (-0x4000, false), (-0x4001, true), (i16::MIN, true)]
        {
            for pair in [[[chip(base)], [chip(0)]], [[chip(0)], [chip(base)]]] {
                let joined = join(&pair[0], &pair[1], 16, &mut [0; 32]);
                assert_eq!(joined, Joined { scans: 1, loud }, "{base}");
            }
        }
    }

    #[test]
    fn a_ring_that_slipped_by_a_word_is_noticed() {
        let (good, mut slipped) = (chip(0x100), chip(0x200));
        slipped.rotate_left(2);
        for channels in [16, 10] {
            let mut scans = [0; 64];
            assert_eq!(join(&[good, good], &[good, slipped], channels, &mut scans).scans, 1);
            assert_eq!(join(&[slipped, good], &[good, good], channels, &mut scans).scans, 0);
        }
    }

    proptest! {
        /// Whatever error affects one chip's words, or both chips' words equally: it is detected if
        /// the chip's own CRC would detect it.
        #[test]
        fn errors_are_found_as_by_each_chips_own_crc(
            codes in any::<[[i16; CHANNELS]; 2]>(),
            error in any::<[u16; CHANNELS + 1]>(),
            in_both in any::<bool>(),
            second in any::<bool>(),
        ) {
            let sent = codes.map(|codes| {
                let [a, b, c, d, e, f, g, h] = codes.map(i16::cast_unsigned);
                [a, b, c, d, e, f, g, h, data_crc(&codes)]
            });
            let bytes = |words: [u16; CHANNELS + 1]| {
                let mut bytes = [0; CHIP_BYTES];
                for (two, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
                    *two = word.to_le_bytes();
                }
                bytes
            };
            let with_error =
                |words: [u16; CHANNELS + 1], hit: bool| core::array::from_fn(|i| words[i] ^ if hit { error[i] } else { 0 });
            let arrived = [with_error(sent[0], in_both || !second), with_error(sent[1], in_both || second)];
            let own = arrived.iter().all(|[a, b, c, d, e, f, g, h, crc]| {
                data_crc(&[*a, *b, *c, *d, *e, *f, *g, *h].map(u16::cast_signed)) == *crc
            });
            let joined = join(&[bytes(arrived[0])], &[bytes(arrived[1])], 16, &mut [0; 32]);
            prop_assert_eq!(joined.scans == 1, own);
        }

        #[test]
        fn the_crc_is_the_polynomials(codes in any::<[i16; CHANNELS]>()) {
            prop_assert_eq!(data_crc(&codes), by_hand(&codes));
        }
    }
}
