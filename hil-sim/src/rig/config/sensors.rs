//! Scales, noise and delays of the ten channels.

use serde::{Deserialize, Serialize};

/// All sensors. A channel reads volts × `units_per_volt`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Converter range, ± this (V).
    pub range_v: f64,
    /// The hammer's force cell.
    pub force: ForceSensor,
    /// The 3-D vibrometer: x, y, z.
    pub vibrometer: Vibrometer,
    /// Single-point vibrometer at specimen A.
    pub ldv_a: SpotVibrometer,
    /// Single-point vibrometer at arm B's specimen.
    pub ldv_b: SpotVibrometer,
    /// The three load cells.
    pub load_cells: LoadCells,
    /// The shaker's force cell.
    pub excitation: Excitation,
    /// Vibrometers fixed to one point; none in the default rig.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<FixedVibrometer>,
}

/// A vibrometer fixed to a response point: one channel along one direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedVibrometer {
    /// Its channel's name.
    pub name: String,
    /// The response point at which it measures.
    pub response: String,
    /// Measured direction (any length; the sign counts).
    pub direction: [f64; 3],
    /// m/s per V.
    pub units_per_volt: f64,
    /// White noise floor ((m/s)/√Hz) up to half the scan rate.
    pub floor: f64,
    /// Delay of the signal (s).
    #[serde(default)]
    pub delay_s: f64,
    /// 1 or −1.
    #[serde(default = "upright")]
    pub polarity: i8,
}

fn upright() -> i8 {
    1
}

/// The hammer's force cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceSensor {
    /// N per V.
    pub units_per_volt: f64,
    /// Noise (N rms).
    pub noise_n: f64,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
    /// Amplitude of the ringing that a hit of nominal duration excites, relative to the hit's peak.
    pub ring_fraction: f64,
    /// The ringing's frequency (Hz).
    pub ring_hz: f64,
    /// The ringing's decay time (s).
    pub ring_decay_s: f64,
}

/// The 3-D vibrometer; arrays are x, y, z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vibrometer {
    /// m/s per V.
    pub units_per_volt: f64,
    /// White noise floor ((m/s)/√Hz) up to half the scan rate.
    pub floor: f64,
    /// Delay of each axis (s).
    pub delay_s: [f64; 3],
    /// 1 or −1.
    pub polarity: [i8; 3],
    /// Additional noise of a speckled point.
    pub speckle: SpeckleNoise,
}

/// Noise of a speckled response point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeckleNoise {
    /// Factor by which the floor is higher.
    pub floor_factor: f64,
    /// Mean rate at which dropouts begin (1/s).
    pub dropouts_per_s: f64,
    /// Their mean duration (s), in which the signal is lost.
    pub dropout_s: f64,
    /// Ratio of the floor within a dropout to the ordinary one.
    pub dropout_floor_factor: f64,
}

/// A single-point vibrometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpotVibrometer {
    /// m/s per V.
    pub units_per_volt: f64,
    /// White noise floor ((m/s)/√Hz) up to half the scan rate.
    pub floor: f64,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
}

/// The three load cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadCells {
    /// N per V.
    pub units_per_volt: f64,
    /// Noise of each (N rms).
    pub noise_n: f64,
    /// Delay of each (s).
    pub delay_s: [f64; 3],
    /// 1 or −1.
    pub polarity: [i8; 3],
}

/// The shaker's force cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excitation {
    /// N per V.
    pub units_per_volt: f64,
    /// Noise (N rms).
    pub noise_n: f64,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
}
