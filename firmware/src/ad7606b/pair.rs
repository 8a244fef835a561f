//! Two chips: sixteen channels per scan, and scans that went missing.
//!
//! Both chips convert on one edge of CONVST. Each is read into a ring of its own, [`CHIP_WORDS`] words per
//! scan, by hardware; this turns one block of both into scans. What it costs is two CRCs per scan, and
//! that is what proves that neither ring has slipped by a word.

use super::CHANNELS;
use super::frames::{CHIP_WORDS, check_words};

/// Channels of a pair.
pub const PAIR_CHANNELS: usize = 2 * CHANNELS;
/// Bytes of one scan of a pair.
pub const PAIR_BYTES: usize = 2 * PAIR_CHANNELS;

/// What a block of both chips contained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Joined {
    /// Good scans, from the start of the block.
    pub scans: usize,
    /// Whether a wrong CRC ended it there.
    pub crc_wrong: bool,
}

/// Writes the scans of one block: first chip, second chip, little-endian. Stops before the first scan of which
/// either chip's CRC is wrong: from there on nothing in the block can be trusted.
pub fn join(
    first: &[[u16; CHIP_WORDS]],
    second: &[[u16; CHIP_WORDS]],
    scans: &mut [[u8; PAIR_BYTES]],
) -> Joined {
    let mut joined = Joined::default();
    for ((a, b), scan) in first.iter().zip(second).zip(scans) {
        if check_words(a).is_err() || check_words(b).is_err() {
            joined.crc_wrong = true;
            break;
        }
        let codes = a[..CHANNELS].iter().chain(&b[..CHANNELS]);
        for (bytes, code) in scan.as_chunks_mut::<2>().0.iter_mut().zip(codes) {
            *bytes = code.to_le_bytes();
        }
        joined.scans += 1;
    }
    joined
}

/// Blocks over which a lag must never vanish before it is a slip and not a late interrupt.
const WATCHED_BLOCKS: u32 = 32;

/// Finds scans that a chip never delivered, by comparing what was read with a hardware count of CONVST.
///
/// When a block has just arrived, as many edges have been counted as scans were read; one or two more when the
/// interrupt that looked came late. A lag that never vanishes over `WATCHED_BLOCKS` blocks is a conversion
/// whose end was not seen.
#[derive(Clone, Copy, Debug)]
pub struct Slip {
    least: u32,
    blocks: u32,
}

impl Default for Slip {
    fn default() -> Self {
        Self { least: u32::MAX, blocks: 0 }
    }
}

impl Slip {
    /// A block has arrived: `edges` were counted when it did, `scans` were read by then. Both count from the
    /// same start and may wrap. Returns how many scans are missing for good, 0 while there is no verdict.
    pub fn block(&mut self, edges: u32, scans: u32) -> u32 {
        self.least = self.least.min(edges.wrapping_sub(scans));
        self.blocks += 1;
        if self.blocks < WATCHED_BLOCKS {
            return 0;
        }
        let missing = self.least;
        *self = Self::default();
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::super::frames::data_crc;
    use super::*;

    fn chip(base: u16) -> [u16; CHIP_WORDS] {
        let mut words = core::array::from_fn(|i| base.wrapping_add(i as u16));
        let bytes: [u8; 16] = core::array::from_fn(|i| words[i / 2].to_be_bytes()[i % 2]);
        words[CHANNELS] = data_crc(&bytes);
        words
    }

    #[test]
    fn two_chips_make_one_scan_of_sixteen() {
        let mut scans = [[0; PAIR_BYTES]; 2];
        let joined = join(&[chip(0x100), chip(0xFFF8)], &[chip(0x200), chip(0)], &mut scans);
        assert_eq!(joined, Joined { scans: 2, crc_wrong: false });
        let code = |scan: usize, i: usize| i16::from_le_bytes([scans[scan][2 * i], scans[scan][2 * i + 1]]);
        assert_eq!((code(0, 0), code(0, 7), code(0, 8), code(0, 15)), (0x100, 0x107, 0x200, 0x207));
        assert_eq!((code(1, 0), code(1, 7)), (-8, -1));
    }

    #[test]
    fn a_ring_that_slipped_by_a_word_is_noticed() {
        let (good, mut slipped) = (chip(0x100), chip(0x200));
        slipped.rotate_left(1);
        let mut scans = [[0; PAIR_BYTES]; 2];
        let joined = join(&[good, good], &[good, slipped], &mut scans);
        assert_eq!(joined, Joined { scans: 1, crc_wrong: true });
    }

    #[test]
    fn a_late_interrupt_is_no_slip_but_a_missing_scan_is() {
        let mut slip = Slip::default();
        for block in 1..200_u32 {
            let late = u32::from(block % 3 != 0);
            assert_eq!(slip.block(block * 15 + late, block * 15), 0);
        }
        let mut slip = Slip::default();
        let found: u32 =
            (1..=WATCHED_BLOCKS).map(|block| slip.block(block * 15 + 2 + block % 2, block * 15)).sum();
        assert_eq!(found, 2);
    }

    #[test]
    fn counts_may_wrap() {
        let mut slip = Slip::default();
        let start = u32::MAX - 100;
        for block in 1..100_u32 {
            let scans = start.wrapping_add(block * 15);
            assert_eq!(slip.block(scans, scans), 0);
        }
    }
}
