//! Input of the host: any bytes as a stream of frames, and their payloads; payloads also without a
//! frame.
#![no_main]

use jointrig_protocol::block::Block;
use jointrig_protocol::frame::Kind;
use jointrig_protocol::packet::Reader;
use jointrig_protocol::hello::Hello;
use jointrig_protocol::{answer, event};
use libfuzzer_sys::fuzz_target;

fn payload(kind: Kind, bytes: &[u8]) {
    match kind {
        Kind::Hello => drop(Hello::from_bytes(bytes)),
        Kind::Answer => drop(postcard::from_bytes::<answer::Numbered>(bytes)),
        Kind::Event => drop(postcard::from_bytes::<event::Numbered>(bytes)),
        Kind::Samples => drop(Block::from_payload(bytes).map(|block| block.codes().count())),
        Kind::Request | Kind::Acknowledge | Kind::Log => {}
    }
}

fuzz_target!(|bytes: &[u8]| {
    // a Hello among the bytes may switch the link to packets
    let mut reader = Reader::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (used, found) = reader.feed(rest);
        assert!(used > 0 || found.is_some());
        if let Some(Ok(frame)) = found {
            payload(frame.kind, frame.payload);
        }
        rest = &rest[used..];
    }
    for kind in [Kind::Hello, Kind::Answer, Kind::Event, Kind::Samples] {
        payload(kind, bytes);
    }
});
