//! One shot of the hammer, from the request to the measured force pulse.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Phase of a shot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// Accepted; waits for its scan and for the structure to be quiet.
    Waiting,
    /// The coil is on, or the bolt is in flight.
    Firing,
    /// The force exceeded the trigger level; pulse and rebounds are being recorded.
    Listening,
    /// Complete.
    Done,
    /// The bolt did not reach the structure within the flight time
    /// ([`crate::request::Trigger::flight_scans`]).
    Missed,
    /// The structure did not become quiet within the time given; the coil was not energised.
    NotQuiet,
    /// Cancelled before the coil was energised (disarmed, link lost, emergency stop, arming
    /// expired).
    Cancelled,
}

/// Known data of one shot. All times are scan indices of the current epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Shot {
    /// The host's shot number, increasing.
    pub number: u32,
    /// Present phase.
    pub phase: Phase,
    /// First scan with the coil on (0 before that).
    pub fired_at: u64,
    /// First scan above the trigger level (0 before that).
    pub trigger: u64,
    /// Requested length of the coil pulse, µs.
    pub pulse_us: u32,
    /// Largest force of the first contact, N, from a parabola through the three largest samples.
    pub peak_n: f32,
    /// Time above half of the peak in the first contact, µs.
    pub width_us: f32,
    /// Largest later contact as a fraction of the peak (0 if there was none).
    pub rebound_ratio: f32,
    /// Scans from trigger to that contact.
    pub rebound_after: u32,
    /// Largest friction force |T| while listening, N: from the load cells, corrected with their
    /// calibration matrix.
    pub friction_peak_n: f32,
    /// The largest ratio of residual motion to its limit when the shot was released (or abandoned).
    pub quiet_ratio: f32,
}
