//! Any bytes as a universal file: no panic; what is read can be written, and read again as the same.
#![no_main]

use jointrig::exchange::uff::{read, write};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let first = read(bytes);
    // texts and numbers that our columns do not hold are refused, which is no fault
    let Ok(written) = write(&first.sets) else { return };
    let second = read(&written);
    assert!(second.faults.is_empty(), "{:?}", second.faults);
    assert_eq!(second.sets.len(), first.sets.len());
});
