//! The names of the rigid bodies.

use serde::{Deserialize, Serialize};

/// Which body a point sits on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyName {
    /// The moving mass (substructure A).
    Mass,
    /// Arm A (substructure A).
    ArmA,
    /// Specimen A (substructure A); arm A itself when the clamp is rigid.
    SpecimenA,
    /// Arm B (substructure B), with its specimen when that clamp is rigid.
    ArmB,
    /// Specimen B (substructure B); arm B itself when the clamp is rigid.
    SpecimenB,
}

impl BodyName {
    /// As rig files write it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::ArmA => "arm_a",
            Self::SpecimenA => "specimen_a",
            Self::ArmB => "arm_b",
            Self::SpecimenB => "specimen_b",
        }
    }

    /// Whether it is one of the two specimens.
    pub fn is_specimen(self) -> bool {
        matches!(self, Self::SpecimenA | Self::SpecimenB)
    }
}
