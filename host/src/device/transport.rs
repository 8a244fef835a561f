//! Byte transport to and from a device.

use std::io;
use std::path::Path;
use std::time::Duration;

/// A byte pipe to one device. It does not preserve frames: bytes may arrive in pieces of any size,
/// and may be lost.
pub trait Transport: Send {
    /// Reads the available bytes into `buf`, waiting at most `timeout` for the first one.
    ///
    /// Returns the number of bytes read; 0 means that nothing arrived in time.
    ///
    /// # Errors
    /// The device or its cable was disconnected.
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Writes all of `bytes`.
    ///
    /// # Errors
    /// The device or its cable was disconnected.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Whether the device's packets arrive as they were sent. A device may then omit byte stuffing
    /// ([`jointrig_protocol::packet`]).
    fn keeps_packets(&self) -> bool {
        false
    }

    /// The firmware image with which the device was started, where it is known; it contains the log
    /// strings.
    fn image(&self) -> Option<&Path> {
        None
    }

    /// The rig's description when the device is simulated in this process; `None` for any other
    /// device. It is taken from the rig's parameters and is not transmitted over the link.
    fn simulated(&self) -> Option<Simulated> {
        None
    }

    /// What is known about a recorder whose samples come over a bridge, beyond the protocol; `None`
    /// for any other device.
    fn recorder(&self) -> Option<Recorder> {
        None
    }

    /// Sentences about a recorder since the last call, each of which a person should read.
    fn take_remarks(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// A recorder whose samples come over a bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorder {
    /// Scans per second, Hz; the protocol knows the nearest integer.
    pub rate_hz: f64,
    /// Scans of its longest block so far: a scan may have been sampled by so much before it
    /// arrives.
    pub longest_block: u32,
}

/// A device that is simulated in this process.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// The rig's name.
    pub rig: String,
    /// The seed of its scatter.
    pub seed: u64,
    /// SHA-256 of all its parameters, base64.
    pub parameters: String,
    /// What an ideal measurement of it would find, as JSON.
    pub truth: serde_json::Value,
}
