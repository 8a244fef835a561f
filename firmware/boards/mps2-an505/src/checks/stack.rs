//! Peak stack usage: the start-up code fills the stack with a pattern, and words that lost it were
//! used.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// From the linker script: the lowest word of the stack.
    static _stack_end: u32;
    /// From the linker script: the end of RAM, where the stack begins.
    static _stack_start: u32;
}

/// Bytes of stack used so far, at most.
pub fn high_water() -> usize {
    let (mut word, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: only the stack's memory lies between the two symbols; it is read word by word with
    // volatile reads, never beyond its top. The part in use is above this function's own frame,
    // where the scan ends.
    unsafe {
        while word < top && ptr::read_volatile(word) == STACK_PAINT_VALUE {
            word = word.add(1);
        }
    }
    top.addr() - word.addr()
}
