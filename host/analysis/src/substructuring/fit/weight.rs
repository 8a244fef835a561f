//! The residuals' covariance: noise of all three measurements, and what every error of geometry does to all bands at once.
//!
//! Noise of a band is circular, so its covariance is one Hermitian matrix N; that of Y^A and Y^B reaches the residual through L and
//! R. The nuisance parameters η (in standard deviations) act through G = ∂r/∂η and are integrated out: Σ = N + G Gᵀ, never formed;
//! with S = I + Gᵀ N⁻¹ G, rᵀ Σ⁻¹ r = rᵀ N⁻¹ r − (Gᵀ N⁻¹ r)ᵀ S⁻¹ (Gᵀ N⁻¹ r), and η's own estimate is S⁻¹ Gᵀ N⁻¹ r.

use super::FitError;
use super::block::{Block, Line};
use super::cell::CellGeometry;
use super::chart::Chart;
use super::model::Predicted;
use super::problem::{Corrected, Problem};
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix, DVector};
use std::ops::{AddAssign, Range};

type C = Complex<f64>;

/// Lines per band at which the noise that passes through L and R is evaluated: it varies slowly.
const SAMPLED: usize = 4;
/// Of the noise that the derivatives hold; another than that of the model's bias.
const NOISE_SEED: u64 = 0x6669_7422;

/// The noise of one band, and the nuisance parameters' effect in units of it.
pub(super) struct BandWeight {
    /// Maps (real parts, imaginary parts) to unit variance, 2m × 2m.
    whiten: DMatrix<f64>,
    /// 2m × nuisance parameters.
    pub(super) g: DMatrix<f64>,
    /// What noise does to the derivatives and, in the same draw, to the residual; in units of the residual's noise.
    pub(super) feigned: Feigned,
}

/// One draw of the noise of Y^A and Y^B as it shows in a band's mean: ∂model/∂joint (2m × parameters) and the residual (2m × 1).
///
/// J is evaluated at noisy Y^A and Y^B, so JᵀJ is too large by δJᵀδJ and Jᵀr by δJᵀδr: the estimate and its interval are
/// corrected by both.
pub(super) struct Feigned {
    pub(super) slopes: DMatrix<f64>,
    pub(super) residual: DMatrix<f64>,
}

impl BandWeight {
    /// Residuals or derivatives in units of their noise, real parts above imaginary ones.
    pub(super) fn whitened(&self, values: &DMatrix<C>) -> DMatrix<f64> {
        &self.whiten * stacked(values)
    }
}

/// The weights of all bands, and Gᵀ N⁻¹ G.
pub(super) struct Weight {
    pub(super) bands: Vec<BandWeight>,
    pub(super) information: DMatrix<f64>,
}

fn stacked(values: &DMatrix<C>) -> DMatrix<f64> {
    let m = values.nrows();
    DMatrix::from_fn(
        2 * m,
        values.ncols(),
        |r, c| {
            if r < m { values[(r, c)].re } else { values[(r - m, c)].im }
        },
    )
}

/// Where the model is linearised.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub(super) problem: &'a Problem,
    pub(super) chart: &'a Chart,
    pub(super) p: &'a DVector<f64>,
    /// A's, B's and the assembly's cells where their geometry is believed to be.
    pub(super) cells: &'a [Vec<CellGeometry>; 3],
    pub(super) data: &'a Corrected,
}

impl Weight {
    pub(super) fn of(point: Point<'_>) -> Result<Weight, FitError> {
        let problem = point.problem;
        let bands: Vec<BandWeight> = (0..problem.bands.len())
            .into_par_iter()
            .map(|band| point.weight(problem.bands[band].clone()))
            .collect::<Result<_, FitError>>()?;
        let count = problem.nuisances.std.len();
        let products: Vec<DMatrix<f64>> = bands.par_iter().map(|b| b.g.transpose() * &b.g).collect();
        let information = products.into_iter().fold(DMatrix::zeros(count, count), |a, b| a + b);
        Ok(Weight { bands, information })
    }
}

/// A band's means at one set of Y^A and Y^B.
struct Evaluated {
    model: DVector<C>,
    slopes: DMatrix<C>,
    /// ∂r/∂η, η in standard deviations.
    effect: DMatrix<C>,
}

impl Point<'_> {
    fn weight(&self, lines: Range<usize>) -> Result<BandWeight, FitError> {
        let Point { problem, data, .. } = *self;
        let share = 1.0 / lines.len() as f64;
        // variance of a band's mean: 2 for real and imaginary part together
        let averaged = 2.0 * problem.shared * share;
        let mut noise = Hermitian::zeros(problem.entries());
        let ajb = &problem.ajb;
        let (t_u, t_f) = self.reductions();
        let variance = (lines.clone().map(|l| &ajb.variance[l]))
            .fold(ajb.variance[lines.start].map(|_| 0.0), |sum, v| sum + v * share);
        noise.spread(&t_u, &t_f, &variance, averaged);
        let step = (lines.len() / SAMPLED).max(1);
        let sampled = lines.clone().step_by(step).count() as f64;
        for l in lines.clone().step_by(step) {
            let predicted =
                problem.predict(self.chart, self.p, [&data.parts[0][l], &data.parts[1][l]], l, false)?;
            for side in 0..2 {
                let (left, right) = self.through(side, &predicted);
                noise.spread(&left, &right, &problem.parts[side].variance[l], averaged / sampled);
            }
        }
        let draws: Vec<[Line; 2]> = lines.clone().map(|l| problem.noise(l, NOISE_SEED)).collect();
        let moved = |sign: f64| {
            self.evaluated(&lines, |side, l| {
                &data.parts[side][l] + &draws[l - lines.start][side] * C::from(sign)
            })
        };
        let here = self.evaluated(&lines, |side, l| data.parts[side][l].clone())?;
        let (plus, minus) = (moved(1.0)?, moved(-1.0)?);
        // neighbouring lines share their noise, the draws do not
        let half = C::from(0.5 * problem.shared.sqrt());
        // an error of geometry whose effect is known only to δG leaves δG η behind, and η has variance one
        noise.add(&((&plus.effect - &minus.effect) * half), 1.0);
        let whiten = noise.whitening().ok_or(FitError::NoiseSingular)?;
        let g = &whiten * stacked(&here.effect);
        let slopes = &whiten * stacked(&((plus.slopes - minus.slopes) * half));
        let residual = (minus.model - plus.model) * half;
        let residual = &whiten * stacked(&DMatrix::from_column_slice(residual.len(), 1, residual.as_slice()));
        let feigned = Feigned { slopes, residual };
        Ok(BandWeight { whiten, g, feigned })
    }

    /// T_u and T_f of the assembly's measured ports.
    fn reductions(&self) -> (Line, Line) {
        let Problem { ajb, rows, columns, .. } = self.problem;
        (ajb.t_u.select_rows(rows).map(C::from), ajb.t_f.select_columns(columns).map(C::from))
    }

    /// What the cells of A or B pass through on their way to the residual: L T_u and T_f R.
    fn through(&self, side: usize, predicted: &Predicted) -> (Line, Line) {
        let problem = self.problem;
        let block = &problem.parts[side];
        let (row, column) = problem.layout.corner(side);
        let left = predicted.left.select_rows(&problem.rows);
        let right = predicted.right.select_columns(&problem.columns);
        (
            left.columns(row, block.rows.count) * block.t_u.map(C::from),
            block.t_f.map(C::from) * right.rows(column, block.columns.count),
        )
    }

    fn evaluated(
        &self,
        lines: &Range<usize>,
        part: impl Fn(usize, usize) -> Line,
    ) -> Result<Evaluated, FitError> {
        let Point { problem, chart, .. } = *self;
        let m = problem.entries();
        let share = 1.0 / lines.len() as f64;
        let mut out = Evaluated {
            model: DVector::zeros(m),
            slopes: DMatrix::zeros(m, chart.count()),
            effect: DMatrix::zeros(m, problem.nuisances.std.len()),
        };
        let (rows, columns) = problem.layout.shape();
        let mut mean = Line::zeros(rows, columns);
        for l in lines.clone() {
            let y = [part(0, l), part(1, l)];
            let predicted = problem.predict(chart, self.p, [&y[0], &y[1]], l, true)?;
            mean += &predicted.y * C::from(share);
            for (mut column, slope) in out.slopes.column_iter_mut().zip(&predicted.slopes) {
                column += DVector::from_column_slice(problem.measured(slope).as_slice()) * C::from(share);
            }
            for (side, y) in y.iter().enumerate() {
                let (left, right) = self.through(side, &predicted);
                let way = Way { left: &left, right: &right, share: -share };
                // Y^A and Y^B stand on the model's side of the residual: minus
                self.aims(side, y, &self.cells[side], &way, &mut out.effect);
            }
        }
        out.model.copy_from_slice(problem.measured(&mean).as_slice());
        let (t_u, t_f) = self.reductions();
        let way = Way { left: &t_u, right: &t_f, share: 1.0 };
        self.aims(2, &mean, &self.cells[2], &way, &mut out.effect);
        self.positions(&mut out.effect);
        for (j, std) in problem.nuisances.std.iter().enumerate() {
            out.effect.column_mut(j).scale_mut(*std);
        }
        Ok(out)
    }

    /// Adds ∂(left · cells · right)/∂η (unscaled) of a block whose ports move by `y`: of the aims only.
    fn aims(&self, place: usize, y: &Line, cells: &[CellGeometry], way: &Way<'_>, effect: &mut DMatrix<C>) {
        let problem = self.problem;
        let block: &Block = problem.blocks()[place];
        let Way { left, right, share } = *way;
        let (rows, columns) = (left.nrows(), right.ncols());
        let mut cells = cells.iter();
        for i in 0..block.impacts.len() {
            for (s, sensor) in block.sensors.iter().enumerate() {
                let Some(cell) = cells.next() else { continue };
                let at = problem.nuisances.of_cell(place, block, s, i);
                let motion = y * &cell.pushed;
                let by_impact = &cell.seen * (y * &cell.slopes);
                let mut add = |j: usize, axes: &[C]| {
                    let mut column = effect.column_mut(j);
                    for (axis, row) in sensor.rows.iter().enumerate() {
                        let value = axes[axis] * share;
                        for c in 0..columns {
                            let value = value * right[(i, c)];
                            for r in 0..rows {
                                column[c * rows + r] += left[(r, *row)] * value;
                            }
                        }
                    }
                };
                for (k, turned) in cell.turned.iter().enumerate() {
                    add(at.aim + k, (turned * &motion).as_slice());
                }
                for k in 0..2 {
                    add(at.aim + 3 + k, by_impact.column(k).as_slice());
                    if let Some(own) = at.impact {
                        add(own + 2 + k, by_impact.column(2 + k).as_slice());
                    }
                }
            }
        }
    }

    /// A position acts as the aims of all its cells do, each alike: their sum.
    fn positions(&self, effect: &mut DMatrix<C>) {
        let problem = self.problem;
        for (place, block) in problem.blocks().into_iter().enumerate() {
            for i in 0..block.impacts.len() {
                for s in 0..block.sensors.len() {
                    let at = problem.nuisances.of_cell(place, block, s, i);
                    let own = [at.sensor.map(|own| (own, 0, 3)), at.impact.map(|own| (own, 3, 2))];
                    for (own, first, count) in own.into_iter().flatten() {
                        for k in 0..count {
                            let aim = effect.column(at.aim + first + k).clone_owned();
                            effect.column_mut(own + k).add_assign(&aim);
                        }
                    }
                }
            }
        }
    }
}

/// From a block's cells to the residual: left · cells · right · share.
struct Way<'a> {
    left: &'a Line,
    right: &'a Line,
    share: f64,
}

/// A Hermitian matrix gathered from real products, which are the fast ones.
struct Hermitian {
    re: DMatrix<f64>,
    im: DMatrix<f64>,
}

impl Hermitian {
    fn zeros(m: usize) -> Hermitian {
        Hermitian { re: DMatrix::zeros(m, m), im: DMatrix::zeros(m, m) }
    }

    /// Adds scale · Σ v_oi x xᴴ, x = (column o of left) ⊗ (row i of right) by columns.
    fn spread(&mut self, left: &Line, right: &Line, variance: &DMatrix<f64>, scale: f64) {
        let (rows, columns) = (left.nrows(), right.ncols());
        let (outputs, inputs) = variance.shape();
        let x = Line::from_fn(rows * columns, outputs * inputs, |at, cell| {
            let (r, c) = (at % rows, at / rows);
            let (o, i) = (cell % outputs, cell / outputs);
            left[(r, o)] * right[(i, c)] * variance[(o, i)].sqrt()
        });
        self.add(&x, scale);
    }

    /// Adds scale · X Xᴴ.
    fn add(&mut self, x: &Line, scale: f64) {
        let (re, im) = (x.map(|v| v.re), x.map(|v| v.im));
        let (re_t, im_t) = (re.transpose(), im.transpose());
        self.re += (&re * &re_t + &im * &im_t) * scale;
        let crossed = (&im * &re_t) * scale;
        self.im += &crossed - crossed.transpose();
    }

    /// C⁻¹ with N/2 = C Cᴴ, as it acts on (real parts, imaginary parts); each part has half the variance.
    fn whitening(&self) -> Option<DMatrix<f64>> {
        let m = self.re.nrows();
        let half = Line::from_fn(m, m, |r, c| C::new(self.re[(r, c)], self.im[(r, c)]) * 0.5);
        // units of one size, or rounding fails the factorisation
        let scale: Vec<f64> = (0..m).map(|r| half[(r, r)].re.sqrt()).collect();
        if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
            return None;
        }
        let even = Line::from_fn(m, m, |r, c| half[(r, c)] / (scale[r] * scale[c]));
        let root = even.cholesky()?.l();
        let mut inverse = root.solve_lower_triangular(&Line::identity(m, m))?;
        for (c, s) in scale.iter().enumerate() {
            inverse.column_mut(c).scale_mut(1.0 / s);
        }
        Some(DMatrix::from_fn(2 * m, 2 * m, |r, c| {
            let v = inverse[(r % m, c % m)];
            match (r < m, c < m) {
                (true, true) | (false, false) => v.re,
                (true, false) => -v.im,
                (false, true) => v.im,
            }
        }))
    }
}
