//! The configuration of the rig (A, B or the assembly), and the names of the rigid bodies that each
//! has.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

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
        if body == BodyName::KnownMass {
            return false;
        }
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

/// The body that a point is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// The free body of known mass beside the rig.
    KnownMass,
    /// A body of a rig that defines its own structure.
    Own(OwnName),
}

/// The bodies of the paper's rig, and the known mass beside it.
const PAPERS: [BodyName; 6] = [
    BodyName::Mass,
    BodyName::ArmA,
    BodyName::SpecimenA,
    BodyName::ArmB,
    BodyName::SpecimenB,
    BodyName::KnownMass,
];

impl BodyName {
    /// The fixed end of a spring.
    pub(super) const GROUND: Self =
        Self::Own(OwnName { bytes: *b"ground\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", length: 6 });

    /// The name in rig files.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Mass => "mass",
            Self::ArmA => "arm_a",
            Self::SpecimenA => "specimen_a",
            Self::ArmB => "arm_b",
            Self::SpecimenB => "specimen_b",
            Self::KnownMass => "known_mass",
            Self::Own(name) => name.as_str(),
        }
    }

    /// Whether it is one of the two specimens.
    pub fn is_specimen(self) -> bool {
        matches!(self, Self::SpecimenA | Self::SpecimenB)
    }
}

impl fmt::Display for BodyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl Serialize for BodyName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for BodyName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        if let Some(known) = PAPERS.into_iter().find(|name| name.as_str() == text) {
            return Ok(known);
        }
        OwnName::new(&text).map(Self::Own).ok_or_else(|| {
            D::Error::custom(format!(
                "the body's name {text:?} is empty or has more than {} bytes",
                OwnName::MOST
            ))
        })
    }
}

/// A body name, `Copy` because every point stores one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct OwnName {
    bytes: [u8; Self::MOST],
    length: u8,
}

impl OwnName {
    /// Maximum length of a name, bytes.
    pub const MOST: usize = 24;

    /// `None` for a name that is empty or too long.
    pub fn new(text: &str) -> Option<Self> {
        let mut bytes = [0; Self::MOST];
        bytes.get_mut(..text.len())?.copy_from_slice(text.as_bytes());
        let length = u8::try_from(text.len()).ok().filter(|length| *length > 0)?;
        Some(Self { bytes, length })
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        // always valid UTF-8: constructed from a whole `str`
        std::str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }
}

impl fmt::Debug for OwnName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}
