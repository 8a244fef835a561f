//! What a device says unasked. Events inform; everything a host must know can also be asked
//! ([`crate::answer::Status`]), so that a lost event loses nothing.

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
    /// Counts events since the device started; a jump tells how many were lost.
    pub number: u32,
    /// The scan at which it happened.
    pub at_scan: u64,
    /// What happened.
    pub event: Event,
}

impl Numbered {
    /// Writes it as a frame's payload; its length. Not generic, so that its code is this crate's and not each caller's.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] when it does not fit.
    pub fn write(&self, payload: &mut [u8]) -> Result<usize, FrameError> {
        postcard::to_slice(self, payload).map(|used| used.len()).map_err(|_| FrameError::TooLong)
    }
}

/// What happened. Variants only ever grow at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Event {
    /// The hammer is armed.
    Armed,
    /// The hammer is disarmed.
    Disarmed(Reason),
    /// A shot reached a new phase.
    Shot(Shot),
    /// Scans were lost in the device: they cannot be asked for again.
    Lost {
        /// Which stream.
        epoch: u32,
        /// First scan lost.
        first_scan: u64,
        /// How many.
        scans: u32,
        /// Why.
        why: Loss,
    },
    /// Once a second while a stream runs.
    Counters(Counters),
    /// The emergency stop latched (true) or was reset at the rig (false).
    EmergencyStop(bool),
    /// The interlock closed (true) or opened (false).
    Interlock(bool),
    /// A converter or another part reported a fault.
    Fault(String<SENTENCE_BYTES>),
    /// The last run ended in a panic, and this is what it said.
    Panic(String<SENTENCE_BYTES>),
    /// The shaker runs.
    ShakerRuns,
    /// The shaker is being brought to rest.
    ShakerStops(Reason),
    /// The shaker has come to rest.
    ShakerRests,
    /// An edge at the sync input or output.
    Edge(Edge),
    /// The external clock is not good, or not any more: the stream has ended, and everything comes to rest.
    Clock(ClockFault),
}

/// Why the hammer disarmed, or the shaker stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// The host asked for it.
    Asked,
    /// The arming, or the order to the shaker, expired.
    Expired,
    /// The shot is over.
    Fired,
    /// The host was not heard for [`crate::limits::LINK_SILENCE_MS`].
    LinkLost,
    /// The interlock opened.
    Interlock,
    /// The emergency stop.
    EmergencyStop,
    /// The stream ended or began anew.
    StreamEnded,
    /// A channel went beyond the limit of the order to the shaker.
    Limit {
        /// Place in the scan, from 0.
        channel: u8,
    },
    /// What the shaker controls is half as large again as ordered.
    Runaway,
    /// The largest drive that the order allows does not reach the ordered amplitude.
    Weak,
    /// The drive was given its codes too late, and rests.
    RanDry,
    /// The front end lost scans, or none came for [`crate::limits::SCAN_SILENCE_MS`]: nothing moves blindly.
    FrontEnd,
    /// The sensor that this needs is not there: the supply of its channel finds an open cable or a short.
    Supply {
        /// Place in the scan, from 0.
        channel: u8,
    },
    /// The external clock was lost.
    Clock,
}

/// Why scans were lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Loss {
    /// They left the ring before the link could carry them.
    LinkSlow,
    /// The front end did not deliver them.
    FrontEnd,
}
