//! Supplies codes to a converter that cyclically plays a ring of words, one word per scan.
//!
//! Two DMA channels of the board go round the ring, one step per scan: the player sends a word to
//! the converter, and the eraser, [`TRAIL`] words behind it, overwrites played words with the rest
//! value. Every word is thus played once, and rest follows the last code given, whether or not any
//! program still runs. This file contains the index arithmetic: where the next codes go, and
//! whether they are in time.
//!
//! ```text
//!            TRAIL          AHEAD
//!   … rest ◀──────▶ now ◀─────────▶ …codes…  end  rest … (and round again)
//!                    └─ LEAD at the start ─┘
//! ```

use crate::board::RanDry;

/// Words in the ring: 5 ms at 51.2 kHz, a power of two so that the count of scans may wrap.
pub const RING: u32 = 256;
/// From rest, the first code is played this many scans later: four blocks of 15 scans, 1.2 ms.
/// Blocks may be late by this time minus [`AHEAD`].
pub const LEAD: u32 = 60;
/// Margin for words that the player has fetched early and for those played while a block's codes
/// are being written.
pub const AHEAD: u32 = 16;
/// How far the eraser is behind the player.
pub const TRAIL: u32 = 16;
/// The word for 0 V: mid-scale of a twelve-bit converter.
pub const REST: u32 = 1 << 11;
/// Converter steps between 0 V and a code of 32 768: 39 % of its range to either side, because an
/// output buffer is not linear within 0.2 V of its supply rails.
pub const SPAN: u32 = 1600;
/// Steps at the largest code.
pub const FULL_SCALE_STEPS: f32 = i16::MAX as f32 * SPAN as f32 / 32_768.0;

const _: () = assert!(RING.is_power_of_two() && LEAD > AHEAD);
/// Fractions per converter step in which a code is exact: 32 768 codes are 1600 steps, so a code is
/// 25/512 of a step.
const PARTS: i32 = 512;
const PARTS_PER_CODE: i32 = 25;
const _: () = assert!(SPAN.cast_signed() * PARTS == 32_768 * PARTS_PER_CODE);

/// The ring's memory, shared with the DMA.
pub trait Words {
    /// The word at a place below [`RING`].
    fn get(&self, place: usize) -> u32;
    /// Writes the word at a place.
    fn set(&mut self, place: usize, word: u32);
}

/// Position of the next codes in the ring.
#[derive(Clone, Debug, Default)]
pub struct Feed {
    /// The scan after the last one that was given a code; `None` at rest.
    end: Option<u32>,
    /// The motion has ended: the next codes begin a new one.
    ended: bool,
    /// Remainder of the rounding, in fractions of a step.
    owed: i32,
}

impl Feed {
    /// At rest.
    pub const fn new() -> Self {
        Self { end: None, ended: false, owed: 0 }
    }

    /// Places codes after those given before, or [`LEAD`] scans ahead when there are none or when
    /// the motion has ended. An empty slice ends the motion. `now` is the number of words that the
    /// player has taken since it began at the ring's first; it may wrap.
    ///
    /// # Errors
    /// [`RanDry`], with the whole ring set to rest: when the player has reached the end of the
    /// previous codes, when there are so many codes that they would overlap words not yet erased,
    /// or when the eraser has not erased.
    pub fn play(&mut self, now: u32, codes: &[i16], words: &mut impl Words) -> Result<(), RanDry> {
        if codes.is_empty() {
            self.ended = true;
            return Ok(());
        }
        let begin = match self.end {
            Some(end) if !self.ended || (LEAD..=RING).contains(&end.wrapping_sub(now)) => end,
            _ => now.wrapping_add(LEAD),
        };
        let count = codes.len() as u32;
        let ahead = i64::from(begin.wrapping_sub(now).cast_signed());
        let in_time = ahead >= i64::from(AHEAD);
        let room = ahead + i64::from(count) <= i64::from(RING - TRAIL - AHEAD);
        if !in_time || !room || (0..count).any(|i| words.get(place(begin.wrapping_add(i))) != REST) {
            self.rest(words);
            return Err(RanDry);
        }
        for (scan, code) in (0..count).zip(codes) {
            words.set(place(begin.wrapping_add(scan)), self.word(*code));
        }
        self.end = Some(begin.wrapping_add(count));
        self.ended = false;
        Ok(())
    }

    /// Sets the whole ring to rest; the next codes begin a new motion.
    pub fn rest(&mut self, words: &mut impl Words) {
        for place in 0..RING as usize {
            words.set(place, REST);
        }
        *self = Self::new();
    }

    /// The word for a code. The rounding remainder is carried to the next code, so that the mean
    /// over several words is finer than a step; the resulting noise is at high frequencies, which
    /// the filter after the converter removes.
    fn word(&mut self, code: i16) -> u32 {
        let exact = i32::from(code) * PARTS_PER_CODE + self.owed;
        let steps = (exact + PARTS / 2).div_euclid(PARTS);
        self.owed = exact - steps * PARTS;
        REST.wrapping_add_signed(steps)
    }
}

fn place(scan: u32) -> usize {
    (scan % RING) as usize
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;
    use std::{vec, vec::IntoIter};

    use super::*;

    /// Words that the simulated player takes before their scan, as a DMA with a small buffer does.
    const EARLY: u32 = 4;
    const BLOCK: usize = 15;

    struct Memory([u32; RING as usize]);

    impl Words for Memory {
        fn get(&self, place: usize) -> u32 {
            self.0[place]
        }

        fn set(&mut self, place: usize, word: u32) {
            self.0[place] = word;
        }
    }

    /// Simulated player and eraser, one step per scan.
    struct Converter {
        memory: Memory,
        now: u32,
        erases: bool,
        played: Vec<u32>,
    }

    impl Converter {
        /// Starts with its count of scans at a multiple of the ring's length.
        fn at(now: u32) -> Self {
            assert_eq!(now % RING, 0);
            Self { memory: Memory([REST; RING as usize]), now, erases: true, played: Vec::new() }
        }

        fn scan(&mut self) {
            self.played.push(self.memory.get(place(self.now.wrapping_add(EARLY))));
            if self.erases {
                self.memory.set(place(self.now.wrapping_sub(TRAIL)), REST);
            }
            self.now = self.now.wrapping_add(1);
        }

        fn scans(&mut self, count: u32) {
            (0..count).for_each(|_| self.scan());
        }

        /// The words played, without the rest before and after them.
        fn heard(&self) -> &[u32] {
            let first = self.played.iter().position(|word| *word != REST).unwrap_or(self.played.len());
            let last = self.played.iter().rposition(|word| *word != REST).map_or(first, |last| last + 1);
            &self.played[first..last]
        }
    }

    /// Blocks of codes that all differ from rest, and the words they must become.
    fn song(blocks: usize) -> (IntoIter<[i16; BLOCK]>, Vec<u32>) {
        let mut code = 1000_i16;
        let blocks: Vec<[i16; BLOCK]> = (0..blocks)
            .map(|_| {
                core::array::from_fn(|_| {
                    code = 1000 + (code.wrapping_mul(75).wrapping_add(74) & 0x3FFF);
                    code
                })
            })
            .collect();
        let mut feed = Feed::new();
        let words = blocks.iter().flatten().map(|code| feed.word(*code)).collect();
        (blocks.into_iter(), words)
    }

    #[test]
    fn codes_are_played_in_order_once_and_rest_follows() {
        // the count of scans wraps during the third run
        for start in [0, RING, 0_u32.wrapping_sub(3 * RING)] {
            let mut converter = Converter::at(start);
            let mut feed = Feed::new();
            let (blocks, words) = song(100);
            for block in blocks {
                feed.play(converter.now, &block, &mut converter.memory).expect("in time");
                converter.scans(BLOCK as u32);
            }
            // no codes are supplied for several rounds
            converter.scans(10 * RING);
            assert_eq!(converter.heard(), words);
            assert!(converter.memory.0.iter().all(|word| *word == REST));
        }
    }

    #[test]
    fn the_first_code_is_played_a_lead_after_it_was_given() {
        let mut converter = Converter::at(0);
        converter.scans(37);
        Feed::new().play(converter.now, &[20_000], &mut converter.memory).expect("in time");
        converter.scans(RING);
        let at = converter.played.iter().position(|word| *word != REST).expect("heard") as u32;
        assert_eq!(at + EARLY, 37 + LEAD);
    }

    #[test]
    fn blocks_may_be_late_and_come_in_a_heap() {
        let mut converter = Converter::at(0);
        let mut feed = Feed::new();
        let (mut blocks, words) = song(1 + 4 * 20);
        feed.play(converter.now, &blocks.next().expect("a block"), &mut converter.memory).expect("in time");
        for _ in 0..20 {
            // codes are up to three blocks late, then catch up: LEAD + BLOCK - 4 * BLOCK would be
            // below AHEAD
            converter.scans(3 * BLOCK as u32);
            for block in blocks.by_ref().take(3) {
                feed.play(converter.now, &block, &mut converter.memory).expect("in time");
            }
            converter.scans(BLOCK as u32);
            feed.play(converter.now, &blocks.next().expect("a block"), &mut converter.memory)
                .expect("in time");
        }
        converter.scans(2 * RING);
        assert_eq!(converter.heard(), words);
    }

    #[test]
    fn codes_that_come_too_late_are_not_taken_and_everything_rests() {
        let last_moment = LEAD + BLOCK as u32 - AHEAD;
        for (wait, taken) in [(last_moment, true), (last_moment + 1, false), (10 * RING, false)] {
            let mut converter = Converter::at(0);
            let mut feed = Feed::new();
            feed.play(converter.now, &[9_000; BLOCK], &mut converter.memory).expect("in time");
            converter.scans(wait);
            let again = feed.play(converter.now, &[9_000; BLOCK], &mut converter.memory);
            assert_eq!(again, if taken { Ok(()) } else { Err(RanDry) }, "after {wait}");
            let waiting = converter.memory.0.iter().any(|word| *word != REST);
            assert_eq!(waiting, taken, "after {wait}");
            // the next codes begin a new motion, LEAD scans ahead
            if !taken {
                let from = converter.now;
                converter.played.clear();
                feed.play(from, &[9_000], &mut converter.memory).expect("in time");
                converter.scans(RING);
                let at = converter.played.iter().position(|word| *word != REST).expect("heard") as u32;
                assert_eq!(at + EARLY, LEAD);
            }
        }
    }

    #[test]
    fn more_than_the_ring_holds_is_not_taken() {
        let mut converter = Converter::at(0);
        let mut feed = Feed::new();
        let fits = (RING - TRAIL - AHEAD - LEAD) as usize;
        feed.play(0, &vec![5_000; fits], &mut converter.memory).expect("in time");
        assert_eq!(feed.play(0, &[5_000], &mut converter.memory), Err(RanDry));
        converter.scans(2 * RING);
        assert!(converter.played.iter().all(|word| *word == REST));
    }

    #[test]
    fn an_eraser_that_stands_still_is_found_out_within_a_round() {
        let mut converter = Converter::at(0);
        let mut feed = Feed::new();
        converter.erases = false;
        let (mut blocks, _) = song(100);
        let accepted = blocks
            .by_ref()
            .take_while(|block| {
                let taken = feed.play(converter.now, block, &mut converter.memory).is_ok();
                converter.scans(BLOCK as u32);
                taken
            })
            .count();
        assert_eq!(accepted, RING as usize / BLOCK);
        assert!(converter.memory.0.iter().all(|word| *word == REST));
    }

    #[test]
    fn rest_is_everywhere_at_once() {
        let mut converter = Converter::at(0);
        let mut feed = Feed::new();
        feed.play(0, &[-20_000; BLOCK], &mut converter.memory).expect("in time");
        feed.rest(&mut converter.memory);
        assert!(converter.memory.0.iter().all(|word| *word == REST));
    }

    #[test]
    fn a_motion_that_ended_is_played_whole_and_the_next_begins_at_any_time() {
        for pause in [0, 10, 30, LEAD, LEAD + 10, 10 * RING] {
            let mut converter = Converter::at(0);
            let mut feed = Feed::new();
            let (blocks, words) = song(8);
            for (i, block) in blocks.enumerate() {
                if i == 4 {
                    feed.play(converter.now, &[], &mut converter.memory).expect("an end");
                    converter.scans(pause);
                }
                feed.play(converter.now, &block, &mut converter.memory).expect("in time");
                converter.scans(BLOCK as u32);
            }
            converter.scans(2 * RING);
            // all words of both motions, in order; between them rest, no longer than the pause
            let heard: Vec<u32> = converter.heard().iter().copied().filter(|word| *word != REST).collect();
            assert_eq!(heard, words, "after {pause}");
            assert!(converter.heard().len() <= words.len() + pause as usize, "after {pause}");
        }
    }

    #[test]
    fn nothing_given_is_not_a_start() {
        let mut converter = Converter::at(0);
        let mut feed = Feed::new();
        feed.play(0, &[], &mut converter.memory).expect("in time");
        converter.scans(10 * RING);
        assert_eq!(feed.play(converter.now, &[1], &mut converter.memory), Ok(()));
    }

    #[test]
    fn a_code_becomes_its_part_of_the_span() {
        for (code, word) in [(0, REST), (i16::MIN, REST - SPAN), (i16::MAX, REST + SPAN), (16_384, 2848)] {
            assert_eq!(Feed::new().word(code), word, "{code}");
        }
        // a code of 5 is a quarter of a step: 64 of them are 15.625 steps, and no word deviates by
        // a whole step
        for code in [5_i16, -5, 1, 17, -1234] {
            let mut feed = Feed::new();
            let steps: Vec<i32> =
                (0..64).map(|_| feed.word(code).cast_signed() - REST.cast_signed()).collect();
            let exact = f64::from(code) * f64::from(SPAN) / 32_768.0;
            assert!(steps.iter().all(|step| (f64::from(*step) - exact).abs() < 1.0));
            let mean = f64::from(steps.iter().sum::<i32>()) / 64.0;
            assert!((mean - exact).abs() <= 0.5 / 64.0, "{code}: {mean} for {exact}");
        }
    }

    #[test]
    fn a_rest_of_rounding_never_moves_a_zero() {
        for code in i16::MIN..=i16::MAX {
            let mut feed = Feed::new();
            feed.word(code);
            assert_eq!(feed.word(0), REST, "after {code}");
        }
    }
}
