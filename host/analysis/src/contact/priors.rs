//! Prior standard deviations of positions, angles, gains and delays.

use crate::substructuring::averaged::Priors as Positions;
use serde::Serialize;

/// Standard deviations of quantities that are not known exactly. They belong to the experiment, and
/// k_T's interval depends on them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactPriors {
    /// Sensors and hits on the arms: position, aim and the hammer's tilt.
    #[serde(flatten)]
    pub positions: Positions,
    /// Position of a vibrometer spot relative to the contact, m along each axis.
    pub spot_m: f64,
    /// Position of a point of the 3-D vibrometer on a specimen, m along each axis.
    pub specimen_point_m: f64,
    /// Gain of each vibrometer and axis, relative.
    pub gain: f64,
    /// Gain of the hammer's force cell, relative: k_T is proportional to it.
    pub hammer_gain: f64,
    /// Delay of each vibrometer and axis relative to the hammer, beyond what the device reports, s.
    pub skew_s: f64,
}

impl Default for ContactPriors {
    /// Spots placed to 0.05 mm, points on specimens to 0.3 mm, gains calibrated to 0.5 %, delays
    /// known to 2 µs.
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

/// Source of an estimate's uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// Noise of the signals.
    Noise,
    /// Positions of the spots next to the contact.
    Spots,
    /// Positions of the points on the specimens.
    SpecimenPoints,
    /// Positions of the points on arm B.
    ArmPoints,
    /// Aim of hammer and vibrometer in each cell.
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
