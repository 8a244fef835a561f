//! Any bytes as the first sheet of a valid workbook, because the archive's checksums would reject
//! most damaged input; bytes before a form feed are its shared strings.
#![no_main]

use jointrig::exchange::read_positions;
use libfuzzer_sys::fuzz_target;
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;

const GOOD: &[u8] = include_bytes!("../corpus/positions_xlsx/positions.xlsx");

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.rsplitn(2, |byte| *byte == 0x0c);
    let sheet = parts.next().unwrap_or_default();
    let texts = parts.next().unwrap_or(b"<sst/>");
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    let mut good = zip::ZipArchive::new(Cursor::new(GOOD)).expect("a workbook");
    let mut zip = zip::ZipWriter::new(file.reopen().expect("the same file"));
    for at in 0..good.len() {
        let part = good.by_index_raw(at).expect("a part");
        if !part.name().is_ok_and(|name| name.ends_with("sheet1.xml")) {
            zip.raw_copy_file(part).expect("disk");
        }
    }
    for (name, text) in [("xl/worksheets/sheet1.xml", sheet), ("xl/sharedStrings.xml", texts)] {
        zip.start_file(name, SimpleFileOptions::default()).expect("a part");
        zip.write_all(text).expect("disk");
    }
    zip.finish().expect("disk");
    drop(read_positions(file.path()));
});
