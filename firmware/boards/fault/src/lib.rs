//! Stack limit and fault status of the Cortex-M33, shared by all boards.
#![no_std]

use cortex_m::peripheral::SCB;
use cortex_m::register::msplim;
use jointrig_firmware::processor_fault::Status;

/// Stack reserved for the fault handler, bytes: formatting its message uses about a quarter of it.
const RESERVE: u32 = 4096;

/// CCR.STKOFHFNMIGN: the stack limit is ignored in the hard fault handler (Armv8-M ARM, "CCR").
const HANDLER_MAY_USE_RESERVE: u32 = 1 << 10;

unsafe extern "C" {
    /// From the linker script: the lowest word of the stack.
    static _stack_end: u32;
}

/// Sets the stack limit: from now on a stack overflow causes a fault instead of overwriting other
/// memory.
///
/// The fault is reported if its own frame (up to 104 bytes) still fits above the limit. Otherwise
/// the processor locks up, as the architecture specifies, and hardware must act: the watchdog and,
/// on boards that have it, the timer break triggered by the locked-up core.
pub fn limit_stack() {
    let lowest = (&raw const _stack_end).addr() as u32;
    // the register's three lowest bits are zero
    let limit = (lowest + RESERVE + 7) & !7;
    // SAFETY: the limit lies within the stack's own memory, below the stack pointer of `main`; the
    // bit of CCR affects only handlers above all configurable priorities, and nothing else writes
    // the register at this time.
    unsafe {
        (*SCB::PTR).ccr.modify(|ccr| ccr | HANDLER_MAY_USE_RESERVE);
        msplim::write(limit);
    }
}

/// The processor's fault status, for the fault handler.
#[must_use]
pub fn status() -> Status {
    // SAFETY: the registers are only read, which has no side effects.
    let scb = unsafe { &*SCB::PTR };
    Status { cfsr: scb.cfsr.read(), mmfar: scb.mmfar.read(), bfar: scb.bfar.read() }
}
