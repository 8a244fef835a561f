//! The parameters of a rig: the contents of a rig TOML file, table by table.
//!
//! `rigs/default.toml` defines every default value;
//! [`RigConfig::default`] reads the embedded copy. A user's file states any subset: its tables
//! merge into the default's, its lists replace the default's lists.

use super::{Configuration, RigError, normalized};
use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

pub use super::configuration::{BodyName, OwnName};
pub(crate) use check::{normal_load, worn};
pub use own_structure::{OwnBody, OwnStructure, Side, Spring};

mod check;
mod own_structure;

/// The rig with rigid bodies from which every rig file starts.
pub const DEFAULT_TOML: &str = include_str!("../../../rigs/default.toml");

/// The rig of a device without a rig file: `rigs/elastic.toml`.
pub const ELASTIC_TOML: &str = include_str!("../../../rigs/elastic.toml");

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
    /// The bodies.
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
    /// Further connections between two bodies or from a body to the ground, such as a cable that
    /// bypasses the contact in the assembly; none in the default rig.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub paths: Vec<Spring>,
    /// Points at which the 3-D vibrometer can measure.
    pub responses: Vec<ResponsePoint>,
    /// Points that the hammer can hit.
    pub impacts: Vec<ImpactPoint>,
    /// Where the single-point vibrometers measure.
    pub spots: Spots,
    /// A free body of known mass, on which hammer and vibrometers are compared; none if there is
    /// no such body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known_mass: Option<KnownMass>,
    /// Where arm A is struck and seen while the joint is open; none if it cannot be opened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open_joint: Option<OpenJoint>,
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
        check::read(text)
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
        table.retain(|field, _| !check::PAPERS_OWN.contains(&field));
        table.to_string()
    }

    /// Whether the specimens of A and B are part of their arms: they are if they do not bend and
    /// their clamps are rigid.
    pub(super) fn lumped(&self) -> [bool; 2] {
        let bodies = &self.bodies;
        let ends = [(&self.clamp, &bodies.specimen_a), (&self.clamp_b, &bodies.specimen_b)];
        ends.map(|(clamp, specimen)| clamp.rigid && specimen.beam.is_none())
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

    /// The known mass, if hammer and vibrometer in `configuration` may be at it: it is used while
    /// B is measured.
    pub(super) fn known_mass_in(&self, configuration: Configuration) -> Option<&KnownMass> {
        self.known_mass.as_ref().filter(|_| configuration == Configuration::B)
    }

    /// The points of the open joint, if hammer and vibrometer in `configuration` may be at them: it
    /// is opened while both sides are in place.
    pub(super) fn open_joint_in(&self, configuration: Configuration) -> Option<&OpenJoint> {
        self.open_joint.as_ref().filter(|_| configuration == Configuration::Ajb)
    }

    /// The same rig with its joint open: the two sides are in place and do not touch.
    pub(super) fn opened(&self) -> Self {
        let contact = Contact {
            law: ContactLaw::Linear,
            stiffness_n_per_m: [0.0; 3],
            rotation_nm_per_rad: [0.0; 3],
            ..self.contact.clone()
        };
        RigConfig { contact, ..self.clone() }
    }

    /// The bodies that the contact joins: A's, then B's.
    pub fn joined(&self) -> [BodyName; 2] {
        self.structure.as_ref().map_or([BodyName::SpecimenA, BodyName::SpecimenB], |own| own.joint)
    }

    /// The load cells' two ends, of which the first may be the ground (`ground`); `None` without
    /// load cells.
    pub(super) fn load_cells_join(&self) -> Option<[BodyName; 2]> {
        let on = |body| [BodyName::GROUND, body];
        match &self.structure {
            None => Some(on(BodyName::ArmB)),
            Some(own) => own.load_cells_between.or(own.load_cells_on.map(on)),
        }
    }

    /// The true position of the contact's centre (m).
    pub(super) fn contact_m(&self) -> [f64; 3] {
        self.errors.acting().moved("contact", self.contact.position_m)
    }

    /// The stuck contact's springs and dashpots at their true positions: one, or its patches.
    pub(super) fn contact_bushings(&self) -> Vec<Bushing> {
        let (whole, centre_m) = (self.contact.bushing(), self.contact_m());
        if self.contact.patches.is_empty() {
            return vec![Bushing { position_m: centre_m, ..whole }];
        }
        let patch = |patch: &Patch| Bushing {
            position_m: std::array::from_fn(|axis| centre_m[axis] + patch.offset_m[axis]),
            stiffness_n_per_m: whole.stiffness_n_per_m.map(|k| k * patch.share),
            rotation_nm_per_rad: whole.rotation_nm_per_rad.map(|k| k * patch.share),
            damping_s: whole.damping_s,
        };
        self.contact.patches.iter().map(patch).collect()
    }

    /// Checks every value, as [`RigConfig::from_toml`] does; for rigs that were changed in code.
    ///
    /// # Errors
    /// [`RigError::Field`] naming the first invalid field.
    pub fn check(&self) -> Result<(), RigError> {
        check::check(self)
    }

    /// The rig of a device: that of its rig file, or [`RigConfig::elastic`] without one.
    ///
    /// # Errors
    /// As [`RigConfig::from_toml`].
    pub fn of_device(rig_toml: Option<&str>) -> Result<Self, RigError> {
        rig_toml.map_or_else(|| Ok(Self::elastic()), Self::from_toml)
    }

    /// The default rig with specimens and arms of steel that bend.
    ///
    /// # Panics
    /// Never: a test reads the embedded file.
    pub fn elastic() -> Self {
        check::read(ELASTIC_TOML).expect("rigs/elastic.toml is a valid rig: a test reads it")
    }
}

impl Default for RigConfig {
    fn default() -> Self {
        check::read(DEFAULT_TOML).expect("rigs/default.toml is a complete, valid rig: a test reads it")
    }
}

/// The bodies of the paper's rig.
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
    /// Specimen B: subtracted from arm B and a separate body when its clamp is not rigid or it
    /// bends.
    pub specimen_b: RigidBody,
}

/// A body: rigid, with six degrees of freedom at its centre of gravity, or a beam that bends.
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
    /// How it bends; rigid if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam: Option<Beam>,
}

/// The elasticity of a body: a straight beam of rectangular section. Mass, centre of gravity and
/// inertia remain those of the body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// One end of its axis (m).
    pub from_m: [f64; 3],
    /// The other end (m). Beyond the ends the body moves rigidly with the end sections.
    pub to_m: [f64; 3],
    /// Edge lengths of the section (m).
    pub section_m: [f64; 2],
    /// Direction of the first edge (any length; only its part across the axis counts); if not
    /// given, that of x, y and z which comes first among the two that are most across the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_edge: Option<[f64; 3]>,
    /// Young's modulus (Pa).
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// β (s) of the material's damping C = β K.
    #[serde(default)]
    pub damping_s: f64,
    /// Number of finite elements.
    #[serde(default = "two")]
    pub elements: u32,
}

fn two() -> u32 {
    2
}

impl Beam {
    /// Direction of the section's first edge for an axis along the unit vector `along`.
    pub(super) fn first_edge(&self, along: [f64; 3]) -> Vector3<f64> {
        let axial = (0..3).max_by(|a, b| along[*a].abs().total_cmp(&along[*b].abs())).unwrap_or(0);
        self.first_edge.map_or_else(|| Vector3::ith(usize::from(axial == 0), 1.0), Vector3::from)
    }
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
    /// No clamp: arm and specimen are one body, or joined rigidly at the clamp's position if the
    /// specimen bends.
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

/// A free body of known mass on a soft support, connected to nothing else. It may be struck while B
/// is measured; the vibrometers of both spots are then aimed at its response point too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownMass {
    /// The body.
    pub body: RigidBody,
    /// Its support.
    pub foam: Bushing,
    /// Where the hammer hits it.
    pub impact: ImpactPoint,
    /// Where the vibrometers measure it.
    pub response: ResponsePoint,
}

/// Points of side A that are used while the joint is open: both sides are in place, as in the
/// assembly, and the specimens do not touch. What then reaches side B passes beside the contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpenJoint {
    /// Where the hammer hits.
    pub impact: ImpactPoint,
    /// Where the 3-D vibrometer measures.
    pub response: ResponsePoint,
}

/// The two spots next to the contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spots {
    /// On specimen A.
    pub ldv_a: Spot,
    /// On specimen B.
    pub ldv_b: Spot,
    /// A mark at which both vibrometers are aimed while the 3-D vibrometer measures it on
    /// substructure B alone; in the assembly they stay on their spots. It is one more response
    /// point; if `responses` contains its name, that entry says where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mark: Option<ResponsePoint>,
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

/// The law of the contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ContactLaw {
    /// Stuck: a bushing, at any amplitude.
    Linear,
    /// Along z a slider in series with the spring and dashpot: stuck up to μN, gross slip beyond.
    Jenkins,
    /// Along z many such sliders in parallel with different limits: microslip, then gross slip at
    /// μN.
    Iwan,
}

/// Distribution of the limits of an Iwan contact's elements. The stiffness is shared evenly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Iwan {
    /// Number of elements.
    pub elements: u32,
    /// The limits are spread evenly over 1 ± this times their mean.
    pub spread: f64,
}

impl Iwan {
    /// Each element's fraction of μN, the weakest first: the distribution is divided into
    /// `elements` equal parts, and each value is the mean of one part.
    pub fn shares(&self) -> Vec<f64> {
        let count = f64::from(self.elements);
        let share = |i: u32| (1.0 + self.spread * ((2.0 * f64::from(i) + 1.0) / count - 1.0)) / count;
        (0..self.elements).map(share).collect()
    }
}

/// The joint under test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The contact law.
    pub law: ContactLaw,
    /// Position (m).
    pub position_m: [f64; 3],
    /// kx, ky, kz (N/m); kz is the tangential contact stiffness.
    pub stiffness_n_per_m: [f64; 3],
    /// krx, kry, krz (N m/rad).
    pub rotation_nm_per_rad: [f64; 3],
    /// β (s) of c = β k for x, y, z, rx, ry, rz.
    pub damping_s: [f64; 6],
    /// μ: the contact carries at most μN along z. The linear law has no limit.
    pub friction_coefficient: f64,
    /// N (N), at the start; [`super::Rig::set_normal_load`] changes it.
    pub normal_load_n: f64,
    /// Longest step while something slips (s).
    pub slip_step_s: f64,
    /// The distribution of an Iwan contact.
    pub iwan: Iwan,
    /// Axes x, y and z of the contact, of which z slides: orthogonal unit vectors; the rig's axes
    /// if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<[[f64; 3]; 3]>,
    /// Parts of a contact that does not touch at one place; a contact that can slip has none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub patches: Vec<Patch>,
    /// Relative increase of all its stiffnesses for each hit since the rig was started. It takes
    /// effect when a cell of the assembly is staged.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drift_per_hit: f64,
    /// The same for each second of scans (1/s).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drift_per_s: f64,
    /// How the energy dissipated by its friction changes it; a contact that does not wear has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wear: Option<Wear>,
}

/// How a contact changes with the energy E that its friction has dissipated: kz grows by the factor
/// 1 + a (1 − exp(−E/E₁)), and so does μ with a and E₁ of its own. The law is applied in steps in
/// which neither changes by more than a thousandth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    /// a of kz; negative if it falls.
    pub stiffness_change: f64,
    /// E₁ of kz (J).
    pub stiffness_energy_j: f64,
    /// a of μ; negative if it falls.
    pub friction_change: f64,
    /// E₁ of μ (J).
    pub friction_energy_j: f64,
}

/// Relative change of stiffness or friction coefficient in one step of the law.
const WEAR_STEP: f64 = 1e-3;

impl Wear {
    /// The factors of kz and μ after the energy `worn_j` (J).
    pub fn factors(&self, worn_j: f64) -> [f64; 2] {
        self.parts().map(|(change, energy_j)| 1.0 - change * (-worn_j / energy_j).exp_m1())
    }

    /// The energy (J) up to which the contact stays as it is at `worn_j`.
    pub fn steady_until_j(&self, worn_j: f64) -> f64 {
        // the relative slopes of both factors fall with the energy, so a step is never too long
        let slope = self
            .parts()
            .into_iter()
            .zip(self.factors(worn_j))
            .map(|((change, energy_j), factor)| {
                (change / energy_j * (-worn_j / energy_j).exp() / factor).abs()
            })
            .fold(0.0, f64::max);
        worn_j + WEAR_STEP / slope
    }

    fn parts(&self) -> [(f64, f64); 2] {
        [(self.stiffness_change, self.stiffness_energy_j), (self.friction_change, self.friction_energy_j)]
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A part of the contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Patch {
    /// Its position relative to the contact's (m).
    pub offset_m: [f64; 3],
    /// Its part of the contact's stiffnesses; the parts sum to one.
    pub share: f64,
}

impl Contact {
    /// Whether its stiffness changes while the rig runs.
    pub fn drifts(&self) -> bool {
        self.drift_per_hit != 0.0 || self.drift_per_s != 0.0
    }

    /// The contact after these hits and seconds; not softer than a twentieth of the stated one.
    #[must_use]
    pub fn drifted(&self, hits: u64, seconds: f64) -> Self {
        let factor = (1.0 + self.drift_per_hit * hits as f64 + self.drift_per_s * seconds).max(0.05);
        Self {
            stiffness_n_per_m: self.stiffness_n_per_m.map(|k| k * factor),
            rotation_nm_per_rad: self.rotation_nm_per_rad.map(|k| k * factor),
            ..self.clone()
        }
    }

    /// The contact after its friction has dissipated this energy (J).
    #[must_use]
    pub fn worn(&self, worn_j: f64) -> Self {
        let Some(wear) = self.wear else { return self.clone() };
        let mut worn = self.clone();
        let [stiffness, friction] = wear.factors(worn_j);
        worn.stiffness_n_per_m[2] *= stiffness;
        worn.friction_coefficient *= friction;
        worn
    }

    /// Each slider's fraction of μN, the weakest first; empty for the linear law. They share the
    /// stiffness evenly.
    pub fn shares(&self) -> Vec<f64> {
        match self.law {
            ContactLaw::Linear => Vec::new(),
            ContactLaw::Jenkins => vec![1.0],
            ContactLaw::Iwan => self.iwan.shares(),
        }
    }

    /// Unit vector of the sliding direction.
    pub fn sliding(&self) -> [f64; 3] {
        self.axes.map_or([0.0, 0.0, 1.0], |axes| normalized(axes[2]))
    }

    /// The stuck contact's spring and dashpot.
    pub fn bushing(&self) -> Bushing {
        Bushing {
            position_m: self.position_m,
            stiffness_n_per_m: self.stiffness_n_per_m,
            rotation_nm_per_rad: self.rotation_nm_per_rad,
            damping_s: self.damping_s,
        }
    }
}

/// Standard deviations of errors that are drawn from the rig's seed; those from
/// `normal_load_variation` on are not drawn but given directly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// Switches off all errors, whatever the other fields are.
    pub none: bool,
    /// Each response and impact point that is not on a specimen, along each axis (m), the same in
    /// every cell.
    pub position_m: f64,
    /// Aiming error added to these, drawn again for each cell (m along each axis).
    pub aim_m: f64,
    /// Each response point on a specimen, along each axis (m), the same in every cell, without an
    /// aiming error.
    pub specimen_point_m: f64,
    /// Each single-point vibrometer's spot, along each axis (m), the same in every cell.
    pub spot_m: f64,
    /// Hammer's tilt about each of the two axes normal to the impact (rad), the same in every cell.
    pub hammer_angle_rad: f64,
    /// Relative gain error of each load cell, each single-point vibrometer and each axis of the 3-D
    /// vibrometer.
    pub gain: f64,
    /// Relative gain error of the hammer's force cell.
    pub hammer_gain: f64,
    /// Deviation from the declared delay (s), early or late, of every channel except the hammer's.
    pub skew_s: f64,
    /// Sensitivity of each fixed sensor to motion along each of the two directions across its own,
    /// relative.
    #[serde(default)]
    pub transverse: f64,
    /// Fraction of each neighbour's force that a load cell reads in addition to its own.
    pub load_cell_cross_talk: f64,
    /// a of N (1 + a x / x₀), the normal load of a slipping contact at its relative displacement x.
    pub normal_load_variation: f64,
    /// x₀ of that formula (m).
    pub normal_load_reference_m: f64,
    /// Ratio of a channel's voltage to the voltage by its scale, by channel name, on top of the
    /// drawn errors; negative for a reversed sensor.
    #[serde(default)]
    pub volts: BTreeMap<String, f64>,
    /// Distance (m) of a true position from the stated one, by the name of a response or impact
    /// point, `ldv_a`, `ldv_b` or `contact`, on top of the drawn errors.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub offset_m: BTreeMap<String, [f64; 3]>,
    /// Rotation vector (rad, about x, y and z) from stated to true directions: of `ldv_a`, `ldv_b`,
    /// the three axes of `vibrometer`, all impacts of the `hammer`, or a fixed sensor by its name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub tilt_rad: BTreeMap<String, [f64; 3]>,
}

impl Errors {
    /// The errors that act: all zero if `none` is set.
    #[must_use]
    pub fn acting(&self) -> Self {
        if !self.none {
            return self.clone();
        }
        Self {
            none: true,
            position_m: 0.0,
            aim_m: 0.0,
            specimen_point_m: 0.0,
            spot_m: 0.0,
            hammer_angle_rad: 0.0,
            gain: 0.0,
            hammer_gain: 0.0,
            skew_s: 0.0,
            transverse: 0.0,
            load_cell_cross_talk: 0.0,
            normal_load_variation: 0.0,
            normal_load_reference_m: self.normal_load_reference_m,
            volts: BTreeMap::new(),
            offset_m: BTreeMap::new(),
            tilt_rad: BTreeMap::new(),
        }
    }

    /// The true position of what `name` names, without drawn errors.
    pub(super) fn moved(&self, name: &str, stated_m: [f64; 3]) -> [f64; 3] {
        let offset_m = self.offset_m.get(name).copied().unwrap_or_default();
        std::array::from_fn(|axis| stated_m[axis] + offset_m[axis])
    }

    /// The true direction of what `name` names, without drawn errors.
    pub(super) fn tilted(&self, name: &str, stated: [f64; 3]) -> [f64; 3] {
        let Some(tilt) = self.tilt_rad.get(name) else { return stated };
        (Rotation3::new(Vector3::from(*tilt)) * Vector3::from(stated)).into()
    }

    /// Relative increase of the normal load per metre of relative displacement (1/m).
    pub fn normal_load_slope_per_m(&self) -> f64 {
        let acting = self.acting();
        acting.normal_load_variation / acting.normal_load_reference_m
    }
}

fn sixteen() -> u8 {
    16
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_sixteen(bits: &u8) -> bool {
    *bits == 16
}

/// All sensors. A channel reads volts × `units_per_volt`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Converter range, ± this (V).
    pub range_v: f64,
    /// Bits of the converters: 16, or 19 to 30.
    #[serde(default = "sixteen", skip_serializing_if = "is_sixteen")]
    pub bits: u8,
    /// The hammer's force cell.
    pub force: ForceSensor,
    /// The 3-D vibrometer: x, y, z.
    pub vibrometer: Vibrometer,
    /// Single-point vibrometer at specimen A.
    pub ldv_a: SpotVibrometer,
    /// Single-point vibrometer at arm B's specimen.
    pub ldv_b: SpotVibrometer,
    /// The three load cells.
    pub load_cells: LoadCells,
    /// The shaker's force cell.
    pub excitation: Excitation,
    /// Sensors fixed to one point; none in the default rig.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<FixedSensor>,
    /// Which of the rig's ten channels the front end does not have, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
}

/// What a fixed sensor measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FixedQuantity {
    /// Velocity: a vibrometer.
    #[default]
    Velocity,
    /// Acceleration: an accelerometer.
    Acceleration,
}

/// A sensor fixed to a response point: one channel along one direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedSensor {
    /// Its channel's name.
    pub name: String,
    /// The response point at which it measures.
    pub response: String,
    /// Measured direction (any length; the sign counts).
    pub direction: [f64; 3],
    /// What it measures.
    #[serde(default)]
    pub quantity: FixedQuantity,
    /// m/s or m/s² per V.
    pub units_per_volt: f64,
    /// White noise floor (m/s or m/s² per √Hz) up to half the scan rate.
    pub floor: f64,
    /// Delay of the signal (s).
    #[serde(default)]
    pub delay_s: f64,
    /// 1 or −1.
    #[serde(default = "upright")]
    pub polarity: i8,
    /// Mass (kg) that it adds to the body at its point; a triaxial sensor states it for one of its
    /// channels.
    #[serde(default)]
    pub mass_kg: f64,
}

fn upright() -> i8 {
    1
}

/// The hammer's force cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceSensor {
    /// N per V.
    pub units_per_volt: f64,
    /// Noise (N rms).
    pub noise_n: f64,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
    /// Amplitude of the ringing that a hit of nominal duration excites, relative to the hit's peak.
    pub ring_fraction: f64,
    /// The ringing's frequency (Hz).
    pub ring_hz: f64,
    /// The ringing's decay time (s).
    pub ring_decay_s: f64,
}

/// The 3-D vibrometer; arrays are x, y, z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vibrometer {
    /// m/s per V.
    pub units_per_volt: f64,
    /// White noise floor ((m/s)/√Hz) up to half the scan rate.
    pub floor: f64,
    /// Delay of each axis (s).
    pub delay_s: [f64; 3],
    /// 1 or −1.
    pub polarity: [i8; 3],
    /// Additional noise of a speckled point.
    pub speckle: SpeckleNoise,
}

/// Noise of a speckled response point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeckleNoise {
    /// Factor by which the floor is higher.
    pub floor_factor: f64,
    /// Mean rate at which dropouts begin (1/s).
    pub dropouts_per_s: f64,
    /// Their mean duration (s), in which the signal is lost.
    pub dropout_s: f64,
    /// Ratio of the floor within a dropout to the ordinary one.
    pub dropout_floor_factor: f64,
}

/// A single-point vibrometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpotVibrometer {
    /// m/s per V.
    pub units_per_volt: f64,
    /// White noise floor ((m/s)/√Hz) up to half the scan rate.
    pub floor: f64,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
}

/// The three load cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadCells {
    /// N per V.
    pub units_per_volt: f64,
    /// Noise of each (N rms).
    pub noise_n: f64,
    /// Delay of each (s).
    pub delay_s: [f64; 3],
    /// 1 or −1.
    pub polarity: [i8; 3],
    /// Whether the three are connected to a summing box: `lc_1` is then the sum of all.
    #[serde(default)]
    pub summed: bool,
}

/// The shaker's force cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excitation {
    /// N per V.
    pub units_per_volt: f64,
    /// Noise (N rms).
    pub noise_n: f64,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1 or −1.
    pub polarity: i8,
}

/// Surroundings of the structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surroundings {
    /// Temperature of the specimen at the start (°C).
    pub temperature_c: f64,
    /// Rate at which it rises (K/s).
    pub warming_k_per_s: f64,
    /// State of the cable of the hammer's force cell.
    pub force_cable: Cable,
    /// State of the cable of the shaker's force cell.
    pub excitation_cable: Cable,
}

/// What a constant-current supply detects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cable {
    /// A sensor.
    Sensor,
    /// An open circuit.
    Open,
    /// A short circuit.
    Short,
}

impl Cable {
    /// Mean voltage at the socket (V): for a sensor the middle of the usual bias range, for an open
    /// socket the voltage of a 24 V supply behind its current source, for a short the voltage drop
    /// of the wire.
    #[must_use]
    pub fn bias_v(self) -> f32 {
        match self {
            Self::Sensor => 11.0,
            Self::Open => 22.5,
            Self::Short => 0.1,
        }
    }
}
