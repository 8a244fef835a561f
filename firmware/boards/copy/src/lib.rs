//! `memcpy` for the Cortex-M33.
//!
//! Rust's own is portable and takes four instructions a word; every block of samples is copied four times
//! on its way. This one moves eight words in two instructions when both sides are aligned, and uses the
//! core's unaligned loads and stores when they are not. A board brings it in by naming this crate.
#![no_std]

use core::arch::global_asm;

// The linker prefers these definitions to the weak ones of the compiler's library. They follow the
// procedure call standard: r0 to r3 and r12 are free, all else is restored; `memcpy` returns r0.
// Loads and stores of single words and halves may be unaligned on this core; multiple ones may not, and
// are used only when both addresses are multiples of four.
global_asm!(
    ".section .text.memcpy,\"ax\",%progbits",
    ".global memcpy",
    ".global __aeabi_memcpy",
    ".global __aeabi_memcpy4",
    ".global __aeabi_memcpy8",
    ".type memcpy, %function",
    ".type __aeabi_memcpy, %function",
    ".type __aeabi_memcpy4, %function",
    ".type __aeabi_memcpy8, %function",
    ".thumb_func",
    "memcpy:",
    ".thumb_func",
    "__aeabi_memcpy:",
    ".thumb_func",
    "__aeabi_memcpy4:",
    ".thumb_func",
    "__aeabi_memcpy8:",
    "mov r12, r0",
    "subs r2, #32",
    "blo 4f",
    "orr r3, r0, r1",
    "lsls r3, r3, #30",
    "bne 2f",
    "push {{r4-r10}}",
    "1: ldmia r1!, {{r3-r10}}",
    "stmia r12!, {{r3-r10}}",
    "subs r2, #32",
    "bhs 1b",
    "pop {{r4-r10}}",
    "b 4f",
    "2: push {{r4-r6}}",
    "3: ldr r3, [r1]",
    "ldr r4, [r1, #4]",
    "ldr r5, [r1, #8]",
    "ldr r6, [r1, #12]",
    "str r3, [r12]",
    "str r4, [r12, #4]",
    "str r5, [r12, #8]",
    "str r6, [r12, #12]",
    "ldr r3, [r1, #16]",
    "ldr r4, [r1, #20]",
    "ldr r5, [r1, #24]",
    "ldr r6, [r1, #28]",
    "str r3, [r12, #16]",
    "str r4, [r12, #20]",
    "str r5, [r12, #24]",
    "str r6, [r12, #28]",
    "adds r1, #32",
    "add r12, #32",
    "subs r2, #32",
    "bhs 3b",
    "pop {{r4-r6}}",
    // fewer than 32 bytes are left: r2 is their number less 32
    "4: adds r2, #28",
    "bmi 6f",
    "5: ldr r3, [r1], #4",
    "str r3, [r12], #4",
    "subs r2, #4",
    "bpl 5b",
    // fewer than four: the two low bits of r2 are still those of their number
    "6: lsls r3, r2, #31",
    "bpl 7f",
    "ldrb r3, [r1], #1",
    "strb r3, [r12], #1",
    "7: lsls r3, r2, #30",
    "bpl 8f",
    "ldrh r3, [r1]",
    "strh r3, [r12]",
    "8: bx lr",
);
