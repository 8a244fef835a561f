//! The direct link to the host: UART 0 of the board, byte by byte.
//!
//! QEMU connects it to the target of its `-serial` option. Bytes then arrive in the host's real
//! time, not in the simulator's time, so a run over it is not repeatable; use the shared ring for
//! repeatable runs.

use core::ptr;
use core::sync::atomic::{AtomicBool, Ordering};

/// UART 0 (Arm AN505, memory map; registers of the CMSDK's APB UART).
const BASE: usize = 0x5020_0000;
const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const DIVISOR: usize = 0x10;
/// STATE: a byte waits to be sent.
const FULL_OUT: u32 = 1;
/// STATE: a byte was received.
const FULL_IN: u32 = 2;
/// CONTROL: both directions enabled.
const BOTH_ON: u32 = 3;
/// The smallest divisor: QEMU sends immediately for any value.
const FASTEST: u32 = 16;
/// Reads of STATE before the line counts as empty: QEMU provides the next byte shortly after the
/// last was taken.
const LOOKS: u32 = 64;

static IN_USE: AtomicBool = AtomicBool::new(false);

fn read(register: usize) -> u32 {
    // SAFETY: an aligned register of a device of this machine, used only by this file.
    unsafe { ptr::read_volatile((BASE + register) as *const u32) }
}

fn write(register: usize, value: u32) {
    // SAFETY: as in `read`.
    unsafe { ptr::write_volatile((BASE + register) as *mut u32, value) }
}

/// Uses the UART as the link.
pub fn start() {
    write(DIVISOR, FASTEST);
    write(CONTROL, BOTH_ON);
    IN_USE.store(true, Ordering::Relaxed);
}

/// Whether the UART is the link.
pub fn is_link() -> bool {
    IN_USE.load(Ordering::Relaxed)
}

/// Reads the received bytes and returns their number.
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

/// Sends as many bytes as the UART accepts now and returns their number.
pub fn give(bytes: &[u8]) -> usize {
    for (count, byte) in bytes.iter().enumerate() {
        if read(STATE) & FULL_OUT != 0 {
            return count;
        }
        write(DATA, u32::from(*byte));
    }
    bytes.len()
}
