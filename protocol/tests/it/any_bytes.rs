//! Arbitrary input: no panic, bounded work, and resynchronisation at the next frame.
#![allow(clippy::unwrap_used)]

use jointrig_protocol::frame::{Accumulator, FrameError, Kind, encode};
use jointrig_protocol::limits::{MAX_FRAME, MAX_WIRE};
use jointrig_protocol::{acknowledge, answer, block, event, hello, request};
use proptest::prelude::*;

/// Feeds `bytes` in pieces of `step`, and returns the frames and errors found.
fn found(bytes: &[u8], step: usize) -> Vec<Result<(Kind, Vec<u8>), FrameError>> {
    let mut accumulator = Accumulator::new();
    let mut out = Vec::new();
    for piece in bytes.chunks(step.max(1)) {
        let mut rest = piece;
        while !rest.is_empty() {
            let (used, frame) = accumulator.feed(rest);
            assert!(used > 0, "feeding must make progress");
            if let Some(frame) = frame {
                out.push(frame.map(|f| (f.kind, f.payload.to_vec())));
            }
            rest = &rest[used..];
        }
    }
    out
}

fn framed(kind: Kind, payload: &[u8]) -> Vec<u8> {
    encode(kind, payload, &mut [0; MAX_WIRE]).unwrap().to_vec()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read(payload in prop::collection::vec(any::<u8>(), 0..MAX_FRAME - 4), step in 1usize..600) {
        let wire = framed(Kind::Log, &payload);
        prop_assert!(wire.len() <= MAX_WIRE);
        prop_assert!(!wire[..wire.len() - 1].contains(&0), "the only zero is the delimiter");
        prop_assert_eq!(found(&wire, step), vec![Ok((Kind::Log, payload))]);
    }

    #[test]
    fn noise_never_harms_the_next_frame(noise in prop::collection::vec(any::<u8>(), 0..3000), step in 1usize..600) {
        let mut bytes = noise;
        bytes.push(0);
        bytes.extend(framed(Kind::Request, b"after the noise"));
        let all = found(&bytes, step);
        prop_assert_eq!(all.last().unwrap(), &Ok((Kind::Request, b"after the noise".to_vec())));
    }

    #[test]
    fn a_changed_byte_is_noticed(payload in prop::collection::vec(any::<u8>(), 1..200), at in any::<prop::sample::Index>(), flip in 1u8..=255) {
        let mut wire = framed(Kind::Answer, &payload);
        let at = at.index(wire.len());
        wire[at] ^= flip;
        wire.push(0);
        for frame in found(&wire, wire.len()) {
            // CRC-32 detects every error burst of up to 32 bits; a fragment split off by a zero in
            // the middle is shorter than a frame can be, or fails its CRC as well
            prop_assert!(frame.is_err() || frame == Ok((Kind::Answer, payload.clone())));
        }
    }

    #[test]
    fn every_reader_takes_any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..MAX_FRAME)) {
        let _ = hello::Hello::from_bytes(&bytes);
        let _ = acknowledge::Acknowledge::from_bytes(&bytes);
        let _ = postcard::from_bytes::<request::Numbered>(&bytes);
        let _ = postcard::from_bytes::<answer::Numbered>(&bytes);
        let _ = postcard::from_bytes::<event::Numbered>(&bytes);
        if let Some(block) = block::Block::from_payload(&bytes) {
            prop_assert_eq!(block.codes().len(), block.words_per_scan() * usize::from(block.header.scans));
        }
    }
}

#[test]
fn the_tail_of_an_oversized_frame_is_not_a_frame() {
    // a good frame appended to more bytes than a frame can have, without a zero in between
    let mut bytes = vec![1; 2 * MAX_WIRE];
    bytes.extend(framed(Kind::Log, b"hidden"));
    bytes.extend(framed(Kind::Log, b"next"));
    assert_eq!(found(&bytes, 64), vec![Err(FrameError::Overflow), Ok((Kind::Log, b"next".to_vec()))]);
}

#[test]
fn an_unknown_kind_is_told_from_damage() {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let mut plain = vec![200, 5, 6];
    plain.extend(crc.checksum(&plain).to_le_bytes());
    let mut wire = cobs_encode(&plain);
    wire.push(0);
    assert_eq!(found(&wire, 3), vec![Err(FrameError::UnknownKind(200))]);
}

fn cobs_encode(plain: &[u8]) -> Vec<u8> {
    let mut out = vec![0; plain.len() + 2];
    let n = cobs::encode(plain, &mut out);
    out.truncate(n);
    out
}
