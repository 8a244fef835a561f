//! Bytes to and from a device, whatever carries them.

use std::io;
use std::path::Path;
use std::time::Duration;

/// A byte pipe to one device. It owes nobody frames: bytes may arrive in any portion, and may be lost.
pub trait Transport: Send {
    /// Reads what is there into `buf`, waiting at most `timeout` for a first byte.
    ///
    /// Returns how many bytes were read; 0 means that nothing arrived in time.
    ///
    /// # Errors
    /// The device or its cable is gone.
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Writes all of `bytes`.
    ///
    /// # Errors
    /// The device or its cable is gone.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Whether what the device sends arrives in the packets in which it was sent. A device may then leave byte stuffing out
    /// ([`jointrig_protocol::packet`]).
    fn keeps_packets(&self) -> bool {
        false
    }

    /// The image that the device at the other end was started with, where that is known: its log strings
    /// are in it.
    fn image(&self) -> Option<&Path> {
        None
    }

    /// What the device is known to be beforehand when it is simulated in this process; none for whatever else may be at the
    /// other end. It comes from the rig's parameters, and over no wire.
    fn simulated(&self) -> Option<Simulated> {
        None
    }
}

/// A device that is simulated in this process.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// The rig's name.
    pub rig: String,
    /// Its seed.
    pub seed: u64,
    /// SHA-256 of all its parameters, in base64.
    pub parameters: String,
    /// What an ideal measurement of it would find, as JSON.
    pub truth: serde_json::Value,
}

impl<T: Transport + ?Sized> Transport for Box<T> {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        (**self).read(buf, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).write_all(bytes)
    }

    fn keeps_packets(&self) -> bool {
        (**self).keeps_packets()
    }

    fn image(&self) -> Option<&Path> {
        (**self).image()
    }

    fn simulated(&self) -> Option<Simulated> {
        (**self).simulated()
    }
}
