//! Packets: the frame format on a link that preserves packet boundaries, such as USB bulk
//! endpoints.
//!
//! | offset | bytes | field |
//! |---|---|---|
//! | 0 | 2 | length of kind, payload and CRC |
//! | 2 | 2 | its complement |
//! | 4 | … | kind, payload, CRC-32: as in [`crate::frame`], without COBS |
//! | … | 0 to 3 | zero padding to a whole number of words, for copying by words |
//!
//! Only a device sends packets, and only to a host whose Hello states that it can read them. Hellos
//! and everything that a host sends are always COBS-encoded. [`Reader`] is the host's reader: it
//! reads both formats, and switches to packets after the device's Hello that announces them.
//!
//! A damaged or lost packet is detected by its head or its CRC. The reader then advances byte by
//! byte until a head is followed by a frame with a correct CRC. Samples that look like a head cost
//! time but never a frame.

use crate::frame::{Accumulator, Frame, FrameError, Kind, head};
use crate::hello::{Hello, Role};
use crate::limits::{CRC_BYTES, HEAD_BYTES, MAX_FRAME, MAX_PACKET, WORD};

/// Shortest frame: kind and CRC.
const SHORTEST: usize = 1 + CRC_BYTES;

/// Finds frames in the data of a device: in COBS, and as packets after its Hello has announced
/// them.
pub struct Reader {
    stuffed: Accumulator,
    packets: Packets,
    /// The device's Hello has announced packets.
    agreed: bool,
}

impl Default for Reader {
    fn default() -> Self {
        Self::new()
    }
}

impl Reader {
    /// A reader that expects COBS.
    #[must_use]
    pub const fn new() -> Self {
        Self { stuffed: Accumulator::new(), packets: Packets::new(), agreed: false }
    }

    /// Consumes some bytes. Returns their number, and the frame that they complete or the reason
    /// why the preceding bytes are not a frame. Call again with the rest, and once more with empty
    /// input after a result that left no input. At least one byte is consumed when `input` is not
    /// empty; no frame is pending when nothing is consumed and nothing found.
    pub fn feed(&mut self, input: &[u8]) -> (usize, Option<Result<Frame<'_>, FrameError>>) {
        if self.agreed {
            return self.packets.feed(input);
        }
        let (used, found) = self.stuffed.feed(input);
        if let Some(Ok(frame)) = &found
            && frame.kind == Kind::Hello
            && Hello::from_bytes(frame.payload).is_ok_and(|hello| hello.role == Role::Device && hello.packets)
        {
            self.agreed = true;
        }
        (used, found)
    }
}

/// Finds packets in an arbitrary byte stream.
struct Packets {
    bytes: [u8; MAX_PACKET],
    /// Bytes in the buffer.
    used: usize,
    /// Bytes at the front that have been returned to the caller.
    taken: usize,
    /// Synchronisation is lost, and this has been reported.
    lost: bool,
}

impl Packets {
    const fn new() -> Self {
        Self { bytes: [0; MAX_PACKET], used: 0, taken: 0, lost: false }
    }

    fn feed(&mut self, input: &[u8]) -> (usize, Option<Result<Frame<'_>, FrameError>>) {
        let mut fed = 0;
        loop {
            let taken = core::mem::take(&mut self.taken);
            self.drop_front(taken);
            // gather up to the end of the current packet and no further, so that the buffer begins
            // with a head
            let wanted = match self.length() {
                None => HEAD_BYTES,
                Some(Ok(length)) => HEAD_BYTES + length.next_multiple_of(WORD),
                Some(Err(())) => {
                    self.drop_front(1);
                    if !core::mem::replace(&mut self.lost, true) {
                        return (fed, Some(Err(FrameError::Malformed)));
                    }
                    continue;
                }
            };
            if self.used < wanted {
                let more = (wanted - self.used).min(input.len() - fed);
                if more == 0 {
                    return (fed, None);
                }
                self.bytes[self.used..self.used + more].copy_from_slice(&input[fed..fed + more]);
                (self.used, fed) = (self.used + more, fed + more);
                continue;
            }
            let end = HEAD_BYTES + self.length().and_then(Result::ok).unwrap_or_default();
            let plain = HEAD_BYTES..end;
            if !matches!(
                Frame::from_plain(&self.bytes[plain.clone()]),
                Err(FrameError::Crc | FrameError::Malformed)
            ) {
                (self.taken, self.lost) = (wanted, false);
                return (fed, Some(Frame::from_plain(&self.bytes[plain])));
            }
            // the head may have been sample data: drop only its first byte
            self.taken = 1;
            if !core::mem::replace(&mut self.lost, true) {
                return (fed, Some(Err(FrameError::Crc)));
            }
        }
    }

    /// The length in the gathered head; `None` while the head is incomplete, `Err` when the bytes
    /// are not a head.
    fn length(&self) -> Option<Result<usize, ()>> {
        let head_bytes = self.bytes[..self.used].first_chunk::<HEAD_BYTES>()?;
        let length = usize::from(u16::from_le_bytes([head_bytes[0], head_bytes[1]]));
        let whole = *head_bytes == head(length) && (SHORTEST..=MAX_FRAME).contains(&length);
        Some(if whole { Ok(length) } else { Err(()) })
    }

    fn drop_front(&mut self, count: usize) {
        self.bytes.copy_within(count..self.used, 0);
        self.used -= count;
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;
    use crate::frame::Writer;

    fn hello() -> Vec<u8> {
        let bytes = Hello { packets: true, ..Hello::device(1, 2, 3) }.to_bytes();
        let mut writer = Writer::new(Kind::Hello);
        writer.payload_mut()[..bytes.len()].copy_from_slice(&bytes);
        writer.seal(bytes.len()).expect("fits").to_vec()
    }

    fn packet(payload: &[u8]) -> Vec<u8> {
        let mut writer = Writer::new(Kind::Log);
        writer.payload_mut().fill(0xAA);
        writer.payload_mut()[..payload.len()].copy_from_slice(payload);
        writer.seal_packet(payload.len()).expect("fits").to_vec()
    }

    /// Reads `bytes` in pieces of `step`; returns the payloads and the number of errors.
    fn found(bytes: &[u8], step: usize) -> (Vec<Vec<u8>>, usize) {
        let mut reader = Reader::new();
        let (mut payloads, mut bad) = (Vec::new(), 0);
        for mut piece in bytes.chunks(step) {
            loop {
                let (used, frame) = reader.feed(piece);
                piece = &piece[used..];
                match frame {
                    Some(Ok(frame)) => payloads.push(frame.payload.to_vec()),
                    Some(Err(_)) => bad += 1,
                    None if piece.is_empty() => break,
                    None => assert!(used > 0, "no progress"),
                }
            }
        }
        (payloads, bad)
    }

    #[test]
    fn a_packet_is_whole_words_and_a_full_block_one_short_usb_packet() {
        for length in 0..=MAX_FRAME - 5 {
            let wire = packet(&std::vec![7; length]);
            assert_eq!(wire.len() % WORD, 0);
            assert!(wire.len() < 512);
        }
    }

    proptest! {
        #[test]
        fn packets_are_read_in_any_pieces_after_the_hello(
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..490), 1..6),
            step in 1_usize..700,
        ) {
            let mut bytes = hello();
            bytes.extend(payloads.iter().flat_map(|payload| packet(payload)));
            let (read, bad) = found(&bytes, step);
            prop_assert_eq!(bad, 0);
            prop_assert_eq!(&read[1..], &payloads[..]);
        }

        /// Codes of small noise look like heads. Damage or loss costs only the affected packets and
        /// no others.
        #[test]
        fn after_damage_the_reader_is_back_in_step(
            codes in prop::collection::vec(-300_i16..300, 240),
            at in 0_usize..2_000,
            lost in 0_usize..600,
            step in 1_usize..700,
        ) {
            let payload: Vec<u8> = codes.iter().flat_map(|code| code.to_le_bytes()).collect();
            let mut bytes = Vec::new();
            bytes.extend((0..6).flat_map(|_| packet(&payload)));
            let at = at.min(bytes.len() - lost - 1);
            bytes.drain(at..at + lost);
            bytes[at] ^= 0x10;
            bytes.splice(0..0, hello());
            let (read, bad) = found(&bytes, step);
            // the damaged range overlaps at most three of six packets
            prop_assert!(read.len() > 3, "{} of 6 were read", read.len() - 1);
            prop_assert!(read[1..].iter().all(|read| *read == payload));
            prop_assert!(bad <= 4);
        }

        #[test]
        fn any_bytes_are_taken(bytes in prop::collection::vec(any::<u8>(), 0..3_000), step in 1_usize..700) {
            let mut all = hello();
            all.extend(bytes);
            found(&all, step);
        }
    }
}
