//! What a device answers: the thing asked for, or a refusal that says why.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::channel::{Channel, Name};
use crate::frame::FrameError;
use crate::limits::SENTENCE_BYTES;
use crate::shot::Shot;
use crate::slow::{Slow, SupplyFault};
use crate::sync::{ClockFault, Sync};

/// The answer to the request of the same number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Numbered {
    /// The request's number.
    pub number: u32,
    /// What came of it.
    pub outcome: Result<Answer, Refusal>,
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

/// What was asked for. Variants only ever grow at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Answer {
    /// Who the device is.
    Info(Info),
    /// One channel.
    Channel(Channel),
    /// How the device is.
    Status(Status),
    /// A stream has begun.
    Started {
        /// Its epoch.
        epoch: u32,
        /// Its channel map.
        map: u8,
        /// Index of its first scan.
        first_scan: u64,
    },
    /// Done, nothing to tell.
    Done,
    /// These scans are on their way again.
    Resending {
        /// First scan of the first block.
        first_scan: u64,
        /// Scans in all.
        scans: u32,
    },
    /// The shot is accepted.
    Scheduled {
        /// Its number.
        number: u32,
    },
    /// Hammer and laser are in place from this scan on.
    Staged {
        /// The first scan for which that holds.
        at_scan: u64,
    },
    /// Slow values.
    Slow(Slow),
    /// Clock and edges.
    Sync(Sync),
}

/// Why a request was not carried out. Variants only ever grow at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Refusal {
    /// This board cannot do that.
    Unsupported,
    /// The request could not be read.
    Unreadable,
    /// The request's number is older than the memory of answers.
    Stale,
    /// There is no such channel.
    NoSuchChannel,
    /// No stream is running.
    NotStreaming,
    /// Another stream runs.
    WrongEpoch {
        /// The epoch that runs.
        current: u32,
    },
    /// The ring no longer holds what was asked for.
    Gone {
        /// The oldest scan that it holds.
        oldest: u64,
    },
    /// The hammer is not armed.
    NotArmed,
    /// The hammer has a shot in hand.
    Busy,
    /// The interlock is open.
    Interlock,
    /// The emergency stop is latched: re-arm at the rig.
    EmergencyStop,
    /// The shaker runs.
    ShakerRuns,
    /// The coil pulse is zero or over the cap.
    PulseOutOfBounds {
        /// The longest allowed, µs.
        cap_us: u32,
    },
    /// This shot number was used before.
    ShotRepeated {
        /// The last number used.
        last: u32,
    },
    /// A value is outside its bounds, or not finite.
    OutOfBounds(String<SENTENCE_BYTES>),
    /// The stage cannot go there.
    Stage(String<SENTENCE_BYTES>),
    /// The hammer is armed, or has a shot in hand.
    HammerArmed,
    /// The constant-current supply of the channel that this needs finds no sensor.
    Supply {
        /// The channel's place in the scan.
        channel: u8,
        /// What it finds.
        fault: SupplyFault,
    },
    /// The clock that the scans are to have is not good, or not known to be.
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

/// Who the device is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Info {
    /// Name of the board.
    pub board: Name,
    /// Serial number.
    pub serial: Name,
    /// Firmware version, semantic.
    pub version: Name,
    /// Target triple that the firmware was built for.
    pub target: String<40>,
    /// Identifies the build, and with it the table of log strings.
    pub build: u64,
    /// Channels in a scan.
    pub channels: u8,
    /// Scans per second.
    pub scan_rate_hz: u32,
    /// Scans that can be sent again.
    pub ring_scans: u32,
    /// Longest coil pulse, µs.
    pub coil_cap_us: u32,
    /// Whether it can be told where hammer and laser are.
    pub stage: bool,
    /// Full scale of the shaker's drive, V; 0 without a shaker.
    pub drive_v: f32,
    /// Why it started last.
    pub reset: Reset,
}

/// Why a device started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reset {
    /// It does not say.
    #[default]
    Unknown,
    /// Power came.
    Power,
    /// The button, or a debugger's reset line.
    Pin,
    /// Its program, after a panic or a fault, or a debugger.
    Software,
    /// A watchdog: its program hung.
    Watchdog,
    /// Its supply was too low for a moment.
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
    /// What the simulated rig in a process calls its board.
    pub const VIRTUAL_BOARD: &'static str = "jointrig-sim";
    /// What the emulated board calls itself, which measures a simulated rig too.
    pub const EMULATED_BOARD: &'static str = "mps2-an505";
}

/// What the hammer does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Hammer {
    /// No shot is allowed.
    Disarmed,
    /// One shot is allowed until the arming expires.
    Armed,
    /// A shot waits for its scan or for quiet.
    Waiting,
    /// The coil is on, or the bolt flies.
    Firing,
    /// Pulse and rebounds are being followed.
    Listening,
    /// The hammer rests before the next arming.
    HoldOff,
}

/// What the shaker does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Shaker {
    /// Nothing.
    Resting,
    /// The amplitude is on its way to what was ordered.
    Slewing,
    /// The amplitude is what was ordered.
    Steady,
    /// The amplitude is on its way to rest.
    Stopping,
}

/// Counters since the device started. They never go back within a boot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Counters {
    /// Good frames received.
    pub frames_in: u32,
    /// Frames received that were damaged or unknown.
    pub frames_bad: u32,
    /// Scans produced in this stream.
    pub scans_produced: u64,
    /// Scans sent for the first time in this stream.
    pub scans_sent: u64,
    /// Scans sent again in this stream.
    pub scans_resent: u64,
    /// Scans that left the ring unsent in this stream: lost, and reported as ranges.
    pub scans_dropped: u64,
    /// Scans that the front end failed to deliver in this stream.
    pub scans_missed: u64,
    /// Events that were dropped because their queue was full.
    pub events_dropped: u32,
    /// Log frames that were dropped.
    pub logs_dropped: u32,
}

/// How the device is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// Epoch of the stream that runs, or of the last one.
    pub epoch: u32,
    /// Whether a stream runs.
    pub streaming: bool,
    /// The next scan that will be produced.
    pub next_scan: u64,
    /// The oldest scan that can be sent again.
    pub oldest_scan: u64,
    /// What the hammer does.
    pub hammer: Hammer,
    /// Remaining arming, ms.
    pub armed_for_ms: u32,
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// Whether the emergency stop is latched.
    pub emergency_stop: bool,
    /// Friction force of the last block, N: mean of the load cells through their calibration matrix.
    pub friction_n: f32,
    /// The last shot, if any.
    pub shot: Option<Shot>,
    /// What the shaker does.
    pub shaker: Shaker,
    /// Amplitude of its drive now, V.
    pub drive_v: f32,
    /// Amplitude that was last measured of what is controlled, m or N; 0 when the drive itself is.
    pub controlled: f32,
    /// What was sent and lost.
    pub counters: Counters,
}
