//! What is known beforehand of positions, angles, gains and delays: standard deviations.

use crate::substructuring::averaged::Priors as Positions;
use serde::Serialize;

/// Standard deviations of what nobody at the rig knows. They are the experiment's own, and k_T's interval rests on them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactPriors {
    /// Sensors and hits on the arms: position, aim, and the hammer's tilt.
    #[serde(flatten)]
    pub positions: Positions,
    /// A spot of the vibrometers beside the contact, m along each axis: where it is against the contact.
    pub spot_m: f64,
    /// A point of the 3-D vibrometer on a specimen, m along each axis.
    pub specimen_point_m: f64,
    /// Gain of each vibrometer and axis, relative.
    pub gain: f64,
    /// Gain of the hammer's force cell, relative: k_T is in proportion to it.
    pub hammer_gain: f64,
    /// Delay of each vibrometer and axis against the hammer beyond what the device tells, s.
    pub skew_s: f64,
}

impl Default for ContactPriors {
    /// Spots placed to 0.05 mm, points on specimens to 0.3 mm, gains calibrated to 0.5 %, delays known to 2 µs.
    fn default() -> Self {
        ContactPriors {
            positions: Positions::default(),
            spot_m: 5e-5,
            specimen_point_m: 3e-4,
            gain: 5e-3,
            hammer_gain: 5e-3,
            skew_s: 2e-6,
        }
    }
}

/// Where an estimate's uncertainty comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// Noise of the signals.
    Noise,
    /// Where the spots beside the contact are.
    Spots,
    /// Where the points on the specimens are.
    SpecimenPoints,
    /// Where the points on arm B are.
    ArmPoints,
    /// How well hammer and vibrometer were aimed in each cell.
    Aim,
    /// The tilt of the hammer in the hits on B alone.
    HammerTilt,
    /// Gains of vibrometers, load cells and hammer.
    Gains,
    /// Delays between the channels.
    Skew,
    /// The model does not describe the signals down to their noise.
    Misfit,
}

impl Cause {
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Noise => "noise",
            Cause::Spots => "spots",
            Cause::SpecimenPoints => "specimen-points",
            Cause::ArmPoints => "arm-points",
            Cause::Aim => "aim",
            Cause::HammerTilt => "hammer-tilt",
            Cause::Gains => "gains",
            Cause::Skew => "skew",
            Cause::Misfit => "misfit",
        }
    }
}
