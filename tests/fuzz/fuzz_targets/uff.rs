//! Any bytes as a universal file: no panic; what is read can be written, and read again as the same; it may be FRFs or records.
#![no_main]

use jointrig::exchange::uff::{Contents, read, write};
use jointrig::exchange::{StatedUnits, frf_uff, record_uff};
use libfuzzer_sys::fuzz_target;

fn made_of(contents: &Contents) {
    let stated = StatedUnits::default();
    drop((frf_uff::from_contents(contents, &stated), record_uff::from_contents(contents, &stated)));
}

fuzz_target!(|bytes: &[u8]| {
    let first = read(bytes);
    made_of(&first);
    // texts and numbers that our columns do not hold are refused, which is no fault
    let Ok(written) = write(&first.sets) else { return };
    let second = read(&written);
    assert!(second.faults.is_empty(), "{:?}", second.faults);
    assert_eq!(second.sets.len(), first.sets.len());
});
