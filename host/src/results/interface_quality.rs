//! Quality of the interface: how well the virtual points reproduce it, and which motions coupling
//! adds.

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
    /// The modes.
    pub modes: Vec<Dof>,
    /// Condition number of the sensors' R, rotations scaled by 40 mm.
    pub condition_responses: f64,
    /// Condition number of the impacts' R.
    pub condition_impacts: f64,
    /// Fraction of the measured motion that the modes reproduce, 0…1, mean over the main band (over
    /// all lines if there are none in it).
    pub overall_sensor: f64,
    /// Fraction of the measured force that they reproduce.
    pub overall_impact: f64,
    /// Specific consistency by channel, 0…1.
    pub sensors: BTreeMap<String, f64>,
    /// Specific consistency by impact, 0…1.
    pub impacts: BTreeMap<String, f64>,
    /// Fraction of the lines with a passive driving point, by mode.
    pub passivity: BTreeMap<Dof, f64>,
    /// Agreement between Y_ij and Y_ji, 0…1; null with one mode.
    pub reciprocity: f64,
}

/// The CMIF of Eq. (B.1), and the set of modes it suggests.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InterfaceModes {
    /// The lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// The largest singular values, \[curve\]\[line\], m/N.
    pub singular_values_m_per_n: Vec<Vec<f64>>,
    /// Participation of each of x, y, z, rx, ry, rz in each curve, 0…1: mean over the main band
    /// (over all lines if there are none in it).
    pub participation: Vec<[f64; 6]>,
    /// Fraction of the motion added by coupling that 2, 4 and 6 modes explain, 0…1.
    pub explained: BTreeMap<usize, f64>,
    /// Number of modes suggested.
    pub suggested: usize,
    /// Reason for the suggestion.
    pub reason: String,
}

/// Bootstrap: the hits of every interface cell are resampled repeatedly.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bootstrap {
    /// The band, Hz.
    pub band_hz: Band,
    /// Number of replicates.
    pub replicates: usize,
    /// Seed of the random numbers; the same seed gives the same figures.
    pub seed: u64,
    /// Result of the replicates, i.e. the scatter of the hits only. N/m; N m/rad for rotations.
    pub hits: BTreeMap<Dof, Replicates>,
    /// The recommended estimate with that scatter instead of the propagated noise.
    pub joint: BTreeMap<Dof, DofEstimate>,
}
