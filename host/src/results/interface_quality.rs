//! What is known of the interface itself: how well the virtual points hold it, and which motions coupling adds.

use crate::substructuring::averaged::{DofEstimate, Replicates};
use crate::substructuring::{Band, Dof};
use serde::Serialize;
use std::collections::BTreeMap;

/// Quality of one virtual point with one set of modes, on the substructure alone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualPoint {
    /// `A` or `B`.
    pub substructure: String,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// Which ones.
    pub modes: Vec<Dof>,
    /// Condition number of the sensors' R, rotations scaled by 40 mm.
    pub condition_responses: f64,
    /// Condition number of the impacts' R.
    pub condition_impacts: f64,
    /// Part of the measured motion that the modes hold, 0…1, mean over the main band (over all lines where it has none).
    pub overall_sensor: f64,
    /// Part of the measured force that they hold.
    pub overall_impact: f64,
    /// Specific consistency by channel, 0…1.
    pub sensors: BTreeMap<String, f64>,
    /// Specific consistency by impact, 0…1.
    pub impacts: BTreeMap<String, f64>,
    /// Part of the lines with a passive driving point, by mode.
    pub passivity: BTreeMap<Dof, f64>,
    /// How far Y_ij equals Y_ji, 0…1; null with one mode.
    pub reciprocity: f64,
}

/// The CMIF of Eq. (B.1), and the set of modes it suggests.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InterfaceModes {
    /// The lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// The largest singular values, \[curve\]\[line\], m/N.
    pub singular_values_m_per_n: Vec<Vec<f64>>,
    /// How much each of x, y, z, rx, ry, rz takes part in each curve, 0…1: mean over the main band (over all lines where it has none).
    pub participation: Vec<[f64; 6]>,
    /// Part of the motion added by coupling that 2, 4 and 6 modes explain, 0…1.
    pub explained: BTreeMap<usize, f64>,
    /// Number of modes suggested.
    pub suggested: usize,
    /// Why.
    pub reason: String,
}

/// Hits of every interface cell drawn anew, again and again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bootstrap {
    /// The band, Hz.
    pub band_hz: Band,
    /// How often.
    pub replicates: usize,
    /// The same seed gives the same figures.
    pub seed: u64,
    /// What the replicates say: the hits' scatter alone. N/m; N m/rad for rotations.
    pub hits: BTreeMap<Dof, Replicates>,
    /// The recommended estimate with that scatter in place of the propagated noise.
    pub joint: BTreeMap<Dof, DofEstimate>,
}
