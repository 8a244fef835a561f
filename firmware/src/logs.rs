//! Log lines for the host: encoded, sent only as whole lines, and the first data to be dropped.
//!
//! A board's logger encodes each line (the terminating zero byte included) and passes it to
//! [`Tap::push`]. The transmitter sends lines only when nothing else waits, so that logging never
//! delays a sample. Lines without space are dropped as a whole and counted in
//! [`Counters::logs_dropped`]. The oldest lines are kept, so that messages from the board's start
//! reach the first host that connects.
//!
//! A line never spans two link frames, so that each frame can be decoded independently.
//!
//! [`Counters::logs_dropped`]: jointrig_protocol::answer::Counters::logs_dropped

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use heapless::Deque;
use jointrig_protocol::limits::{CRC_BYTES, MAX_FRAME};

/// The longest encoded line: what fits one frame of the link.
pub const LINE_BYTES: usize = MAX_FRAME - 1 - CRC_BYTES;

/// Capacity in bytes: about a hundred lines.
const WAITING_BYTES: usize = 2_048;

/// Terminates an encoded line; occurs nowhere else.
const END: u8 = 0;

/// Buffer between a board's logger and its link.
pub struct Tap<M: RawMutex> {
    waits: AtomicBool,
    lines: Mutex<M, RefCell<Waiting>>,
}

struct Waiting {
    bytes: Deque<u8, WAITING_BYTES>,
    dropped: u32,
}

impl<M: RawMutex> Default for Tap<M> {
    fn default() -> Self {
        Self::new()
    }
}

impl<M: RawMutex> Tap<M> {
    /// An empty buffer.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            waits: AtomicBool::new(false),
            lines: Mutex::new(RefCell::new(Waiting { bytes: Deque::new(), dropped: 0 })),
        }
    }

    /// Adds an encoded line, its zero included. Drops the whole line when there is no space, when
    /// it is longer than [`LINE_BYTES`], or when its last byte is not the terminating zero.
    ///
    /// To call this from an interrupt, `M` must support it.
    pub fn push(&self, line: &[u8]) {
        self.lines.lock(|waiting| {
            let mut waiting = waiting.borrow_mut();
            let room = waiting.bytes.capacity() - waiting.bytes.len();
            if line.len() > LINE_BYTES.min(room) || line.last() != Some(&END) {
                waiting.dropped = waiting.dropped.saturating_add(1);
                return;
            }
            // space was checked above
            waiting.bytes.extend(line.iter().copied());
            self.waits.store(true, Ordering::Relaxed);
        });
    }

    /// Whether a line waits: queried after every frame, and cheaper than taking the lock.
    #[must_use]
    pub fn waits(&self) -> bool {
        self.waits.load(Ordering::Relaxed)
    }

    /// Lines dropped since the start.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.lines.lock(|waiting| waiting.borrow().dropped)
    }

    /// Moves as many whole lines as fit into `room`. Returns their length in bytes, or `None` when
    /// no whole line was moved.
    #[must_use]
    pub fn take(&self, room: &mut [u8]) -> Option<usize> {
        self.lines.lock(|waiting| {
            let bytes = &mut waiting.borrow_mut().bytes;
            let mut whole = 0;
            for (place, (byte, to)) in bytes.iter().zip(room.iter_mut()).enumerate() {
                *to = *byte;
                if *byte == END {
                    whole = place + 1;
                }
            }
            for _ in 0..whole {
                bytes.pop_front();
            }
            self.waits.store(!bytes.is_empty(), Ordering::Relaxed);
            (whole > 0).then_some(whole)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_sync::blocking_mutex::raw::NoopRawMutex;

    type TestTap = Tap<NoopRawMutex>;

    fn line(of: u8, length: usize) -> heapless::Vec<u8, { LINE_BYTES + 1 }> {
        let mut line: heapless::Vec<u8, _> = core::iter::repeat_n(of, length - 1).collect();
        line.push(END).expect("room");
        line
    }

    #[test]
    fn lines_leave_whole_and_in_order() {
        let tap = TestTap::new();
        let mut room = [0; 16];
        assert_eq!(tap.take(&mut room), None);
        for (of, length) in [(1, 6), (2, 9), (3, 4)] {
            tap.push(&line(of, length));
        }
        assert_eq!(tap.take(&mut room), Some(15), "the third begins, and does not fit whole");
        assert_eq!(room[..15], [1, 1, 1, 1, 1, 0, 2, 2, 2, 2, 2, 2, 2, 2, 0]);
        assert_eq!(tap.take(&mut room), Some(4));
        assert_eq!((tap.take(&mut room), tap.dropped()), (None, 0));
    }

    #[test]
    fn what_finds_no_room_is_dropped_whole_and_counted_and_the_oldest_stay() {
        let tap = TestTap::new();
        let lines = WAITING_BYTES / 100;
        for of in 1..=100 {
            tap.push(&line(of, 100));
        }
        assert_eq!(tap.dropped() as usize, 100 - lines);
        tap.push(&line(7, WAITING_BYTES - lines * 100));
        assert_eq!(tap.dropped() as usize, 100 - lines, "the rest of the room is used");
        let mut room = [0; LINE_BYTES];
        let mut next = 1;
        while let Some(count) = tap.take(&mut room) {
            for taken in room[..count].split_inclusive(|byte| *byte == END) {
                let of = if next <= lines { next as u8 } else { 7 };
                assert!(taken[..taken.len() - 1].iter().all(|byte| *byte == of));
                next += 1;
            }
        }
        assert_eq!(next - 1, lines + 1);
    }

    #[test]
    fn a_line_that_could_never_leave_is_dropped_at_once() {
        let tap = TestTap::new();
        tap.push(&line(1, LINE_BYTES));
        tap.push(&line(1, LINE_BYTES + 1));
        tap.push(&[1, 2, 3]);
        tap.push(&[]);
        assert_eq!(tap.dropped(), 3);
        let mut room = [0; LINE_BYTES];
        assert_eq!(tap.take(&mut room), Some(LINE_BYTES));
        assert_eq!(tap.take(&mut room), None);
    }
}
