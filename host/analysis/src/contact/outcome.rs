//! The result: k_T and c_T with their confidence intervals, the sources of uncertainty of a
//! compliance, and k_T(f).

use super::block::Block;
use super::diagnosis::{Diagnosis, Doubt, diagnose, part};
use super::parameters::Cause;
use super::parameters::{COMPLIANCE, Parameters, RETARDATION};
use super::solver::BIN_HZ;
use super::solver::Certainty;
use super::solver::Solution;
use super::{ContactError, Input};
use crate::band::Band;
use crate::identified::COMPLIANCE_HALF_WIDTH;
use crate::substructuring::joint_over_bands::NORMAL_95;
use nalgebra::DVector;
use serde::Serialize;
use std::collections::BTreeMap;

/// k_T of one frequency bin, N/m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OfFrequency {
    /// Centre of the bin, Hz.
    pub frequency_hz: f64,
    /// k_T in the bin, N/m.
    pub k_t_n_per_m: Interval,
}

/// Stiffness and damping of the contact, with diagnostics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stiffness {
    /// k_T, N/m. The interval is that of the compliance, inverted.
    pub k_t_n_per_m: Interval,
    /// c_T, N s/m.
    pub c_t_n_s_per_m: Interval,
    /// The lines used, Hz.
    pub band_hz: Band,
    /// Lines used, over all impacts.
    pub lines: usize,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<Cause, f64>,
    /// k_T bin by bin.
    pub of_frequency: Vec<OfFrequency>,
    /// Tests of the assumptions.
    pub diagnosis: Diagnosis,
    /// The assumptions that do not hold.
    pub doubts: Vec<Doubt>,
    /// χ² per degree of freedom over all signals.
    pub chi_square: f64,
}

/// Assembles the result.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the compliance cannot be distinguished from zero.
pub fn of(
    input: &Input<'_>,
    blocks: &[Block],
    parameters: &Parameters,
    solution: &Solution,
) -> Result<Stiffness, ContactError> {
    let compliance = solution.p[COMPLIANCE];
    let covariance = &solution.certainty.covariance;
    let misfit = solution.chi_square.max(1.0);
    let mut row = DVector::zeros(solution.p.len());
    row[COMPLIANCE] = 1.0;
    let variances = of_sum(&row, parameters, &solution.certainty, misfit);
    let (k_t, budget) = stiffness_of(compliance, variances, input.priors.hammer_gain)?;
    let k = k_t.mean;
    // c = β/c₀, which the hammer's gain scales as it scales k
    let beta = solution.p[RETARDATION];
    let slopes = [-beta * k * k, k];
    let at = [COMPLIANCE, RETARDATION];
    let of_damping: f64 = (0..2)
        .flat_map(|i| (0..2).map(move |j| (i, j)))
        .map(|(i, j)| slopes[i] * slopes[j] * covariance[(at[i], at[j])])
        .sum();
    let of_gain = (input.priors.hammer_gain * beta * k).powi(2);
    let spread = NORMAL_95 * (of_damping.max(0.0) * misfit + of_gain).sqrt();
    let c_t = Interval { mean: beta * k, ci95: [beta * k - spread, beta * k + spread] };

    let diagnosis = diagnose(blocks, parameters, solution);
    Ok(Stiffness {
        k_t_n_per_m: k_t,
        c_t_n_s_per_m: c_t,
        band_hz: input.band_hz,
        lines: blocks.iter().map(|block| block.lines.len()).sum(),
        budget,
        of_frequency: of_frequency(blocks, solution, compliance),
        doubts: diagnosis.doubts(),
        diagnosis,
        chi_square: solution.chi_square,
    })
}

fn of_frequency(blocks: &[Block], solution: &Solution, compliance: f64) -> Vec<OfFrequency> {
    let mut lows: Vec<f64> = solution.bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let at = |low: f64| {
        let part = part(blocks, solution, |_, at| at == low)?;
        let (mean, half) = (compliance + part.deviation, NORMAL_95 * part.sigma);
        let interval = Interval { mean: mean.recip(), ci95: [(mean + half).recip(), (mean - half).recip()] };
        let known = half < COMPLIANCE_HALF_WIDTH * mean;
        known.then_some(OfFrequency { frequency_hz: low + 0.5 * BIN_HZ, k_t_n_per_m: interval })
    };
    lows.into_iter().filter_map(at).collect()
}

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub mean: f64,
    /// Its 95 % interval, lower and upper end.
    pub ci95: [f64; 2],
}

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
                "the contact is too stiff to be distinguished from a rigid one: k_T is above {:.0} N/µm",
                1e-6 / stiffest
            )
        } else {
            "the estimated compliance is negative".into()
        }));
    }
    let ci95 = [1.0 / (compliance + half), 1.0 / (compliance - half)];
    let shares = variances.into_iter().map(|(cause, variance)| (cause, variance.sqrt() / compliance));
    Ok((Interval { mean: 1.0 / compliance, ci95 }, shares.filter(|(_, share)| *share > 0.0).collect()))
}
