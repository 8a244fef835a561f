//! What a response is, and what that makes of an FRF.

use serde::{Deserialize, Serialize};

/// What a response is; an FRF's numerator, per newton of the hammer's force.
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
    /// All of them, each the time derivative of the one before.
    const ALL: [MotionQuantity; 3] =
        [MotionQuantity::Displacement, MotionQuantity::Velocity, MotionQuantity::Acceleration];

    /// The word used in files of records.
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

    /// What an FRF of such a response is called, in files too.
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

    /// How many times the displacement was multiplied by s: 0, 1 or 2.
    pub fn order_of_s(self) -> i32 {
        self as i32
    }
}
