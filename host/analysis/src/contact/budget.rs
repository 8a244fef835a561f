//! Sources of the uncertainty of a compliance.

use super::ContactError;
use super::covariance::Certainty;
use super::interval::Interval;
use super::parameters::Parameters;
use super::priors::Cause;
use crate::identified::COMPLIANCE_HALF_WIDTH;
use crate::substructuring::joint_over_bands::NORMAL_95;
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Variances by cause, in the squared unit of the uncertain quantity; they add up.
pub type Variances = BTreeMap<Cause, f64>;

/// Variances of Σ row_i p_i by cause.
pub fn of_sum(row: &DVector<f64>, parameters: &Parameters, certainty: &Certainty, misfit: f64) -> Variances {
    let variance = (&certainty.covariance * row).dot(row);
    // the estimate's response to an error of a prior, whose precision enters as half an inverse
    // variance
    let answer = &certainty.answer * row;
    let mut variances = Variances::new();
    let mut noise = variance;
    for (own, answer) in parameters.all().iter().zip(answer.iter()) {
        if !own.sigma.is_finite() || own.sigma == 0.0 || own.cause == Cause::Noise {
            continue;
        }
        let share = (answer / own.sigma).powi(2);
        *variances.entry(own.cause).or_default() += share;
        noise -= share;
    }
    variances.insert(Cause::Noise, noise.max(0.0));
    variances.insert(Cause::Misfit, (variance * (misfit - 1.0)).max(0.0));
    variances
}

/// k_T of a compliance in m/N with these variances, and its relative standard deviation by cause.
/// The hammer's gain, to which k_T is proportional, is added.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the compliance cannot be distinguished from zero.
pub fn stiffness_of(
    compliance: f64,
    mut variances: Variances,
    hammer_gain: f64,
) -> Result<(Interval, BTreeMap<Cause, f64>), ContactError> {
    *variances.entry(Cause::Gains).or_default() += (hammer_gain * compliance).powi(2);
    let half = NORMAL_95 * variances.values().sum::<f64>().sqrt();
    if !(compliance > 0.0 && half < COMPLIANCE_HALF_WIDTH * compliance) {
        let stiffest = compliance + half;
        return Err(ContactError::NotIdentified(if stiffest > 0.0 {
            format!(
                "the contact is too stiff to be told from a rigid one: k_T is above {:.0} N/µm",
                1e-6 / stiffest
            )
        } else {
            "the compliance comes out negative".into()
        }));
    }
    let ci95 = [1.0 / (compliance + half), 1.0 / (compliance - half)];
    let shares = variances.into_iter().map(|(cause, variance)| (cause, variance.sqrt() / compliance));
    Ok((Interval { mean: 1.0 / compliance, ci95 }, shares.filter(|(_, share)| *share > 0.0).collect()))
}
