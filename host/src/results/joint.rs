//! The joint by substructuring: the quality of its virtual points, which motions coupling adds,
//! values over bands, and the spectra from which they are computed.

use super::Statistics;
use crate::identified::SCATTER_OF_LINES;
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

/// Method name of T/Δx at the specimens.
pub const DIRECT: &str = "direct";

/// Rank of a row: the headline quotes the row of the main band with the largest rank.
pub fn headline_rank(method: &str, idms: usize) -> (bool, bool, usize) {
    (method == "internal", method == "internal-printed", idms)
}

/// One method, one set of interface deformation modes, one band.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Joint {
    /// The method's name, as on the command line.
    pub method: String,
    /// Interface deformation modes of each virtual point: 2, 4, 6, or another choice.
    pub idms: usize,
    /// The modes; empty if no virtual point is used.
    pub modes: Vec<Dof>,
    /// The band, ends included, Hz.
    pub band_hz: Band,
    /// Stiffness of the translations by direction (`x`, `y`, `z`), N/m.
    pub stiffness_n_per_m: BTreeMap<String, Statistics>,
    /// Damping of the translations by direction, N s/m.
    pub damping_n_s_per_m: BTreeMap<String, Statistics>,
    /// Stiffness of the rotations (`rx`, `ry`, `rz`), N m/rad.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub stiffness_n_m_per_rad: BTreeMap<String, Statistics>,
    /// Damping of the rotations, N m s/rad.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub damping_n_m_s_per_rad: BTreeMap<String, Statistics>,
    /// Stiffness of flexible interface modes by name: N m for extensions, N m² for the others.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub stiffness_flexible_si: BTreeMap<String, Statistics>,
    /// Stiffness between two degrees of freedom (`y-z`, `z-rx`, …): N/m, N/rad or N m/rad.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub coupling_si: BTreeMap<String, Statistics>,
    /// Damping between them, in the same units times seconds.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub coupling_damping_si: BTreeMap<String, Statistics>,
    /// Standard deviation of the stiffness of one line due to the FRFs' noise alone, N/m by
    /// direction: by linear propagation through virtual points and method, median over the band.
    /// Absent where a variance is not known.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub noise_n_per_m: BTreeMap<String, f64>,
    /// Lines of the band that were used.
    pub lines: usize,
    /// For `fit`: how well the model describes the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goodness: Option<Goodness>,
    /// Warnings that a reader must know before using these numbers.
    pub warnings: Vec<String>,
}

impl Joint {
    /// Stiffness along the sliding direction z, N/m.
    pub fn sliding_stiffness(&self) -> Option<&Statistics> {
        self.stiffness_n_per_m.get("z")
    }

    /// Whether the sliding stiffness is positive and reliable enough to be quoted alone: the
    /// scatter of its lines is within `SCATTER_OF_LINES` times the mean, and their noise within
    /// the mean.
    pub fn identified(&self) -> bool {
        let noise = self.noise_n_per_m.get("z").copied().unwrap_or(0.0);
        self.sliding_stiffness()
            .is_some_and(|k| k.mean > 0.0 && k.std <= SCATTER_OF_LINES * k.mean && noise <= k.mean)
    }
}

/// How well a model with K and C describes all cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Goodness {
    /// χ² per degree of freedom; about 0.8 to 1 if model, noise and assumed geometry errors
    /// describe the data.
    pub chi_square_per_dof: f64,
    /// The largest geometry error in the fit, in assumed standard deviations.
    pub largest_error: f64,
    /// Whether the search converged.
    pub settled: bool,
}

/// A method that could not be applied, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refusal {
    /// The method's name.
    pub method: String,
    /// Interface deformation modes of each virtual point.
    pub idms: usize,
    /// The reason given by the method.
    pub reason: String,
}

/// Stiffness and damping line by line.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct JointSpectrum {
    /// The lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// One curve for each method, IDM set and direction.
    pub curves: Vec<SpectrumCurve>,
}

/// One diagonal term of the joint over frequency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpectrumCurve {
    /// The method's name.
    pub method: String,
    /// Interface deformation modes of each virtual point.
    pub idms: usize,
    /// Direction: `x`, `y` or `z`.
    pub dof: String,
    /// Re Z, N/m; null if there is no value for the line.
    pub stiffness_n_per_m: Vec<Option<f64>>,
    /// Standard deviation of the stiffness from the FRFs' noise alone, N/m; empty where their
    /// variance is not known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stiffness_noise_n_per_m: Vec<Option<f64>>,
    /// Damping, N s/m; null if there is no value for the line.
    pub damping_n_s_per_m: Vec<Option<f64>>,
}
