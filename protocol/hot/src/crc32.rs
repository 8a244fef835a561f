//! CRC-32 of a frame's content. A controller processes four bytes at a time with lookup tables; a
//! host uses `crc32fast`, which uses the processor's CRC instructions where available.

#[cfg(any(target_os = "none", test))]
pub use tables::checksum;

/// CRC-32 of `bytes`.
#[cfg(not(any(target_os = "none", test)))]
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

#[cfg(any(target_os = "none", test))]
mod tables {
    use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

    /// CRC-32/ISO-HDLC, reflected.
    const POLYNOMIAL: u32 = 0xEDB8_8320;

    // Effect of a byte on the CRC, immediately and after one to three further zero bytes. Four
    // separate tables instead of one with four rows, so that each table's address stays in a
    // register. Eight tables would not be faster: each byte needs its extraction, its lookup and
    // its XOR in any case.
    //
    // The tables are filled at first use: in flash they would take 4 kB and each lookup would incur
    // flash wait states. Two callers that find the tables empty may both fill them; they write the
    // same values.
    static AT_ONCE: Table = [const { AtomicU32::new(0) }; 256];
    static AFTER_1: Table = [const { AtomicU32::new(0) }; 256];
    static AFTER_2: Table = [const { AtomicU32::new(0) }; 256];
    static AFTER_3: Table = [const { AtomicU32::new(0) }; 256];
    static FILLED: AtomicBool = AtomicBool::new(false);

    type Table = [AtomicU32; 256];

    #[cold]
    #[inline(never)]
    fn fill() {
        // Unknown to the compiler, which would otherwise recognise a CRC and put a table of its own
        // into the flash, 1 kB, or repeat the step 32 times.
        let bits = core::hint::black_box(8);
        for byte in 0..256 {
            let mut crc = byte as u32;
            for table in [&AT_ONCE, &AFTER_1, &AFTER_2, &AFTER_3] {
                for _ in 0..bits {
                    crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
                }
                table[byte].store(crc, Ordering::Relaxed);
            }
        }
        FILLED.store(true, Ordering::Release);
    }

    #[inline(always)]
    fn word(crc: u32, word: u32) -> u32 {
        let word = crc ^ word;
        AFTER_3[(word & 0xFF) as usize].load(Ordering::Relaxed)
            ^ AFTER_2[(word >> 8 & 0xFF) as usize].load(Ordering::Relaxed)
            ^ AFTER_1[(word >> 16 & 0xFF) as usize].load(Ordering::Relaxed)
            ^ AT_ONCE[(word >> 24) as usize].load(Ordering::Relaxed)
    }

    /// CRC-32 of `bytes`.
    #[inline(never)]
    #[must_use]
    pub fn checksum(bytes: &[u8]) -> u32 {
        if !FILLED.load(Ordering::Acquire) {
            fill();
        }
        let (lines, rest) = bytes.as_chunks::<32>();
        let mut crc = u32::MAX;
        for line in lines {
            for bytes in line.as_chunks::<4>().0 {
                crc = word(crc, u32::from_le_bytes(*bytes));
            }
        }
        let (words, rest) = rest.as_chunks::<4>();
        for bytes in words {
            crc = word(crc, u32::from_le_bytes(*bytes));
        }
        for byte in rest {
            crc = (crc >> 8) ^ AT_ONCE[usize::from(crc as u8 ^ byte)].load(Ordering::Relaxed);
        }
        !crc
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_content_agrees_with_the_usual_crate(content in prop::collection::vec(any::<u8>(), 0..600)) {
            let wanted = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&content);
            prop_assert_eq!(tables::checksum(&content), wanted);
            prop_assert_eq!(crc32fast::hash(&content), wanted);
        }
    }
}
