//! Input of the bridge: any bytes as a recorder's stream, and as blocks after a good header.
#![no_main]

use jointrig_bridge::blocks::Blocks;
use jointrig_bridge::convert::{Converter, Run};
use jointrig_bridge::header::Header;
use jointrig_protocol::channel::words_per_scan;
use libfuzzer_sys::fuzz_target;

const GOOD: &str = r#"{"jointrig_bridge":1,"board":"b","serial":"s","rate_hz":1000,"sample":"f32","channels":[{"name":"a","unit":"g","full_scale":50},{"name":"b","unit":"N","sensitivity_v":-0.01,"full_scale":5}]}"#;

fn read(header: &Header, bytes: &[u8]) {
    let words = words_per_scan(&header.channels);
    let mut blocks = Blocks::new(bytes, header.scan_bytes());
    let mut converter = Converter::new(header);
    while let Ok(Some(block)) = blocks.next_block() {
        let (scans, mut seen) = (block.bytes.len() / header.scan_bytes(), 0);
        converter.convert(block.bytes, |run| {
            seen += match run {
                Run::Codes(codes) => codes.len() / words,
                Run::Invalid(scans) => scans as usize,
            }
        });
        assert_eq!(seen, scans);
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut rest = bytes;
    if let Ok(header) = Header::read(&mut rest) {
        read(&header, rest);
    }
    read(&Header::parse(GOOD.as_bytes()).expect("good"), bytes);
});
