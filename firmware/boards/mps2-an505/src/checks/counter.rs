//! Counts instructions with a timer of the machine.
//!
//! Under `-icount shift=10`, QEMU advances its clock by 1024 ns per executed instruction and by
//! nothing else, so TIMER0 (20 MHz) counts instructions, identically in every run. They are not
//! cycles.

use core::ptr;

/// TIMER0: control, value, reload.
const TIMER: *mut u32 = 0x5000_0000 as *mut u32;
const TICK_NS: u64 = 50;
const INSTRUCTION_NS: u64 = 1 << 10;

/// Starts the timer, which repeatedly counts down from its largest value.
pub fn start() {
    for (register, value) in [(0, 0), (2, u32::MAX), (1, u32::MAX), (0, 1)] {
        // SAFETY: TIMER0's registers are at this address on this machine, and nothing else uses
        // them; with its interrupt disabled it changes nothing but its own value.
        unsafe { TIMER.add(register).write_volatile(value) }
    }
}

/// Ticks since a fixed instant, modulo 2³².
#[inline]
pub fn ticks() -> u32 {
    // SAFETY: as in `start`; reading the value has no effect.
    !unsafe { ptr::read_volatile(TIMER.add(1)) }
}

/// Instructions for a number of ticks.
pub fn instructions(ticks: u64) -> u64 {
    (ticks * TICK_NS + INSTRUCTION_NS / 2) / INSTRUCTION_NS
}
