//! The logger of a board: each line is encoded once and passed as a whole to two destinations.
//!
//! One is [`TAP`], from which the firmware's transmitter takes lines for the host; the other is the
//! function that the board sets with [`also_to`] (a debug probe, the simulator's memory). A line is
//! completed before it is passed on, so that neither destination receives a partial line; a line
//! longer than a frame of the link is dropped for both.
//!
//! Interrupts are disabled while a line is encoded, as with any defmt logger on a single core:
//! about a thousand instructions per line, none without a line.
#![no_std]

use core::cell::{Cell, RefCell};

use critical_section::{CriticalSection, Mutex, RestoreState};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use jointrig_firmware::logs::{LINE_BYTES, Tap};

/// Lines for the host; pass it to [`jointrig_firmware::Core::with_logs`].
pub static TAP: Tap<CriticalSectionRawMutex> = Tap::new();

/// Takes one encoded line; called with interrupts disabled.
pub type Place = fn(&[u8]);

static ALSO: Mutex<Cell<Option<Place>>> = Mutex::new(Cell::new(None));

/// Sends lines to `place` as well from now on.
pub fn also_to(place: Place) {
    critical_section::with(|free| ALSO.borrow(free).set(Some(place)));
}

/// The build id of this image: the first eight bytes of the hash that the linker wrote into it. A
/// host uses it to find the table of log strings.
#[must_use]
pub fn build_id() -> u64 {
    unsafe extern "C" {
        static __jointrig_build_id: [u8; 24];
    }
    // SAFETY: build-id.x, with which every board is linked, places the symbol at the start of the
    // linker's note: a header of 16 bytes, followed by the 20 bytes of a SHA-1. It is in flash and
    // never written.
    let note = unsafe { &__jointrig_build_id };
    let [.., a, b, c, d, e, f, g, h] = *note;
    u64::from_be_bytes([a, b, c, d, e, f, g, h])
}

/// The line being encoded.
struct Line {
    encoder: defmt::Encoder,
    bytes: Vec<u8, LINE_BYTES>,
    /// It exceeded the buffer.
    too_long: bool,
    /// Interrupt state before the line, while there is one.
    before: Option<RestoreState>,
}

static LINE: Mutex<RefCell<Line>> = Mutex::new(RefCell::new(Line {
    encoder: defmt::Encoder::new(),
    bytes: Vec::new(),
    too_long: false,
    before: None,
}));

impl Line {
    fn encode(&mut self, step: impl FnOnce(&mut defmt::Encoder, &mut dyn FnMut(&[u8]))) {
        let Self { encoder, bytes, too_long, .. } = self;
        step(encoder, &mut |encoded| *too_long |= bytes.extend_from_slice(encoded).is_err());
    }

    fn hand_over(&mut self, free: CriticalSection<'_>) {
        if self.too_long {
            // the tap counts an empty line as a dropped one
            TAP.push(&[]);
        } else {
            TAP.push(&self.bytes);
            if let Some(place) = ALSO.borrow(free).get() {
                place(&self.bytes);
            }
        }
        self.bytes.clear();
        self.too_long = false;
    }
}

#[defmt::global_logger]
struct Logger;

// SAFETY: `acquire` disables interrupts on the single core and `release` restores them, so that
// nothing else logs in between; a line begun inside another one (by a `Format` that logs) panics.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: released by `release`, which defmt calls after every `acquire`, with the same
        // nesting.
        let before = unsafe { critical_section::acquire() };
        critical_section::with(|free| {
            let mut line = LINE.borrow_ref_mut(free);
            assert!(line.before.is_none(), "a log line begins inside another one");
            line.before = Some(before);
            line.encode(|encoder, write| encoder.start_frame(write));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        let before = critical_section::with(|free| {
            let mut line = LINE.borrow_ref_mut(free);
            line.encode(|encoder, write| encoder.end_frame(write));
            line.hand_over(free);
            line.before.take()
        });
        if let Some(before) = before {
            // SAFETY: this is the value that `acquire` received, and it is restored once.
            unsafe { critical_section::release(before) }
        }
    }

    unsafe fn write(bytes: &[u8]) {
        critical_section::with(|free| {
            LINE.borrow_ref_mut(free).encode(|encoder, write| encoder.write(bytes, write));
        });
    }
}
