//! The residuals' covariance: noise of all three measurements, and the effect of every error of
//! geometry, common to all bands.
//!
//! Noise of a band is circular, so its covariance is one Hermitian matrix N; that of Y^A and Y^B
//! reaches the residual through L and R. The nuisance parameters η (in standard deviations) act
//! through G = ∂r/∂η and are integrated out: Σ = N + G Gᵀ, which is never formed; with S = I + Gᵀ
//! N⁻¹ G, rᵀ Σ⁻¹ r = rᵀ N⁻¹ r − (Gᵀ N⁻¹ r)ᵀ S⁻¹ (Gᵀ N⁻¹ r), and the estimate of η is S⁻¹ Gᵀ N⁻¹ r.
//!
//! Effect of every error of geometry on a band's residual, at one set of Y^A and Y^B.

use super::FitError;
use super::block::{AIMS, CellGeometry, ReceptanceBlock, factors};
use super::chart::Chart;
use super::large_matrix::{crossed, rows as own_rows};
use super::model::{Predicted, Slopes, Wanted};
use super::noise::{AssemblyAims, ByImpact, Met, OfImpact, Whitening};
use super::problem::{Corrected, Problem};
use crate::parallel::prelude::*;
use crate::substructuring::product::product;
use crate::{C, Line};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Lines per band at which the noise that passes through L and R is evaluated: it varies slowly.
const SAMPLED: usize = 4;
/// Seed for the noise in the derivatives; different from that of the model's bias.
const NOISE_SEED: u64 = 0x6669_7422;
/// Columns of G that are multiplied in one product.
const TILE: usize = 128;

/// The noise of one band, and the effect of the nuisance parameters in units of it.
pub(super) struct BandWeight {
    pub(super) whitening: Whitening,
    pub(super) g: Whitened,
    /// Effect of one draw of the noise of Y^A and Y^B on a band's mean, in units of the residual's
    /// noise: on the residual (first column) and on ∂model/∂joint.
    ///
    /// J is evaluated at noisy Y^A and Y^B, so JᵀJ is too large by δJᵀδJ and Jᵀr by δJᵀδr: the
    /// estimate and its interval are corrected for both.
    pub(super) noise_inflation: DMatrix<f64>,
}

/// G, the effect of the nuisance parameters.
pub(super) struct Whitened {
    /// In units of the noise: 2m × the number of parameters before the assembly's aims.
    pub(super) written: DMatrix<f64>,
    /// The assembly's aims, not whitened.
    pub(super) aims: AssemblyAims,
}

/// The weights of all bands, and Gᵀ N⁻¹ G (its lower triangle).
pub(super) struct Weight {
    pub(super) bands: Vec<BandWeight>,
    pub(super) information: DMatrix<f64>,
}

/// The point at which the model is linearised.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub(super) problem: &'a Problem,
    pub(super) chart: &'a Chart,
    pub(super) p: &'a DVector<f64>,
    /// A's, B's and the assembly's cells at their currently estimated geometry.
    pub(super) cells: &'a [Vec<CellGeometry>; 3],
    pub(super) data: &'a Corrected,
}

impl Weight {
    pub(super) fn of(point: Point<'_>) -> Result<Weight, FitError> {
        let problem = point.problem;
        let factors = [0, 1].map(|place: usize| factors(&point.cells[place]));
        let (bands, met): (Vec<BandWeight>, Vec<Met>) = (problem.bands.par_iter())
            .enumerate()
            .map(|(band, lines)| {
                let weight = point.weight(band, lines.clone(), &factors)?;
                let met = Met::of(&weight.whitening, &problem.pushes, &weight.g.written, &weight.g.aims);
                Ok((weight, met))
            })
            .collect::<Result<Vec<_>, FitError>>()?
            .into_iter()
            .unzip();
        let mut information = DMatrix::zeros(problem.nuisances.std.len(), problem.nuisances.std.len());
        put_written(&bands, &mut information);
        put_aims(problem, &bands, &met, &mut information);
        Ok(Weight { bands, information })
    }
}

/// The lower triangle of Σ gᵀg for the explicitly stored columns, tile by tile.
fn put_written(bands: &[BandWeight], information: &mut DMatrix<f64>) {
    let count = bands.first().map_or(0, |band| band.g.written.ncols());
    let tile = |first: usize| first..(first + TILE).min(count);
    let places: Vec<(usize, usize)> = (0..count)
        .step_by(TILE)
        .flat_map(|row| (0..=row).step_by(TILE).map(move |column| (row, column)))
        .collect();
    let turned: Vec<DMatrix<f64>> = bands.par_iter().map(|band| band.g.written.transpose()).collect();
    let tiles: Vec<DMatrix<f64>> = (places.par_iter())
        .map(|&(row, column)| {
            let (rows, columns) = (tile(row), tile(column));
            let mut sum = DMatrix::zeros(rows.len(), columns.len());
            for (band, turned) in bands.iter().zip(&turned) {
                let right = band.g.written.columns(columns.start, columns.len());
                // copied to a separate matrix: products of views with few rows read past their end
                sum.gemm(1.0, &own_rows(turned, rows.start, rows.len()), &right, 1.0);
            }
            sum
        })
        .collect();
    for (at, tile) in places.into_iter().zip(tiles) {
        information.view_mut(at, tile.shape()).copy_from(&tile);
    }
}

/// The rows of the lower triangle that belong to the assembly's aims.
fn put_aims(problem: &Problem, bands: &[BandWeight], met: &[Met], information: &mut DMatrix<f64>) {
    let block = &problem.ajb;
    let sums: Vec<Option<OfImpact>> = (0..block.impacts.len())
        .into_par_iter()
        .map(|i| OfImpact::sum(i, bands.iter().map(|band| &band.g.aims).zip(met)))
        .collect();
    let first = problem.nuisances.of_assembly();
    for (i, sum) in sums.into_iter().enumerate() {
        let Some(sum) = sum else { continue };
        let place = |impact: usize, k: usize| problem.assembly_aim(impact, k);
        for (k, column) in sum.written.column_iter().enumerate() {
            (0..first).zip(column.iter()).for_each(|(j, v)| information[(place(i, k), j)] = *v);
        }
        for (later, tile) in sum.later.iter().enumerate() {
            for k in 0..tile.ncols() {
                for other in 0..tile.nrows() {
                    let (one, two) = (place(i, k), place(i + later, other));
                    information[(one.max(two), one.min(two))] = tile[(other, k)];
                }
            }
        }
    }
}

impl Point<'_> {
    /// The weight of one band; `factors` are those of A's and B's cells.
    fn weight(
        &self,
        band: usize,
        lines: Range<usize>,
        factors: &[DMatrix<f64>; 2],
    ) -> Result<BandWeight, FitError> {
        let Point { problem, data, .. } = *self;
        // variance of a band's mean: 2 for real and imaginary part together
        let averaged = 2.0 * problem.shared / lines.len() as f64;
        let step = (lines.len() / SAMPLED).max(1);
        let sampled = lines.clone().step_by(step).count() as f64;
        let mut parts = Vec::new();
        for l in lines.clone().step_by(step) {
            let wanted = Wanted { gains: true, ..Wanted::default() };
            let own = data.parts.each_ref().map(|part| &part[l..=l]);
            for predicted in problem.predict(self.chart, self.p, own, l..l + 1, wanted)? {
                for side in 0..2 {
                    let (left, right) = problem.through(side, &predicted);
                    let variance = &problem.parts[side].variance[l];
                    parts.push(ByImpact::of_cells(&left, right, variance, averaged / sampled));
                }
            }
        }
        let draws: Vec<[Line; 2]> = lines.clone().map(|l| problem.noise(l, NOISE_SEED)).collect();
        let moved = |sign: f64| {
            self.evaluated(&lines, true, factors, |side, l| {
                &data.parts[side][l] + &draws[l - lines.start][side] * C::from(sign)
            })
        };
        let here = self.evaluated(&lines, false, factors, |side, l| data.parts[side][l].clone())?.effect;
        let (plus, minus) = (moved(1.0)?, moved(-1.0)?);
        // neighbouring lines share their noise, but the draws are independent
        let half = 0.5 * problem.shared.sqrt();
        // if the effect of an error of geometry is uncertain by δG, δG η remains in the residual,
        // with η of unit variance
        parts.push(plus.effect.aims.apart(&minus.effect.aims, half).covariance(&problem.pushes));
        let mut noise = problem.own_noise[band].clone();
        noise.add_by_impact(&parts);
        noise.add(&((plus.effect.written - minus.effect.written) * half));
        let whitening = noise.whitening().ok_or(FitError::NoiseSingular)?;
        let g = Whitened { written: whitening.of(here.written), aims: here.aims };
        let mut noise_inflation = (plus.model - minus.model) * half;
        // what increases the model decreases the residual
        noise_inflation.column_mut(0).neg_mut();
        let noise_inflation = whitening.of(noise_inflation);
        Ok(BandWeight { whitening, g, noise_inflation })
    }
}

impl Whitened {
    /// G η in units of the noise.
    pub(super) fn times(&self, problem: &Problem, whitening: &Whitening, eta: &[f64]) -> DMatrix<f64> {
        let (written, _) = eta.split_at(problem.nuisances.of_assembly());
        let aims = self.aims.times(&problem.pushes, |i, k| eta[problem.assembly_aim(i, k)]);
        whitening.of(aims) + &self.written * DMatrix::from_column_slice(written.len(), 1, written)
    }

    /// Gᵀ N⁻¹ times the columns, which are given in units of the noise.
    pub(super) fn pulled(
        &self,
        problem: &Problem,
        whitening: &Whitening,
        columns: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut pulled = DMatrix::zeros(problem.nuisances.std.len(), columns.ncols());
        pulled.rows_mut(0, self.written.ncols()).copy_from(&crossed(&self.written, columns));
        let aims = self.aims.pulled(&problem.pushes, &whitening.back(columns.clone()));
        for (i, own) in aims.iter().enumerate() {
            for k in 0..self.aims.by_impact[i].ncols() {
                pulled.row_mut(problem.assembly_aim(i, k)).copy_from(&own.row(k));
            }
        }
        pulled
    }
}

/// A band's means at one set of Y^A and Y^B: real parts of the measured entries, followed by the
/// imaginary parts.
pub(super) struct Evaluated {
    /// The model, then its derivatives by the joint if requested.
    pub(super) model: DMatrix<f64>,
    pub(super) effect: Effect,
}

/// ∂r/∂η, η in standard deviations.
pub(super) struct Effect {
    /// For positions, tilts and the aims at A's and B's cells: one column each.
    pub(super) written: DMatrix<f64>,
    /// For the aims at the assembly's cells, which are the last nuisance parameters.
    pub(super) aims: AssemblyAims,
}

/// From a block's cells to the residual: left · cells · right. The cells' values follow from the
/// ports' admittance y.
struct Way {
    y: Line,
    /// Real parts, followed by the imaginary parts.
    left: DMatrix<f64>,
    right: Line,
}

/// Stacks the real parts on top of the imaginary parts.
fn stacked(y: &Line) -> DMatrix<f64> {
    let columns = y.column_iter().flat_map(|column| {
        let (re, im): (Vec<f64>, Vec<f64>) = column.iter().map(|v| (v.re, v.im)).unzip();
        re.into_iter().chain(im)
    });
    DMatrix::from_iterator(2 * y.nrows(), y.ncols(), columns)
}

impl Point<'_> {
    pub(super) fn evaluated(
        &self,
        lines: &Range<usize>,
        slopes: bool,
        factors: &[DMatrix<f64>; 2],
        part: impl Fn(usize, usize) -> Line,
    ) -> Result<Evaluated, FitError> {
        let Point { problem, chart, .. } = *self;
        let m = problem.entries();
        let share = 1.0 / lines.len() as f64;
        let mut model = DMatrix::zeros(2 * m, if slopes { 1 + chart.count() } else { 1 });
        let mut written = DMatrix::zeros(2 * m, problem.nuisances.of_assembly());
        let (rows, columns) = problem.layout.shape();
        let mut mean = Line::zeros(rows, columns);
        let mut ways: [Vec<Way>; 2] = [vec![], vec![]];
        let parts = [0, 1].map(|side| lines.clone().map(|l| part(side, l)).collect::<Vec<Line>>());
        let wanted = Wanted { y: true, gains: true, slopes };
        let own = parts.each_ref().map(Vec::as_slice);
        let predicted = problem.predict(chart, self.p, own, lines.clone(), wanted)?;
        for predicted in &predicted {
            mean += &predicted.y * C::from(share);
        }
        for (side, parts) in parts.into_iter().enumerate() {
            for (y, predicted) in parts.into_iter().zip(&predicted) {
                let (left, right) = problem.through(side, predicted);
                ways[side].push(Way { y, left: stacked(&left), right });
            }
        }
        let lines_slopes: Vec<Slopes> = predicted.into_iter().map(|line| line.slopes).collect();
        problem.add_measured(model.column_mut(0).as_mut_slice(), &mean, 1.0);
        problem.put_slopes(&mut model.as_mut_slice()[2 * m..], &lines_slopes, share);
        for (side, ways) in ways.iter().enumerate() {
            // Y^A and Y^B enter through the model, which the residual subtracts: minus
            self.aims(side, ways, &factors[side], -share, &mut written);
        }
        self.positions(&mut written);
        let aims = self.assembly_aims(&mean, &mut written);
        for (mut column, std) in written.column_iter_mut().zip(&problem.nuisances.std) {
            column.scale_mut(*std);
        }
        Ok(Evaluated { model, effect: Effect { written, aims } })
    }

    /// The aims at the assembly's cells, with the ports' admittance `y`; adds their sums, which are
    /// the effects of positions and tilts (unscaled).
    fn assembly_aims(&self, y: &Line, written: &mut DMatrix<f64>) -> AssemblyAims {
        let problem = self.problem;
        let block = &problem.ajb;
        let sensors = block.sensors.len();
        let (rows, left) = (problem.rows.len(), &problem.reductions.0);
        let mut by_impact = Vec::with_capacity(block.impacts.len());
        for (i, cells) in self.cells[2].chunks_exact(sensors.max(1)).enumerate() {
            let mut add = |j: usize, v: &[f64]| {
                let (re, im) = v.split_at(rows);
                let mut to = written.column_mut(j);
                let (to_re, to_im) = to.as_mut_slice().split_at_mut(problem.entries());
                for (to, own) in [(to_re, re), (to_im, im)] {
                    for (c, to) in to.chunks_exact_mut(rows).enumerate() {
                        let t = problem.reductions.1[(i, c)].re;
                        to.iter_mut().zip(own).for_each(|(to, v)| *to += v * t);
                    }
                }
            };
            let mut shown = DMatrix::<f64>::zeros(2 * rows, AIMS * sensors);
            // sum over all cells of the impact: two shifts and two tilts
            let mut together = DMatrix::<f64>::zeros(2 * rows, 4);
            for (s, (cell, sensor)) in cells.iter().zip(&block.sensors).enumerate() {
                let at = problem.nuisances.of_cell(2, block, s, i);
                let seen = product(&left.select_columns(&sensor.rows), &of_cell(cell, y));
                for (k, seen) in seen.column_iter().enumerate() {
                    let stacked: Vec<f64> =
                        seen.iter().map(|v| v.re).chain(seen.iter().map(|v| v.im)).collect();
                    if k < AIMS {
                        let std = problem.nuisances.std[at.aim + k];
                        let mut to = shown.column_mut(AIMS * s + k);
                        to.iter_mut().zip(&stacked).for_each(|(to, v)| *to = v * std);
                    }
                    if k < 3 {
                        if let Some(own) = at.sensor {
                            add(own + k, &stacked);
                        }
                    } else {
                        let mut to = together.column_mut(k - 3);
                        to.iter_mut().zip(&stacked).for_each(|(to, v)| *to += v);
                    }
                }
            }
            if let Some(own) =
                (sensors > 0).then(|| problem.nuisances.of_cell(2, block, 0, i).impact).flatten()
            {
                for (k, column) in together.as_slice().chunks_exact(2 * rows).enumerate() {
                    add(own + k, column);
                }
            }
            by_impact.push(shown);
        }
        AssemblyAims::of(by_impact)
    }

    /// Adds ∂(left · cells · right)/∂η (unscaled) of A or B, summed over `ways` and times `share`:
    /// for the aims, and for the tilts.
    ///
    /// All cells of an impact share one row of `right`, so the sum over lines is a matrix product:
    /// the effects on the cells, transformed by `left`, times the rows of `right`.
    fn aims(&self, side: usize, ways: &[Way], factors: &DMatrix<f64>, share: f64, effect: &mut DMatrix<f64>) {
        let problem = self.problem;
        let block: &ReceptanceBlock = &problem.parts[side];
        let sensors = block.sensors.len();
        let (rows, columns, lines) = (problem.rows.len(), problem.columns.len(), ways.len());
        let effects = effects(factors, ways);
        let mut first = 0;
        for (i, cells) in self.cells[side].chunks_exact(sensors.max(1)).enumerate() {
            // five aims per cell, then both tilts of all cells together
            let count = AIMS * sensors + 2;
            let height = rows * count;
            let mut shown = DMatrix::<f64>::zeros(height, 2 * lines);
            let mut come = DMatrix::zeros(2 * lines, 2 * columns);
            for (l, way) in ways.iter().enumerate() {
                for c in 0..columns {
                    let v = way.right[(i, c)] * share;
                    come[(l, c)] = v.re;
                    come[(lines + l, c)] = -v.im;
                    come[(l, columns + c)] = v.im;
                    come[(lines + l, columns + c)] = v.re;
                }
                let own = |part: usize| &effects.as_slice()[(part * lines + l) * effects.nrows() + first..];
                let mut values = own(0).iter().zip(own(1)).map(|(re, im)| C::new(*re, *im));
                for (s, sensor) in block.sensors.iter().enumerate() {
                    for k in 0..AIMS + 2 {
                        let at = rows * if k < AIMS { AIMS * s + k } else { AIMS * sensors + k - AIMS };
                        let (re, im) = shown.as_mut_slice().split_at_mut(height * lines);
                        let re = &mut re[height * l + at..][..rows];
                        let im = &mut im[height * l + at..][..rows];
                        for (row, v) in sensor.rows.iter().zip(values.by_ref()) {
                            let (left, left_im) =
                                way.left.as_slice()[2 * row * rows..][..2 * rows].split_at(rows);
                            let parts = re.iter_mut().zip(im.iter_mut()).zip(left.iter().zip(left_im));
                            for ((re, im), (left, left_im)) in parts {
                                *re += left * v.re - left_im * v.im;
                                *im += left * v.im + left_im * v.re;
                            }
                        }
                    }
                }
            }
            first += (AIMS + 2) * cells.iter().map(|cell| cell.seen.nrows()).sum::<usize>();
            // real parts in the first half of the columns, imaginary parts in the second
            let seen: DMatrix<f64> = shown * come;
            let mut add = |j: usize, parameter: usize| {
                let mut to = effect.column_mut(j);
                for (at, to) in to.as_mut_slice().chunks_exact_mut(rows).enumerate() {
                    let own = &seen.as_slice()[at * height + parameter * rows..][..rows];
                    to.iter_mut().zip(own).for_each(|(to, v)| *to += v);
                }
            };
            for s in 0..sensors {
                let at = problem.nuisances.of_cell(side, block, s, i);
                for k in 0..AIMS {
                    add(at.aim + k, AIMS * s + k);
                }
                if let Some(own) = at.impact.filter(|_| s == 0) {
                    add(own + 2, AIMS * sensors);
                    add(own + 3, AIMS * sensors + 1);
                }
            }
        }
    }

    /// A position error acts like the same aim error at all its cells: its effect is the sum of
    /// theirs, here over A's and B's cells.
    fn positions(&self, effect: &mut DMatrix<f64>) {
        let problem = self.problem;
        let height = effect.nrows();
        for (place, block) in problem.parts.iter().enumerate() {
            for i in 0..block.impacts.len() {
                for s in 0..block.sensors.len() {
                    let at = problem.nuisances.of_cell(place, block, s, i);
                    let own = [at.sensor.map(|own| (own, 0, 3)), at.impact.map(|own| (own, 3, 2))];
                    for (own, first, count) in own.into_iter().flatten() {
                        for k in 0..count {
                            // positions come before all aims
                            let (positions, aims) =
                                effect.as_mut_slice().split_at_mut((at.aim + first + k) * height);
                            let to = &mut positions[(own + k) * height..][..height];
                            to.iter_mut().zip(&aims[..height]).for_each(|(to, aim)| *to += aim);
                        }
                    }
                }
            }
        }
    }
}

/// The derivatives of all cells' values at some lines, in the order of
/// [`factors`]; one column per line with the real parts, then one per line
/// with the imaginary parts.
fn effects(factors: &DMatrix<f64>, ways: &[Way]) -> DMatrix<f64> {
    let mut y = DMatrix::zeros(factors.ncols(), 2 * ways.len());
    for (l, way) in ways.iter().enumerate() {
        for (at, v) in way.y.iter().enumerate() {
            y[(at, l)] = v.re;
            y[(at, ways.len() + l)] = v.im;
        }
    }
    factors * y
}

/// The derivatives of one cell's values (axes × 7) at the ports' admittance y: by three shifts of
/// the sensor, two of the impact, and two tilts.
fn of_cell(cell: &CellGeometry, y: &Line) -> Line {
    let motion = product(y, &cell.pushed);
    let by_impact = product(&cell.seen, &product(y, &cell.slopes));
    let mut effects = Line::zeros(cell.seen.nrows(), AIMS + 2);
    for (k, turned) in cell.turned.iter().enumerate() {
        effects.set_column(k, &product(turned, &motion).column(0));
    }
    effects.columns_mut(3, 4).copy_from(&by_impact);
    effects
}

impl Problem {
    /// The transformations from the cells of A or B to the residual: L T_u and T_f R.
    pub(super) fn through(&self, side: usize, predicted: &Predicted) -> (Line, Line) {
        let block = &self.parts[side];
        let left = self.layout.left(predicted, side).select_rows(&self.rows);
        let right = self.layout.right(predicted, side).select_columns(&self.columns);
        (product(&left, &block.t_u), product(&block.t_f, &right))
    }
}
