//! From TOML text to a checked configuration, with line numbers in the errors.
//!
//! A user-defined structure, which replaces the paper's chain of bodies.
//!
//! Unknown errors of positions, angles and sensors.

use super::{BodyName, Bushing, DEFAULT_TOML, RigConfig, RigidBody};
use crate::rig::Configuration;
use crate::rig::error::RigError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Fields that a user-defined structure replaces.
pub(super) const PAPERS_OWN: [&str; 8] =
    ["bodies", "leaf_springs", "knife_edge", "wire", "push_rod_a", "clamp", "clamp_b", "lower_push_rod"];

/// Merges `text` into the default and checks the result.
pub fn read(text: &str) -> Result<RigConfig, RigError> {
    let user = DeTable::parse(text).map_err(|error| document_error(&error, text))?;
    let mut merged =
        DeTable::parse(DEFAULT_TOML).expect("rigs/default.toml is TOML: it is embedded and a test reads it");
    merge(merged.get_mut(), user.get_ref().clone());
    if user.get_ref().contains_key("structure")
        && let Some(field) = PAPERS_OWN.into_iter().find(|field| user.get_ref().contains_key(*field))
    {
        let line = locate(user.get_ref(), field).map(|offset| line_of(text, offset));
        let reason = "describes the paper's rig, and [structure] another one: remove one of them".to_owned();
        return Err(RigError::Field { field: field.to_owned(), reason, line });
    }
    // Only the user's text can be wrong here, so every span refers to it.
    let config = RigConfig::deserialize(toml::Deserializer::from(merged))
        .map_err(|error| document_error(&error, text))?;
    config.check().map_err(|error| match error {
        RigError::Field { field, reason, .. } => {
            let line = locate(user.get_ref(), &field).map(|offset| line_of(text, offset));
            RigError::Field { field, reason, line }
        }
        other => other,
    })?;
    Ok(config)
}

fn merge<'i>(base: &mut DeTable<'i>, over: DeTable<'i>) {
    // A body's inertia has two forms; the one stated by the user replaces the other.
    for (stated, replaced) in [("box_m", "inertia_kg_m2"), ("inertia_kg_m2", "box_m")] {
        if over.contains_key(stated) {
            base.remove(replaced);
        }
    }
    for (key, value) in over {
        let name: &str = key.get_ref();
        if let (Some(DeValue::Table(below)), DeValue::Table(inner)) =
            (base.get_mut(name).map(Spanned::get_mut), value.get_ref())
        {
            merge(below, inner.clone());
        } else {
            // Removed first: inserting over an equal key would keep the old key, and with it the
            // default's span.
            base.remove(name);
            base.insert(key, value);
        }
    }
}

fn document_error(error: &toml::de::Error, text: &str) -> RigError {
    let line = error.span().map(|span| line_of(text, span.start));
    RigError::Document { line, reason: error.message().trim().replace('\n', ", ") }
}

fn line_of(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|byte| *byte == b'\n').count() + 1
}

/// Byte offset at which the user's document sets `path` (as `bodies.mass.mass_kg` or
/// `impacts[3].name`), or the nearest table around it that the document has.
fn locate(table: &DeTable<'_>, path: &str) -> Option<usize> {
    let (head, rest) = path.split_once('.').map_or((path, None), |(head, rest)| (head, Some(rest)));
    let (name, index) = match head.split_once('[') {
        Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
        None => (head, None),
    };
    let mut value = table.get(name)?;
    let mut offset = value.span().start;
    if let (Some(index), DeValue::Array(items)) = (index, value.get_ref()) {
        value = items.get(index)?;
        offset = value.span().start;
    }
    match (rest, value.get_ref()) {
        (Some(rest), DeValue::Table(inner)) => locate(inner, rest).or(Some(offset)),
        _ => Some(offset),
    }
}

/// Any rigid bodies, the springs between them, and the two bodies that the contact joins.
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

/// A rigid body of a substructure. (It repeats the fields of [`RigidBody`], because serde cannot
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

/// Standard deviations of errors that are drawn from the rig's seed; the last three are not drawn
/// but given directly.
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
            load_cell_cross_talk: 0.0,
            normal_load_variation: 0.0,
            normal_load_reference_m: self.normal_load_reference_m,
            volts: BTreeMap::new(),
        }
    }

    /// Relative increase of the normal load per metre of relative displacement (1/m).
    pub fn normal_load_slope_per_m(&self) -> f64 {
        let acting = self.acting();
        acting.normal_load_variation / acting.normal_load_reference_m
    }
}
