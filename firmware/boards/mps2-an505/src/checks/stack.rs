//! The stack's high-water mark: the start-up code paints the stack, and what lost its paint was
//! used.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// From the linker script: the lowest word of the stack.
    static _stack_end: u32;
    /// From the linker script: the end of RAM, where the stack begins.
    static _stack_start: u32;
}

/// Bytes of stack that were ever used.
pub fn high_water() -> usize {
    let (mut word, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: between the two lies the stack's memory and nothing else; it is read word by word,
    // volatile, and never beyond its top. What is in use is above this function's own frame, where
    // the scan ends.
    unsafe {
        while word < top && ptr::read_volatile(word) == STACK_PAINT_VALUE {
            word = word.add(1);
        }
    }
    top.addr() - word.addr()
}
