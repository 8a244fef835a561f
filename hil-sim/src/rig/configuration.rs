//! The configuration of the rig: A, B or the assembly.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::body::BodyName;

/// A configuration of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Configuration {
    /// Moving mass, arm A and its specimen; specimen B removed.
    A,
    /// Arm B with its specimen; specimen A removed.
    B,
    /// Both, joined by the contact.
    #[serde(rename = "AJB")]
    Ajb,
}

impl Configuration {
    /// All three.
    pub const ALL: [Self; 3] = [Self::A, Self::B, Self::Ajb];

    /// `A`, `B` or `AJB`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::Ajb => "AJB",
        }
    }

    /// Whether the paper's rig has `body` in this configuration.
    pub(super) fn has(self, body: BodyName) -> bool {
        let of_b = matches!(body, BodyName::ArmB | BodyName::SpecimenB);
        match self {
            Self::A => !of_b,
            Self::B => of_b,
            Self::Ajb => true,
        }
    }
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// The kind of frequency response function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Displacement per force (m/N).
    Receptance,
    /// Velocity per force (m/(s N)).
    Mobility,
    /// Acceleration per force (m/(s² N)).
    Accelerance,
}
