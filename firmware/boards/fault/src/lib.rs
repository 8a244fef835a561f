//! Stack limit and fault status of the Cortex-M33, the same on every board.
#![no_std]

use cortex_m::peripheral::SCB;
use cortex_m::register::msplim;
use jointrig_firmware::processor_fault::Status;

/// Stack that is kept for the fault handler, bytes: formatting its sentence takes about a quarter
/// of it.
const RESERVE: u32 = 4096;

/// CCR.STKOFHFNMIGN: the limit does not hold in the hard fault's own handler (Armv8-M ARM, "CCR").
const HANDLER_MAY_USE_RESERVE: u32 = 1 << 10;

unsafe extern "C" {
    /// From the linker script: the lowest word of the stack.
    static _stack_end: u32;
}

/// From here on a stack that grows into other memory is a fault instead of other memory's end.
///
/// The fault is told when its own frame (up to 104 bytes) still fits above the limit; otherwise the
/// processor locks up, as the architecture has it, and what stands behind it must act: the
/// watchdog, and on boards that have one the timer break of the locked-up core.
pub fn limit_stack() {
    let lowest = (&raw const _stack_end).addr() as u32;
    // the register's three lowest bits are zero
    let limit = (lowest + RESERVE + 7) & !7;
    // SAFETY: the limit lies within the stack's own memory, below the stack pointer of `main`; the
    // bit of CCR concerns handlers above all priorities only, and nothing else writes the register
    // now.
    unsafe {
        (*SCB::PTR).ccr.modify(|ccr| ccr | HANDLER_MAY_USE_RESERVE);
        msplim::write(limit);
    }
}

/// What the processor says of the fault. For its handler.
#[must_use]
pub fn status() -> Status {
    // SAFETY: the registers are read, and reading them changes nothing.
    let scb = unsafe { &*SCB::PTR };
    Status { cfsr: scb.cfsr.read(), mmfar: scb.mmfar.read(), bfar: scb.bfar.read() }
}
