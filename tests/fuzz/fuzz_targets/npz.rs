//! Any bytes as an npz file: FRFs, impact records, hysteresis records.
#![no_main]

use jointrig::exchange::{read_frf, read_hysteresis, read_impacts};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("disk");
    drop((read_frf(file.path()), read_impacts(file.path()), read_hysteresis(file.path())));
});
