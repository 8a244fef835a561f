//! Scales, noise and delays of the ten channels.

use serde::{Deserialize, Serialize};

/// All sensors. A channel reads volts × `units_per_volt`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Converters span ± this (V).
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
    /// Vibrometers that stay at a point; none in the default rig.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<FixedVibrometer>,
}

/// A vibrometer that stays at a response point: one channel along one direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedVibrometer {
    /// Its channel's name.
    pub name: String,
    /// The response point at which it looks.
    pub response: String,
    /// What it feels (any length; sign included).
    pub direction: [f64; 3],
    /// m/s per V.
    pub units_per_volt: f64,
    /// White noise floor ((m/s)/√Hz) up to half the scan rate.
    pub floor: f64,
    /// How late the signal is (s).
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
    /// How late the signal is (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
    /// Ringing that the onset of a hit of nominal width starts, over the hit's peak.
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
    /// How late each axis is (s).
    pub delay_s: [f64; 3],
    /// 1 or −1.
    pub polarity: [i8; 3],
    /// What a speckled point adds.
    pub speckle: SpeckleNoise,
}

/// Noise of a speckled response point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeckleNoise {
    /// The floor is this many times higher.
    pub floor_factor: f64,
    /// Dropouts begin at this mean rate (1/s).
    pub dropouts_per_s: f64,
    /// Their mean duration (s); the signal is lost meanwhile.
    pub dropout_s: f64,
    /// The floor within a dropout, over the ordinary one.
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
    /// How late the signal is (s).
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
    /// How late each is (s).
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
    /// How late the signal is (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
}
