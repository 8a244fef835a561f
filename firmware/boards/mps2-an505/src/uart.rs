//! The plain way to the host: UART 0 of the board, byte by byte.
//!
//! QEMU connects it to whatever its `-serial` names. Bytes then come in the host's time, not in the
//! simulator's, so a run over it is not repeatable; the shared ring is for that.

use core::ptr;
use core::sync::atomic::{AtomicBool, Ordering};

/// UART 0 (Arm AN505, memory map; registers of the CMSDK's APB UART).
const BASE: usize = 0x5020_0000;
const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const DIVISOR: usize = 0x10;
/// STATE: a byte waits to leave.
const FULL_OUT: u32 = 1;
/// STATE: a byte has come.
const FULL_IN: u32 = 2;
/// CONTROL: both directions on.
const BOTH_ON: u32 = 3;
/// The smallest divisor: QEMU sends at once whatever it is.
const FASTEST: u32 = 16;
/// Looks at STATE before an empty line is believed: QEMU brings the next byte a moment after the
/// last was taken.
const LOOKS: u32 = 64;

static IN_USE: AtomicBool = AtomicBool::new(false);

fn read(register: usize) -> u32 {
    // SAFETY: a register of a device of this machine, aligned, and used by this file alone.
    unsafe { ptr::read_volatile((BASE + register) as *const u32) }
}

fn write(register: usize, value: u32) {
    // SAFETY: as in `read`.
    unsafe { ptr::write_volatile((BASE + register) as *mut u32, value) }
}

/// Makes it the link.
pub fn start() {
    write(DIVISOR, FASTEST);
    write(CONTROL, BOTH_ON);
    IN_USE.store(true, Ordering::Relaxed);
}

/// Whether it is the link.
pub fn is_link() -> bool {
    IN_USE.load(Ordering::Relaxed)
}

/// Takes what has come; how many bytes.
pub fn take(buffer: &mut [u8]) -> usize {
    let mut count = 0;
    let mut looks = 0;
    while count < buffer.len() && looks < LOOKS {
        if read(STATE) & FULL_IN == 0 {
            looks += 1;
            continue;
        }
        buffer[count] = read(DATA) as u8;
        count += 1;
        looks = 0;
    }
    count
}

/// Gives as many bytes as it takes now; how many.
pub fn give(bytes: &[u8]) -> usize {
    for (count, byte) in bytes.iter().enumerate() {
        if read(STATE) & FULL_OUT != 0 {
            return count;
        }
        write(DATA, u32::from(*byte));
    }
    bytes.len()
}
