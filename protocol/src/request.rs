//! Requests of the host. Every request has a number; a repeated number is answered from stored
//! replies without acting again, and every actuator request is checked against its bounds before it
//! is accepted.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::channel::Name;
use crate::limits::CHANNEL_CAPACITY;
use crate::sync::Clock;

/// A numbered request. Numbers increase within a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Numbered {
    /// The request's number within the session.
    pub number: u32,
    /// The request.
    pub request: Request,
}

impl Numbered {
    /// Decodes a frame's payload. Not generic, so that its code is compiled in this crate and not
    /// once per caller.
    ///
    /// # Errors
    /// [`Unreadable`], with the number if that is readable: postcard writes it first.
    pub fn read(payload: &[u8]) -> Result<Self, Unreadable> {
        postcard::from_bytes(payload)
            .map_err(|_| Unreadable(postcard::take_from_bytes(payload).ok().map(|(number, _)| number)))
    }
}

/// A request of which at most the number could be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreadable(pub Option<u32>);

/// What is requested. New variants are only ever added at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Request {
    /// Identity and properties of the device. → [`crate::answer::Answer::Info`]
    Info,
    /// Describe one channel. → [`crate::answer::Answer::Channel`]
    Channel {
        /// Index in the scan, from 0.
        index: u8,
    },
    /// State of the device. → [`crate::answer::Answer::Status`]
    Status,
    /// Begin a new stream of sample blocks. → [`crate::answer::Answer::Started`]
    Start,
    /// End the stream; the ring keeps its content. → [`crate::answer::Answer::Done`]
    Stop,
    /// Retransmit the blocks that contain these scans. → [`crate::answer::Answer::Resending`]
    Resend {
        /// Session epoch of the stream.
        epoch: u32,
        /// First scan requested.
        first_scan: u64,
        /// Number of scans.
        scans: u32,
    },
    /// Set how the force pulse is recognised. → [`crate::answer::Answer::Done`]
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
    /// Cancel the arming and any shot whose coil is not on yet. → `Done`
    Disarm,
    /// Fire one shot. → [`crate::answer::Answer::Scheduled`]
    Fire(Fire),
    /// Set the positions of hammer and laser (virtual rigs only). →
    /// [`crate::answer::Answer::Staged`]
    Stage(Stage),
    /// Emergency stop: stop everything that moves; only a local action at the rig re-arms. → `Done`
    EmergencyStop,
    /// Run the shaker with a sine for a bounded time; while it runs, change amplitude, frequency or
    /// time. → `Done`
    Shake(Shake),
    /// Bring the shaker to rest over a ramp. → `Done`
    Rest,
    /// Set the scales with which the device evaluates trigger, quiet, limits and amplitudes in this
    /// session, instead of the built-in ones. The channel descriptions ([`Request::Channel`]) and
    /// the samples are unaffected. → `Done`
    ///
    /// Refused while the hammer is armed or the shaker moves. Reset when the session ends. Since
    /// protocol 1.1.
    Scales {
        /// SI units per volt, sign included, of every channel in order; each nonzero, and within a
        /// factor of [`crate::limits::SCALE_FACTOR_CAP`] of the built-in value.
        units_per_volt: Vec<f32, CHANNEL_CAPACITY>,
    },
    /// Last measured temperature and sensor supplies. → [`crate::answer::Answer::Slow`]. Since
    /// protocol 1.1.
    Slow,
    /// Select the clock that times the scans. It is measured before anything can be started with
    /// it: send [`Request::Sync`] until its fault is no longer
    /// [`crate::sync::ClockFault::Unproven`]. → `Done`
    ///
    /// Refused while a stream runs. Reset when the session ends. Since protocol 1.2.
    Clock(Clock),
    /// Present state of clock and edges. → [`crate::answer::Answer::Sync`]. Since protocol 1.2.
    Sync,
    /// Emit one pulse at the sync output as soon as possible; its instant is reported as
    /// [`crate::event::Event::Edge`]. → `Done`. Since protocol 1.2.
    Mark,
}

/// How the force pulse is recognised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Trigger {
    /// Force above which contact is recognised, N.
    pub level_n: f32,
    /// How long to wait for contact after the coil is switched off, scans.
    pub flight_scans: u32,
    /// How long to watch for rebounds after the trigger, scans.
    pub listen_scans: u32,
    /// How long the hammer is held off after a shot, scans.
    pub hold_off_scans: u32,
}

/// One shot of the hammer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Fire {
    /// The host's shot number, larger than any before in this session.
    pub number: u32,
    /// Coil pulse, µs; refused when it exceeds the board's cap.
    pub pulse_us: u32,
    /// The coil stays off before this scan.
    pub not_before: u64,
    /// Residual motion allowed in the quiet window, one limit per channel in the channel's unit
    /// (rms); 0 excludes a channel. See [`Fire::quiet_window`].
    pub quiet_limits: Vec<f32, CHANNEL_CAPACITY>,
    /// Length of the windows in which residual motion is evaluated, in decimated samples (0: not
    /// evaluated).
    pub quiet_window: u16,
    /// The shot is abandoned when the structure is not quiet within this many scans from
    /// `not_before`.
    pub quiet_patience: u32,
}

/// The quantity that a shaker request holds constant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Control {
    /// The drive itself.
    Drive,
    /// The relative displacement of the specimens, from their two vibrometers.
    Displacement {
        /// Amplitude, m.
        amplitude_m: f32,
    },
    /// The excitation force.
    Force {
        /// Amplitude, N.
        amplitude_n: f32,
    },
}

/// A sine from the shaker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Shake {
    /// Phase increment per scan, in units of 2⁻³² turn: frequency × 2³² / scan rate. The frequency
    /// is thus exact relative to the scan clock, and a change of frequency keeps the phase
    /// continuous.
    pub step: u32,
    /// The controlled quantity and its amplitude.
    pub control: Control,
    /// Amplitude of the drive, V; when another quantity is controlled, the largest amplitude of the
    /// drive. Refused when it exceeds the board's full scale.
    pub amplitude_v: f32,
    /// Slew rate of the amplitude, V/s; refused when faster than full scale in
    /// [`crate::limits::SHAKE_RAMP_MS`].
    pub slew_v_per_s: f32,
    /// Validity, ms: at most [`crate::limits::SHAKE_VALID_CAP_MS`]. Afterwards the shaker comes to
    /// rest over a ramp, unless the request was renewed.
    pub valid_ms: u32,
    /// Magnitudes above which the shaker is brought to rest, one per channel in the channel's unit;
    /// 0 excludes a channel.
    pub limits: Vec<f32, CHANNEL_CAPACITY>,
}

impl Shake {
    /// The phase increment per scan for `frequency_hz` at `scan_rate_hz`, rounded to within 2⁻³³ of
    /// a turn.
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

/// Positions of hammer and laser.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Stage {
    /// Which structure is mounted in the rig.
    pub configuration: Configuration,
    /// Name of the impact point.
    pub impact: Name,
    /// Name of the response point.
    pub response: Name,
    /// Number of the next attempt in this cell, from 0.
    pub attempt: u32,
}
