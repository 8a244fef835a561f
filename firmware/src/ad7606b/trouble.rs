//! Faults of the converters during acquisition, with the messages sent to the host.

use core::fmt;

use crate::sentence::{Sentence, Tell};

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
