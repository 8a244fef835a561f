//! Converts blocks of two rings into scans: proven, joined, and with the number of scans missing
//! before them.

use jointrig_hot::pair::{CHIP_BYTES, join};

use super::alignment::{Alignment, Moment, Verdict};
use super::trouble::Trouble;
use crate::board::Delivered;

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
