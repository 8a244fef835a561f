//! What a response is, and what it makes of an FRF.

use serde::{Deserialize, Serialize};
use std::fmt;

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

/// What an FRF's numerator is, per newton of the hammer's force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Displacement per force, m/N.
    Receptance,
    /// Velocity per force, m/(s N).
    Mobility,
    /// Acceleration per force, m/(s² N).
    Accelerance,
}

impl Quantity {
    /// How many times the receptance was multiplied by s: 0, 1 or 2.
    pub fn order_of_s(self) -> i32 {
        match self {
            Quantity::Receptance => 0,
            Quantity::Mobility => 1,
            Quantity::Accelerance => 2,
        }
    }

    /// The word used in files.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Receptance => "receptance",
            Quantity::Mobility => "mobility",
            Quantity::Accelerance => "accelerance",
        }
    }

    /// The quantity called `name` in a file, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        [Quantity::Receptance, Quantity::Mobility, Quantity::Accelerance]
            .into_iter()
            .find(|q| q.name() == name.trim().to_lowercase())
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
