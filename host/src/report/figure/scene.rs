//! Positions in space: where hammer and vibrometer are placed on the two arms.

use serde::Serialize;

/// Contents of a scene. Lengths in m; x lateral, y vertical, z horizontal along the sliding
/// direction.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Scene {
    /// Boxes that outline the bodies.
    pub bodies: Vec<Body>,
    /// Positions.
    pub spots: Vec<Spot>,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Body {
    /// What it represents.
    pub role: super::Role,
    /// One corner, m.
    pub low: [f64; 3],
    /// The opposite corner, m.
    pub high: [f64; 3],
}

/// A position.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spot {
    /// Its name.
    pub name: String,
    /// What it represents.
    pub role: super::Role,
    /// The position, m.
    pub at: [f64; 3],
    /// The hammer's direction; absent for a response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toward: Option<[f64; 3]>,
}
