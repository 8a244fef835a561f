//! Impact records: what the hammer and the sensors gave, before any processing.

use crate::substructuring::frf::Quantity;
use serde::{Deserialize, Serialize};

/// What a response channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionQuantity {
    /// m.
    Displacement,
    /// m/s.
    Velocity,
    /// m/s².
    Acceleration,
}

impl MotionQuantity {
    /// The word used in files.
    pub fn name(self) -> &'static str {
        match self {
            MotionQuantity::Displacement => "displacement",
            MotionQuantity::Velocity => "velocity",
            MotionQuantity::Acceleration => "acceleration",
        }
    }

    /// The quantity called `name`, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        [MotionQuantity::Displacement, MotionQuantity::Velocity, MotionQuantity::Acceleration]
            .into_iter()
            .find(|q| q.name() == name.trim().to_lowercase())
    }

    /// What an FRF of such a response is called.
    pub fn frf(self) -> Quantity {
        match self {
            MotionQuantity::Displacement => Quantity::Receptance,
            MotionQuantity::Velocity => Quantity::Mobility,
            MotionQuantity::Acceleration => Quantity::Accelerance,
        }
    }
}

/// Hits of one impact position with the same response channels.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactRecords {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Hammer force \[hit\]\[sample\], N.
    pub force_n: Vec<Vec<f64>>,
    /// Responses \[hit\]\[channel\]\[sample\], SI.
    pub response: Vec<Vec<Vec<f64>>>,
    /// What the responses are.
    pub quantity: MotionQuantity,
}
