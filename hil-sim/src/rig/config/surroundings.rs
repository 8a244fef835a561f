//! What is around the structure: the specimen's temperature, and the cables of the sensors that are fed with a constant current.

use serde::{Deserialize, Serialize};

/// Around the structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surroundings {
    /// Temperature of the specimen at the start (°C).
    pub temperature_c: f64,
    /// By how much it rises (K/s).
    pub warming_k_per_s: f64,
    /// The hammer's force cell at its supply.
    pub force_cable: Cable,
    /// The shaker's force cell at its supply.
    pub excitation_cable: Cable,
}

/// What a constant-current supply finds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cable {
    /// A sensor.
    Sensor,
    /// Nothing.
    Open,
    /// A short.
    Short,
}

impl Cable {
    /// Mean voltage at the socket (V): of a sensor in the middle of what such sensors have, of an open socket what a supply of 24 V
    /// leaves behind its current source, of a short the wire's.
    #[must_use]
    pub fn bias_v(self) -> f32 {
        match self {
            Self::Sensor => 11.0,
            Self::Open => 22.5,
            Self::Short => 0.1,
        }
    }
}
