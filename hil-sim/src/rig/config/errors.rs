//! Unknown errors of positions, angles and sensors.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

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
