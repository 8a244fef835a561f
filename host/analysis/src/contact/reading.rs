//! One reading of the contact's compliance: its value and its uncertainties.

use super::Known;
use super::parameters::COMPLIANCE;
use nalgebra::DVector;

/// A level's compliance, its dependence on the parameters of the hits' fit, and its other
/// uncertainties.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The level's frequency, Hz.
    pub frequency_hz: f64,
    /// 1/k_T, m/N.
    pub compliance: f64,
    /// Its derivatives by the parameters.
    pub row: DVector<f64>,
    /// Variance of the motions per newton at this frequency.
    pub turning: f64,
    /// Variance due to where the shaker pushes.
    pub place: f64,
    /// Variance due to the scatter of the level itself.
    pub level: f64,
}

/// Difference between a level's compliance and that of the hits, in standard deviations of the
/// difference.
pub fn apart(known: &Known, reading: &Reading) -> f64 {
    let difference = &reading.row - unit(known);
    let own = reading.turning + reading.place + reading.level;
    let variance = known.of_sum(&difference).values().sum::<f64>() + own;
    (reading.compliance - known.p[COMPLIANCE]) / variance.sqrt()
}

/// The derivatives of the hits' own reading, which is the parameter itself.
pub fn unit(known: &Known) -> DVector<f64> {
    let mut unit = DVector::zeros(known.p.len());
    unit[COMPLIANCE] = 1.0;
    unit
}
