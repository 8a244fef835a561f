//! k_T's interval after further hits, predicted from the fit of those that exist.
//!
//! At the most likely parameters the information of every signal is known. One more hit in a cell
//! lowers the noise of the cell's signals and nothing else: positions, aims, gains and delays keep
//! their priors, and the part of a cell's signals that the model does not explain stays, or shows
//! once the noise is low enough, so that the interval tends to a limit. A change of the noise
//! changes the information of the cell's impact, which depends on some of the parameters only:
//! with A the curvature of the posterior without what noise contributes to it, and ΔA that change,
//! A⁻¹ changes by an update of that rank (Woodbury). No candidate is fitted again.
//!
//! The information of new hits is that of the present ones per hit. So the prediction lacks what
//! only new data can show: a contradiction, a bad place, and the scatter of the estimates of noise
//! and misfit.

use super::block::{Block, PlannedCell, plan_cell};
use super::model::{LineModel, Normal};
use super::outcome::{Interval, Stiffness, of_contact, of_sum};
use super::parameters::{Cause, Parameter, Parameters};
use super::solver::{self, Certainty, Motion, motions, weigh};
use super::{ContactError, Fit, Input, fitted};
use crate::identified::COMPLIANCE_HALF_WIDTH;
use crate::parallel::prelude::*;
use crate::structure::Structure;
use crate::substructuring::joint_over_bands::NORMAL_95;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use std::collections::BTreeMap;

/// A cell to which hits can be added.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ForecastCell {
    /// The assembly AJB, or B alone.
    pub structure: Structure,
    /// The impact's name.
    pub impact: String,
    /// The response point's name.
    pub point: String,
    /// Its hits in this forecast, including those that were added to it.
    pub hits: usize,
    block: usize,
    cell: usize,
}

/// Predicts k_T's interval. Hits can be added one cell after another; nothing is fitted again.
#[derive(Debug, Clone)]
pub struct Forecast {
    cells: Vec<ForecastCell>,
    blocks: Vec<Block>,
    parameters: Parameters,
    p: Vec<f64>,
    motion: Motion,
    shared: f64,
    /// The unexplained fractions of the signals, by block, cell and instrument.
    latent: Vec<Vec<[f64; 2]>>,
    /// Information of each block, over its parameters.
    information: Vec<DMatrix<f64>>,
    /// The part of each block's information on k_T that is not due to noise.
    not_noise: Vec<f64>,
    posterior: Posterior,
    interval: IntervalOf,
}

/// What makes an interval from the variance of the compliance.
#[derive(Debug, Clone, Copy)]
struct IntervalOf {
    compliance: f64,
    misfit: f64,
    /// Relative half width that is added to the statistical one, for errors that are there for
    /// certain.
    offset: f64,
}

impl IntervalOf {
    /// Relative half width of k_T's 95 % interval; infinite if the compliance cannot be
    /// distinguished from zero.
    fn half_width(&self, variance: f64) -> f64 {
        let part = self.of_compliance(variance) + self.offset;
        if part < COMPLIANCE_HALF_WIDTH { part / (1.0 - part * part) } else { f64::INFINITY }
    }

    /// Relative half width of the compliance's interval, without the offset.
    fn of_compliance(&self, variance: f64) -> f64 {
        NORMAL_95 * (variance * self.misfit).sqrt() / self.compliance
    }
}

/// The inverse of A, and A⁻¹ N A⁻¹ with the information N that noise alone contributes: the
/// covariance of the parameters is half their sum.
#[derive(Debug, Clone)]
pub(super) struct Posterior {
    pub(super) inverse: DMatrix<f64>,
    pub(super) of_noise: DMatrix<f64>,
    /// Derivatives of the contact's compliance by the parameters.
    pub(super) row: DVector<f64>,
}

/// The update of a [`Posterior`] by a change of A in some parameters.
struct Update<'a> {
    at: &'a [usize],
    /// (1 + ΔA C)⁻¹ ΔA, with C the inverse of A in these parameters.
    kernel: DMatrix<f64>,
}

impl Posterior {
    fn of(certainty: &Certainty, row: DVector<f64>) -> Self {
        let inverse = 2.0 * &certainty.answer;
        Posterior { of_noise: 2.0 * &certainty.covariance - &inverse, inverse, row }
    }

    fn certainty(&self) -> Certainty {
        Certainty { answer: 0.5 * &self.inverse, covariance: 0.5 * (&self.inverse + &self.of_noise) }
    }

    /// Variance of the compliance.
    pub(super) fn variance(&self) -> f64 {
        0.5 * (self.row.dot(&(&self.inverse * &self.row)) + self.row.dot(&(&self.of_noise * &self.row)))
    }

    /// `None` if A would not be positive.
    fn update<'a>(&self, at: &'a [usize], change: &DMatrix<f64>) -> Option<Update<'a>> {
        // metres and kilograms occur together: only the scaled matrices can be factorised
        let units = DVector::from_iterator(
            at.len(),
            at.iter().map(|i| self.inverse[(*i, *i)]).map(|d| if d > 0.0 { d.sqrt() } else { 1.0 }),
        );
        let change = solver::scaled(change, &units);
        let inverse = solver::scaled(&part(&self.inverse, at), &units.map(f64::recip));
        let one = DMatrix::identity(at.len(), at.len());
        let kernel = (one + &change * inverse).lu().solve(&change)?;
        let kernel = solver::scaled(&kernel, &units.map(f64::recip));
        kernel.iter().all(|value| value.is_finite()).then_some(Update { at, kernel })
    }

    /// Variance of the compliance after A has changed by `change` in the parameters `at`.
    pub(super) fn variance_after(&self, at: &[usize], change: &DMatrix<f64>) -> Option<f64> {
        let Update { kernel, .. } = self.update(at, change)?;
        let (inverse, of_noise) = (&self.inverse * &self.row, &self.of_noise * &self.row);
        let chosen = |of: &DVector<f64>| DVector::from_iterator(at.len(), at.iter().map(|i| of[*i]));
        let own = chosen(&inverse);
        let step = kernel * &own;
        let inverse = self.row.dot(&inverse) - own.dot(&step);
        let noise = self.row.dot(&of_noise) - 2.0 * chosen(&of_noise).dot(&step)
            + (part(&self.of_noise, at) * &step).dot(&step);
        Some(0.5 * (inverse + noise.max(0.0)))
    }

    /// Changes A by `change` in the parameters `at`; returns whether it stayed positive.
    pub(super) fn change(&mut self, at: &[usize], change: &DMatrix<f64>) -> bool {
        let Some(Update { at, kernel }) = self.update(at, change) else { return false };
        let columns = |of: &DMatrix<f64>| DMatrix::from_fn(of.nrows(), at.len(), |i, j| of[(i, at[j])]);
        let spread = columns(&self.inverse) * kernel;
        let of_noise = columns(&self.of_noise);
        let inner = &spread * part(&self.of_noise, at);
        let crossed = &of_noise * spread.transpose();
        self.of_noise += inner * spread.transpose() - &crossed - crossed.transpose();
        self.inverse -= &spread * columns(&self.inverse).transpose();
        true
    }

    /// Appends parameters of which only the prior is known.
    fn extend(&mut self, priors: &[Parameter]) {
        let count = self.inverse.nrows();
        let all = count + priors.len();
        self.row = std::mem::take(&mut self.row).resize_vertically(all, 0.0);
        for matrix in [&mut self.inverse, &mut self.of_noise] {
            *matrix = std::mem::take(matrix).resize(all, all, 0.0);
        }
        for (at, own) in priors.iter().enumerate() {
            self.inverse[(count + at, count + at)] = 2.0 * own.sigma * own.sigma;
        }
    }
}

/// The rows and columns of these parameters.
fn part(of: &DMatrix<f64>, at: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(at.len(), at.len(), |i, j| of[(at[i], at[j])])
}

/// Fits the hits and prepares the forecast. `planned` are the plan's cells without hits; those
/// whose impact is not part of the fit, or that are like none of its cells, cannot be predicted
/// before some of them are measured, and are left out.
///
/// # Errors
/// [`ContactError`] if there is no k_T yet.
pub fn forecast(
    input: &Input<'_>,
    planned: &[PlannedCell<'_>],
) -> Result<(Stiffness, Forecast), ContactError> {
    let (found, fit) = fitted(input)?;
    let Fit { mut parameters, mut blocks, solution, .. } = fit;
    let not_determined = || {
        ContactError::NotIdentified("the points do not determine the motion of arm B and specimen A".into())
    };
    let motion = motions(&blocks, &solution.bins);
    let of_noise: Vec<(usize, Normal)> = solution
        .bins
        .par_iter()
        .map(|bin| (bin.block, solver::of_noise(&blocks, bin, &solution.p)))
        .collect();
    let (compliance, row) = of_contact(&solution.p);
    let mut posterior = Posterior::of(&solution.certainty, row);
    let mut p = solution.p;
    let (shared, misfit) = (solution.shared, solution.chi_square.max(1.0));
    let informations = |blocks: &[Block], p: &[f64]| -> Option<Vec<DMatrix<f64>>> {
        blocks.par_iter().map(|block| solver::information(block, &motion, p, shared)).collect()
    };
    let information = informations(&blocks, &p).ok_or_else(not_determined)?;
    let answer = &posterior.inverse * &posterior.row;
    let not_noise = (blocks.iter().enumerate().zip(&information))
        .map(|((b, block), information)| {
            let own =
                DVector::from_iterator(block.parameters.len(), block.parameters.iter().map(|at| answer[*at]));
            let whole = (information * &own).dot(&own);
            let noise = of_noise.iter().filter(|(of, _)| *of == b);
            let noise: f64 = noise.map(|(_, normal)| (&normal.information * &own).dot(&own)).sum();
            if whole > 0.0 { (1.0 - noise / shared / whole).clamp(0.0, 1.0) } else { 1.0 }
        })
        .collect();
    let seen = |block: &Block, b: usize, line: usize, p: &[f64]| {
        let (map, offsets) = LineModel::new(block, p, block.lines[line].s).map();
        let moved = map * &motion[b][line];
        moved.iter().zip(offsets).map(|(moved, offset)| moved + offset).collect::<Vec<Complex<f64>>>()
    };
    let mut cells = measured(&blocks);
    let measured = cells.len();
    let mut latent = solver::latent(&blocks, &solution.bins);
    let known = p.len();
    for own in planned {
        if let Some((block, cell)) = plan_cell(&mut blocks, own, input, &mut parameters, &mut p, seen) {
            // that of a cell on the same body
            let all = &blocks[block].cells;
            let like = all.iter().position(|other| other.group == all[cell].group).unwrap_or(0);
            let own_latent = latent[block][like];
            latent[block].push(own_latent);
            cells.push(ForecastCell {
                structure: own.structure,
                impact: own.impact.into(),
                point: own.point.into(),
                hits: 0,
                block,
                cell,
            });
        }
    }
    posterior.extend(&parameters.all()[known..]);
    let information = if cells.len() == measured {
        information
    } else {
        // the same, with rows and parameters that carry no information yet
        informations(&blocks, &p).ok_or_else(not_determined)?
    };
    let interval = IntervalOf { compliance, misfit, offset: 0.0 };
    let mut forecast = Forecast {
        cells,
        blocks,
        parameters,
        p,
        motion,
        shared,
        latent,
        information,
        not_noise,
        posterior,
        interval,
    };
    forecast.state(&found.k_t_n_per_m);
    Ok((found, forecast))
}

/// The cells of the blocks that can be struck: a hit in one fills those that have the same hits.
fn measured(blocks: &[Block]) -> Vec<ForecastCell> {
    let of_block = |(b, block): (usize, &Block)| {
        let structure = if block.along_z.is_some() { Structure::B } else { Structure::Ajb };
        let struck = block.cells.iter().enumerate().filter(|(_, cell)| cell.first.is_none());
        let own = struck.map(|(c, cell)| ForecastCell {
            structure,
            impact: block.impact.clone(),
            point: cell.name.clone(),
            hits: cell.hits,
            block: b,
            cell: c,
        });
        own.collect::<Vec<_>>()
    };
    blocks.iter().enumerate().flat_map(of_block).collect()
}

impl Forecast {
    /// Makes the present interval this one, which contains errors that the fit does not know of.
    pub fn state(&mut self, k_t: &Interval) {
        let [low, high] = k_t.ci95;
        let stated = 0.5 * k_t.mean * (low.recip() - high.recip());
        self.interval.offset = (stated - self.interval.of_compliance(self.posterior.variance())).max(0.0);
    }

    /// The cells that hits can be added to, those of the plan without hits last.
    pub fn cells(&self) -> &[ForecastCell] {
        &self.cells
    }

    /// Relative half width of k_T's 95 % interval with the hits of this forecast; infinite if k_T
    /// is not identified.
    pub fn half_width(&self) -> f64 {
        self.interval.half_width(self.posterior.variance())
    }

    /// The same after `more` hits in the cell with this index. If the prediction fails, it is that
    /// without them.
    pub fn half_width_after(&self, cell: usize, more: usize) -> f64 {
        let changed = self.changed(cell, more);
        let variance =
            changed.and_then(|(block, change, _)| self.posterior.variance_after(&block.parameters, &change));
        variance.map_or(self.half_width(), |variance| self.interval.half_width(variance))
    }

    /// Adds hits to the cell with this index; returns whether the prediction succeeded.
    pub fn add(&mut self, cell: usize, more: usize) -> bool {
        let Some((block, change, information)) = self.changed(cell, more) else { return false };
        if !self.posterior.change(&block.parameters, &change) {
            return false;
        }
        let at = self.cells[cell].block;
        self.information[at] = information;
        self.blocks[at] = block;
        self.cells[cell].hits += more;
        true
    }

    /// The block after more hits in a cell, the change of A in its parameters, and its information.
    fn changed(&self, cell: usize, more: usize) -> Option<(Block, DMatrix<f64>, DMatrix<f64>)> {
        let own = &self.cells[cell];
        let mut block = self.blocks[own.block].clone();
        for cell in block.hit_again(own.cell, more) {
            solver::reveal(&mut block, cell, self.latent[own.block][cell]);
        }
        weigh(&mut block);
        let information = solver::information(&block, &self.motion, &self.p, self.shared)?;
        let change = (&information - &self.information[own.block]) * self.not_noise[own.block];
        Some((block, change, information))
    }

    /// The half width with `factor` times the hits in those cells that `of` selects, or the present
    /// one if that is smaller.
    pub fn half_width_with_hits(&self, factor: usize, of: impl Fn(&ForecastCell) -> bool) -> f64 {
        let mut all = self.clone();
        for cell in (0..self.cells.len()).filter(|cell| of(&self.cells[*cell])) {
            all.add(cell, self.cells[cell].hits * factor.saturating_sub(1));
        }
        all.half_width().min(self.half_width())
    }

    /// Relative standard deviation of k_T by cause, with the hits of this forecast.
    pub fn budget(&self) -> BTreeMap<Cause, f64> {
        let IntervalOf { compliance, misfit, .. } = self.interval;
        let variances = of_sum(&self.posterior.row, &self.parameters, &self.posterior.certainty(), misfit);
        variances.into_iter().map(|(cause, variance)| (cause, variance.sqrt() / compliance)).collect()
    }

    /// The half width if the stated errors of one cause were `factor` times as large, with the same
    /// hits: places measured again, sensors calibrated again.
    pub fn half_width_with(&self, cause: Cause, factor: f64) -> f64 {
        let stated = |own: &Parameter| own.cause == cause && own.sigma.is_finite() && own.sigma > 0.0;
        let own = self.parameters.all().iter().enumerate().filter(|(_, own)| stated(own));
        let (at, precision): (Vec<usize>, Vec<f64>) =
            own.map(|(at, own)| (at, 0.5 * ((factor * own.sigma).powi(-2) - own.sigma.powi(-2)))).unzip();
        let change = DMatrix::from_diagonal(&DVector::from_vec(precision));
        let variance = self.posterior.variance_after(&at, &change);
        self.interval.half_width(variance.unwrap_or_else(|| self.posterior.variance()))
    }
}
