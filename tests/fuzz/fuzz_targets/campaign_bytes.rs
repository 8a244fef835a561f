//! A campaign file with damaged bytes. The input is a list of edits, six bytes each: position
//! (modulo 4 bytes), kind and value.
#![no_main]

mod base_campaign;

use base_campaign::base;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|edits: &[u8]| {
    let base = base();
    let mut bytes = base.bytes.clone();
    for edit in edits.chunks_exact(6).take(32) {
        let at = u32::from_le_bytes([edit[0], edit[1], edit[2], edit[3]]) as usize % bytes.len();
        let end = |length: usize| bytes.len().min(at + length);
        match edit[4] % 6 {
            0 => bytes[at] = edit[5],
            1 => bytes[at] ^= 1 << (edit[5] % 8),
            2 => {
                let end = end(edit[5].into());
                bytes[at..end].fill(0);
            }
            // a page that was written to another place, or an older version of it
            3 => {
                let from = (at / 4096) * 4096;
                let to = usize::from(edit[5]) * 4096 % bytes.len();
                if from + 4096 <= bytes.len() && to + 4096 <= bytes.len() {
                    bytes.copy_within(from..from + 4096, to);
                }
            }
            4 => {
                let end = end(4);
                let number = u32::from(edit[5]).wrapping_mul(0x0101_0101).to_be_bytes();
                bytes[at..end].copy_from_slice(&number[..end - at]);
            }
            _ => bytes.truncate(at.max(1)),
        }
    }
    let path = base.copy(&bytes);
    base.hold(&path, &edits);
});
