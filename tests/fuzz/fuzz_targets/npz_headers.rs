//! Any bytes as an array in a valid archive, because the archive's checksums would reject most
//! damaged input: a header up to the end of the first line, then values. A reader gets this array
//! for every name that it requests.
#![no_main]

use jointrig::exchange::{read_frf, read_hysteresis, read_impacts};
use libfuzzer_sys::fuzz_target;
use std::io::Write;
use zip::write::SimpleFileOptions;

const ARRAYS: [&str; 12] = [
    "fs", "force", "response", "quantity", "frequency", "outputs", "inputs", "frf", "variance", "velocity_a", "velocity_b", "load_cells",
];

fuzz_target!(|bytes: &[u8]| {
    let end = bytes.iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |at| at + 1);
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    let mut zip = zip::ZipWriter::new(file.reopen().expect("the same file"));
    for array in ARRAYS {
        zip.start_file(format!("{array}.npy"), SimpleFileOptions::default()).expect("a member");
        zip.write_all(b"\x93NUMPY\x02\x00").expect("disk");
        zip.write_all(&(end as u32).to_le_bytes()).expect("disk");
        zip.write_all(bytes).expect("disk");
    }
    zip.finish().expect("disk");
    drop((read_frf(file.path()), read_impacts(file.path()), read_hysteresis(file.path())));
});
