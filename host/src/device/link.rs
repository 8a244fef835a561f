//! Frames over a transport: extracts complete, undamaged frames from bytes, and sends frames.

use std::io;
use std::time::Duration;

use jointrig_protocol::frame::{Frame, FrameError, Kind, Writer};
use jointrig_protocol::packet::Reader;

use super::transport::Transport;

/// Bytes read in one call: over a hundred full blocks.
const READ_BYTES: usize = 65_536;

/// A transport that carries frames.
pub struct Link {
    transport: Box<dyn Transport>,
    reader: Reader,
    writer: Writer,
    bytes: Vec<u8>,
    frames: u64,
    bad: u64,
}

impl Link {
    /// Sends and receives frames over `transport`.
    pub fn new(transport: Box<dyn Transport>) -> Self {
        Self {
            transport,
            reader: Reader::new(),
            writer: Writer::new(Kind::Hello),
            bytes: vec![0; READ_BYTES],
            frames: 0,
            bad: 0,
        }
    }

    /// Number of good frames received.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Number of damaged frames received.
    pub fn bad(&self) -> u64 {
        self.bad
    }

    /// The transport.
    pub fn transport(&mut self) -> &mut dyn Transport {
        &mut *self.transport
    }

    /// Passes every available frame to `take`, waiting at most `timeout` for the first byte.
    /// Returns whether any byte arrived.
    pub fn receive(&mut self, timeout: Duration, mut take: impl FnMut(Frame<'_>)) -> io::Result<bool> {
        let got = self.transport.read(&mut self.bytes, timeout)?;
        let mut rest = &self.bytes[..got];
        while !rest.is_empty() {
            let (used, found) = self.reader.feed(rest);
            rest = &rest[used..];
            match found {
                Some(Ok(frame)) => {
                    self.frames += 1;
                    take(frame);
                }
                Some(Err(error)) => {
                    self.bad += 1;
                    log::debug!("{error}");
                }
                None => {}
            }
        }
        Ok(got > 0)
    }

    /// Ends an incomplete frame at the receiver.
    pub fn end_frame(&mut self) -> io::Result<()> {
        self.transport.write_all(&[0])
    }

    /// Sends a frame with a payload of fixed layout.
    pub fn send(&mut self, kind: Kind, payload: &[u8]) -> io::Result<()> {
        self.writer.restart(kind);
        let room = self.writer.payload_mut();
        let room = room.get_mut(..payload.len()).ok_or_else(|| io::Error::other(FrameError::TooLong))?;
        room.copy_from_slice(payload);
        let wire = self.writer.seal(payload.len()).map_err(io::Error::other)?;
        self.transport.write_all(wire)
    }

    /// Sends a frame with a postcard payload.
    pub fn send_value<T: serde::Serialize>(&mut self, kind: Kind, value: &T) -> io::Result<()> {
        self.writer.restart(kind);
        let wire = self.writer.seal_value(value).map_err(io::Error::other)?;
        self.transport.write_all(wire)
    }
}
