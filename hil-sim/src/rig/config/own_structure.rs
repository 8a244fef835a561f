//! A user-defined structure, which replaces the paper's chain of bodies.

use serde::{Deserialize, Serialize};

use super::{Beam, BodyName, Bushing, RigidBody};
use crate::rig::Configuration;

/// Any bodies, the springs between them, and the two bodies that the contact joins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnStructure {
    /// The bodies that the contact joins: A's, then B's.
    pub joint: [BodyName; 2],
    /// The bodies that are hit and measured as A's and B's interfaces: substructuring identifies
    /// what lies between them.
    pub arms: [BodyName; 2],
    /// The body that the three load cells support; `None` without load cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_cells_on: Option<BodyName>,
    /// The two bodies between which the load cells are, instead: each reads its spring force, kz
    /// times the second body's motion along z minus the first's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_cells_between: Option<[BodyName; 2]>,
    /// The bodies.
    pub bodies: Vec<OwnBody>,
    /// Supports and connections.
    pub springs: Vec<Spring>,
}

impl OwnStructure {
    /// The body with this name.
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

/// A body of a substructure. (It repeats the fields of [`RigidBody`], because serde cannot
/// refuse unknown fields in a flattened struct.)
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnBody {
    /// Its name, unique among bodies.
    pub name: BodyName,
    /// The substructure to which it belongs.
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
    /// How it bends; rigid if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam: Option<Beam>,
}

impl OwnBody {
    /// Mass, inertia and elasticity.
    pub fn rigid(&self) -> RigidBody {
        RigidBody {
            mass_kg: self.mass_kg,
            cg_m: self.cg_m,
            box_m: self.box_m,
            inertia_kg_m2: self.inertia_kg_m2,
            beam: self.beam.clone(),
        }
    }
}

/// A spring and dashpot for all six relative motions, between two bodies or from the ground
/// (`ground`) to one. (It repeats the fields of [`Bushing`], for the same reason.)
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// The bodies it joins.
    pub between: [BodyName; 2],
    /// The configurations that have it; if not given, all that have its bodies.
    #[serde(default = "everywhere", rename = "in")]
    pub present: Vec<Configuration>,
    /// Position (m).
    pub position_m: [f64; 3],
    /// kx, ky, kz (N/m).
    pub stiffness_n_per_m: [f64; 3],
    /// krx, kry, krz (N m/rad).
    pub rotation_nm_per_rad: [f64; 3],
    /// β (s) of c = β k for x, y, z, rx, ry, rz.
    pub damping_s: [f64; 6],
    /// Axes x, y and z of the spring: orthogonal unit vectors; the rig's axes if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<[[f64; 3]; 3]>,
}

fn everywhere() -> Vec<Configuration> {
    Configuration::ALL.to_vec()
}

impl Spring {
    /// Its bodies; `None` is the ground.
    pub fn ends(&self) -> [Option<BodyName>; 2] {
        self.between.map(|end| (end.as_str() != "ground").then_some(end))
    }

    /// Position and stiffness.
    pub fn bushing(&self) -> Bushing {
        Bushing {
            position_m: self.position_m,
            stiffness_n_per_m: self.stiffness_n_per_m,
            rotation_nm_per_rad: self.rotation_nm_per_rad,
            damping_s: self.damping_s,
        }
    }
}
