//! Frames: kind, payload and CRC-32 (ISO-HDLC, little-endian), COBS-encoded and terminated by zero.
//!
//! This is the format on a byte stream. On a link that preserves packet boundaries, a device may
//! send the same content after a packet head instead ([`crate::packet`]), because COBS costs a
//! controller more time than the CRC.
//!
//! [`encode`] writes one frame; [`Accumulator`] finds frames in an arbitrary byte stream. For any
//! input, the accumulator uses bounded memory, does work proportional to the number of bytes, and
//! resynchronises at the next zero byte. An oversized frame is latched until that zero: its tail is
//! never parsed as a separate frame.

use jointrig_hot::cobs::stuff;
use jointrig_hot::crc32::checksum;

use crate::limits::{CRC_BYTES, HEAD_BYTES, MAX_FRAME, MAX_PACKET, MAX_WIRE, WORD};

/// Content of a frame. New kinds are only ever added at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Kind {
    /// The frozen handshake, both ways ([`crate::hello`]).
    Hello = 1,
    /// Host to device, postcard ([`crate::request`]).
    Request = 2,
    /// Device to host, postcard ([`crate::answer`]).
    Answer = 3,
    /// Device to host, postcard, unsolicited ([`crate::event`]).
    Event = 4,
    /// Device to host, fixed layout ([`crate::block`]).
    Samples = 5,
    /// Host to device, fixed layout ([`crate::acknowledge`]).
    Acknowledge = 6,
    /// Device to host: encoded defmt, dropped first when the link is too slow.
    Log = 7,
}

impl Kind {
    /// The kind for a frame's first byte; `None` if this version does not know it.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Option<Self> {
        Some(match byte {
            1 => Self::Hello,
            2 => Self::Request,
            3 => Self::Answer,
            4 => Self::Event,
            5 => Self::Samples,
            6 => Self::Acknowledge,
            7 => Self::Log,
            _ => return None,
        })
    }
}

/// Why bytes were not accepted as a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// Longer than [`MAX_WIRE`]: everything up to the next zero was skipped.
    Overflow,
    /// Not COBS, or too short to hold a kind and a CRC.
    Malformed,
    /// The CRC does not match the content.
    Crc,
    /// A kind that this version does not know.
    UnknownKind(u8),
    /// The payload does not fit a frame (only when encoding).
    TooLong,
}

impl core::fmt::Display for FrameError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Overflow => write!(f, "a frame longer than {MAX_WIRE} bytes was skipped"),
            Self::Malformed => f.write_str("bytes that are no frame were skipped"),
            Self::Crc => f.write_str("a frame whose CRC-32 does not agree was skipped"),
            Self::UnknownKind(kind) => write!(f, "a frame of unknown kind {kind} was skipped"),
            Self::TooLong => write!(f, "the content does not fit a frame of {MAX_FRAME} bytes"),
        }
    }
}

impl core::error::Error for FrameError {}

/// A decoded frame, borrowed from the accumulator that found it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// What the payload is.
    pub kind: Kind,
    /// The payload, without kind and CRC.
    pub payload: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Parses kind, payload and CRC without COBS encoding.
    pub(crate) fn from_plain(plain: &'a [u8]) -> Result<Self, FrameError> {
        let (content, crc) = plain.split_last_chunk::<CRC_BYTES>().ok_or(FrameError::Malformed)?;
        let (kind, payload) = content.split_first().ok_or(FrameError::Malformed)?;
        if checksum(content) != u32::from_le_bytes(*crc) {
            return Err(FrameError::Crc);
        }
        let kind = Kind::from_byte(*kind).ok_or(FrameError::UnknownKind(*kind))?;
        Ok(Frame { kind, payload })
    }
}

/// The four bytes before a packet: the length of its frame, and the complement of the length, so
/// that a reader can resynchronise.
#[inline]
pub(crate) const fn head(length: usize) -> [u8; HEAD_BYTES] {
    let [low, high] = (length as u16).to_le_bytes();
    [low, high, !low, !high]
}

/// A frame to be sent: the content is written in place, then sealed.
///
/// ```
/// use jointrig_protocol::frame::{Kind, Writer};
/// let mut writer = Writer::new(Kind::Log);
/// writer.payload_mut()[..2].copy_from_slice(&[7, 0]);
/// let wire = writer.seal(2).unwrap();
/// assert_eq!(wire.last(), Some(&0));
/// ```
#[repr(C, align(4))]
pub struct Writer {
    /// A packet's head followed by the frame. Aligned, because a block's samples begin at offset 20
    /// and are copied word by word.
    packet: [u8; MAX_PACKET],
    wire: [u8; MAX_WIRE],
}

impl Writer {
    /// An empty frame of this kind.
    #[must_use]
    pub const fn new(kind: Kind) -> Self {
        let mut packet = [0; MAX_PACKET];
        packet[HEAD_BYTES] = kind as u8;
        Self { packet, wire: [0; MAX_WIRE] }
    }

    /// Starts again with another kind, reusing the memory.
    #[inline]
    pub fn restart(&mut self, kind: Kind) {
        self.packet[HEAD_BYTES] = kind as u8;
    }

    /// The payload's buffer: `MAX_FRAME − 5` bytes.
    #[inline]
    pub fn payload_mut(&mut self) -> &mut [u8] {
        &mut self.packet[HEAD_BYTES + 1..MAX_PACKET - CRC_BYTES]
    }

    /// Appends the CRC over the kind and the first `payload` bytes, and encodes with COBS.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] when `payload` is more than fits.
    pub fn seal(&mut self, payload: usize) -> Result<&[u8], FrameError> {
        let end = self.add_crc(payload)?;
        let length = stuff(&self.packet[HEAD_BYTES..end], &mut self.wire).ok_or(FrameError::TooLong)?;
        Ok(&self.wire[..length])
    }

    /// As [`Writer::seal`], but as a packet ([`crate::packet`]): head, kind, payload, CRC.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] when `payload` is more than fits.
    #[inline]
    pub fn seal_packet(&mut self, payload: usize) -> Result<&[u8], FrameError> {
        let end = self.add_crc(payload)?;
        self.packet[..HEAD_BYTES].copy_from_slice(&head(end - HEAD_BYTES));
        let whole = end.next_multiple_of(WORD);
        self.packet[end..whole].fill(0);
        Ok(&self.packet[..whole])
    }

    /// Appends the CRC over kind and payload, and returns the end position.
    #[inline]
    fn add_crc(&mut self, payload: usize) -> Result<usize, FrameError> {
        let end = HEAD_BYTES + 1 + payload;
        let room = self.packet.get_mut(HEAD_BYTES..end + CRC_BYTES).ok_or(FrameError::TooLong)?;
        let (content, crc) = room.split_at_mut(1 + payload);
        crc.copy_from_slice(&checksum(content).to_le_bytes());
        Ok(end + CRC_BYTES)
    }

    /// Serialises `value` with postcard as the payload, and seals.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] when the value does not fit.
    pub fn seal_value<T: serde::Serialize>(&mut self, value: &T) -> Result<&[u8], FrameError> {
        let used = postcard::to_slice(value, self.payload_mut()).map_err(|_| FrameError::TooLong)?.len();
        self.seal(used)
    }
}

/// Encodes one frame into `wire` and returns the used part, delimiter included.
///
/// # Errors
/// [`FrameError::TooLong`] when payload or `wire` do not fit.
pub fn encode<'a>(kind: Kind, payload: &[u8], wire: &'a mut [u8; MAX_WIRE]) -> Result<&'a [u8], FrameError> {
    let mut writer = Writer::new(kind);
    let room = writer.payload_mut();
    if payload.len() > room.len() {
        return Err(FrameError::TooLong);
    }
    room[..payload.len()].copy_from_slice(payload);
    let sealed = writer.seal(payload.len())?;
    let length = sealed.len();
    wire[..length].copy_from_slice(sealed);
    Ok(&wire[..length])
}

/// Finds frames in a stream of bytes.
pub struct Accumulator {
    bytes: [u8; MAX_WIRE],
    used: usize,
    overflowed: bool,
}

impl Default for Accumulator {
    fn default() -> Self {
        Self::new()
    }
}

impl Accumulator {
    /// An empty accumulator, synchronised to a frame boundary.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_WIRE], used: 0, overflowed: false }
    }

    /// Consumes bytes up to and including the next zero.
    ///
    /// Returns the number of bytes consumed and, if a zero was among them, the frame before it.
    /// Call again with the rest. Empty frames (consecutive zeros) are an idle line, not errors. At
    /// least one byte is consumed when `input` is not empty.
    pub fn feed(&mut self, input: &[u8]) -> (usize, Option<Result<Frame<'_>, FrameError>>) {
        let Some(end) = input.iter().position(|byte| *byte == 0) else {
            self.gather(input);
            return (input.len(), None);
        };
        self.gather(&input[..end]);
        let used = core::mem::take(&mut self.used);
        if core::mem::take(&mut self.overflowed) {
            return (end + 1, Some(Err(FrameError::Overflow)));
        }
        if used == 0 {
            return (end + 1, None);
        }
        (end + 1, Some(Self::decode(&mut self.bytes[..used])))
    }

    fn gather(&mut self, input: &[u8]) {
        if self.overflowed {
            return;
        }
        match self.bytes.get_mut(self.used..self.used + input.len()) {
            Some(room) => {
                room.copy_from_slice(input);
                self.used += input.len();
            }
            None => self.overflowed = true,
        }
    }

    fn decode(bytes: &mut [u8]) -> Result<Frame<'_>, FrameError> {
        let length = cobs::decode_in_place(bytes).map_err(|_| FrameError::Malformed)?;
        Frame::from_plain(&bytes[..length])
    }
}
