//! The most likely parameters: Gauss–Newton steps on the posterior, with the motion eliminated at every line.

use super::ContactError;
use super::block::Block;
use super::line::{Normal, Residual};
use super::parameters::{COMPLIANCE, Parameters};
use super::unexplained;
use crate::frf::noise::shared_by_lines;
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// Width of the bins whose lines are summed and judged together, Hz.
pub const BIN_HZ: f64 = 25.0;
/// Steps at most.
const STEPS: usize = 60;
/// The compliance moves less than this part of its standard deviation: done.
const SETTLED: f64 = 0.03;
/// A cost may rise by this part between passes: the shifts' motion is that of the pass before.
const SLACK: f64 = 3e-3;

/// How often the noise is widened by what is left, at most.
const WIDENED: usize = 6;

/// A parameter that nothing tells stays finite by this part of its own unit.
const REGULAR: f64 = 1e-13;
/// Of what seems known of a combination of parameters, so much may be noise; the sums of so few lines scatter themselves, and tell no more.
const MOSTLY_NOISE: f64 = 0.8;

/// Motion of every line of every block.
type Motion = Vec<Vec<DVector<Complex<f64>>>>;

/// The lines of one block in one bin.
#[derive(Debug, Clone)]
pub struct Bin {
    /// Which block.
    pub block: usize,
    /// Its lowest frequency, Hz.
    pub low_hz: f64,
    /// What its lines say.
    pub normal: Normal,
    /// What is left of each row, line by line, over the noise.
    pub residuals: Vec<Residual>,
    motion: Vec<DVector<Complex<f64>>>,
}

/// The most likely parameters, and how well they are known.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The parameters.
    pub p: Vec<f64>,
    /// How they answer to what is measured and stated: half the inverse of the posterior's curvature.
    pub answer: DMatrix<f64>,
    /// Their covariance, before any misfit is counted.
    pub covariance: DMatrix<f64>,
    /// What each block says in each bin, at these parameters.
    pub bins: Vec<Bin>,
    /// By how much neighbouring lines share their noise.
    pub shared: f64,
    /// χ² per degree of freedom over all blocks.
    pub chi_square: f64,
}

/// Finds them. What the model leaves of a cell beyond its noise is counted as noise of that cell from then on.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the rows do not tell the motion or the parameters, or no minimum is reached.
pub fn solve(
    blocks: &mut [Block],
    parameters: &Parameters,
    sigma_per_s: f64,
) -> Result<Solution, ContactError> {
    let shared = shared_by_lines(sigma_per_s, distance_hz(blocks));
    let mut solution = settle(blocks, parameters, parameters.start(), shared)?;
    for _ in 0..WIDENED {
        let left: Vec<(usize, &Residual)> = (solution.bins.iter())
            .flat_map(|bin| bin.residuals.iter().map(|residual| (bin.block, residual)))
            .collect();
        if !unexplained::widen(blocks, &left) {
            break;
        }
        solution = settle(blocks, parameters, solution.p, shared)?;
    }
    let (answer, covariance) = under_noise(blocks, parameters, &solution)?;
    solution.answer = answer;
    solution.covariance = covariance;
    Ok(solution)
}

/// Steps from `p` to the nearest minimum.
fn settle(
    blocks: &[Block],
    parameters: &Parameters,
    mut p: Vec<f64>,
    shared: f64,
) -> Result<Solution, ContactError> {
    let first = evaluate(blocks, &p, None)?;
    let mut motion = motions(blocks, &first);
    let mut best: Option<(Vec<f64>, Vec<Bin>, f64)> = None;
    let mut damping = 1e-9;
    for _ in 0..STEPS {
        let bins = evaluate(blocks, &p, Some(&motion))?;
        let cost = cost(parameters, &p, &bins, shared);
        let better = best.as_ref().is_none_or(|(_, _, before)| cost <= before * (1.0 + SLACK));
        if better {
            motion = motions(blocks, &bins);
            damping = (damping * 0.1_f64).max(1e-9);
            best = Some((p.clone(), bins, cost));
        } else {
            damping = (damping * 100.0).max(1e-6);
        }
        let Some((at, bins, _)) = &best else { unreachable!("the first pass is better than none") };
        let (information, gradient) = normal(parameters, blocks, at, bins, shared);
        let (step, covariance) = newton(&information, &gradient, damping)?;
        let sigma = covariance[(COMPLIANCE, COMPLIANCE)].max(0.0).sqrt();
        if damping <= 1e-6 && step[COMPLIANCE].abs() <= SETTLED * sigma {
            let (_, undamped) = newton(&information, &gradient, 0.0)?;
            let chi_square = per_freedom(bins);
            let (p, bins) = (at.clone(), bins.clone());
            return Ok(Solution {
                p,
                answer: undamped.clone(),
                covariance: undamped,
                bins,
                shared,
                chi_square,
            });
        }
        p = at.iter().zip(step.iter()).map(|(at, step)| at + step).collect();
    }
    Err(ContactError::NotIdentified("the fit of the contact does not settle".into()))
}

fn distance_hz(blocks: &[Block]) -> f64 {
    let lines = blocks.iter().map(|block| &block.lines).find(|lines| lines.len() > 1);
    lines.map_or(1.0, |lines| lines[1].frequency_hz - lines[0].frequency_hz)
}

/// The posterior's curvature without what noise adds to it, inverted, and the covariance that follows. With J the information of the steps and
/// N what noise alone adds to it, the curvature is J − N in the mean, and the slope at the truth scatters by J: the covariance
/// is (J − N)⁻¹ J (J − N)⁻¹, as for any regression whose regressors are noisy.
fn under_noise(
    blocks: &[Block],
    parameters: &Parameters,
    solution: &Solution,
) -> Result<(DMatrix<f64>, DMatrix<f64>), ContactError> {
    let of_noise: Vec<Bin> = (solution.bins.par_iter())
        .map(|bin| {
            let block = &blocks[bin.block];
            let mut normal = Normal::none(block.parameters.len());
            for residual in &bin.residuals {
                normal.add_of_noise(block, residual.line, &solution.p);
            }
            Bin { normal, residuals: Vec::new(), motion: Vec::new(), ..*bin }
        })
        .collect();
    let (seen, _) = normal(parameters, blocks, &solution.p, &solution.bins, solution.shared);
    let noise = of_bins(blocks, &of_noise, solution.p.len(), solution.shared).0;
    // in units in which J is the identity, what noise adds to it has eigenvalues from 0 to about 1
    let unit = units(&seen);
    let scaled =
        |of: &DMatrix<f64>| DMatrix::from_fn(unit.len(), unit.len(), |i, j| of[(i, j)] * unit[i] * unit[j]);
    let lost = || ContactError::NotIdentified("the hits do not tell the force at the contact".into());
    let lower = (scaled(&seen) + DMatrix::identity(unit.len(), unit.len()) * REGULAR)
        .cholesky()
        .ok_or_else(lost)?
        .unpack();
    let half = lower.solve_lower_triangular(&scaled(&noise)).ok_or_else(lost)?;
    let added = lower.solve_lower_triangular(&half.transpose()).ok_or_else(lost)?.symmetric_eigen();
    let axes = lower.transpose().solve_upper_triangular(&added.eigenvectors).ok_or_else(lost)?;
    let left = added.eigenvalues.map(|of_noise| 1.0 - of_noise.clamp(0.0, MOSTLY_NOISE));
    let inverse = |power: i32| {
        let weighed = DMatrix::from_fn(unit.len(), unit.len(), |i, k| axes[(i, k)] * left[k].powi(-power));
        let whole = 0.5 * weighed * axes.transpose();
        scaled(&whole)
    };
    Ok((inverse(1), inverse(2)))
}

/// All blocks, bin by bin.
fn evaluate(blocks: &[Block], p: &[f64], before: Option<&Motion>) -> Result<Vec<Bin>, ContactError> {
    let mut tasks: Vec<(usize, std::ops::Range<usize>)> = Vec::new();
    for (b, block) in blocks.iter().enumerate() {
        let mut from = 0;
        while let Some(first) = block.lines.get(from) {
            let end_hz = (first.frequency_hz / BIN_HZ).floor() * BIN_HZ + BIN_HZ;
            let to = from + block.lines[from..].partition_point(|line| line.frequency_hz < end_hz);
            tasks.push((b, from..to));
            from = to;
        }
    }
    let bins: Vec<Option<Bin>> =
        tasks.into_par_iter().map(|(b, lines)| bin(blocks, b, lines, p, before)).collect();
    bins.into_iter().collect::<Option<Vec<Bin>>>().ok_or_else(|| {
        ContactError::NotIdentified("the points do not tell how arm B and specimen A move".into())
    })
}

fn bin(
    blocks: &[Block],
    b: usize,
    lines: std::ops::Range<usize>,
    p: &[f64],
    before: Option<&Motion>,
) -> Option<Bin> {
    let block = &blocks[b];
    let low_hz = (block.lines[lines.start].frequency_hz / BIN_HZ).floor() * BIN_HZ;
    let mut normal = Normal::none(block.parameters.len());
    let mut motion = Vec::with_capacity(lines.len());
    let mut residuals = Vec::with_capacity(lines.len());
    for line in lines {
        let shifts = before.filter(|_| !block.shifted_by.is_empty()).map(|motion| {
            [0, 1].map(|axis| {
                let mut shift = DVector::zeros(block.latent());
                for (other, weights) in &block.shifted_by {
                    if let Some(moved) = motion[*other].get(line) {
                        shift += moved * Complex::from(weights[axis]);
                    }
                }
                shift
            })
        });
        let (moved, residual) = normal.add(block, line, p, shifts.as_ref())?;
        motion.push(moved);
        residuals.push(residual);
    }
    Some(Bin { block: b, low_hz, normal, residuals, motion })
}

fn motions(blocks: &[Block], bins: &[Bin]) -> Motion {
    let mut all: Motion = vec![Vec::new(); blocks.len()];
    for bin in bins {
        all[bin.block].extend(bin.motion.iter().cloned());
    }
    all
}

fn per_freedom(bins: &[Bin]) -> f64 {
    let chi: f64 = bins.iter().map(|bin| bin.normal.chi_square).sum();
    let freedom: f64 = bins.iter().map(|bin| bin.normal.freedom).sum();
    if freedom > 0.0 { chi / freedom } else { f64::NAN }
}

fn cost(parameters: &Parameters, p: &[f64], bins: &[Bin], shared: f64) -> f64 {
    let prior = parameters.all().iter().zip(p).filter(|(own, _)| own.sigma.is_finite() && own.sigma > 0.0);
    let prior: f64 = prior.map(|(own, p)| 0.5 * ((p - own.start) / own.sigma).powi(2)).sum();
    let noise: f64 = bins.iter().map(|bin| bin.normal.chi_square).sum();
    prior + noise / shared
}

/// Half the posterior's curvature, and its slope. |r|² is minus the logarithm of a complex noise's likelihood, half of (p/σ)² that of a prior's.
fn normal(
    parameters: &Parameters,
    blocks: &[Block],
    p: &[f64],
    bins: &[Bin],
    shared: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let (mut information, mut gradient) = of_bins(blocks, bins, p.len(), shared);
    for (i, (own, p)) in parameters.all().iter().zip(p).enumerate() {
        if own.sigma.is_infinite() {
            continue;
        }
        // what is known exactly may not move at all
        let precision = 0.5 / (own.sigma * own.sigma).max(f64::MIN_POSITIVE.sqrt());
        information[(i, i)] += precision;
        gradient[i] += precision * (p - own.start);
    }
    (information, gradient)
}

/// The bins' part of it, for `count` parameters.
fn of_bins(blocks: &[Block], bins: &[Bin], count: usize, shared: f64) -> (DMatrix<f64>, DVector<f64>) {
    let mut information = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    for bin in bins {
        let (own, weight) = (&blocks[bin.block].parameters, shared.recip());
        for (i, to) in own.iter().enumerate() {
            gradient[*to] += weight * bin.normal.gradient[i];
            for (j, other) in own.iter().enumerate() {
                information[(*to, *other)] += weight * bin.normal.information[(i, j)];
            }
        }
    }
    (information, gradient)
}

/// Parameters in metres beside parameters in kilograms: in units of their own they can be factorised.
fn units(information: &DMatrix<f64>) -> DVector<f64> {
    information.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 })
}

/// The step, and the covariance of the parameters.
fn newton(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
) -> Result<(DVector<f64>, DMatrix<f64>), ContactError> {
    let lost = || ContactError::NotIdentified("the hits do not tell the force at the contact".into());
    let unit = units(information);
    let mut scaled = DMatrix::from_fn(unit.len(), unit.len(), |i, j| information[(i, j)] * unit[i] * unit[j]);
    for i in 0..unit.len() {
        scaled[(i, i)] = scaled[(i, i)].max(f64::MIN_POSITIVE) * (1.0 + damping) + REGULAR;
    }
    let factors = scaled.cholesky().ok_or_else(lost)?;
    let step = -factors.solve(&gradient.component_mul(&unit)).component_mul(&unit);
    let inverse = factors.inverse();
    let covariance =
        DMatrix::from_fn(unit.len(), unit.len(), |i, j| 0.5 * inverse[(i, j)] * unit[i] * unit[j]);
    Ok((step, covariance))
}
