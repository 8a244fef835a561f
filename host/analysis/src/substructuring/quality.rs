//! How well virtual points and internals represent the measurement.

use super::consistency::Consistency;
use super::idm::Dof;
use super::method::Method;
use crate::structure::Structure;
use serde::Serialize;

/// Internals used by a form of Eq. (3): n_i and n_c, and whether P and Q cover every interface
/// motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Internals {
    /// The form of Eq. (3).
    pub method: Method,
    /// n_c, number of interface deformation modes.
    pub idms: usize,
    /// n_i, number of internal impacts.
    pub impacts: usize,
    /// n_i, number of internal responses.
    pub responses: usize,
    /// The line at which ranks and condition numbers are computed, Hz.
    pub frequency_hz: f64,
    /// Rank of P to rounding.
    pub rank_p: usize,
    /// Rank of Q to rounding.
    pub rank_q: usize,
    /// Condition number of P, rotations scaled by 40 mm: upper bound of the noise amplification.
    pub condition_p: f64,
    /// Condition number of Q.
    pub condition_q: f64,
}

/// Quality of the virtual points of A alone and B alone for one IDM set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualPointQuality {
    /// A or B.
    pub substructure: Structure,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// The modes.
    pub modes: Vec<Dof>,
    /// Condition number of R_u, rotations scaled by 40 mm.
    pub condition_responses: f64,
    /// Condition number of R_f, rotations scaled by 40 mm.
    pub condition_impacts: f64,
    /// Names of the channels, in the order of `consistency.specific_sensor`.
    pub channels: Vec<String>,
    /// Names of the impacts, in the order of `consistency.specific_impact`.
    pub impacts: Vec<String>,
    /// Frequency of each line of `consistency.overall_*`, Hz.
    pub frequency_hz: Vec<f64>,
    /// The part of motion and force that the virtual point retains.
    pub consistency: Consistency,
    /// Fraction of lines with a passive driving point, by degree of freedom in the set's order.
    pub passivity: Vec<f64>,
    /// Agreement of Y_ij and Y_ji at the virtual point, 0…1; rotations in metres over 40 mm.
    pub reciprocity: f64,
}
