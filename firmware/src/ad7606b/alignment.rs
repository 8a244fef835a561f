//! Checks block by block whether the data of two chips are exactly aligned with the clock that
//! starts their conversions.
//!
//! Hardware reads each chip into its own ring, starting when BUSY falls. A missed falling edge
//! leaves a chip permanently one scan behind, an extra edge puts it ahead, and a lost word shifts
//! the boundaries of its scans; no CRC detects the first two. Therefore three values are read at
//! one moment after a block was copied: the count of clock periods, the phase within the period,
//! and the fill level of both rings. Outside the few µs of a read-out, these must agree to the
//! word. The block is then proven: both rings contain exactly the scans that the clock implies, and
//! the copied block was complete and not yet overwritten.
//!
//! Nothing here counts interrupts, so a late interrupt cannot cause an error. No block is passed on
//! before it is proven, so a slip costs the current block and the scans since then, and no
//! misaligned scan is ever sent as good.

use jointrig_hot::pair::CHIP_BYTES;

/// Words that a chip sends for one scan.
pub const SCAN_WORDS: u32 = CHIP_BYTES as u32 / 2;

/// Timing within a period of the clock, in timer counts.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// From this count on, period count and phase are consistent: the period counter is incremented
    /// a few counts late.
    pub settled: u32,
    /// The read-out of the period's scan never begins before this count.
    pub read_from: u32,
    /// The read-out is complete from this count on.
    pub read_by: u32,
}

/// Values read at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// Periods begun since the rings were started, minus one; it may wrap.
    pub periods: u32,
    /// The timer's count within the present period.
    pub phase: u32,
    /// Fill position of each ring, in words from its beginning.
    pub words: [u32; 2],
}

/// Verdict on a block at a given moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Complete, aligned and not overwritten.
    Proven,
    /// The chips may be in a read-out: try again a few µs later.
    Again,
    /// Words by which each ring is behind the clock; negative when ahead.
    Slipped([i32; 2]),
    /// The block may have been overwritten while it was copied.
    Late,
}

/// Alignment check for two rings of the same size.
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
    /// Checks block `number`, counted from the start of the rings (it may wrap when `blocks` is a
    /// power of two).
    #[must_use]
    pub fn judge(&self, number: u32, moment: &Moment) -> Verdict {
        let Clock { settled, read_from, read_by } = self.clock;
        let read = match moment.phase {
            phase if phase >= read_by => moment.periods.wrapping_add(1),
            phase if phase >= settled && phase < read_from => moment.periods,
            _ => return Verdict::Again,
        };
        // scans read since the block began, according to the clock
        let since = read.wrapping_sub(number.wrapping_mul(self.block_scans)).cast_signed();
        if i64::from(since) > i64::from((self.blocks - 1) * self.block_scans) {
            return Verdict::Late;
        }
        let ring = (self.blocks * self.block_scans * SCAN_WORDS).cast_signed();
        let begin = (number % self.blocks * self.block_scans * SCAN_WORDS).cast_signed();
        let due = begin + since * SCAN_WORDS.cast_signed();
        let [first, second] = moment.words.map(u32::cast_signed);
        // the usual case, without a division: `since` is less than the ring's length, so one
        // subtraction is enough
        let place = if due >= ring { due - ring } else { due };
        if (first, second) == (place, place) {
            // aligned, but possibly checked before the block was complete
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
