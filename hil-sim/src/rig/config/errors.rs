//! What nobody at the rig knows: errors of places, angles and sensors.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Standard deviations, drawn from the rig's seed; the last three are no draws but stated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// None of them, whatever the others say.
    pub none: bool,
    /// Each response and impact point that is not on a specimen, along each axis (m), the same in every cell.
    pub position_m: f64,
    /// Added to these anew in each cell (m along each axis).
    pub aim_m: f64,
    /// Each response point on a specimen, along each axis (m), the same in every cell; nothing is added in a cell.
    pub specimen_point_m: f64,
    /// Each single-point vibrometer's spot, along each axis (m), the same in every cell.
    pub spot_m: f64,
    /// Hammer's tilt about each of the two axes across the impact (rad), the same in every cell.
    pub hammer_angle_rad: f64,
    /// Relative, of the gain of each load cell, each single-point vibrometer and each axis of the 3-D vibrometer.
    pub gain: f64,
    /// Relative, of the gain of the hammer's force cell.
    pub hammer_gain: f64,
    /// Delay beyond the declared one (s) of every channel but the hammer's, early or late.
    pub skew_s: f64,
    /// Part of each neighbour's force that a load cell reads beside its own.
    pub load_cell_cross_talk: f64,
    /// a of N (1 + a x / x₀), the normal load of a contact that slips at its relative displacement x.
    pub normal_load_variation: f64,
    /// x₀ of that (m).
    pub normal_load_reference_m: f64,
    /// What channels give over what their scale says, by name, on top of what is drawn; negative where a sensor is turned.
    #[serde(default)]
    pub volts: BTreeMap<String, f64>,
}

impl Errors {
    /// As they act: all zero if there shall be none.
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

    /// By how much the normal load grows per metre of relative displacement, over itself (1/m).
    pub fn normal_load_slope_per_m(&self) -> f64 {
        let acting = self.acting();
        acting.normal_load_variation / acting.normal_load_reference_m
    }
}
