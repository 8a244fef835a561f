//! Surroundings of the structure: the specimen's temperature, and the cables of the sensors with
//! constant-current supplies.

use serde::{Deserialize, Serialize};

/// Surroundings of the structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surroundings {
    /// Temperature of the specimen at the start (°C).
    pub temperature_c: f64,
    /// Rate at which it rises (K/s).
    pub warming_k_per_s: f64,
    /// State of the cable of the hammer's force cell.
    pub force_cable: Cable,
    /// State of the cable of the shaker's force cell.
    pub excitation_cable: Cable,
}

/// What a constant-current supply detects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cable {
    /// A sensor.
    Sensor,
    /// An open circuit.
    Open,
    /// A short circuit.
    Short,
}

impl Cable {
    /// Mean voltage at the socket (V): for a sensor the middle of the usual bias range, for an open
    /// socket the voltage of a 24 V supply behind its current source, for a short the voltage drop
    /// of the wire.
    #[must_use]
    pub fn bias_v(self) -> f32 {
        match self {
            Self::Sensor => 11.0,
            Self::Open => 22.5,
            Self::Short => 0.1,
        }
    }
}
