//! The ring of recent blocks; it is both the transmit queue and the store for retransmission.
//!
//! Blocks enter with increasing first scans. A cursor marks what has been sent. Scans that leave
//! the ring unsent are counted as dropped and kept as a range until it has been reported.

#![expect(clippy::inline_always, reason = "built for size, each would be a call or three for every block")]

use heapless::Vec;
use jointrig_protocol::block::{GAP, Header};
use jointrig_protocol::event::Loss;
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;

/// Capacity for ranges of lost scans waiting to be reported.
const LOSSES: usize = 8;

/// One block in the ring; the samples come first, so that they are aligned and copied by words.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
pub struct Slot {
    samples: [u8; BLOCK_SAMPLE_BYTES],
    first_scan: u64,
    flags: u8,
    scans: u8,
}

impl Slot {
    /// An unused slot.
    pub const EMPTY: Self = Self { first_scan: 0, flags: 0, scans: 0, samples: [0; BLOCK_SAMPLE_BYTES] };
}

/// A range of scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// The first scan.
    pub first_scan: u64,
    /// Number of scans.
    pub scans: u64,
}

/// A block read from the ring to be sent.
pub struct Out<'a> {
    /// Its header.
    pub header: Header,
    /// Its samples, in whole scans.
    pub samples: &'a [u8],
}

/// The ring, over slots provided by the board.
pub struct Ring<'a> {
    slots: &'a mut [Slot],
    bytes_per_scan: usize,
    epoch: u32,
    /// Sequence number of the next block to enter; its slot index is this modulo the number of
    /// slots.
    head: u64,
    /// Sequence number of the oldest block held.
    tail: u64,
    /// Index of its slot.
    tail_place: usize,
    /// Sequence number of the next block to send.
    cursor: u64,
    /// Losses not yet reported to the host, the oldest first.
    unreported: Vec<(Range, Loss), LOSSES>,
    /// Whether the next block to be sent follows a loss.
    gap: bool,
}

impl<'a> Ring<'a> {
    /// An empty ring for scans of `bytes_per_scan` bytes.
    pub fn new(slots: &'a mut [Slot], bytes_per_scan: usize) -> Self {
        Self {
            slots,
            bytes_per_scan,
            epoch: 0,
            head: 0,
            tail: 0,
            tail_place: 0,
            cursor: 0,
            unreported: Vec::new(),
            gap: false,
        }
    }

    /// Discards everything and begins a stream.
    pub fn restart(&mut self, epoch: u32) {
        self.epoch = epoch;
        (self.tail, self.tail_place) = (self.head, self.place(self.head));
        self.cursor = self.head;
        self.unreported.clear();
        self.gap = false;
    }

    /// Scans that the ring can hold when all blocks are full.
    pub fn capacity_scans(&self) -> u32 {
        (self.slots.len() * (BLOCK_SAMPLE_BYTES / self.bytes_per_scan)) as u32
    }

    /// The oldest scan held, if any.
    pub fn oldest_scan(&self) -> Option<u64> {
        (self.tail < self.head).then(|| self.slot(self.tail).first_scan)
    }

    /// Samples of the newest block, in whole scans.
    pub fn newest(&self) -> Option<&[u8]> {
        (self.tail < self.head).then(|| self.out(self.head - 1, 0).samples)
    }

    /// Index of the slot of a block in the ring, or of the next block.
    #[inline(always)]
    fn place(&self, sequence: u64) -> usize {
        // the difference is at most the length, so this needs no division; there would be two per
        // block
        let place = self.tail_place + (sequence - self.tail) as usize;
        if place >= self.slots.len() { place - self.slots.len() } else { place }
    }

    #[inline(always)]
    fn slot(&self, sequence: u64) -> &Slot {
        &self.slots[self.place(sequence)]
    }

    /// Adds a block, and removes the oldest when the ring is full. Returns the number of scans
    /// removed unsent.
    pub fn push(&mut self, first_scan: u64, flags: u8, scans: u8, samples: &[u8; BLOCK_SAMPLE_BYTES]) -> u64 {
        let mut dropped = 0;
        if self.head - self.tail == self.slots.len() as u64 {
            let leaving = self.slot(self.tail);
            let range = Range { first_scan: leaving.first_scan, scans: u64::from(leaving.scans) };
            if self.cursor == self.tail {
                self.cursor += 1;
                dropped = range.scans;
                self.report(range, Loss::LinkSlow);
            }
            (self.tail, self.tail_place) = (self.tail + 1, self.place(self.tail + 1));
        }
        let at = self.place(self.head);
        let slot = &mut self.slots[at];
        slot.first_scan = first_scan;
        slot.flags = flags;
        slot.scans = scans;
        slot.samples.copy_from_slice(samples);
        self.head += 1;
        dropped
    }

    /// Records a loss to be reported to the host. Adjoining ranges with the same cause are merged.
    /// When no further range can be recorded, the newest one is extended over the scans in between:
    /// every lost scan is reported, and so are some that arrived, which has no effect on a host
    /// that has them.
    #[inline(never)]
    pub fn report(&mut self, range: Range, why: Loss) {
        self.gap = true;
        let full = self.unreported.is_full();
        match self.unreported.last_mut() {
            Some((last, cause))
                if full || (*cause == why && last.first_scan + last.scans == range.first_scan) =>
            {
                last.scans = (range.first_scan + range.scans).saturating_sub(last.first_scan);
            }
            // not full
            _ => drop(self.unreported.push((range, why))),
        }
    }

    /// Takes the oldest unreported loss, and its cause.
    pub fn take_loss(&mut self) -> Option<(Range, Loss)> {
        // exchanges instead of `Vec::remove`, for the reason given in crate::events
        let mut taken = self.unreported.pop()?;
        for loss in self.unreported.iter_mut().rev() {
            core::mem::swap(loss, &mut taken);
        }
        Some(taken)
    }

    /// Discards the losses of a stream whose session has ended.
    pub fn forget_losses(&mut self) {
        self.unreported.clear();
    }

    /// Whether a loss waits to be reported.
    pub fn has_loss(&self) -> bool {
        !self.unreported.is_empty()
    }

    /// Number of unsent blocks.
    pub fn unsent(&self) -> u64 {
        self.head - self.cursor
    }

    /// The next unsent block; advances the cursor.
    pub fn next_unsent(&mut self) -> Option<Out<'_>> {
        if self.cursor == self.head {
            return None;
        }
        let sequence = self.cursor;
        self.cursor += 1;
        let gap = if core::mem::take(&mut self.gap) { GAP } else { 0 };
        Some(self.out(sequence, gap))
    }

    /// The sequence number of the block that contains `scan`, or of the first after it.
    fn find(&self, scan: u64) -> u64 {
        let (mut low, mut high) = (self.tail, self.head);
        while low < high {
            let middle = low + (high - low) / 2;
            let slot = self.slot(middle);
            if slot.first_scan + u64::from(slot.scans) <= scan { low = middle + 1 } else { high = middle }
        }
        low
    }

    /// The block that contains `scan` or the first one after it, with a flag added, and the scan
    /// after its last. `None` when everything in the ring is older.
    pub fn at_or_after(&self, scan: u64, flag: u8) -> Option<(Out<'_>, u64)> {
        let sequence = self.find(scan);
        if sequence == self.head {
            return None;
        }
        let slot = self.slot(sequence);
        let end = slot.first_scan + u64::from(slot.scans);
        Some((self.out(sequence, flag), end))
    }

    #[inline(always)]
    fn out(&self, sequence: u64, flag: u8) -> Out<'_> {
        let slot = self.slot(sequence);
        Out {
            header: Header {
                flags: slot.flags | flag,
                map: CHANNEL_MAP,
                scans: slot.scans,
                epoch: self.epoch,
                first_scan: slot.first_scan,
            },
            samples: &slot.samples[..usize::from(slot.scans) * self.bytes_per_scan],
        }
    }
}

/// The id of the only channel map: a board's channels do not change while it runs.
pub const CHANNEL_MAP: u8 = 1;
