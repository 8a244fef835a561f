//! Events: unsolicited messages of the device. They are for information only: everything that a
//! host must know can also be requested ([`crate::answer::Status`]), so a lost event loses no
//! information.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::answer::Counters;
use crate::frame::FrameError;
use crate::limits::SENTENCE_BYTES;
use crate::shot::Shot;
use crate::sync::{ClockFault, Edge};

/// A numbered event.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Numbered {
    /// Counts events since the device started; a jump shows how many were lost.
    pub number: u32,
    /// The scan at which the event occurred.
    pub at_scan: u64,
    /// The event.
    pub event: Event,
}

impl Numbered {
    /// Serialises into a frame's payload and returns the length. Not generic, so that its code is
    /// compiled in this crate and not once per caller.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] when it does not fit.
    pub fn write(&self, payload: &mut [u8]) -> Result<usize, FrameError> {
        postcard::to_slice(self, payload).map(|used| used.len()).map_err(|_| FrameError::TooLong)
    }
}

/// What happened. New variants are only ever added at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Event {
    /// The hammer is armed.
    Armed,
    /// The hammer is disarmed.
    Disarmed(Reason),
    /// A shot reached a new phase.
    Shot(Shot),
    /// Scans were lost in the device and cannot be requested again.
    Lost {
        /// Session epoch of the stream.
        epoch: u32,
        /// First scan lost.
        first_scan: u64,
        /// Number of scans lost.
        scans: u32,
        /// Cause of the loss.
        why: Loss,
    },
    /// Counters, sent once a second while a stream runs.
    Counters(Counters),
    /// The emergency stop latched (true) or was reset at the rig (false).
    EmergencyStop(bool),
    /// The interlock closed (true) or opened (false).
    Interlock(bool),
    /// A converter or another part reported a fault.
    Fault(String<SENTENCE_BYTES>),
    /// The last run ended in a panic with this message.
    Panic(String<SENTENCE_BYTES>),
    /// The shaker is running.
    ShakerRuns,
    /// The shaker is ramping down to rest.
    ShakerStops(Reason),
    /// The shaker has come to rest.
    ShakerRests,
    /// An edge at the sync input or output.
    Edge(Edge),
    /// The external clock has not been proven good, or has failed: the stream has ended, and hammer
    /// and shaker come to rest.
    Clock(ClockFault),
}

/// Why the hammer was disarmed or the shaker stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// Requested by the host.
    Asked,
    /// The arming, or the shaker request, expired.
    Expired,
    /// The shot is over.
    Fired,
    /// Nothing was received from the host for [`crate::limits::LINK_SILENCE_MS`].
    LinkLost,
    /// The interlock opened.
    Interlock,
    /// The emergency stop was triggered.
    EmergencyStop,
    /// The stream ended or was restarted.
    StreamEnded,
    /// A channel exceeded its limit in the shaker request.
    Limit {
        /// Index in the scan, from 0.
        channel: u8,
    },
    /// The controlled quantity stays more than a quarter above its requested amplitude, although
    /// the drive is reduced.
    Runaway,
    /// The largest drive that the request allows does not reach the requested amplitude.
    Weak,
    /// Drive samples were supplied too late; the drive is at rest.
    RanDry,
    /// The front end lost scans, or delivered none for [`crate::limits::SCAN_SILENCE_MS`]; nothing
    /// may move without measured data.
    FrontEnd,
    /// A required sensor is missing: the supply of its channel detects an open cable or a short
    /// circuit.
    Supply {
        /// Index in the scan, from 0.
        channel: u8,
    },
    /// The external clock was lost.
    Clock,
}

/// Why scans were lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Loss {
    /// They left the ring before the link could send them.
    LinkSlow,
    /// The front end did not deliver them.
    FrontEnd,
}
