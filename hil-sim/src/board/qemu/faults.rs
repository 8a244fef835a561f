//! Faults that a test injects: in the link, in the converters and in the program itself.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use jointrig_firmware::ad7606b::reader::Trouble;
use jointrig_firmware::lockstep::NEVER;

use super::front_end::Slip;

/// A fault of the converters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConverterFault {
    /// The board notices, reports this trouble, and delivers nothing.
    Noticed(Trouble),
    /// Nothing is delivered and the board does not report it: it waits.
    Hung,
    /// The converters lose their alignment with the clock and continue to send.
    Slips(Slip),
}

#[derive(Clone, Copy, Debug)]
struct Converters {
    fault: ConverterFault,
    from_scan: u64,
    scans: u64,
}

impl Converters {
    fn covers(&self, scan: u64) -> bool {
        scan >= self.from_scan && scan < self.from_scan + self.scans
    }
}

/// The faults of one board.
#[derive(Debug, Default)]
pub struct Faults {
    stall_from: AtomicU64,
    stall_scans: AtomicU64,
    panic: AtomicBool,
    processor: AtomicBool,
    stack: AtomicBool,
    converters: Mutex<Option<Converters>>,
}

impl Faults {
    /// From the block with scan `from_scan` on, and for `scans` scans, the link moves nothing in
    /// either direction while the board's time advances, as when a PC is busy.
    pub fn stall_link(&self, from_scan: u64, scans: u64) {
        self.stall_from.store(from_scan, Ordering::Release);
        self.stall_scans.store(scans, Ordering::Release);
    }

    /// From the block with scan `from_scan` on, and for `scans` scans, the converters fail.
    pub fn break_converters(&self, fault: ConverterFault, from_scan: u64, scans: u64) {
        *self.converters.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Converters { fault, from_scan, scans });
    }

    /// The acquisition task panics at its next block.
    pub fn panic(&self) {
        self.panic.store(true, Ordering::Release);
    }

    /// The acquisition task reads an unmapped address at its next block.
    pub fn fault_processor(&self) {
        self.processor.store(true, Ordering::Release);
    }

    /// The acquisition task overflows its stack at its next block.
    pub fn overflow_stack(&self) {
        self.stack.store(true, Ordering::Release);
    }

    pub(super) fn must_fault(&self) -> bool {
        self.processor.load(Ordering::Acquire)
    }

    pub(super) fn must_overflow(&self) -> bool {
        self.stack.load(Ordering::Acquire)
    }

    pub(super) fn must_panic(&self) -> bool {
        self.panic.load(Ordering::Acquire)
    }

    /// Whether the link is stalled after `scans` scans were produced.
    pub(super) fn stalled(&self, scans: u64) -> bool {
        let from = self.stall_from.load(Ordering::Acquire);
        let count = self.stall_scans.load(Ordering::Acquire);
        count > 0 && scans >= from && scans < from.saturating_add(count)
    }

    /// Whether the board's clock runs without waiting for the host after `scans` scans. A host
    /// cannot acknowledge what it was not sent, so a board must not wait for that until it has
    /// delivered again.
    pub(super) fn let_run(&self, scans: u64, per_block: usize) -> bool {
        let again = 2 * per_block as u64;
        let failing = |broken: Converters| {
            scans + again >= broken.from_scan && scans < broken.from_scan + broken.scans + again
        };
        self.stalled(scans) || self.converters().is_some_and(failing)
    }

    fn converters(&self) -> Option<Converters> {
        *self.converters.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// When the awaited block arrives, whose last scan is converted at `due_us`.
    pub(super) fn delivered_at(&self, due_us: u64, rate_hz: u32, per_block: usize) -> u64 {
        let Some(broken) = self.converters().filter(|broken| broken.fault == ConverterFault::Hung) else {
            return due_us;
        };
        if due_us == NEVER {
            return due_us;
        }
        let end_scan = (u128::from(due_us) * u128::from(rate_hz) / 1_000_000) as u64;
        let first_scan = end_scan.saturating_sub(per_block as u64);
        if !broken.covers(first_scan) {
            return due_us;
        }
        // the board is notified of the end of the fault, not of the first block after it
        let blocks = lost_blocks(&broken, first_scan, per_block) - 1;
        due_us + (blocks * per_block as u64 * 1_000_000).div_ceil(u64::from(rate_hz))
    }

    /// What the converters do with the block that begins with scan `first`.
    pub(super) fn of_block(&self, first: u64, per_block: usize) -> Happening {
        let Some(broken) = self.converters() else { return Happening::Sent(Slip::default(), 0) };
        let here = first..first + per_block as u64;
        match broken.fault {
            ConverterFault::Noticed(trouble) if broken.covers(first) => Happening::Noticed(trouble),
            ConverterFault::Hung if broken.covers(first) => {
                Happening::StoodStill(lost_blocks(&broken, first, per_block))
            }
            ConverterFault::Slips(slip) if here.contains(&broken.from_scan) => {
                Happening::Sent(slip, (broken.from_scan - first) as usize)
            }
            _ => Happening::Sent(Slip::default(), 0),
        }
    }
}

/// Outcome of a block.
pub(super) enum Happening {
    /// It was sent, with a slip at one of its scans.
    Sent(Slip, usize),
    /// This many blocks passed, and nothing was sent.
    StoodStill(u64),
    /// The board itself reports the trouble.
    Noticed(Trouble),
}

/// Number of blocks from `first_scan` on that do not arrive.
fn lost_blocks(broken: &Converters, first_scan: u64, per_block: usize) -> u64 {
    (broken.from_scan + broken.scans - first_scan).div_ceil(per_block as u64)
}
