//! Places in space: where hammer and vibrometer go on the two arms.

use serde::Serialize;

/// What a scene holds. Lengths in m; x lateral, y vertical, z horizontal along the sliding direction.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Scene {
    /// Boxes, as a hint of the bodies.
    pub bodies: Vec<Body>,
    /// Places.
    pub spots: Vec<Spot>,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Body {
    /// What it stands for.
    pub role: super::Role,
    /// One corner, m.
    pub low: [f64; 3],
    /// The opposite one, m.
    pub high: [f64; 3],
}

/// A place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spot {
    /// Its name.
    pub name: String,
    /// What it stands for.
    pub role: super::Role,
    /// Where, m.
    pub at: [f64; 3],
    /// The hammer's direction; a response without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toward: Option<[f64; 3]>,
}
