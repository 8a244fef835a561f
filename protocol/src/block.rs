//! Sample blocks: 16 bytes of header (the frame's kind byte included), then scans, little-endian.
//!
//! | offset in frame | bytes | field |
//! |---|---|---|
//! | 0 | 1 | kind ([`crate::frame::Kind::Samples`]) |
//! | 1 | 1 | flags |
//! | 2 | 1 | channel-map id |
//! | 3 | 1 | scans in this block |
//! | 4 | 4 | session epoch |
//! | 8 | 8 | absolute index of the first scan |
//! | 16 | … | scans: for each, one 16-bit word per channel, then one per wide channel |
//!
//! Words are two's complement. A wide channel ([`crate::channel::Channel::is_wide`]) has codes of up to 30 bits. Its word among
//! the channels contains the upper 16 bits, so that whatever reads 16-bit codes reads the same
//! quantity; the remaining bits follow after the last channel, in the order of the wide channels.
//!
//! The scan index is the only time base for results. It advances whether or not a block is
//! delivered, so that a loss is an exact range of scans. A restart begins a new epoch and never
//! shows as a gap.

use crate::limits::{BLOCK_HEADER_BYTES, BLOCK_SAMPLE_BYTES};

/// Bytes of the header that are payload (all but the kind byte).
pub const HEADER_PAYLOAD: usize = BLOCK_HEADER_BYTES - 1;

/// At least one channel reached either end of its converter's range.
pub const OVER_RANGE: u8 = 1;
/// The hammer's trigger lies in this block.
pub const TRIGGER: u8 = 1 << 1;
/// Scans before this block were lost in the device and cannot be requested again.
pub const GAP: u8 = 1 << 2;
/// Retransmitted on request.
pub const RESENT: u8 = 1 << 3;

/// A block's header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Any of [`OVER_RANGE`], [`TRIGGER`], [`GAP`], [`RESENT`].
    pub flags: u8,
    /// Id of the channel map of the samples.
    pub map: u8,
    /// Scans in the block.
    pub scans: u8,
    /// Session epoch of the stream.
    pub epoch: u32,
    /// Absolute index of the first scan.
    pub first_scan: u64,
}

impl Header {
    /// The 15 payload bytes.
    #[must_use]
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "built for size it would be a call for every block")]
    pub fn to_bytes(&self) -> [u8; HEADER_PAYLOAD] {
        // Slice copies are avoided: when built for size, each becomes three calls, and this runs
        // for every block.
        let [a, b, c, d] = self.epoch.to_le_bytes();
        let [e, f, g, h, i, j, k, l] = self.first_scan.to_le_bytes();
        [self.flags, self.map, self.scans, a, b, c, d, e, f, g, h, i, j, k, l]
    }
}

/// A received block: header and raw sample bytes, verified to be whole scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<'a> {
    /// Its header.
    pub header: Header,
    samples: &'a [u8],
}

impl<'a> Block<'a> {
    /// Decodes a frame's payload. `None` when it is too short, too long or contains no scan, when
    /// its length is not a whole number of 16-bit words per scan, or when the scan index would
    /// overflow.
    #[must_use]
    pub fn from_payload(payload: &'a [u8]) -> Option<Self> {
        let (h, samples) = payload.split_first_chunk::<HEADER_PAYLOAD>()?;
        let header = Header {
            flags: h[0],
            map: h[1],
            scans: h[2],
            epoch: u32::from_le_bytes([h[3], h[4], h[5], h[6]]),
            first_scan: u64::from_le_bytes([h[7], h[8], h[9], h[10], h[11], h[12], h[13], h[14]]),
        };
        let scans = usize::from(header.scans);
        if scans == 0
            || samples.is_empty()
            || samples.len() > BLOCK_SAMPLE_BYTES
            || !samples.len().is_multiple_of(2 * scans)
            || header.first_scan.checked_add(scans as u64).is_none()
        {
            return None;
        }
        Some(Self { header, samples })
    }

    /// 16-bit words in each scan ([`crate::channel::words_per_scan`]).
    #[must_use]
    pub fn words_per_scan(&self) -> usize {
        self.samples.len() / (2 * usize::from(self.header.scans))
    }

    /// Index of the scan after the last one.
    #[must_use]
    pub fn end_scan(&self) -> u64 {
        self.header.first_scan + u64::from(self.header.scans)
    }

    /// Words in order: scan by scan, channel by channel.
    pub fn codes(&self) -> impl ExactSizeIterator<Item = i16> + 'a {
        self.samples.as_chunks::<2>().0.iter().map(|b| i16::from_le_bytes(*b))
    }
}
