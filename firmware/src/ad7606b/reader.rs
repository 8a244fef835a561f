//! Converts blocks of two rings into scans: proven, joined, and with the number of scans missing
//! before them.
//!
//! # Alignment
//!
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

use core::fmt;

use jointrig_hot::pair::{CHIP_BYTES, join};

use crate::board::Delivered;
use crate::sentence::{Sentence, Tell};

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

/// Readings of a moment after which a read-out is considered stuck; a read-out takes a few µs.
const LOOKS: u32 = 1_000;

/// Reads two rings, block by block.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    alignment: Alignment,
    /// Channels in a scan.
    channels: usize,
    /// The next block to be read.
    block: u32,
    /// The clock's count of periods when the rings were started.
    started_at: u32,
    /// Period count up to which scans have been delivered or reported missing.
    accounted: u32,
}

impl Reader {
    /// A reader that reads nothing before [`Reader::start`]; scans are missing from `now` on, in
    /// the clock's count of periods.
    #[must_use]
    pub fn new(alignment: Alignment, channels: usize, now: u32) -> Self {
        Self { alignment, channels, block: 0, started_at: now, accounted: now }
    }

    /// Call after the rings were started empty, with their first scan in period `at`.
    pub fn start(&mut self, at: u32) {
        (self.block, self.started_at) = (0, at);
    }

    /// The next block to be read.
    #[must_use]
    pub fn due(&self) -> u32 {
        self.block
    }

    /// The period of the next scan to be delivered or reported missing, in the clock's count.
    #[must_use]
    pub fn next_period(&self) -> u32 {
        self.accounted
    }

    /// Reads the next block directly from the rings' memory. `look` reads a moment, with the
    /// clock's own count of periods. It is called after the block was copied, which proves that the
    /// block was not overwritten meanwhile. Good scans are written to `scans`, whose content is
    /// meaningless after an error.
    ///
    /// A wrong CRC ends the block at that scan and is reported in addition.
    ///
    /// # Errors
    /// [`Trouble::Slipped`] or [`Trouble::Overrun`]: nothing in the block can be trusted, and the
    /// rings must be restarted.
    pub fn take(
        &mut self,
        [first, second]: [&[[u8; CHIP_BYTES]]; 2],
        mut look: impl FnMut() -> Moment,
        scans: &mut [u8],
    ) -> Result<(Delivered, Option<Trouble>), Trouble> {
        let joined = join(first, second, self.channels, scans);
        self.prove(&mut look)?;
        let good = joined.scans as u32;
        let from = self.started_at.wrapping_add(self.block.wrapping_mul(self.alignment.block_scans));
        let missed = from.wrapping_sub(self.accounted);
        self.accounted = from.wrapping_add(good);
        self.block = self.block.wrapping_add(1);
        let trouble = (good < self.alignment.block_scans).then_some(Trouble::Crc);
        Ok((Delivered { scans: good as u8, missed, loud: joined.loud }, trouble))
    }

    fn prove(&self, look: &mut impl FnMut() -> Moment) -> Result<(), Trouble> {
        for _ in 0..LOOKS {
            let seen = look();
            let moment = Moment { periods: seen.periods.wrapping_sub(self.started_at), ..seen };
            match self.alignment.judge(self.block, &moment) {
                Verdict::Proven => return Ok(()),
                Verdict::Again => {}
                Verdict::Slipped([first, second]) => return Err(Trouble::Slipped(first, second)),
                Verdict::Late => return Err(Trouble::Overrun),
            }
        }
        Err(Trouble::Overrun)
    }

    /// Reports that no scan can be delivered; all scans up to `now` are missing.
    pub fn nothing(&mut self, now: u32) -> Delivered {
        let missed = now.wrapping_sub(self.accounted);
        self.accounted = now;
        Delivered { scans: 0, missed, loud: false }
    }
}

// Faults of the converters during acquisition, with the messages sent to the host.

/// A fault of the front end. The scans lost by it are also reported as a lost range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// No block arrived; contains the blocks that each converter had sent. BUSY does not fall, or
    /// the read-out is not started.
    Silent(u32, u32),
    /// A scan's CRC is wrong.
    Crc,
    /// The converters are not aligned with their clock: words by which each is behind, negative
    /// when ahead (9 words are a scan).
    Slipped(i32, i32),
    /// The reader was too late, and the rings were overwritten.
    Overrun,
    /// The DMA reported an error.
    Dma,
}

impl Tell for Trouble {
    fn tell(&self, to: &mut Sentence) {
        match self {
            Self::Silent(first, second) => {
                to.text("BUSY stuck, or no read-out: after ").number(*first).text(" and ").number(*second);
                to.text(" blocks of converters 1 and 2")
            }
            Self::Crc => to.text("converter data: wrong CRC"),
            Self::Slipped(first, second) => {
                to.text("out of step with CONVST: converters 1 and 2 lag by ").signed(*first);
                to.text(" and ").signed(*second).text(" words (9 are a scan)")
            }
            Self::Overrun => to.text("acquisition was too late for its rings"),
            Self::Dma => to.text("DMA error while reading the converters"),
        };
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Sentence::of(self).fmt(f)
    }
}
