//! The committed frames match what the code writes, and they decode.
#![allow(clippy::unwrap_used)]

use jointrig_protocol::frame::Kind;
use jointrig_protocol::packet::Reader;
use jointrig_protocol::{acknowledge, answer, block, event, golden, hello, request};

#[test]
fn committed_vectors_are_what_is_written() {
    if std::env::var_os("JOINTRIG_BLESS").is_some() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("golden");
        golden::for_each(|name, wire| std::fs::write(folder.join(format!("{name}.bin")), wire).unwrap())
            .unwrap();
        panic!("golden vectors rewritten; run again without JOINTRIG_BLESS");
    }
    assert_eq!(golden::check(), Ok(29));
}

#[test]
fn committed_vectors_decode() {
    let mut reader = Reader::new();
    for (name, wire) in golden::COMMITTED {
        let (used, frame) = reader.feed(wire);
        assert_eq!(used, wire.len(), "{name}");
        let frame = frame.unwrap().unwrap();
        let whole = match frame.kind {
            Kind::Hello => hello::Hello::from_bytes(frame.payload).is_ok(),
            Kind::Request => postcard::from_bytes::<request::Numbered>(frame.payload).is_ok(),
            Kind::Answer => postcard::from_bytes::<answer::Numbered>(frame.payload).is_ok(),
            Kind::Event => postcard::from_bytes::<event::Numbered>(frame.payload).is_ok(),
            Kind::Samples => block::Block::from_payload(frame.payload).is_some(),
            Kind::Acknowledge => acknowledge::Acknowledge::from_bytes(frame.payload).is_some(),
            Kind::Log => frame.payload == [0, 1, 0, 255],
        };
        assert!(whole, "{name} does not decode");
    }
}
