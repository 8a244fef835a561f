//! One reading of the contact's compliance: what it says, and what it is uncertain by.

use super::Known;
use super::parameters::COMPLIANCE;
use nalgebra::DVector;

/// A level's compliance as it depends on the parameters of the hits' fit, and what else it is uncertain by.
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
    /// Of where the shaker pushes.
    pub place: f64,
    /// Of the level's own scatter.
    pub level: f64,
}

/// By how many standard deviations of the difference a level's compliance is apart from that of the hits.
pub fn apart(known: &Known, reading: &Reading) -> f64 {
    let difference = &reading.row - unit(known);
    let own = reading.turning + reading.place + reading.level;
    let variance = known.of_sum(&difference).values().sum::<f64>() + own;
    (reading.compliance - known.p[COMPLIANCE]) / variance.sqrt()
}

/// The hits' own reading: the parameter itself.
pub fn unit(known: &Known) -> DVector<f64> {
    let mut unit = DVector::zeros(known.p.len());
    unit[COMPLIANCE] = 1.0;
    unit
}
