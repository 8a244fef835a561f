//! The laboratory's measurement errors: the plan's `[priors]`.

use crate::contact::ContactPriors;
use serde::Deserialize;

/// Standard deviations; values that are absent default to those of careful manual work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorsPlan {
    /// Points and impacts on the arms, m along each axis.
    pub position_m: Option<f64>,
    /// Added at each aim of hammer and vibrometer, m along each axis.
    pub aim_m: Option<f64>,
    /// The hammer's tilt about each axis across its direction, rad.
    pub hammer_angle_rad: Option<f64>,
    /// The spots next to the contact, m along each axis.
    pub spot_m: Option<f64>,
    /// Points on the specimens, m along each axis.
    pub specimen_point_m: Option<f64>,
    /// Gains of the vibrometers, relative.
    pub gain: Option<f64>,
    /// Gain of the hammer's force cell, relative.
    pub hammer_gain: Option<f64>,
    /// Delays in addition to those that the device reports, s.
    pub skew_s: Option<f64>,
}

impl PriorsPlan {
    /// The priors: the stated values, defaults for the others.
    pub fn known(&self) -> ContactPriors {
        let mut known = ContactPriors::default();
        for (stated, at) in [
            (self.position_m, &mut known.positions.position_m),
            (self.aim_m, &mut known.positions.aim_m),
            (self.hammer_angle_rad, &mut known.positions.hammer_angle_rad),
            (self.spot_m, &mut known.spot_m),
            (self.specimen_point_m, &mut known.specimen_point_m),
            (self.gain, &mut known.gain),
            (self.hammer_gain, &mut known.hammer_gain),
            (self.skew_s, &mut known.skew_s),
        ] {
            if let Some(stated) = stated {
                *at = stated;
            }
        }
        known
    }

    /// The stated values, by name.
    pub fn stated(&self) -> [(&'static str, Option<f64>); 8] {
        [
            ("position_m", self.position_m),
            ("aim_m", self.aim_m),
            ("hammer_angle_rad", self.hammer_angle_rad),
            ("spot_m", self.spot_m),
            ("specimen_point_m", self.specimen_point_m),
            ("gain", self.gain),
            ("hammer_gain", self.hammer_gain),
            ("skew_s", self.skew_s),
        ]
    }
}
