//! The quantity of a response, and the corresponding type of FRF.

use serde::{Deserialize, Serialize};

/// The quantity of a response: the numerator of an FRF, per newton of the hammer's force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionQuantity {
    /// m; per force a receptance, m/N.
    Displacement,
    /// m/s; per force a mobility, m/(s N).
    Velocity,
    /// m/s²; per force an accelerance, m/(s² N).
    Acceleration,
}

impl MotionQuantity {
    /// All quantities, each the time derivative of the one before.
    const ALL: [MotionQuantity; 3] =
        [MotionQuantity::Displacement, MotionQuantity::Velocity, MotionQuantity::Acceleration];

    /// The name used in record files.
    pub fn name(self) -> &'static str {
        match self {
            MotionQuantity::Displacement => "displacement",
            MotionQuantity::Velocity => "velocity",
            MotionQuantity::Acceleration => "acceleration",
        }
    }

    /// The quantity called `name`, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name.trim().to_lowercase())
    }

    /// Name of the FRF of such a response, also used in files.
    pub fn frf_name(self) -> &'static str {
        match self {
            MotionQuantity::Displacement => "receptance",
            MotionQuantity::Velocity => "mobility",
            MotionQuantity::Acceleration => "accelerance",
        }
    }

    /// The quantity whose FRFs are called `name`, if there is one.
    pub fn from_frf_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.frf_name() == name.trim().to_lowercase())
    }

    /// Power of s by which the displacement is multiplied: 0, 1 or 2.
    pub fn order_of_s(self) -> i32 {
        self as i32
    }
}
