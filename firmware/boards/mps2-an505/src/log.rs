//! Log lines: defmt frames in a ring of the shared memory, dropped whole when it is full.

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use critical_section::{Mutex, RestoreState};
use jointrig_firmware::lockstep::{LOG_AT, RING_BYTES};

use crate::{memory, port};

/// The longest frame; a longer one is dropped.
const FRAME_BYTES: usize = 256;

struct Frame {
    encoder: defmt::Encoder,
    bytes: [u8; FRAME_BYTES],
    used: usize,
    restore: RestoreState,
}

static TAKEN: AtomicBool = AtomicBool::new(false);
static FRAME: Mutex<RefCell<Frame>> = Mutex::new(RefCell::new(Frame {
    encoder: defmt::Encoder::new(),
    bytes: [0; FRAME_BYTES],
    used: 0,
    restore: RestoreState::invalid(),
}));

impl Frame {
    fn put(bytes: &mut [u8; FRAME_BYTES], used: &mut usize, new: &[u8]) {
        if let Some(room) = bytes.get_mut(*used..*used + new.len()) {
            room.copy_from_slice(new);
        }
        // beyond the end it is remembered as too long
        *used += new.len();
    }
}

fn with_frame(f: impl FnOnce(&mut Frame)) {
    critical_section::with(|token| f(&mut FRAME.borrow_ref_mut(token)));
}

#[defmt::global_logger]
struct Ring;

// SAFETY: `acquire` begins a critical section that `release` ends, so a frame is never interrupted by
// another; a second `acquire` in between panics, as defmt asks.
unsafe impl defmt::Logger for Ring {
    fn acquire() {
        // SAFETY: ended by exactly one `release`, which defmt calls for every `acquire`.
        let restore = unsafe { critical_section::acquire() };
        assert!(!TAKEN.swap(true, Ordering::Relaxed), "a log line within a log line");
        with_frame(|frame| {
            frame.restore = restore;
            frame.used = 0;
            let Frame { encoder, bytes, used, .. } = frame;
            encoder.start_frame(|new| Frame::put(bytes, used, new));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        let mut restore = RestoreState::invalid();
        with_frame(|frame| {
            let Frame { encoder, bytes, used, .. } = frame;
            encoder.end_frame(|new| Frame::put(bytes, used, new));
            if let Some(bytes) = frame.bytes.get(..frame.used) {
                keep(bytes);
            }
            restore = frame.restore;
        });
        TAKEN.store(false, Ordering::Relaxed);
        // SAFETY: ends the critical section of the `acquire` before it.
        unsafe { critical_section::release(restore) }
    }

    unsafe fn write(new: &[u8]) {
        with_frame(|frame| {
            let Frame { encoder, bytes, used, .. } = frame;
            encoder.write(new, |new| Frame::put(bytes, used, new));
        });
    }
}

fn keep(frame: &[u8]) {
    port::with(|port| {
        let head = port.ask.log_head;
        let room = RING_BYTES - head.wrapping_sub(port.reply.log_tail);
        if frame.len() <= room as usize {
            memory::write_ring(LOG_AT, head, frame);
            port.ask.log_head = head.wrapping_add(frame.len() as u32);
        }
    });
}
