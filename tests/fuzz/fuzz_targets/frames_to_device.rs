//! Input of the device: any bytes as a stream of frames, and their payloads. Payloads are also
//! tried without a frame, because the checksum would reject most random input.
#![no_main]

use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::frame::{Accumulator, Kind, encode};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::{BLOCK_HEADER_BYTES, BLOCK_SAMPLE_BYTES, MAX_WIRE};
use jointrig_protocol::request;
use libfuzzer_sys::fuzz_target;
use std::hint::black_box;

fn payload(bytes: &[u8]) {
    let _ = black_box((Hello::from_bytes(bytes), Acknowledge::from_bytes(bytes)));
    let _ = black_box(postcard::from_bytes::<request::Numbered>(bytes));
}

fuzz_target!(|bytes: &[u8]| {
    let mut accumulator = Accumulator::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (used, found) = accumulator.feed(rest);
        assert!(used > 0);
        if let Some(Ok(frame)) = found {
            payload(frame.payload);
        }
        rest = &rest[used..];
    }
    payload(bytes);
    // whatever preceded it on the line, a zero resynchronises the decoder
    let mut wire = [0; MAX_WIRE];
    let sent = &bytes[..bytes.len().min(BLOCK_HEADER_BYTES + BLOCK_SAMPLE_BYTES - 1)];
    let frame = encode(Kind::Request, sent, &mut wire).expect("short enough");
    // the result of the frame that it ends does not matter here
    let _ = accumulator.feed(&[0]);
    let (_, found) = accumulator.feed(frame);
    let heard = found.expect("a whole frame").expect("a good one");
    assert_eq!((heard.kind, heard.payload), (Kind::Request, sent));
});
