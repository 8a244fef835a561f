//! Any bytes as a workbook.
#![no_main]

use jointrig::exchange::read_positions;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("disk");
    drop(read_positions(file.path()));
});
