//! Maximum likelihood of a modal model for measured FRFs.
//!
//! The model of the receptance of output o and input i, on the lines s = σ + iω, is
//!
//! X(s) = Σ_r [ψ_or ℓ_ir/(s − λ_r) + conjugate] + Σ_k E_oi,k s^(q_k),
//!
//! with one pole λ, one shape ψ and one participation ℓ per mode: every residue matrix has rank
//! one. The real terms E stand for the modes outside the band. The noise of each value is normal,
//! with the same variance for its real and imaginary part, so that the likelihood is the weighted
//! sum of squares χ².
//!
//! χ² is minimised by Gauss–Newton steps with Levenberg–Marquardt damping over all parameters at
//! once. The terms E of each cell and then the shapes at each output are eliminated from the normal
//! equations, because they are only coupled through the poles and participations. Gradient and χ²
//! are computed from the residuals of all lines; only the matrix of the normal equations uses
//! weights averaged over short segments of lines, which affects the path but not the minimum.

use super::data::Data;
use crate::C;
use crate::parallel::prelude::*;
use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};

/// Poles, shapes, participations and residual terms, free of units as [`Data`].
#[derive(Clone)]
pub(super) struct Model {
    pub(super) poles: Vec<C>,
    /// Output × mode.
    pub(super) shape: DMatrix<C>,
    /// Input × mode.
    pub(super) participation: DMatrix<C>,
    /// Powers of s of the residual terms.
    pub(super) powers: Vec<i32>,
    /// Residual term × cell.
    pub(super) terms: DMatrix<f64>,
}

impl Model {
    /// No modes, and residual terms of these powers, all zero.
    pub(super) fn empty(data: &Data, powers: &[i32]) -> Model {
        Model {
            poles: vec![],
            shape: DMatrix::zeros(data.outputs, 0),
            participation: DMatrix::zeros(data.inputs, 0),
            powers: powers.to_vec(),
            terms: DMatrix::zeros(powers.len(), data.cells()),
        }
    }

    pub(super) fn residue(&self, cell: usize, mode: usize) -> C {
        let inputs = self.participation.nrows();
        self.shape[(cell / inputs, mode)] * self.participation[(cell % inputs, mode)]
    }

    fn residues(&self, cell: usize) -> Vec<C> {
        (0..self.poles.len()).map(|mode| self.residue(cell, mode)).collect()
    }

    /// Number of free real parameters; the scale between shape and participation is not free.
    pub(super) fn parameters(&self) -> usize {
        let of_mode = 2 + 2 * (self.shape.nrows() + self.participation.nrows() - 1);
        of_mode * self.poles.len() + self.terms.len()
    }

    /// The same without one mode.
    pub(super) fn without(&self, mode: usize) -> Model {
        let mut poles = self.poles.clone();
        poles.remove(mode);
        let (shape, participation) = (self.shape.clone(), self.participation.clone());
        Model {
            poles,
            shape: shape.remove_column(mode),
            participation: participation.remove_column(mode),
            ..self.clone()
        }
    }

    /// The same with one more mode.
    pub(super) fn with(&self, pole: C, shape: &DVector<C>, participation: &DVector<C>) -> Model {
        let n = self.poles.len();
        let mut all = self.clone();
        all.poles.push(pole);
        all.shape = all.shape.insert_column(n, C::from(0.0));
        all.shape.set_column(n, shape);
        all.participation = all.participation.insert_column(n, C::from(0.0));
        all.participation.set_column(n, participation);
        all
    }

    /// The same with one more residual term, which is zero.
    pub(super) fn with_power(&self, power: i32) -> Model {
        let mut all = self.clone();
        all.powers.push(power);
        all.terms = all.terms.insert_row(self.powers.len(), 0.0);
        all
    }

    /// Scales every participation to length one; the residues stay the same.
    fn balance(&mut self) {
        for mode in 0..self.poles.len() {
            let length = self.participation.column(mode).norm();
            if length > 0.0 {
                self.participation.column_mut(mode).unscale_mut(length);
                self.shape.column_mut(mode).scale_mut(length);
            }
        }
    }
}

/// The real columns that the model is linear in, real parts of all lines above imaginary parts:
/// two per mode for its residue, two per mode for the derivative by its pole, the residual terms.
fn basis(data: &Data, poles: &[C], powers: &[i32]) -> DMatrix<f64> {
    let (lines, n) = (data.lines(), poles.len());
    let mut basis = DMatrix::zeros(2 * lines, 4 * n + powers.len());
    let i = C::i();
    let mut set = |column: usize, l: usize, receptance: C| {
        let value = receptance * data.to_quantity[l];
        basis[(l, column)] = value.re;
        basis[(lines + l, column)] = value.im;
    };
    for (r, pole) in poles.iter().enumerate() {
        for (l, s) in data.s.iter().enumerate() {
            let (one, mirrored) = ((s - pole).inv(), (s - pole.conj()).inv());
            set(2 * r, l, one + mirrored);
            set(2 * r + 1, l, i * (one - mirrored));
            let (one, mirrored) = (one * one, mirrored * mirrored);
            set(2 * (n + r), l, one + mirrored);
            set(2 * (n + r) + 1, l, i * (one - mirrored));
        }
    }
    for (k, &power) in powers.iter().enumerate() {
        for (l, s) in data.s.iter().enumerate() {
            set(4 * n + k, l, s.powi(power));
        }
    }
    basis
}

/// A model with its residuals.
pub(super) struct Evaluation {
    pub(super) model: Model,
    pub(super) chi2: f64,
    basis: DMatrix<f64>,
    /// Basis column × cell: the sum over the lines of column × weight × residual.
    gradient: DMatrix<f64>,
}

impl Evaluation {
    pub(super) fn new(data: &Data, model: Model) -> Evaluation {
        let basis = basis(data, &model.poles, &model.powers);
        Evaluation::with_basis(data, model, basis)
    }

    /// As [`Evaluation::new`]; `basis` may have more columns than the model, for their gradient.
    fn with_basis(data: &Data, model: Model, basis: DMatrix<f64>) -> Evaluation {
        let transposed = basis.transpose();
        let of_output = |o: usize| {
            let mut left = residuals_of(data, &model, &basis, o);
            let mut weighted = left.clone();
            for (column, mut to) in weighted.column_iter_mut().enumerate() {
                let weight = data.weight.column(o * data.inputs + column);
                let (mut re, mut im) = to.rows_range_pair_mut(..data.lines(), data.lines()..);
                re.component_mul_assign(&weight);
                im.component_mul_assign(&weight);
            }
            let gradient = &transposed * &weighted;
            left.component_mul_assign(&weighted);
            (gradient, left.sum())
        };
        let parts: Vec<(DMatrix<f64>, f64)> = (0..data.outputs).into_par_iter().map(of_output).collect();
        let mut gradient = DMatrix::zeros(basis.ncols(), data.cells());
        let mut chi2 = 0.0;
        for (o, (part, of_output)) in parts.iter().enumerate() {
            gradient.columns_mut(o * data.inputs, data.inputs).copy_from(part);
            chi2 += of_output;
        }
        Evaluation { model, chi2, basis, gradient }
    }

    /// The residuals, one column per cell, real parts above imaginary parts.
    pub(super) fn residuals(&self, data: &Data) -> DMatrix<f64> {
        let of_output = |o: usize| residuals_of(data, &self.model, &self.basis, o);
        let parts: Vec<DMatrix<f64>> = (0..data.outputs).into_par_iter().map(of_output).collect();
        let mut all = DMatrix::zeros(2 * data.lines(), data.cells());
        for (o, part) in parts.iter().enumerate() {
            all.columns_mut(o * data.inputs, data.inputs).copy_from(part);
        }
        all
    }

    /// χ² per degree of freedom.
    pub(super) fn chi2_per_dof(&self, data: &Data) -> f64 {
        self.chi2 / degrees_of_freedom(data, &self.model)
    }
}

/// Number of real values minus that of free parameters, at least one.
pub(super) fn degrees_of_freedom(data: &Data, model: &Model) -> f64 {
    (data.y.len() as f64 - model.parameters() as f64).max(1.0)
}

/// The residuals of the cells of one output.
fn residuals_of(data: &Data, model: &Model, basis: &DMatrix<f64>, output: usize) -> DMatrix<f64> {
    let n = model.poles.len();
    let (from, inputs) = (output * data.inputs, data.inputs);
    let mut coefficients = DMatrix::zeros(2 * n, inputs);
    for i in 0..inputs {
        for (r, a) in model.residues(from + i).into_iter().enumerate() {
            coefficients[(2 * r, i)] = a.re;
            coefficients[(2 * r + 1, i)] = a.im;
        }
    }
    let mut left = data.y.columns(from, inputs).into_owned();
    left.gemm(-1.0, &basis.columns(0, 2 * n), &coefficients, 1.0);
    left.gemm(-1.0, &basis.columns(4 * n, model.powers.len()), &model.terms.columns(from, inputs), 1.0);
    left
}

/// Segments of lines over which the weights are averaged for the normal equations: with more, the
/// matrix would be better and slower to compute. Weights are averages over ±10 Hz already.
const SEGMENTS: usize = 256;

/// Inner products of the basis' columns, one column per segment of lines, upper triangle packed,
/// and the bounds of the segments.
///
/// A segment has few lines, for which a matrix product spends its time on anything but products.
fn inner_products(basis: &DMatrix<f64>, lines: usize) -> (DMatrix<f64>, Vec<(usize, usize)>) {
    let segments = lines.min(SEGMENTS);
    let bounds: Vec<(usize, usize)> =
        (0..segments).map(|k| (k * lines / segments, (k + 1) * lines / segments)).collect();
    let columns = basis.ncols();
    let (packed_length, by_line) = (columns * (columns + 1) / 2, basis.transpose());
    let of_segment = |&(from, to): &(usize, usize)| {
        let mut packed = vec![0.0; packed_length];
        for line in from..to {
            let (re, im) = (by_line.column(line), by_line.column(lines + line));
            let (re, im) = (re.as_slice(), im.as_slice());
            let mut rest = packed.as_mut_slice();
            for c in 0..columns {
                let (column, after) = rest.split_at_mut(c + 1);
                for ((sum, re_r), im_r) in column.iter_mut().zip(re).zip(im) {
                    *sum += re[c] * re_r + im[c] * im_r;
                }
                rest = after;
            }
        }
        packed
    };
    let packed: Vec<Vec<f64>> = bounds.par_iter().map(of_segment).collect();
    (DMatrix::from_vec(packed_length, segments, packed.concat()), bounds)
}

/// The residual terms of one cell: factors of their own block, their coupling to the other columns,
/// and their gradient.
type TermsNormal = (Cholesky<f64, Dyn>, DMatrix<f64>, DVector<f64>);

/// The normal equations of one cell after its residual terms were eliminated.
struct CellNormal {
    /// 4 × modes: residues and derivatives by the poles.
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    terms: Option<TermsNormal>,
}

impl CellNormal {
    fn new(full: &DMatrix<f64>, gradient: &DVectorView<'_, f64>, modes: usize) -> Option<CellNormal> {
        let (m, k) = (4 * modes, full.nrows() - 4 * modes);
        let mut matrix = full.view((0, 0), (m, m)).into_owned();
        let mut own = gradient.rows(0, m).into_owned();
        if k == 0 {
            return Some(CellNormal { matrix, gradient: own, terms: None });
        }
        let chol = ridged(full.view((m, m), (k, k)).into_owned())?;
        let coupling = full.view((m, 0), (k, m)).into_owned();
        let g = gradient.rows(m, k).into_owned();
        let solved = chol.solve(&coupling);
        matrix -= transposed_times(&coupling, &solved);
        own.gemv_tr(-1.0, &solved, &g, 1.0);
        Some(CellNormal { matrix, gradient: own, terms: Some((chol, coupling, g)) })
    }
}

/// aᵀ b. nalgebra's own product with a transposed matrix forms one inner product after the other,
/// some ten times slower than a copy and a blocked product.
pub(super) fn transposed_times(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    a.transpose() * b
}

/// Cholesky factors of a positive matrix; a ridge of 1e-13 of each diagonal value keeps columns
/// that rounding makes dependent from failing.
fn ridged(mut matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    for i in 0..matrix.nrows() {
        matrix[(i, i)] *= 1.0 + 1e-13;
        if matrix[(i, i)] <= 0.0 {
            matrix[(i, i)] = f64::MIN_POSITIVE.sqrt();
        }
    }
    Cholesky::new(matrix)
}

/// R(p)ᵀ M R(q), where R(z) is the real 2 × 2 matrix of a multiplication by z, block by block.
fn turned(matrix: &DMatrix<f64>, (row, column): (usize, usize), p: &[C], q: &[C]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(2 * p.len(), 2 * q.len());
    for (c, q) in q.iter().enumerate() {
        for (r, p) in p.iter().enumerate() {
            let at = |i: usize, j: usize| matrix[(row + 2 * r + i, column + 2 * c + j)];
            let (a, b, d, e) = (at(0, 0), at(0, 1), at(1, 0), at(1, 1));
            // columns times R(q)
            let (a, b, d, e) =
                (a * q.re + b * q.im, b * q.re - a * q.im, d * q.re + e * q.im, e * q.re - d * q.im);
            out[(2 * r, 2 * c)] = p.re * a + p.im * d;
            out[(2 * r, 2 * c + 1)] = p.re * b + p.im * e;
            out[(2 * r + 1, 2 * c)] = p.re * d - p.im * a;
            out[(2 * r + 1, 2 * c + 1)] = p.re * e - p.im * b;
        }
    }
    out
}

/// R(p)ᵀ g.
fn turned_vector(gradient: &[f64], p: &[C]) -> DVector<f64> {
    let mut out = DVector::zeros(2 * p.len());
    for (r, p) in p.iter().enumerate() {
        let (x, y) = (gradient[2 * r], gradient[2 * r + 1]);
        out[2 * r] = p.re * x + p.im * y;
        out[2 * r + 1] = p.re * y - p.im * x;
    }
    out
}

/// The normal equations of all parameters at one model.
pub(super) struct Normal {
    modes: usize,
    inputs: usize,
    /// By output: the block of its shapes, its coupling to poles and participations, its gradient.
    outputs: Vec<(DMatrix<f64>, DMatrix<f64>, DVector<f64>)>,
    /// Diagonal values before the residual terms were eliminated: by output, and of the rest.
    output_scales: Vec<DVector<f64>>,
    scales: DVector<f64>,
    /// Block and gradient of the poles and then the participations, input by input.
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
    cells: Vec<CellNormal>,
}

/// What one output adds to the normal equations.
struct OfOutput {
    own: DMatrix<f64>,
    coupling: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Diagonal values before the residual terms were eliminated: own, then poles and
    /// participations.
    own_scales: DVector<f64>,
    scales: DVector<f64>,
    poles: DMatrix<f64>,
    poles_gradient: DVector<f64>,
    /// By input: block of its participations, its coupling to the poles, its gradient.
    inputs: Vec<(DMatrix<f64>, DMatrix<f64>, DVector<f64>)>,
    cells: Vec<CellNormal>,
}

impl Normal {
    /// None if the matrix is not positive even with a ridge.
    pub(super) fn new(data: &Data, at: &Evaluation) -> Option<Normal> {
        let model = &at.model;
        let (n, inputs) = (model.poles.len(), data.inputs);
        let (packed, bounds) = inner_products(&at.basis, data.lines());
        let of_output = |o: usize| of_output(data, at, &packed, &bounds, o);
        let parts: Option<Vec<OfOutput>> = (0..data.outputs).into_par_iter().map(of_output).collect();
        let size = 2 * n * (inputs + 1);
        let mut normal = Normal {
            modes: n,
            inputs,
            outputs: vec![],
            output_scales: vec![],
            scales: DVector::zeros(size),
            shared: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
            cells: vec![],
        };
        for part in parts? {
            let add = |to: &mut DMatrix<f64>, at: (usize, usize), what: &DMatrix<f64>| {
                let mut view = to.view_mut(at, what.shape());
                view += what;
            };
            add(&mut normal.shared, (0, 0), &part.poles);
            let mut to = normal.gradient.rows_mut(0, 2 * n);
            to += &part.poles_gradient;
            for (i, (own, coupling, gradient)) in part.inputs.iter().enumerate() {
                let from = 2 * n * (i + 1);
                add(&mut normal.shared, (from, from), own);
                add(&mut normal.shared, (from, 0), coupling);
                add(&mut normal.shared, (0, from), &coupling.transpose());
                let mut to = normal.gradient.rows_mut(from, 2 * n);
                to += gradient;
            }
            normal.scales += part.scales;
            normal.output_scales.push(part.own_scales);
            normal.outputs.push((part.own, part.coupling, part.gradient));
            normal.cells.extend(part.cells);
        }
        normal.fix_scale(model);
        Some(normal)
    }

    /// Fixes the scale between shape and participation, which the data do not depend on: the change
    /// of a participation is perpendicular to it. The data's information is the measure of the
    /// penalty, so that the matrix stays well scaled.
    fn fix_scale(&mut self, model: &Model) {
        let (n, inputs) = (self.modes, self.inputs);
        for r in 0..n {
            let at = |i: usize| 2 * n * (i + 1) + 2 * r;
            let information: f64 =
                (0..inputs).map(|i| self.shared[(at(i), at(i))] + self.shared[(at(i) + 1, at(i) + 1)]).sum();
            let conjugate: Vec<C> = (0..inputs).map(|i| model.participation[(i, r)].conj()).collect();
            let unit = DMatrix::identity(2, 2);
            for i in 0..inputs {
                for j in 0..inputs {
                    let penalty = turned(&unit, (0, 0), &[conjugate[i]], &[conjugate[j]]);
                    let mut to = self.shared.view_mut((at(i), at(j)), (2, 2));
                    to += penalty * information;
                }
            }
        }
    }

    /// Eliminates the shapes: the factors of each output's block and of the rest, with `damping`
    /// times a diagonal added.
    pub(super) fn factors(&self, damping: f64) -> Option<Factors> {
        // relative to the values before the elimination: a pole that a residual term can imitate
        // has little information left, but must not take long steps
        let damped = |matrix: &DMatrix<f64>, scales: &DVector<f64>| {
            let mut matrix = matrix.clone();
            for (i, scale) in scales.iter().enumerate() {
                matrix[(i, i)] += damping * scale;
            }
            matrix
        };
        let of_output = |o: usize| {
            let (own, coupling, _) = &self.outputs[o];
            let chol = ridged(damped(own, &self.output_scales[o]))?;
            let mut half = coupling.clone();
            chol.l_dirty().solve_lower_triangular_mut(&mut half);
            Some((chol, half))
        };
        let by_output: Option<Vec<_>> = (0..self.outputs.len()).into_par_iter().map(of_output).collect();
        let by_output = by_output?;
        let (rows, size) = (2 * self.modes, self.shared.nrows());
        let mut halves = DMatrix::zeros(rows * by_output.len(), size);
        for (o, (_, half)) in by_output.iter().enumerate() {
            halves.rows_mut(o * rows, rows).copy_from(half);
        }
        let mut shared = damped(&self.shared, &self.scales);
        shared -= transposed_times(&halves, &halves);
        let shared = ridged(shared)?;
        Some(Factors { outputs: by_output, shared })
    }

    /// The Gauss–Newton step and the decrease of χ² that it promises.
    fn step(&self, model: &Model, damping: f64) -> Option<(Model, f64)> {
        let (n, inputs) = (self.modes, self.inputs);
        let factors = self.factors(damping)?;
        let mut shared = self.gradient.clone();
        let mut halves = Vec::with_capacity(self.outputs.len());
        for ((chol, half), (_, _, gradient)) in factors.outputs.iter().zip(&self.outputs) {
            let mut own = gradient.clone();
            chol.l_dirty().solve_lower_triangular_mut(&mut own);
            shared.gemv_tr(-1.0, half, &own, 1.0);
            halves.push(own);
        }
        factors.shared.solve_mut(&mut shared);
        let mut promised = shared.dot(&self.gradient);
        let mut next = model.clone();
        let complex = |v: &[f64], r: usize| C::new(v[2 * r], v[2 * r + 1]);
        let change_of_poles: Vec<C> = (0..n).map(|r| complex(shared.as_slice(), r)).collect();
        let participation =
            DMatrix::from_fn(inputs, n, |i, r| complex(&shared.as_slice()[2 * n * (i + 1)..], r));
        let mut shape = DMatrix::zeros(model.shape.nrows(), n);
        for (o, ((chol, half), mut own)) in factors.outputs.iter().zip(halves).enumerate() {
            own.gemv(-1.0, half, &shared, 1.0);
            chol.l_dirty().tr_solve_lower_triangular_mut(&mut own);
            promised += own.dot(&self.outputs[o].2);
            for r in 0..n {
                shape[(o, r)] = complex(own.as_slice(), r);
            }
        }
        for (pole, change) in next.poles.iter_mut().zip(&change_of_poles) {
            *pole += change;
        }
        next.shape += &shape;
        next.participation += &participation;
        for (cell, normal) in self.cells.iter().enumerate() {
            let Some((chol, coupling, gradient)) = &normal.terms else { continue };
            let (o, i) = (cell / inputs, cell % inputs);
            let mut change = DVector::zeros(4 * n);
            for r in 0..n {
                let residue =
                    model.participation[(i, r)] * shape[(o, r)] + model.shape[(o, r)] * participation[(i, r)];
                let by_pole = model.residue(cell, r) * change_of_poles[r];
                (change[2 * r], change[2 * r + 1]) = (residue.re, residue.im);
                (change[2 * (n + r)], change[2 * (n + r) + 1]) = (by_pole.re, by_pole.im);
            }
            let mut right = gradient.clone();
            right.gemv(-1.0, coupling, &change, 1.0);
            chol.solve_mut(&mut right);
            promised += right.dot(gradient);
            let mut to = next.terms.column_mut(cell);
            to += right;
        }
        Some((next, promised))
    }

    /// Bounds of the increase of χ² when each mode is removed: if in every cell the other residues
    /// adapt freely, and if nothing adapts.
    pub(super) fn loss_without(&self, model: &Model) -> Vec<[f64; 2]> {
        let n = self.modes;
        let of_cell = |(cell, normal): (usize, &CellNormal)| -> Vec<[f64; 2]> {
            let residues = normal.matrix.view((0, 0), (2 * n, 2 * n)).into_owned();
            let inverse = ridged(residues.clone()).map(|chol| chol.inverse());
            let bound = |r: usize| {
                let a = model.residue(cell, r);
                let a = nalgebra::Vector2::new(a.re, a.im);
                let own = residues.fixed_view::<2, 2>(2 * r, 2 * r);
                let free = (inverse.as_ref())
                    .and_then(|inverse| inverse.fixed_view::<2, 2>(2 * r, 2 * r).try_inverse())
                    .map_or(0.0, |freed| a.dot(&(freed * a)));
                [free, a.dot(&(own * a))]
            };
            (0..n).map(bound).collect()
        };
        let by_cell: Vec<Vec<[f64; 2]>> = self.cells.iter().enumerate().map(of_cell).collect();
        let sum = |r: usize, which: usize| by_cell.iter().map(|cell| cell[r][which]).sum();
        (0..n).map(|r| [sum(r, 0), sum(r, 1)]).collect()
    }

    /// Inverse of the terms' block, coupling of the terms to the other columns, for each cell.
    pub(super) fn terms_of(&self, cell: usize) -> Option<(&Cholesky<f64, Dyn>, &DMatrix<f64>)> {
        self.cells[cell].terms.as_ref().map(|(chol, coupling, _)| (chol, coupling))
    }
}

/// Factors of the normal equations.
pub(super) struct Factors {
    /// By output: factors of its own block L Lᵀ, and L⁻¹ times its coupling to the shared part.
    pub(super) outputs: Vec<(Cholesky<f64, Dyn>, DMatrix<f64>)>,
    /// The poles and the participations, after the shapes were eliminated.
    pub(super) shared: Cholesky<f64, Dyn>,
}

fn of_output(
    data: &Data,
    at: &Evaluation,
    packed: &DMatrix<f64>,
    bounds: &[(usize, usize)],
    o: usize,
) -> Option<OfOutput> {
    let model = &at.model;
    let (n, inputs) = (model.poles.len(), data.inputs);
    let products = packed * mean_weights(data, bounds, o);
    let psi: Vec<C> = model.shape.row(o).iter().copied().collect();
    let mut part = OfOutput {
        own: DMatrix::zeros(2 * n, 2 * n),
        coupling: DMatrix::zeros(2 * n, 2 * n * (inputs + 1)),
        gradient: DVector::zeros(2 * n),
        own_scales: DVector::zeros(2 * n),
        scales: DVector::zeros(2 * n * (inputs + 1)),
        poles: DMatrix::zeros(2 * n, 2 * n),
        poles_gradient: DVector::zeros(2 * n),
        inputs: Vec::with_capacity(inputs),
        cells: Vec::with_capacity(inputs),
    };
    let columns = at.basis.ncols();
    for i in 0..inputs {
        let cell = o * inputs + i;
        let full = unpacked(products.column(i).as_slice(), columns);
        let normal = CellNormal::new(&full, &at.gradient.column(cell), n)?;
        let ell: Vec<C> = model.participation.row(i).iter().copied().collect();
        let a = model.residues(cell);
        let (g, d) = (&normal.matrix, 2 * n);
        for r in 0..n {
            // a multiplication by z scales both columns of a residue by |z|² on average
            let mean = |at: usize| 0.5 * (full[(at, at)] + full[(at + 1, at + 1)]);
            let (of_residue, of_pole) = (mean(2 * r), mean(d + 2 * r));
            for at in [2 * r, 2 * r + 1] {
                part.own_scales[at] += ell[r].norm_sqr() * of_residue;
                part.scales[at] += a[r].norm_sqr() * of_pole;
                part.scales[2 * n * (i + 1) + at] += psi[r].norm_sqr() * of_residue;
            }
        }
        part.own += turned(g, (0, 0), &ell, &ell);
        let from = 2 * n * (i + 1);
        part.coupling.columns_mut(from, 2 * n).copy_from(&turned(g, (0, 0), &ell, &psi));
        let mut to = part.coupling.columns_mut(0, 2 * n);
        to += turned(g, (0, d), &ell, &a);
        part.poles += turned(g, (d, d), &a, &a);
        let (of_residue, of_pole) = normal.gradient.as_slice().split_at(d);
        part.gradient += turned_vector(of_residue, &ell);
        part.poles_gradient += turned_vector(of_pole, &a);
        part.inputs.push((
            turned(g, (0, 0), &psi, &psi),
            turned(g, (0, d), &psi, &a),
            turned_vector(of_residue, &psi),
        ));
        part.cells.push(normal);
    }
    Some(part)
}

/// Poles closer to the line of measurement than this many steps of it would describe a single line,
/// not a peak.
pub(super) const NARROWEST: f64 = 0.05;

/// Poles this many times below or above the band cannot be told from a residual term.
const FARTHEST: f64 = 8.0;

/// Limit of the steps of one fit; a start near the minimum needs four to eight.
const STEPS: usize = 60;

/// As [`STEPS`] for fits that only decide.
const ROUGH_STEPS: usize = 25;

/// A step that promises to lower χ² by less than this fraction of χ² per degree of freedom moves no
/// parameter by more than 1e-4 of its standard deviation.
const CONVERGED: f64 = 1e-8;

/// As [`CONVERGED`] for fits that only decide: far below any threshold.
const ROUGH: f64 = 1e-2;

/// A fit that only decides also ends when a step lowers χ² by less than this fraction of what all
/// steps did: poles outside the band move slowly, and go on in the next fit.
const SLOW: f64 = 1e-3;

/// The pole `to`, but no further from `from` than allowed in one step: at most half way to zero
/// frequency and to the narrowest peak, at most twice the frequency, and with a damping ratio of at
/// most 0.71. One pole that runs away must not stop the others.
fn bounded(data: &Data, to: C, from: C) -> C {
    let narrowest = data.sigma - NARROWEST * data.step;
    let re = if to.re.is_finite() { to.re } else { from.re };
    let im = if to.im.is_finite() { to.im } else { from.im };
    let re = re.clamp(from.re - from.norm(), (0.5 * (from.re + narrowest)).max(from.re));
    let (low, high) = (data.s[0].im / FARTHEST, data.s[data.lines() - 1].im * FARTHEST);
    let im = im.clamp(0.5 * from.im, 2.0 * from.im).clamp(low, high);
    C::new(re.min(narrowest).max(-im), im)
}

/// Minimises χ² from `start`.
pub(super) fn fit(data: &Data, start: Model) -> Evaluation {
    minimise(data, start, STEPS, CONVERGED, 0.0)
}

/// As [`fit`], but only as accurately as decisions about modes need.
pub(super) fn fit_roughly(data: &Data, start: Model) -> Evaluation {
    minimise(data, start, ROUGH_STEPS, ROUGH, SLOW)
}

/// As [`fit_roughly`], but to the end: what is left must not count as evidence for a pole that was
/// removed.
pub(super) fn fit_to_the_end(data: &Data, start: Model) -> Evaluation {
    minimise(data, start, STEPS, ROUGH, 0.0)
}

fn minimise(data: &Data, mut start: Model, steps: usize, accuracy: f64, slow: f64) -> Evaluation {
    start.balance();
    let mut at = Evaluation::new(data, start);
    let first = at.chi2;
    let mut damping = 1e-4;
    for _ in 0..steps {
        data.count_step(at.basis.ncols());
        let Some(normal) = Normal::new(data, &at) else { return at };
        let (next, promised) = loop {
            if let Some((mut model, promised)) = normal.step(&at.model, damping) {
                for (pole, before) in model.poles.iter_mut().zip(&at.model.poles) {
                    *pole = bounded(data, *pole, *before);
                }
                model.balance();
                let next = Evaluation::new(data, model);
                if next.chi2 <= at.chi2 {
                    break (next, promised);
                }
                // below zero by rounding in nearly singular equations: then more damping is needed
                if (0.0..=accuracy * at.chi2_per_dof(data)).contains(&promised) {
                    return at;
                }
            }
            damping = (damping * 10.0).max(1e-6);
            if damping > 1e6 {
                return at;
            }
        };
        let gain = at.chi2 - next.chi2;
        let stalled = gain <= 1e-14 * at.chi2;
        at = next;
        if promised <= accuracy * at.chi2_per_dof(data) || stalled || gain < slow * (first - at.chi2) {
            return at;
        }
        damping = match gain / promised {
            good if good > 0.75 && damping < 1e-7 => 0.0,
            good if good > 0.75 => 0.05 * damping,
            fair if fair > 0.25 => 0.5 * damping,
            _ => 4.0 * damping,
        };
    }
    at
}

/// Shapes and participations for given poles: the residues of every cell by linear least squares,
/// then the nearest matrix of rank one.
pub(super) fn with_shapes(data: &Data, poles: &[C], powers: &[i32]) -> Option<Model> {
    let mut model = Model::empty(data, powers);
    let zero = (DVector::zeros(data.outputs), DVector::zeros(data.inputs));
    for &pole in poles {
        model = model.with(pole, &zero.0, &zero.1);
    }
    let n = poles.len();
    let at = Evaluation::new(data, model);
    let normal = Normal::new(data, &at)?;
    let mut residues: Vec<DMatrix<C>> = vec![DMatrix::zeros(data.outputs, data.inputs); n];
    for (cell, normal) in normal.cells.iter().enumerate() {
        let mut own = normal.matrix.view((0, 0), (2 * n, 2 * n)).into_owned();
        // a pole that is there twice must not give residues that cancel
        for i in 0..2 * n {
            own[(i, i)] *= 1.0 + 1e-9;
        }
        let solved = ridged(own)?.solve(&normal.gradient.rows(0, 2 * n));
        for (r, residue) in residues.iter_mut().enumerate() {
            residue[(cell / data.inputs, cell % data.inputs)] = C::new(solved[2 * r], solved[2 * r + 1]);
        }
    }
    let mut model = at.model;
    for (r, residue) in residues.iter().enumerate() {
        let (shape, participation) = rank_one(residue);
        model.shape.set_column(r, &shape);
        model.participation.set_column(r, &participation);
    }
    Some(model)
}

/// The vectors ψ and ℓ (of length one) whose product ψℓᵀ is nearest to a matrix.
pub(super) fn rank_one(matrix: &DMatrix<C>) -> (DVector<C>, DVector<C>) {
    let square = matrix.adjoint() * matrix;
    // the longest column of the square is the start of the power iteration
    let longest = (0..square.ncols()).max_by(|&a, &b| square[(a, a)].re.total_cmp(&square[(b, b)].re));
    let Some(longest) = longest else { return (DVector::zeros(matrix.nrows()), DVector::zeros(0)) };
    let mut v: DVector<C> = square.column(longest).into_owned();
    for _ in 0..30 {
        let length = v.norm();
        if length == 0.0 || !length.is_finite() {
            v = DVector::zeros(matrix.ncols());
            v[longest] = C::from(1.0);
            break;
        }
        v.unscale_mut(length);
        v = &square * &v;
    }
    let length = v.norm();
    if length > 0.0 {
        v.unscale_mut(length);
    }
    (matrix * &v, v.conjugate())
}

/// Something that describes modes outside the band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Beyond {
    /// A real matrix times a power of s.
    Power(i32),
    /// A pole with a residue of rank one.
    Pole(C),
}

/// For each of `more` the decrease of χ² that it gives if all columns of each cell, derivatives by
/// the poles included, adapt freely (and its residue has any rank).
pub(super) fn gains(data: &Data, at: &Evaluation, more: &[Beyond]) -> Vec<f64> {
    let own = at.basis.ncols();
    let columns: Vec<DMatrix<f64>> = (more.iter())
        .map(|one| match one {
            Beyond::Power(power) => basis(data, &[], &[*power]),
            Beyond::Pole(pole) => basis(data, &[*pole], &[]).columns(0, 2).into_owned(),
        })
        .collect();
    let counts: Vec<usize> = columns.iter().map(DMatrix::ncols).collect();
    let mut all = DMatrix::zeros(2 * data.lines(), own + counts.iter().sum::<usize>());
    all.columns_mut(0, own).copy_from(&at.basis);
    let mut from = own;
    for column in &columns {
        all.columns_mut(from, column.ncols()).copy_from(column);
        from += column.ncols();
    }
    let extended = Evaluation::with_basis(data, at.model.clone(), all);
    let (packed, bounds) = inner_products(&extended.basis, data.lines());
    let of_output = |o: usize| {
        let products = &packed * mean_weights(data, &bounds, o);
        let mut sums = vec![0.0; more.len()];
        for i in 0..data.inputs {
            let full = unpacked(products.column(i).as_slice(), extended.basis.ncols());
            let Some(chol) = ridged(full.view((0, 0), (own, own)).into_owned()) else { continue };
            let gradient = extended.gradient.column(o * data.inputs + i);
            let mut from = own;
            for (sum, &count) in sums.iter_mut().zip(&counts) {
                let coupling = full.view((0, from), (own, count)).into_owned();
                let solved = chol.solve(&coupling);
                let mut left = full.view((from, from), (count, count)).into_owned();
                let before = left.diagonal();
                left -= transposed_times(&coupling, &solved);
                let mut right = gradient.rows(from, count).into_owned();
                right.gemv_tr(-1.0, &solved, &gradient.rows(0, own), 1.0);
                from += count;
                // columns that the others already contain, but for rounding, gain nothing
                if (0..count).any(|k| left[(k, k)] <= 1e-11 * before[k]) {
                    continue;
                }
                if let Some(chol) = Cholesky::new(left) {
                    *sum += chol.solve(&right).dot(&right);
                }
            }
        }
        sums
    };
    let by_output: Vec<Vec<f64>> = (0..data.outputs).into_par_iter().map(of_output).collect();
    (0..more.len()).map(|k| by_output.iter().map(|sums| sums[k]).sum()).collect()
}

/// Segment × input: the mean weight of each cell of one output.
fn mean_weights(data: &Data, bounds: &[(usize, usize)], output: usize) -> DMatrix<f64> {
    DMatrix::from_fn(bounds.len(), data.inputs, |k, i| {
        let (from, to) = bounds[k];
        data.weight.column(output * data.inputs + i).rows(from, to - from).mean()
    })
}

/// The symmetric matrix of a packed upper triangle.
fn unpacked(packed: &[f64], columns: usize) -> DMatrix<f64> {
    let mut full = DMatrix::zeros(columns, columns);
    let places = (0..columns).flat_map(|c| (0..=c).map(move |r| (r, c)));
    for ((r, c), value) in places.zip(packed) {
        full[(r, c)] = *value;
        full[(c, r)] = *value;
    }
    full
}
