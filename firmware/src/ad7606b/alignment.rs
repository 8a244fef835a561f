//! Whether what two chips sent is in step with the clock that made them convert, block by block,
//! and exactly.
//!
//! Each chip is read into a ring of its own by hardware, which begins when BUSY falls. A fall that
//! was not seen leaves a chip one scan behind for good, a fall too many puts it ahead, a word that
//! was lost tears its scans; no CRC tells the first two. So at one moment, after a block was
//! copied, three things are read off: the count of the clock's periods with its phase, and how far
//! either ring is filled. Away from the few µs of a read-out these must agree to the word. Then the
//! block is proven: both rings hold exactly the scans that the clock says, and what was copied was
//! complete and not yet overwritten.
//!
//! Nothing here counts interrupts, so that none can come late; and no block leaves before it is
//! proven, so that a slip costs the block in hand and what went by since, and never a scan that was
//! sent as good.

use jointrig_hot::pair::CHIP_BYTES;

/// Words that a chip sends for one scan.
pub const SCAN_WORDS: u32 = CHIP_BYTES as u32 / 2;

/// A period of the clock, in counts of its timer.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// From here on a period's count and its phase belong together: the counter of periods hears of
    /// a new one a few counts late.
    pub settled: u32,
    /// Before this no read-out of the period's scan begins.
    pub read_from: u32,
    /// From here on it is over.
    pub read_by: u32,
}

/// What was read off at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// Periods that have begun since the rings' start, less one; it may wrap.
    pub periods: u32,
    /// The timer's count in the present one.
    pub phase: u32,
    /// How far either ring is filled, words from its beginning.
    pub words: [u32; 2],
}

/// What a moment says of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Complete, in step, and not overwritten.
    Proven,
    /// The chips may be being read: a few µs later it can be said.
    Again,
    /// Words by which either ring is behind the clock; negative, ahead of it.
    Slipped([i32; 2]),
    /// The block may have been overwritten while it was copied.
    Late,
}

/// Two rings of so many blocks.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// The clock.
    pub clock: Clock,
    /// Scans in a block.
    pub block_scans: u32,
    /// Blocks in each ring.
    pub blocks: u32,
}

impl Alignment {
    /// Judges block `number`, counted from the rings' start (it may wrap when `blocks` is a power
    /// of two).
    #[must_use]
    pub fn judge(&self, number: u32, moment: &Moment) -> Verdict {
        let Clock { settled, read_from, read_by } = self.clock;
        let read = match moment.phase {
            phase if phase >= read_by => moment.periods.wrapping_add(1),
            phase if phase >= settled && phase < read_from => moment.periods,
            _ => return Verdict::Again,
        };
        // scans that the clock says were read since the block began
        let since = read.wrapping_sub(number.wrapping_mul(self.block_scans)).cast_signed();
        if i64::from(since) > i64::from((self.blocks - 1) * self.block_scans) {
            return Verdict::Late;
        }
        let ring = (self.blocks * self.block_scans * SCAN_WORDS).cast_signed();
        let begin = (number % self.blocks * self.block_scans * SCAN_WORDS).cast_signed();
        let due = begin + since * SCAN_WORDS.cast_signed();
        let [first, second] = moment.words.map(u32::cast_signed);
        // the usual case, without a division: a block is over before the next but six begins
        let place = if due >= ring { due - ring } else { due };
        if (first, second) == (place, place) {
            // or in step, and told too early
            let whole = since >= self.block_scans.cast_signed();
            return if whole { Verdict::Proven } else { Verdict::Again };
        }
        let lag = |words: i32| {
            let lag = (due - words).rem_euclid(ring);
            if lag > ring / 2 { lag - ring } else { lag }
        };
        Verdict::Slipped([lag(first), lag(second)])
    }
}
