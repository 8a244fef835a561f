//! A structure of a rig's own, instead of the paper's bodies in a row.

use serde::{Deserialize, Serialize};

use super::{BodyName, Bushing, RigidBody};
use crate::rig::Configuration;

/// Any rigid bodies, springs between them, and which two the contact joins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnStructure {
    /// The bodies that the contact joins: of A, then of B.
    pub joint: [BodyName; 2],
    /// The bodies that are hit and measured as A's and B's interface: what lies between them is what substructuring sees.
    pub arms: [BodyName; 2],
    /// The body that the three load cells hold; none without load cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_cells_on: Option<BodyName>,
    /// The bodies.
    pub bodies: Vec<OwnBody>,
    /// What holds them.
    pub springs: Vec<Spring>,
}

impl OwnStructure {
    /// The body of this name.
    pub fn body(&self, name: BodyName) -> Option<&OwnBody> {
        self.bodies.iter().find(|body| body.name == name)
    }
}

/// A substructure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// The first.
    A,
    /// The second.
    B,
}

/// A rigid body of a substructure. (Its fields are a [`RigidBody`]'s once more: serde refuses unknown fields only where none is flattened.)
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnBody {
    /// Its name, unique among bodies.
    pub name: BodyName,
    /// The substructure that it belongs to.
    pub of: Side,
    /// Mass (kg).
    pub mass_kg: f64,
    /// Centre of gravity (m).
    pub cg_m: [f64; 3],
    /// Edge lengths (m) of the homogeneous box that gives the inertia.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub box_m: Option<[f64; 3]>,
    /// Principal inertia Ixx, Iyy, Izz (kg m²); instead of the box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_kg_m2: Option<[f64; 3]>,
}

impl OwnBody {
    /// Mass and inertia.
    pub fn rigid(&self) -> RigidBody {
        RigidBody {
            mass_kg: self.mass_kg,
            cg_m: self.cg_m,
            box_m: self.box_m,
            inertia_kg_m2: self.inertia_kg_m2,
        }
    }
}

/// A spring and dashpot for all six relative motions, between two bodies or from the ground (`ground`) to one. (Its fields are a
/// [`Bushing`]'s, for the same reason.)
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// What it joins.
    pub between: [BodyName; 2],
    /// The configurations that have it; all that have its bodies, where nothing is said.
    #[serde(default = "everywhere", rename = "in")]
    pub present: Vec<Configuration>,
    /// Where (m).
    pub position_m: [f64; 3],
    /// kx, ky, kz (N/m).
    pub stiffness_n_per_m: [f64; 3],
    /// krx, kry, krz (N m/rad).
    pub rotation_nm_per_rad: [f64; 3],
    /// β (s) of c = β k for x, y, z, rx, ry, rz.
    pub damping_s: [f64; 6],
    /// What x, y and z are here: unit vectors at right angles; the rig's own, where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<[[f64; 3]; 3]>,
}

fn everywhere() -> Vec<Configuration> {
    Configuration::ALL.to_vec()
}

impl Spring {
    /// Its bodies; none is the ground.
    pub fn ends(&self) -> [Option<BodyName>; 2] {
        self.between.map(|end| (end.as_str() != "ground").then_some(end))
    }

    /// Where it is, and how stiff.
    pub fn bushing(&self) -> Bushing {
        Bushing {
            position_m: self.position_m,
            stiffness_n_per_m: self.stiffness_n_per_m,
            rotation_nm_per_rad: self.rotation_nm_per_rad,
            damping_s: self.damping_s,
        }
    }
}
