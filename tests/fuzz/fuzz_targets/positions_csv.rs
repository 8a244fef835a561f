//! Any bytes as the tables of a geometry: the bytes are split at form feeds, one part for each
//! sheet.
#![no_main]

use jointrig::exchange::read_positions;
use libfuzzer_sys::fuzz_target;

const SHEETS: [&str; 8] = [
    "Channels_A",
    "Impacts_A",
    "Channels_B",
    "Impacts_B",
    "Channels_AJB",
    "Impacts_AJB",
    "VP_Channels",
    "VP_RefChannels",
];

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (sheet, part) in SHEETS.iter().zip(bytes.split(|byte| *byte == 0x0c).cycle()) {
        std::fs::write(folder.path().join(format!("{sheet}.csv")), part).expect("disk");
    }
    drop(read_positions(folder.path()));
});
