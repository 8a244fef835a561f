//! The most likely parameters and their uncertainty: Gauss–Newton steps on the posterior, with the
//! motion eliminated at every line, and sums over all lines of all blocks by frequency bin.
//!
//! Residuals of a cell beyond its noise come from aim errors that other impacts do not show, a bad
//! hit or a misplaced point, and are proportional to the signal. They are therefore counted as
//! noise proportional to it, separately for each cell and instrument, with the fraction that brings
//! the residual to its expected value, times [`ALIKE`]. An outlying cell thus gets less weight; the
//! weights of the others stay the same.

use super::ContactError;
use super::block::{Block, BlockCell, BlockLine};
use super::model::{Normal, Residual};
use super::parameters::{CENTRE, COMPLIANCE, HAMMER, Parameters};
use crate::errors_in_variables::NoiseInflation;
use crate::frf::noise::shared_by_lines;
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// Largest number of steps.
const STEPS: usize = 60;
/// Before the noise is widened by the residuals, outlying cells, with too much weight, can keep the
/// search from converging. It then ends where [`FEW`] steps lower the cost by less than this
/// fraction. Widening the noise earlier would take for noise what the parameters can still explain.
const SLOW: f64 = 1e-4;
/// Steps over which [`SLOW`] is judged.
const FEW: usize = 5;
/// Convergence: the step changes the compliance by less than this fraction of its standard
/// deviation, and all parameters together lower the cost by less than this. The first condition
/// alone can hold by chance while others, which the compliance follows later, are many standard
/// deviations away.
const SETTLED: f64 = 0.01;
/// Number of consecutive steps with an unchanged compliance after which the search ends: any
/// further decrease of the cost then comes from the shifts' motion, which always lags by one pass.
const AT_REST: usize = 4;
/// Relative rise of the cost that is accepted between passes: the shifts' motion is that of the
/// previous pass.
const SLACK: f64 = 1e-3;
/// Damping up to which a step counts as undamped.
const HARDLY_DAMPED: f64 = 1e-6;

/// Factor on the residual of a cell beyond its noise. Most of it is one error of its hits, for
/// example their aim, which changes all lines alike, so that lines do not average it. Taken for
/// noise that is independent at each line (a factor of 1), it made intervals of k_T miss by up to
/// four standard deviations. A mode is about nine lines wide, and its residuals count as one.
const ALIKE: f64 = 3.0;

/// Largest number of times that the noise is widened by the residuals.
const WIDENED: usize = 6;

/// The most likely parameters and their uncertainty.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The parameters.
    pub p: Vec<f64>,
    /// Their uncertainty.
    pub certainty: Certainty,
    /// Normal equations of each block and bin at these parameters.
    pub bins: Vec<Bin>,
    /// Variance factor for the noise that neighbouring lines share.
    pub shared: f64,
    /// χ² per degree of freedom over all blocks.
    pub chi_square: f64,
}

/// A point of the search.
struct SearchPoint {
    p: Vec<f64>,
    bins: Vec<Bin>,
    cost: f64,
}

/// The posterior with the current noise.
struct Posterior<'a> {
    blocks: &'a [Block],
    parameters: &'a Parameters,
    shared: f64,
}

/// Whether the noise has been widened by the residuals yet.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Widening {
    /// No: the search ends where it is slow, because the next one moves its end.
    ToCome,
    /// Yes: the search ends where it has converged.
    Begun,
}

/// How a search begins.
#[derive(Debug, Clone, Default)]
pub struct Start {
    /// Parameters that the search leaves at these values.
    pub held: Vec<(usize, f64)>,
    /// Whether they are searched too after a first minimum. Otherwise only the uncertainty contains
    /// what they may deviate from.
    pub released: bool,
}

/// Finds the most likely parameters, with the noise that they leave: the best of the minima that
/// the searches from these starts reach. Residuals of a cell beyond its noise are counted as noise
/// of that cell. The uncertainty contains that the truth may be at another of these minima.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the rows do not determine the motion or the parameters, or no
/// minimum is reached.
pub fn solve(
    blocks: &[Block],
    parameters: &Parameters,
    starts: &[Start],
    sigma_per_s: f64,
) -> Result<(Vec<Block>, Solution), ContactError> {
    let shared = shared_by_lines(sigma_per_s, distance_hz(blocks));
    let mut from = parameters.start();
    Posterior { blocks, parameters, shared }.centre(&mut from)?;
    let searched: Vec<Result<Minimum, ContactError>> =
        starts.par_iter().map(|start| search(blocks, parameters, &from, start, shared)).collect();
    let reached: Vec<(f64, Vec<f64>)> =
        searched.iter().flatten().map(|found| (found.cost, found.place.p.clone())).collect();
    let mut refused = None;
    let mut best: Option<Minimum> = None;
    for found in searched {
        match found {
            Ok(found) if best.as_ref().is_none_or(|best| found.cost < best.cost) => best = Some(found),
            Ok(_) => {}
            Err(error) => refused = Some(refused.unwrap_or(error)),
        }
    }
    let Minimum { blocks, place: here, cost } = best.ok_or_else(|| refused.unwrap_or_else(not_converged))?;
    let (information, _) = Posterior { blocks: &blocks, parameters, shared }.normal(&here);
    let mut certainty = certainty(&blocks, &here.bins, &here.p, &information, shared)?;
    if let Some((weight, way)) = other_minimum(cost, &here.p, &reached) {
        certainty.covariance += &way * way.transpose() * weight;
    }
    let chi_square = per_freedom(&here.bins);
    Ok((blocks, Solution { p: here.p, certainty, bins: here.bins, shared, chi_square }))
}

/// Of the minima that are reached, each with its cost, the one that adds most to the variance of
/// the compliance at the best minimum `p`: the probability that the truth is there and not at `p`,
/// which follows from the costs, and the difference of the parameters. `None` if all searches end
/// at `p`.
fn other_minimum(cost: f64, p: &[f64], reached: &[(f64, Vec<f64>)]) -> Option<(f64, DVector<f64>)> {
    let of = |(other, there): &(f64, Vec<f64>)| {
        let way = DVector::from_iterator(p.len(), there.iter().zip(p).map(|(there, here)| there - here));
        ((1.0 + (other - cost).exp()).recip(), way)
    };
    let effect = |(weight, way): &(f64, DVector<f64>)| weight * way[COMPLIANCE].powi(2);
    let all = reached.iter().map(of).filter(|one| effect(one) > 0.0);
    all.max_by(|a, b| effect(a).total_cmp(&effect(b)))
}

/// The end of a search, with its noise.
struct Minimum {
    blocks: Vec<Block>,
    place: SearchPoint,
    /// Minus the logarithm of the posterior. Searches end with different noise, so that it contains
    /// the noise's normalisation.
    cost: f64,
}

fn not_converged() -> ContactError {
    ContactError::NotIdentified("the fit of the contact does not converge".into())
}

fn search(
    blocks: &[Block],
    parameters: &Parameters,
    from: &[f64],
    start: &Start,
    shared: f64,
) -> Result<Minimum, ContactError> {
    let mut blocks = blocks.to_vec();
    let (mut searched, mut p) = (parameters.clone(), from.to_vec());
    for (at, value) in &start.held {
        searched.hold(*at, *value);
        p[*at] = *value;
    }
    let motion = motions(&blocks, &evaluate(&blocks, &p, None)?);
    let posterior = Posterior { blocks: &blocks, parameters: &searched, shared };
    let (mut here, mut settled) = posterior.settle(p, motion, Widening::ToCome)?;
    if start.released {
        searched = parameters.clone();
        let motion = motions(&blocks, &here.bins);
        let posterior = Posterior { blocks: &blocks, parameters: &searched, shared };
        (here, settled) = posterior.settle(here.p, motion, Widening::ToCome)?;
    }
    for _ in 0..WIDENED {
        let left: Vec<(usize, &Residual)> = (here.bins.iter())
            .flat_map(|bin| bin.residuals.iter().map(|residual| (bin.block, residual)))
            .collect();
        if !widen(&mut blocks, &left) && settled {
            break;
        }
        let motion = motions(&blocks, &here.bins);
        let posterior = Posterior { blocks: &blocks, parameters: &searched, shared };
        (here, settled) = posterior.settle(here.p, motion, Widening::Begun)?;
    }
    if !settled {
        return Err(not_converged());
    }
    let noise: f64 = here.bins.iter().map(|bin| normalisation(&blocks[bin.block], bin)).sum();
    let cost = Posterior { blocks: &blocks, parameters, shared }.prior(&here.p)
        + (here.bins.iter().map(|bin| bin.normal.chi_square).sum::<f64>() + noise) / shared;
    Ok(Minimum { blocks, place: here, cost })
}

/// Logarithm by which counting more noise than measured lowers the likelihood of a bin: that of its
/// variance for each degree of freedom.
fn normalisation(block: &Block, bin: &Bin) -> f64 {
    let of_line = |residual: &Residual| -> f64 {
        let line = &block.lines[residual.line];
        let row = |(r, (_, free)): (usize, &(Complex<f64>, f64))| {
            -2.0 * free * (line.weight[r] * line.sigma[r]).ln()
        };
        residual.rows.iter().enumerate().map(row).sum()
    };
    if block.counts { bin.residuals.iter().map(of_line).sum() } else { 0.0 }
}

/// The fit of changed blocks with the current noise.
pub struct Refit {
    /// The parameters.
    pub p: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// The motion at every line.
    pub motion: Motion,
}

/// Fits the blocks again, from parameters near the minimum.
///
/// # Errors
/// As [`solve`].
pub fn refit(
    blocks: &[Block],
    parameters: &Parameters,
    shared: f64,
    p: &[f64],
) -> Result<Refit, ContactError> {
    let motion = motions(blocks, &evaluate(blocks, p, None)?);
    let posterior = Posterior { blocks, parameters, shared };
    let (here, settled) = posterior.settle(p.to_vec(), motion, Widening::Begun)?;
    if !settled {
        return Err(not_converged());
    }
    let (information, _) = posterior.normal(&here);
    let covariance = certainty(blocks, &here.bins, &here.p, &information, shared)?.covariance;
    Ok(Refit { motion: motions(blocks, &here.bins), covariance, p: here.p })
}

impl Posterior<'_> {
    /// Steps from `p` to the nearest minimum, with `motion` as that at `p` or near it; the flag
    /// states whether it converged. The shifts' motion is that of the last accepted point, so the
    /// cost of a point is not computed with the motion of the next. If a step seems to increase the
    /// cost, the current point is therefore evaluated again with the new motion.
    fn settle(
        &self,
        p: Vec<f64>,
        mut motion: Motion,
        widening: Widening,
    ) -> Result<(SearchPoint, bool), ContactError> {
        let mut here = self.place(p, &motion)?;
        motion = motions(self.blocks, &here.bins);
        let mut stale = true;
        let mut damping = 1e-9;
        let mut at_rest = 0;
        let mut costs = Vec::new();
        for step in 0..STEPS {
            costs.push(here.cost);
            let before = step.checked_sub(FEW).filter(|_| widening == Widening::ToCome);
            if before.is_some_and(|before| here.cost > costs[before] * (1.0 - SLOW)) {
                break;
            }
            let (information, gradient) = self.normal(&here);
            let (step, sigma) = newton(&information, &gradient, damping)?;
            if damping <= HARDLY_DAMPED && step[COMPLIANCE].abs() <= SETTLED * sigma {
                at_rest += 1;
                if -0.5 * gradient.dot(&step) <= SETTLED || at_rest >= AT_REST {
                    return Ok((here, true));
                }
            } else {
                at_rest = 0;
            }
            let next = here.p.iter().zip(step.iter()).map(|(at, step)| at + step).collect();
            let next = self.place(next, &motion)?;
            if stale && next.cost > here.cost * (1.0 + SLACK) {
                here = self.place(here.p, &motion)?;
                stale = false;
            }
            if next.cost <= here.cost * (1.0 + SLACK) {
                motion = motions(self.blocks, &next.bins);
                (here, stale) = (next, true);
                damping = (damping * 0.1_f64).max(1e-9);
            } else {
                damping = (damping * 100.0).max(1e-6);
            }
        }
        Ok((here, false))
    }

    /// Moves the contact's centre to where the cost is smallest along each axis, if it is much
    /// smaller there. Where the faces rock on each other, the cost bends the wrong way between the
    /// stated place and one some standard deviations off, so that steps of all parameters together
    /// end elsewhere.
    fn centre(&self, p: &mut [f64]) -> Result<(), ContactError> {
        for at in [CENTRE, CENTRE + 1] {
            let own = &self.parameters.all()[at];
            if !(own.sigma.is_finite() && own.sigma > 0.0) {
                continue;
            }
            let cost = |value: f64| -> Result<f64, ContactError> {
                let mut there = p.to_vec();
                there[at] = value;
                Ok(self.cost(&there, &evaluate(self.blocks, &there, None)?))
            };
            let step = own.sigma / PER_SIGMA;
            let places: Vec<f64> = (-FAR..=FAR).map(|n| own.start + f64::from(n) * step).collect();
            let costs: Vec<f64> = places.iter().map(|place| cost(*place)).collect::<Result<_, _>>()?;
            let stated = costs[FAR as usize];
            // beyond an end it may be smaller still
            let inside = (1..costs.len() - 1).min_by(|a, b| costs[*a].total_cmp(&costs[*b]));
            let Some(least) = inside.filter(|least| costs[*least] < MUCH_SMALLER * stated) else { continue };
            let bend = costs[least - 1] + costs[least + 1] - 2.0 * costs[least];
            let beyond =
                if bend > 0.0 { 0.5 * step * (costs[least - 1] - costs[least + 1]) / bend } else { 0.0 };
            p[at] = places[least] + beyond;
        }
        Ok(())
    }

    fn place(&self, p: Vec<f64>, motion: &Motion) -> Result<SearchPoint, ContactError> {
        let bins = evaluate(self.blocks, &p, Some(motion))?;
        Ok(SearchPoint { cost: self.cost(&p, &bins), p, bins })
    }

    fn cost(&self, p: &[f64], bins: &[Bin]) -> f64 {
        let noise: f64 = bins.iter().map(|bin| bin.normal.chi_square).sum();
        self.prior(p) + noise / self.shared
    }

    /// Minus the logarithm of the prior.
    fn prior(&self, p: &[f64]) -> f64 {
        let own = self.parameters.all().iter().zip(p);
        let own = own.filter(|(own, _)| own.sigma.is_finite() && own.sigma > 0.0);
        let stated: f64 = own.map(|(own, value)| 0.5 * ((value - own.expected(p)) / own.sigma).powi(2)).sum();
        let compared = self.parameters.compared().iter();
        stated + compared.map(|own| 0.5 * own.deviation(p).0.powi(2)).sum::<f64>()
    }

    /// Half the posterior's curvature, and its gradient. |r|² is minus the log-likelihood of
    /// complex noise; a prior contributes half of (p/σ)².
    fn normal(&self, at: &SearchPoint) -> (DMatrix<f64>, DVector<f64>) {
        let bins = at.bins.iter().map(|bin| (bin.block, &bin.normal));
        let (mut information, mut gradient) = summed(self.blocks, bins, at.p.len(), self.shared);
        for (i, (own, p)) in self.parameters.all().iter().zip(&at.p).enumerate() {
            if own.sigma.is_infinite() {
                continue;
            }
            // an exactly known parameter must not move
            let precision = 0.5 / (own.sigma * own.sigma).max(f64::MIN_POSITIVE.sqrt());
            information[(i, i)] += precision;
            let deviation = p - own.expected(&at.p);
            gradient[i] += precision * deviation;
            if own.per_newton {
                gradient[HAMMER] -= precision * own.start * deviation;
                information[(HAMMER, HAMMER)] += precision * own.start * own.start;
                information[(i, HAMMER)] -= precision * own.start;
                information[(HAMMER, i)] -= precision * own.start;
            }
        }
        for own in self.parameters.compared() {
            let (deviation, by) = own.deviation(&at.p);
            for (i, one) in by {
                gradient[i] += 0.5 * one * deviation;
                for (j, other) in by {
                    information[(i, j)] += 0.5 * one * other;
                }
            }
        }
        (information, gradient)
    }
}

/// The search for a start of the contact's centre: steps per standard deviation, and steps to each
/// side of the stated place.
const PER_SIGMA: f64 = 2.0;
const FAR: i32 = 6;

/// The search starts elsewhere if the cost there is below this part of that at the stated place.
/// Errors of other places, or of what is stated of the specimens, lower it less.
const MUCH_SMALLER: f64 = 0.1;

fn distance_hz(blocks: &[Block]) -> f64 {
    let lines = blocks.iter().map(|block| &block.lines).find(|lines| lines.len() > 1);
    lines.map_or(1.0, |lines| lines[1].frequency_hz - lines[0].frequency_hz)
}

fn per_freedom(bins: &[Bin]) -> f64 {
    let chi: f64 = bins.iter().map(|bin| bin.normal.chi_square).sum();
    let freedom: f64 = bins.iter().map(|bin| bin.normal.freedom).sum();
    if freedom > 0.0 { chi / freedom } else { f64::NAN }
}

/// The step, and the standard deviation of the compliance.
fn newton(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
) -> Result<(DVector<f64>, f64), ContactError> {
    let unit = units(information);
    let mut scaled = scaled(information, &unit);
    for i in 0..unit.len() {
        scaled[(i, i)] = scaled[(i, i)].max(f64::MIN_POSITIVE) * (1.0 + damping) + REGULAR;
    }
    let factors = scaled.cholesky().ok_or_else(ContactError::no_force)?;
    let step = -factors.solve(&gradient.component_mul(&unit)).component_mul(&unit);
    let mut one = DVector::zeros(unit.len());
    one[COMPLIANCE] = unit[COMPLIANCE];
    let variance = 0.5 * factors.solve(&one)[COMPLIANCE] * unit[COMPLIANCE];
    Ok((step, variance.max(0.0).sqrt()))
}

/// Relative regularisation, which keeps a parameter without any information finite.
pub const REGULAR: f64 = 1e-13;
/// Upper limit of the fraction of information that is attributed to noise. The sums over so few
/// lines scatter themselves, so that a larger fraction is not significant.
const MOSTLY_NOISE: f64 = 0.8;

/// Response of the parameters to data and priors, and their covariance.
#[derive(Debug, Clone)]
pub struct Certainty {
    /// Response to measured data and priors: half the inverse of the posterior's curvature.
    pub answer: DMatrix<f64>,
    /// Covariance of the parameters, without any factor for misfit.
    pub covariance: DMatrix<f64>,
}

/// Scale of each parameter. Metres and kilograms occur together: only the scaled matrix can be
/// factorised.
pub fn units(information: &DMatrix<f64>) -> DVector<f64> {
    information.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 })
}

/// `matrix` in these scales.
pub fn scaled(matrix: &DMatrix<f64>, unit: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(unit.len(), unit.len(), |i, j| matrix[(i, j)] * unit[i] * unit[j])
}

/// Certainty of the most likely parameters `p`, whose `information` includes the contribution of
/// noise.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the information matrix is not positive definite.
pub fn certainty(
    blocks: &[Block],
    bins: &[Bin],
    p: &[f64],
    information: &DMatrix<f64>,
    shared: f64,
) -> Result<Certainty, ContactError> {
    let of_noise: Vec<(usize, Normal)> =
        bins.par_iter().map(|bin| (bin.block, of_noise(blocks, bin, p))).collect();
    let (noise, _) = summed(blocks, of_noise.iter().map(|(block, normal)| (*block, normal)), p.len(), shared);
    let unit = units(information);
    let regular = scaled(information, &unit) + DMatrix::identity(unit.len(), unit.len()) * REGULAR;
    let noise_inflation =
        NoiseInflation::of(regular, &scaled(&noise, &unit)).ok_or_else(ContactError::no_force)?;
    let inverse = |power: i32| {
        let weight = |of_noise: f64| (1.0 - of_noise.clamp(0.0, MOSTLY_NOISE)).powi(-power);
        // the information is half of the curvature
        scaled(&(0.5 * noise_inflation.weighed(weight)), &unit)
    };
    Ok(Certainty { answer: inverse(1), covariance: inverse(2) })
}

/// What noise alone contributes to the information of a bin.
pub fn of_noise(blocks: &[Block], bin: &Bin, p: &[f64]) -> Normal {
    let block = &blocks[bin.block];
    let mut normal = Normal::none(block.parameters.len());
    for residual in &bin.residuals {
        normal.add_of_noise(block, residual.line, p);
    }
    normal
}

/// Width of the bins whose lines are summed and judged together, Hz.
pub const BIN_HZ: f64 = 25.0;

/// Motion at every line of every block.
pub type Motion = Vec<Vec<DVector<Complex<f64>>>>;

/// The lines of one block in one bin.
#[derive(Debug, Clone)]
pub struct Bin {
    /// Index of the block.
    pub block: usize,
    /// Its lowest frequency, Hz.
    pub low_hz: f64,
    /// Normal equations of its lines.
    pub normal: Normal,
    /// Residuals of each row at each line, divided by the noise.
    pub residuals: Vec<Residual>,
    motion: Vec<DVector<Complex<f64>>>,
}

/// Evaluates all blocks, bin by bin.
pub fn evaluate(blocks: &[Block], p: &[f64], before: Option<&Motion>) -> Result<Vec<Bin>, ContactError> {
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
        ContactError::NotIdentified("the points do not determine the motion of arm B and specimen A".into())
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
        let shifts = before.and_then(|motion| shifts(block, motion, line));
        let (moved, residual) = normal.add(block, line, p, shifts.as_ref())?;
        motion.push(moved);
        residuals.push(residual);
    }
    Some(Bin { block: b, low_hz, normal, residuals, motion })
}

/// The motion that a shift of the impact by one metre along each of two axes adds at a line; `None`
/// if it is not known.
pub fn shifts(block: &Block, motion: &Motion, line: usize) -> Option<[DVector<Complex<f64>>; 2]> {
    (!block.shifted_by.is_empty()).then(|| {
        [0, 1].map(|axis| {
            let mut shift = DVector::zeros(block.latent());
            for (other, weights) in &block.shifted_by {
                if let Some(moved) = motion[*other].get(line) {
                    shift += moved * Complex::from(weights[axis]);
                }
            }
            shift
        })
    })
}

/// Information of all lines of a block, over its parameters; `None` if its rows do not determine
/// the motion.
pub fn information(block: &Block, motion: &Motion, p: &[f64], shared: f64) -> Option<DMatrix<f64>> {
    let mut normal = Normal::none(block.parameters.len());
    for line in 0..block.lines.len() {
        normal.add(block, line, p, shifts(block, motion, line).as_ref())?;
    }
    Some(normal.information / shared)
}

/// The best-fitting motion of each line, by block.
pub fn motions(blocks: &[Block], bins: &[Bin]) -> Motion {
    let mut all: Motion = vec![Vec::new(); blocks.len()];
    for bin in bins {
        all[bin.block].extend(bin.motion.iter().cloned());
    }
    all
}

/// Information matrix and gradient of all bins together, for `count` parameters.
pub fn summed<'a>(
    blocks: &[Block],
    bins: impl Iterator<Item = (usize, &'a Normal)>,
    count: usize,
    shared: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut information = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    let weight = shared.recip();
    for (block, normal) in bins {
        let own = &blocks[block].parameters;
        for (i, to) in own.iter().enumerate() {
            gradient[*to] += weight * normal.gradient[i];
            let mut column = information.column_mut(*to);
            for (other, value) in own.iter().zip(normal.information.column(i)) {
                column[*other] += weight * value;
            }
        }
    }
    (information, gradient)
}

/// χ² per degree of freedom above which the noise does not explain the residuals of a cell. A cell
/// has about fifty degrees of freedom, so its χ² scatters by 0.2.
const STRAYS: f64 = 1.6;

/// Relative accuracy to which the fraction of the signal is found.
const ACCURACY: f64 = 0.03;

/// One row of one line: |r|², its expected value divided by the noise variance, the noise variance
/// without any addition, |value|².
type Seen = [f64; 4];

/// Widens the noise where needed, from the residuals of each block's lines; returns whether a
/// change was large enough to fit again.
pub fn widen(blocks: &mut [Block], left: &[(usize, &Residual)]) -> bool {
    let mut changed = false;
    for (b, block) in blocks.iter_mut().enumerate() {
        let seen = seen_by_cell(block, left.iter().filter(|(of, _)| *of == b).map(|(_, own)| *own));
        for (cell, seen) in block.cells.iter_mut().zip(&seen) {
            for (part, seen) in cell.unexplained.iter_mut().zip(seen) {
                let found = part_of_signal(seen);
                changed |= (found - *part).abs() > 0.1 * part.max(found);
                *part = found;
            }
        }
        weigh(block);
    }
    changed
}

/// The rows of a block's lines by cell and instrument (load cells and spots, or the point).
fn seen_by_cell<'a>(block: &Block, left: impl Iterator<Item = &'a Residual>) -> Vec<[Vec<Seen>; 2]> {
    let mut seen: Vec<[Vec<Seen>; 2]> = vec![[Vec::new(), Vec::new()]; block.cells.len()];
    for residual in left {
        let line = &block.lines[residual.line];
        for (r, row) in block.rows.iter().enumerate() {
            let (left, free) = residual.rows[r];
            let variance = line.weight[r].powi(-2);
            let instrument = usize::from(row.channel >= 3);
            seen[row.cell][instrument].push([
                left.norm_sqr() * variance,
                free,
                line.sigma[r].powi(2),
                line.value[r].norm_sqr(),
            ]);
        }
    }
    seen
}

/// The fraction of the signal that the model leaves unexplained, for each block, cell and
/// instrument, whether or not it is significant yet: that of the cell, but at least that of all such
/// cells of the structure together. As hits lower the noise, it becomes visible.
pub fn latent(blocks: &[Block], bins: &[Bin]) -> Vec<Vec<[f64; 2]>> {
    let seen: Vec<Vec<[Vec<Seen>; 2]>> = (blocks.iter().enumerate())
        .map(|(b, block)| {
            seen_by_cell(block, bins.iter().filter(|bin| bin.block == b).flat_map(|bin| &bin.residuals))
        })
        .collect();
    let pooled = |alone: bool, instrument: usize| {
        let own =
            (blocks.iter().zip(&seen)).filter(|(block, _)| block.counts && block.along_z.is_some() == alone);
        let rows: Vec<Seen> = own
            .flat_map(|(block, seen)| block.cells.iter().zip(seen))
            .filter(|(cell, _)| cell.unexplained[instrument] == 0.0)
            .flat_map(|(_, seen)| seen[instrument].iter().copied())
            .collect();
        excess(&rows, 1.0)
    };
    let pools = [false, true].map(|alone| [0, 1].map(|instrument| pooled(alone, instrument)));
    (blocks.iter().zip(&seen))
        .map(|(block, seen)| {
            let pools = pools[usize::from(block.along_z.is_some())];
            let of_cell = |(cell, seen): (&BlockCell, &[Vec<Seen>; 2])| {
                [0, 1].map(|instrument| match cell.unexplained[instrument] {
                    0.0 => excess(&seen[instrument], 1.0).max(pools[instrument]),
                    known => known,
                })
            };
            block.cells.iter().zip(seen).map(of_cell).collect()
        })
        .collect()
}

/// Counts the unexplained fraction of a cell's signals that [`latent`] found, once the noise is so
/// low that [`widen`] would.
pub fn reveal(block: &mut Block, cell: usize, latent: [f64; 2]) {
    for (instrument, part) in latent.into_iter().enumerate() {
        let rows: Vec<usize> = (0..block.rows.len())
            .filter(|r| block.rows[*r].cell == cell && usize::from(block.rows[*r].channel >= 3) == instrument)
            .collect();
        let over = |line: &BlockLine, r: usize| (part * line.value[r].norm() / line.sigma[r]).powi(2);
        let all = block.lines.iter().flat_map(|line| rows.iter().map(move |r| over(line, *r)));
        let mean = all.sum::<f64>() / (rows.len() * block.lines.len()).max(1) as f64;
        let unexplained = &mut block.cells[cell].unexplained[instrument];
        if 1.0 + mean > STRAYS && part > *unexplained {
            *unexplained = part;
        }
    }
}

/// Sets the weights of a block from its noise and the fractions of the signals that are not
/// explained; a cell without hits has none.
pub fn weigh(block: &mut Block) {
    let parts: Vec<Option<f64>> = (block.rows.iter())
        .map(|row| {
            let cell = &block.cells[row.cell];
            (cell.hits > 0).then(|| cell.unexplained[usize::from(row.channel >= 3)])
        })
        .collect();
    for line in &mut block.lines {
        for (r, part) in parts.iter().enumerate() {
            let alike = part.map(|part| ALIKE * part * line.value[r].norm());
            line.weight[r] = alike.map_or(0.0, |alike| line.sigma[r].hypot(alike).recip());
        }
    }
}

/// The fraction of the signal to be added to the noise so that χ² has its expected value; 0 if χ²
/// is close enough already.
fn part_of_signal(seen: &[Seen]) -> f64 {
    excess(seen, STRAYS)
}

/// The same with χ² close enough up to `allowed` times its expected value.
fn excess(seen: &[Seen], allowed: f64) -> f64 {
    let expected: f64 = seen.iter().map(|[_, free, ..]| free).sum();
    let chi = |part: f64| -> f64 {
        seen.iter().map(|[left, _, variance, signal]| left / (variance + part * part * signal)).sum()
    };
    if expected < 1.0 || chi(0.0) <= allowed * expected {
        return 0.0;
    }
    let mut high = 1e-3;
    while chi(high) > expected && high < 1e3 {
        high *= 2.0;
    }
    let mut low = 0.0;
    while high - low > ACCURACY * high {
        let middle = 0.5 * (low + high);
        if chi(middle) > expected {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::{other_minimum, part_of_signal};

    #[test]
    fn a_minimum_counts_as_likely_as_its_cost_says() {
        let place = |compliance: f64| vec![compliance, 3.0 * compliance];
        let here = place(1.0);
        assert_eq!(other_minimum(5.0, &here, &[(5.0, place(1.0))]), None);
        // as likely as the best minimum, and one that is farther but hardly possible
        let all = [(5.0, place(1.0)), (5.0, place(1.5)), (35.0, place(3.0))];
        let (weight, way) = other_minimum(5.0, &here, &all).expect("another minimum");
        assert_eq!((weight, way.as_slice()), (0.5, [0.5, 1.5].as_slice()));
        // e times less likely
        let (weight, _) = other_minimum(5.0, &here, &[(6.0, place(1.5))]).expect("another minimum");
        assert!((weight - 1.0 / (1.0 + 1.0_f64.exp())).abs() < 1e-12, "{weight}");
    }

    #[test]
    fn what_is_left_in_proportion_to_the_signal_is_found() {
        // variance 1, signals of 10 to 1000, a residual of 2 % of the signal in addition to noise
        let seen: Vec<[f64; 4]> = (0..60)
            .map(|i| {
                let signal: f64 = 10_f64.powf(1.0 + f64::from(i) / 30.0);
                [1.0 + (0.02 * signal).powi(2), 1.0, 1.0, signal * signal]
            })
            .collect();
        assert!((part_of_signal(&seen) - 0.02).abs() < 0.04 * 0.02, "{}", part_of_signal(&seen));
        let quiet: Vec<[f64; 4]> =
            seen.iter().map(|[_, free, variance, signal]| [1.2, *free, *variance, *signal]).collect();
        assert_eq!(part_of_signal(&quiet), 0.0);
    }
}
