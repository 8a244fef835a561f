//! Fault status of a Cortex-M33 in words, from its status registers (Armv8-M Architecture Reference
//! Manual, DDI 0553, "CFSR").

use core::fmt;

use crate::sentence::{Sentence, Tell};

/// The status registers at entry of the fault handler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Configurable Fault Status Register, 0xE000ED28.
    pub cfsr: u32,
    /// `MemManage` Fault Address Register, 0xE000ED34.
    pub mmfar: u32,
    /// `BusFault` Address Register, 0xE000ED38.
    pub bfar: u32,
}

/// Bits of CFSR, the more specific first.
const WORDS: [(u32, &str); 16] = [
    (20, "stack overflow"),
    (25, "division by zero"),
    (24, "unaligned access"),
    (19, "no coprocessor"),
    (18, "bad return"),
    (17, "bad processor state"),
    (16, "undefined instruction"),
    (12, "bus error while stacking"),
    (11, "bus error while unstacking"),
    (10, "bus error, some instructions ago"),
    (9, "bus error"),
    (8, "bus error at the instruction"),
    (4, "access violation while stacking"),
    (3, "access violation while unstacking"),
    (1, "access violation"),
    (0, "access violation at the instruction"),
];
const MMFAR_VALID: u32 = 1 << 7;
const BFAR_VALID: u32 = 1 << 15;

impl Tell for Status {
    fn tell(&self, to: &mut Sentence) {
        let word = WORDS.iter().find(|(bit, _)| self.cfsr & (1 << bit) != 0);
        to.text(word.map_or("cause unknown", |(_, word)| word));
        if self.cfsr & BFAR_VALID != 0 {
            to.text(" at ").hex(self.bfar, 8);
        } else if self.cfsr & MMFAR_VALID != 0 {
            to.text(" at ").hex(self.mmfar, 8);
        }
        to.text(" (CFSR ").hex(self.cfsr, 1).text(")");
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Sentence::of(self).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_is_told_in_words() {
        let status = |cfsr| Status { cfsr, mmfar: 0x10, bfar: 0x4000_0000 };
        let told = |cfsr| heapless::format!(100; "{}", status(cfsr)).unwrap_or_default();
        assert_eq!(told(1 << 20), "stack overflow (CFSR 0x100000)");
        assert_eq!(told(1 << 9 | 1 << 15), "bus error at 0x40000000 (CFSR 0x8200)");
        assert_eq!(told(1 << 1 | 1 << 7), "access violation at 0x00000010 (CFSR 0x82)");
        assert_eq!(told(0), "cause unknown (CFSR 0x0)");
    }
}
