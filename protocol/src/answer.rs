//! Replies of the device: the requested data, or a refusal with its reason.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::channel::{Channel, Name};
use crate::frame::FrameError;
use crate::limits::SENTENCE_BYTES;
use crate::shot::Shot;
use crate::slow::{Slow, SupplyFault};
use crate::sync::{ClockFault, Sync};

/// The reply to the request with the same number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Numbered {
    /// The request's number.
    pub number: u32,
    /// The requested data, or the reason for the refusal.
    pub outcome: Result<Answer, Refusal>,
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

/// The requested data. New variants are only ever added at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Answer {
    /// Identity and properties of the device.
    Info(Info),
    /// Description of one channel.
    Channel(Channel),
    /// State of the device.
    Status(Status),
    /// A stream has begun.
    Started {
        /// Its session epoch.
        epoch: u32,
        /// Its channel-map id.
        map: u8,
        /// Index of its first scan.
        first_scan: u64,
    },
    /// Done; there is no data to return.
    Done,
    /// These scans are being sent again.
    Resending {
        /// First scan of the first block.
        first_scan: u64,
        /// Total number of scans.
        scans: u32,
    },
    /// The shot is accepted.
    Scheduled {
        /// Its number.
        number: u32,
    },
    /// Hammer and laser are in position from this scan on.
    Staged {
        /// The first scan with both in position.
        at_scan: u64,
    },
    /// Temperature and sensor supplies.
    Slow(Slow),
    /// Clock state and edge counts.
    Sync(Sync),
}

/// Why a request was not carried out. New variants are only ever added at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Refusal {
    /// This board does not support the request.
    Unsupported,
    /// The request could not be decoded.
    Unreadable,
    /// The request's number is older than the stored replies.
    Stale,
    /// There is no such channel.
    NoSuchChannel,
    /// No stream is running.
    NotStreaming,
    /// Another stream is running.
    WrongEpoch {
        /// The epoch of the running stream.
        current: u32,
    },
    /// The ring no longer holds the requested scans.
    Gone {
        /// The oldest scan in the ring.
        oldest: u64,
    },
    /// The hammer is not armed.
    NotArmed,
    /// A shot is in progress.
    Busy,
    /// The interlock is open.
    Interlock,
    /// The emergency stop is latched: it must be reset at the rig.
    EmergencyStop,
    /// The shaker is running.
    ShakerRuns,
    /// The coil pulse is zero or exceeds the cap.
    PulseOutOfBounds {
        /// Longest allowed pulse, µs.
        cap_us: u32,
    },
    /// This shot number has already been used.
    ShotRepeated {
        /// The last number used.
        last: u32,
    },
    /// A value is out of bounds or not finite.
    OutOfBounds(String<SENTENCE_BYTES>),
    /// The stage cannot reach the requested position.
    Stage(String<SENTENCE_BYTES>),
    /// The hammer is armed, or a shot is in progress.
    HammerArmed,
    /// The constant-current supply of a required channel detects no sensor.
    Supply {
        /// Index of the channel in the scan, from 0.
        channel: u8,
        /// The fault detected.
        fault: SupplyFault,
    },
    /// The selected scan clock is faulty or has not been verified yet.
    Clock(ClockFault),
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unsupported => f.write_str("the device cannot do that"),
            Self::Unreadable => f.write_str("the device could not read the request"),
            Self::Stale => f.write_str("the request came too late to be told from an old one"),
            Self::NoSuchChannel => f.write_str("the device has no such channel"),
            Self::NotStreaming => f.write_str("no stream is running; start one first"),
            Self::WrongEpoch { current } => write!(f, "another stream runs (epoch {current})"),
            Self::Gone { oldest } => {
                write!(f, "the device no longer holds these scans (its oldest is {oldest})")
            }
            Self::NotArmed => f.write_str("the hammer is not armed"),
            Self::Busy => f.write_str("the hammer has a shot in hand"),
            Self::Interlock => f.write_str("the interlock is open: close the guard, then arm again"),
            Self::EmergencyStop => {
                f.write_str("the emergency stop is latched: release and reset it at the rig")
            }
            Self::ShakerRuns => f.write_str("the shaker runs; stop it before using the hammer"),
            Self::PulseOutOfBounds { cap_us } => write!(f, "the coil pulse must be 1 to {cap_us} us"),
            Self::ShotRepeated { last } => write!(f, "this shot number was used before (last: {last})"),
            Self::OutOfBounds(what) | Self::Stage(what) => f.write_str(what),
            Self::HammerArmed => f.write_str("the hammer is armed; disarm it before using the shaker"),
            Self::Supply { channel, fault } => {
                write!(f, "the sensor of channel {channel} (from 0) is not there: {fault}")
            }
            Self::Clock(fault) => fault.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

/// Identity and properties of the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Info {
    /// Name of the board.
    pub board: Name,
    /// Serial number.
    pub serial: Name,
    /// Firmware version (semantic versioning).
    pub version: Name,
    /// Target triple that the firmware was built for.
    pub target: String<40>,
    /// Identifies the build, and thus the matching table of log strings.
    pub build: u64,
    /// Channels in a scan.
    pub channels: u8,
    /// Scans per second.
    pub scan_rate_hz: u32,
    /// Scans that the ring holds for retransmission.
    pub ring_scans: u32,
    /// Longest coil pulse, µs.
    pub coil_cap_us: u32,
    /// Whether the device accepts the positions of hammer and laser
    /// ([`crate::request::Request::Stage`]).
    pub stage: bool,
    /// Full scale of the shaker's drive, V; 0 without a shaker.
    pub drive_v: f32,
    /// Cause of the last reset.
    pub reset: Reset,
}

/// Cause of a device's last reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reset {
    /// Not reported.
    #[default]
    Unknown,
    /// Power-on.
    Power,
    /// Reset button, or a debugger's reset line.
    Pin,
    /// Software reset: after a panic or a fault, or by a debugger.
    Software,
    /// Watchdog reset: the program hung.
    Watchdog,
    /// Supply voltage briefly too low.
    Brownout,
}

impl core::fmt::Display for Reset {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Unknown => "unknown",
            Self::Power => "power came",
            Self::Pin => "its reset button or a debugger",
            Self::Software => "its own program, after a panic or fault, or a debugger",
            Self::Watchdog => "the watchdog: its program hung",
            Self::Brownout => "its supply was too low for a moment",
        })
    }
}

impl Info {
    /// Board name of the simulated rig that runs within the host process.
    pub const VIRTUAL_BOARD: &'static str = "jointrig-sim";
    /// Board name of the emulated board, which also measures a simulated rig.
    pub const EMULATED_BOARD: &'static str = "mps2-an505";
}

/// State of the hammer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Hammer {
    /// No shot is allowed.
    Disarmed,
    /// One shot is allowed until the arming expires.
    Armed,
    /// A shot waits for its scan or for the structure to be quiet.
    Waiting,
    /// The coil is on, or the bolt is in flight.
    Firing,
    /// Pulse and rebounds are being recorded.
    Listening,
    /// Hold-off time after a shot; the next shot waits for its end.
    HoldOff,
}

/// State of the shaker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Shaker {
    /// At rest.
    Resting,
    /// The amplitude is ramping to the requested value.
    Slewing,
    /// The amplitude has the requested value.
    Steady,
    /// The amplitude is ramping down to zero.
    Stopping,
}

/// Counters of frames, events and logs since the device started, and of scans since the stream
/// started. They never decrease, except that the latter restart with each stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Counters {
    /// Good frames received.
    pub frames_in: u32,
    /// Received frames that were damaged or of unknown kind.
    pub frames_bad: u32,
    /// Scans produced in this stream.
    pub scans_produced: u64,
    /// Scans sent for the first time in this stream.
    pub scans_sent: u64,
    /// Scans retransmitted in this stream.
    pub scans_resent: u64,
    /// Scans that left the ring unsent in this stream; they are lost and reported as ranges.
    pub scans_dropped: u64,
    /// Scans that the front end failed to deliver in this stream.
    pub scans_missed: u64,
    /// Events dropped because their queue was full.
    pub events_dropped: u32,
    /// Log frames dropped.
    pub logs_dropped: u32,
}

/// State of the device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// Epoch of the running stream, or of the last one.
    pub epoch: u32,
    /// Whether a stream is running.
    pub streaming: bool,
    /// The next scan that will be produced.
    pub next_scan: u64,
    /// The oldest scan that can be retransmitted.
    pub oldest_scan: u64,
    /// State of the hammer.
    pub hammer: Hammer,
    /// Remaining arming time, ms.
    pub armed_for_ms: u32,
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// Whether the emergency stop is latched.
    pub emergency_stop: bool,
    /// Friction force of the last block, N: mean of the load cells, corrected with their
    /// calibration matrix.
    pub friction_n: f32,
    /// The last shot, if any.
    pub shot: Option<Shot>,
    /// State of the shaker.
    pub shaker: Shaker,
    /// Present amplitude of its drive, V.
    pub drive_v: f32,
    /// Last measured amplitude of the controlled quantity, m or N; 0 when the drive itself is
    /// controlled.
    pub controlled: f32,
    /// Counters of data sent and lost.
    pub counters: Counters,
}
