//! What a host may ask. Every request has a number; a repeated number is answered from memory and does
//! nothing twice, and every actuator request is bounded before it is accepted.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::channel::Name;
use crate::limits::MAX_CHANNELS;
use crate::sync::Clock;

/// A numbered request. Numbers increase within a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Numbered {
    /// The request's number within the session.
    pub number: u32,
    /// What is asked.
    pub request: Request,
}

impl Numbered {
    /// Reads a frame's payload. Not generic, so that its code is this crate's and not each caller's.
    ///
    /// # Errors
    /// [`Unreadable`], with the number where that can be read: postcard writes it first.
    pub fn read(payload: &[u8]) -> Result<Self, Unreadable> {
        postcard::from_bytes(payload)
            .map_err(|_| Unreadable(postcard::take_from_bytes(payload).ok().map(|(number, _)| number)))
    }
}

/// A request of which at most the number can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreadable(pub Option<u32>);

/// What is asked. Variants only ever grow at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Request {
    /// Who are you? → [`crate::answer::Answer::Info`]
    Info,
    /// Describe one channel. → [`crate::answer::Answer::Channel`]
    Channel {
        /// Place in the scan, from 0.
        index: u8,
    },
    /// How are you? → [`crate::answer::Answer::Status`]
    Status,
    /// Begin a new stream of sample blocks. → [`crate::answer::Answer::Started`]
    Start,
    /// End the stream; the ring keeps what it has. → [`crate::answer::Answer::Done`]
    Stop,
    /// Send blocks again that hold these scans. → [`crate::answer::Answer::Resending`]
    Resend {
        /// Which stream.
        epoch: u32,
        /// First scan wanted.
        first_scan: u64,
        /// How many.
        scans: u32,
    },
    /// How the force pulse is recognised. → [`crate::answer::Answer::Done`]
    Trigger(Trigger),
    /// The load cells' calibration matrix, row-major: forces (N) = matrix × readings (N). → `Done`
    LoadCells {
        /// 3 × 3, dimensionless.
        matrix: [f32; 9],
    },
    /// Allow one shot within this time; replaces an earlier arming. → `Done`
    Arm {
        /// At most [`crate::limits::ARM_VALID_CAP_MS`].
        valid_ms: u32,
    },
    /// Take back arming and any shot whose coil is not on yet. → `Done`
    Disarm,
    /// One shot. → [`crate::answer::Answer::Scheduled`]
    Fire(Fire),
    /// Where hammer and laser are (virtual rigs only). → [`crate::answer::Answer::Staged`]
    Stage(Stage),
    /// Stop everything that moves; only a local action at the rig re-arms. → `Done`
    EmergencyStop,
    /// A sine from the shaker, for a bounded time; while it runs, another amplitude, frequency or time. → `Done`
    Shake(Shake),
    /// Bring the shaker to rest, over a ramp. → `Done`
    Rest,
    /// By which scales the device judges trigger, quiet, limits and amplitudes in this session, instead of those that it was built
    /// with. What it says of its channels ([`Request::Channel`]) stays, and so do the samples. → `Done`
    ///
    /// Refused while the hammer is armed or the shaker moves. Forgotten when the session ends. Since protocol 1.1.
    Scales {
        /// SI units per volt, sign included, of every channel in order; each not zero, and within a factor of
        /// [`crate::limits::SCALE_FACTOR_CAP`] of what it was built with.
        units_per_volt: Vec<f32, MAX_CHANNELS>,
    },
    /// Temperature and sensor supplies as they were measured last. → [`crate::answer::Answer::Slow`]. Since protocol 1.1.
    Slow,
    /// What is to time the scans. It is measured before anything can be started by it: ask [`Request::Sync`] until its fault is not
    /// [`crate::sync::ClockFault::Unproven`] any more. → `Done`
    ///
    /// Refused while a stream runs. Forgotten when the session ends. Since protocol 1.2.
    Clock(Clock),
    /// Clock and edges as they are now. → [`crate::answer::Answer::Sync`]. Since protocol 1.2.
    Sync,
    /// One pulse of the sync output, as soon as it can be; its instant comes as [`crate::event::Event::Edge`]. → `Done`. Since protocol 1.2.
    Mark,
}

/// How the force pulse is recognised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Trigger {
    /// Force that counts as contact, N.
    pub level_n: f32,
    /// How long to wait for contact after the coil goes off, scans.
    pub flight_scans: u32,
    /// How long to watch for rebounds after the trigger, scans.
    pub listen_scans: u32,
    /// How long the hammer rests after a shot, scans.
    pub hold_off_scans: u32,
}

/// One shot of the hammer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Fire {
    /// The host's number for it, larger than any before in this session.
    pub number: u32,
    /// Coil pulse, µs; refused when over the board's cap.
    pub pulse_us: u32,
    /// The coil stays off before this scan.
    pub not_before: u64,
    /// Residual motion allowed in the quiet window, one limit per channel in the channel's unit (rms);
    /// 0 leaves a channel out. See [`Fire::quiet_window`].
    pub quiet_limits: Vec<f32, MAX_CHANNELS>,
    /// Length of the windows in which residual motion is judged, in decimated samples (0: not judged).
    pub quiet_window: u16,
    /// Give up when the structure is not quiet after this many scans from `not_before`.
    pub quiet_patience: u32,
}

/// What the shaker's order holds constant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Control {
    /// The drive itself.
    Drive,
    /// The relative displacement of the specimens, from their two vibrometers.
    Displacement {
        /// Amplitude, m.
        amplitude_m: f32,
    },
    /// The excitation's force.
    Force {
        /// Amplitude, N.
        amplitude_n: f32,
    },
}

/// A sine from the shaker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Shake {
    /// Turn per scan, in parts of 2³²: frequency × 2³² / scan rate. So the frequency is exact to the scans'
    /// clock, and a change of it keeps the phase.
    pub step: u32,
    /// What has which amplitude.
    pub control: Control,
    /// The drive's amplitude, V, and when something else is controlled the drive's largest; refused when over the
    /// board's full scale.
    pub amplitude_v: f32,
    /// How fast the amplitude goes there, V/s; refused when faster than full scale in
    /// [`crate::limits::SHAKE_RAMP_MS`].
    pub slew_v_per_s: f32,
    /// How long it holds, ms: at most [`crate::limits::SHAKE_VALID_CAP_MS`]. Then the shaker comes to rest, over
    /// a ramp, unless it was ordered anew.
    pub valid_ms: u32,
    /// Magnitudes that bring the shaker to rest, one per channel in the channel's unit; 0 leaves a channel out.
    pub limits: Vec<f32, MAX_CHANNELS>,
}

impl Shake {
    /// The turn per scan that makes `frequency_hz` at `scan_rate_hz`, to 2⁻³³ of a turn.
    #[must_use]
    pub fn step_of(frequency_hz: f64, scan_rate_hz: u32) -> u32 {
        // a negative or too large frequency saturates, and the device refuses it
        (frequency_hz / f64::from(scan_rate_hz) * 4_294_967_296.0 + 0.5) as u32
    }
}

/// A configuration of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Configuration {
    /// Substructure A alone.
    A,
    /// Substructure B alone.
    B,
    /// The assembly with its joint.
    Ajb,
}

/// Where hammer and laser are.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Stage {
    /// Which structure hangs in the rig.
    pub configuration: Configuration,
    /// Name of the impact point.
    pub impact: Name,
    /// Name of the response point.
    pub response: Name,
    /// Number of the next attempt in this cell, from 0.
    pub attempt: u32,
}
