//! The parameters of a rig: the contents of a rig TOML file.
//!
//! `rigs/default.toml` is the built-in default and defines every default value;
//! [`RigConfig::default`] reads the embedded copy. A user's file states any subset: its tables
//! merge into the default's, its lists replace the default's lists.

mod check;
mod check_structure;
mod contact;
mod document;
mod errors;
mod own_structure;
mod sensors;
mod surroundings;
mod values;

pub use super::body::{BodyName, OwnName};
pub(crate) use check::normal_load;
pub use contact::{Contact, ContactLaw, Iwan};
pub use errors::Errors;
pub use own_structure::{OwnBody, OwnStructure, Side, Spring};
pub use sensors::{
    Excitation, FixedVibrometer, ForceSensor, LoadCells, Sensors, SpeckleNoise, SpotVibrometer, Vibrometer,
};
pub use surroundings::{Cable, Surroundings};

use serde::{Deserialize, Serialize};

use super::Configuration;
use super::error::RigError;

/// The built-in default rig, as text.
pub const DEFAULT_TOML: &str = include_str!("../../../rigs/default.toml");

/// Everything that describes one rig. SI units; axes and origin as in [`crate::rig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigConfig {
    /// The rig's name, for people.
    pub name: String,
    /// Scans per second (Hz).
    pub scan_rate_hz: u32,
    /// User-defined bodies and springs, instead of the fields below up to the load cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub structure: Option<OwnStructure>,
    /// The rigid bodies.
    pub bodies: Bodies,
    /// Ground to moving mass.
    pub leaf_springs: Vec<Bushing>,
    /// Moving mass to arm A.
    pub knife_edge: Bushing,
    /// Ground to arm A: the vinyl wire that carries arm A when it hangs alone.
    pub wire: Tether,
    /// Ground to arm A: the push rod that loads the contact.
    pub push_rod_a: Tether,
    /// Arm A to specimen A.
    pub clamp: Clamp,
    /// Arm B to specimen B.
    pub clamp_b: Clamp,
    /// Specimen A to specimen B (the arm, where a clamp is rigid): the joint under test.
    pub contact: Contact,
    /// Ground to arm B; exactly three.
    pub load_cells: Vec<Bushing>,
    /// Ground to arm B.
    pub lower_push_rod: Bushing,
    /// Points at which the 3-D vibrometer can measure.
    pub responses: Vec<ResponsePoint>,
    /// Points that the hammer can hit.
    pub impacts: Vec<ImpactPoint>,
    /// Where the single-point vibrometers measure.
    pub spots: Spots,
    /// The shaker.
    pub shaker: Shaker,
    /// The automatic hammer.
    pub hammer: Hammer,
    /// Scales, noise and delays of the channels.
    pub sensors: Sensors,
    /// Temperature and cables.
    pub surroundings: Surroundings,
    /// Unknown errors of positions, angles and sensors.
    pub errors: Errors,
}

impl RigConfig {
    /// Reads a rig file: any subset of the default's fields.
    ///
    /// # Errors
    /// [`RigError::Document`] for text that is not TOML, an unknown field or a wrong type, with its
    /// line; [`RigError::Field`] for an invalid value.
    pub fn from_toml(text: &str) -> Result<Self, RigError> {
        document::read(text)
    }

    /// The complete rig as TOML; [`RigConfig::from_toml`] reads it back equal.
    ///
    /// # Panics
    /// Never: every field has a TOML form.
    pub fn to_toml(&self) -> String {
        let written = "every field of RigConfig has a TOML form";
        if self.structure.is_none() {
            return toml::to_string(self).expect(written);
        }
        let mut table = toml::Table::try_from(self).expect(written);
        // these fields describe another rig
        table.retain(|field, _| !document::PAPERS_OWN.contains(&field));
        table.to_string()
    }

    /// Whether `configuration` has `body`.
    pub fn has(&self, configuration: Configuration, body: BodyName) -> bool {
        let Some(own) = &self.structure else { return configuration.has(body) };
        own.body(body).is_some_and(|body| match configuration {
            Configuration::A => body.of == Side::A,
            Configuration::B => body.of == Side::B,
            Configuration::Ajb => true,
        })
    }

    /// The bodies that the contact joins: A's, then B's.
    pub fn joined(&self) -> [BodyName; 2] {
        self.structure.as_ref().map_or([BodyName::SpecimenA, BodyName::SpecimenB], |own| own.joint)
    }

    /// The body that the load cells support; `None` without load cells.
    pub fn load_cells_on(&self) -> Option<BodyName> {
        self.structure.as_ref().map_or(Some(BodyName::ArmB), |own| own.load_cells_on)
    }

    /// Checks every value, as [`RigConfig::from_toml`] does; for rigs that were changed in code.
    ///
    /// # Errors
    /// [`RigError::Field`] naming the first invalid field.
    pub fn check(&self) -> Result<(), RigError> {
        check::check(self)
    }
}

impl Default for RigConfig {
    fn default() -> Self {
        document::read(DEFAULT_TOML).expect("rigs/default.toml is a complete, valid rig: a test reads it")
    }
}

/// The rigid bodies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bodies {
    /// Moving mass.
    pub mass: RigidBody,
    /// Arm A.
    pub arm_a: RigidBody,
    /// Specimen A.
    pub specimen_a: RigidBody,
    /// Arm B with its specimen.
    pub arm_b: RigidBody,
    /// Specimen B: subtracted from arm B and a separate body when its clamp is not rigid.
    pub specimen_b: RigidBody,
}

/// A rigid body: six degrees of freedom at its centre of gravity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigidBody {
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

/// A massless spring and dashpot for all six relative motions at one point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bushing {
    /// Position (m).
    pub position_m: [f64; 3],
    /// kx, ky, kz (N/m).
    pub stiffness_n_per_m: [f64; 3],
    /// krx, kry, krz (N m/rad).
    pub rotation_nm_per_rad: [f64; 3],
    /// β (s) of c = β k for x, y, z, rx, ry, rz.
    pub damping_s: [f64; 6],
}

/// A support that is present only in some configurations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tether {
    /// Present when substructure A is alone.
    pub in_a: bool,
    /// Present in the assembly.
    pub in_ajb: bool,
    /// The support.
    pub bushing: Bushing,
}

/// The clamp between an arm and its specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clamp {
    /// No clamp: arm and specimen are one body.
    pub rigid: bool,
    /// Under the normal load: in the assembly.
    pub loaded: Bushing,
    /// Without the normal load: the substructure alone.
    pub free: Bushing,
}

/// A point of the 3-D vibrometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponsePoint {
    /// Its name, unique among responses.
    pub name: String,
    /// The body it sits on.
    pub body: BodyName,
    /// Nominal position (m).
    pub position_m: [f64; 3],
    /// Standard deviation of its position along each axis (m); if not given, `errors` defines it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
    /// Affected by speckle noise.
    #[serde(default)]
    pub speckle: bool,
}

/// A point the hammer hits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImpactPoint {
    /// Its name, unique among impacts.
    pub name: String,
    /// The body it sits on.
    pub body: BodyName,
    /// Nominal position (m).
    pub position_m: [f64; 3],
    /// Direction of the force on the structure (any length; the sign counts).
    pub direction: [f64; 3],
}

/// Where one single-point vibrometer measures, along the sliding direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// The body it measures.
    pub body: BodyName,
    /// Position (m).
    pub position_m: [f64; 3],
}

/// The two spots next to the contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spots {
    /// On specimen A.
    pub ldv_a: Spot,
    /// On specimen B.
    pub ldv_b: Spot,
}

/// The shaker: a force along the sliding direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shaker {
    /// The body it pushes.
    pub body: BodyName,
    /// Position (m).
    pub position_m: [f64; 3],
    /// Force per drive (N/V).
    pub gain_n_per_v: f64,
    /// The amplifier saturates at ± this drive (V).
    pub limit_v: f64,
}

/// The automatic hammer; [`crate::rig::hammer`] describes how these are used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hammer {
    /// Moving mass of the bolt with its tip (kg).
    pub bolt_kg: f64,
    /// Contact stiffness of the tip (N/m).
    pub tip_n_per_m: f64,
    /// From the rest stop to the surface (m).
    pub gap_m: f64,
    /// Return spring (N/m).
    pub spring_n_per_m: f64,
    /// Return spring's force at the rest stop (N).
    pub preload_n: f64,
    /// Coil's pull when cold (N).
    pub coil_n: f64,
    /// Ratio of the speed after a contact to the speed before it.
    pub restitution: f64,
    /// Fraction of the coil's pull lost when warm.
    pub warming: f64,
    /// Attempts within a cell to reach 63 % of that loss.
    pub warming_attempts: f64,
    /// Standard deviation of the speed at contact, relative.
    pub speed_scatter: f64,
    /// Standard deviation of the contact's duration, relative.
    pub width_scatter: f64,
    /// Occasional disturbances of a hit.
    pub mishaps: Mishaps,
    /// If set, an operator strikes repeatedly, independent of the device's orders.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hand: Option<Hand>,
}

/// An operator with the hammer, who strikes as hard as a coil pulse of `pulse_s` would.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// Time from staging to the first hit, and between hits (s).
    pub every_s: f64,
    /// Duration of the equivalent coil pulse (s).
    pub pulse_s: f64,
}

/// Probabilities per attempt (at most one happens), and ranges of uniform draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mishaps {
    /// Probability of a second pulse.
    pub double_hit: f64,
    /// Ratio of its peak to the first.
    pub double_fraction: [f64; 2],
    /// Its delay after the first (s).
    pub double_delay_s: [f64; 2],
    /// Probability of a weak hit.
    pub weak: f64,
    /// Ratio of its peak to an undisturbed one.
    pub weak_fraction: [f64; 2],
    /// Probability of a hit beyond the sensors' range.
    pub overload: f64,
    /// Ratio of its peak to an undisturbed one.
    pub overload_factor: [f64; 2],
}
