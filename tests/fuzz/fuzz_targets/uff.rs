//! Any bytes as a universal file: no panic; what is read can be written and reads back the same; it
//! may contain FRFs or records.
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
    // texts and numbers that do not fit the columns are refused, which is correct
    let Ok(written) = write(&first.sets) else { return };
    let second = read(&written);
    assert!(second.faults.is_empty(), "{:?}", second.faults);
    assert_eq!(second.sets.len(), first.sets.len());
});
