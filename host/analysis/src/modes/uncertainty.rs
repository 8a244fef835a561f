//! Modes with their covariance, in SI units.
//!
//! The covariance is the inverse of the normal equations' matrix (the Cramér–Rao bound), times χ²
//! per degree of freedom where that exceeds one or the noise was not given.
//!
//! With an exponential window the noise of neighbouring lines is correlated, which the fit does not
//! use. What this does to one mode alone has a closed form, which scales the covariance of poles
//! and of shapes: see [`correlated_pole`].

use super::data::Data;
use super::evidence::scale;
use super::likelihood::{Evaluation, Factors, Model, Normal, transposed_times};
use super::{DrivingPoint, Mode, ResidualTerm, Scaling};
use crate::C;
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, DVector, Matrix2};
use std::f64::consts::TAU;

/// Variance of a pole with the window's correlation between lines, over that without.
///
/// In the time domain the estimate of a pole weights the noise with h(t) = (t − 1/2d) e^(−dt),
/// where d = σ − Re λ, and the noise's power falls as e^(−2σt). With u = d/(d + σ) and the noise's
/// power q at the start of a record, ∫h²e^(−2σt) over ∫h² is q u (2u² − 2u + 1).
fn correlated_pole(data: &Data, pole: C) -> f64 {
    let u = data.share_of_noise(pole);
    data.noise_at_start() * u * (2.0 * u * u - 2.0 * u + 1.0)
}

/// As [`correlated_pole`] for a residue, whose weight is h(t) = (1 − dt) e^(−dt).
fn correlated_residue(data: &Data, pole: C) -> f64 {
    let u = data.share_of_noise(pole);
    data.noise_at_start() * u * (2.0 - 2.0 * u + u * u)
}

/// The modes in rising frequency and the residual terms; none if the data do not determine them.
pub(super) fn results(
    data: &Data,
    at: &Evaluation,
    driving: &[DrivingPoint],
) -> Option<(Vec<Mode>, Vec<ResidualTerm>)> {
    let normal = Normal::new(data, at)?;
    let factors = normal.factors(0.0)?;
    let variance = scale(data, at);
    let model = &at.model;
    let mut order: Vec<usize> = (0..model.poles.len()).collect();
    order.sort_by(|&a, &b| model.poles[a].norm().total_cmp(&model.poles[b].norm()));
    let losses = normal.loss_without(model);
    // T of each output: its shapes change by −T times the change of poles and participations
    let eliminated: Vec<DMatrix<f64>> = (factors.outputs.par_iter())
        .map(|(chol, half)| {
            let mut t = half.clone();
            chol.l_dirty().tr_solve_lower_triangular_mut(&mut t);
            t
        })
        .collect();
    let of_mode = |&r: &usize| {
        let covariance = covariance_of_mode(data, model, &factors, &eliminated, r) * variance;
        let significance = losses[r][0] / variance;
        mode(data, model, r, &covariance, significance, driving)
    };
    let modes = order.par_iter().map(of_mode).collect();
    let terms = terms(data, model, &normal, &factors, &eliminated, variance);
    Some((modes, terms))
}

/// Covariance of one mode's pole, its shape (output by output) and its participation (input by
/// input), two real values each.
fn covariance_of_mode(
    data: &Data,
    model: &Model,
    factors: &Factors,
    eliminated: &[DMatrix<f64>],
    r: usize,
) -> DMatrix<f64> {
    let (n, outputs, inputs) = (model.poles.len(), data.outputs, data.inputs);
    let size = 2 * (1 + outputs + inputs);
    let mut half = DMatrix::zeros(2 * n * (inputs + 1), size);
    for part in 0..2 {
        half[(2 * r + part, part)] = 1.0;
        for (o, t) in eliminated.iter().enumerate() {
            half.column_mut(2 * (1 + o) + part).copy_from(&(-t.row(2 * r + part).transpose()));
        }
        for i in 0..inputs {
            half[(2 * n * (i + 1) + 2 * r + part, 2 * (1 + outputs + i) + part)] = 1.0;
        }
    }
    factors.shared.l_dirty().solve_lower_triangular_mut(&mut half);
    let mut covariance = transposed_times(&half, &half);
    for (o, (chol, _)) in factors.outputs.iter().enumerate() {
        let mut own = DMatrix::zeros(2 * n, 2);
        own[(2 * r, 0)] = 1.0;
        own[(2 * r + 1, 1)] = 1.0;
        chol.l_dirty().solve_lower_triangular_mut(&mut own);
        let at = 2 * (1 + o);
        let mut to = covariance.view_mut((at, at), (2, 2));
        to += own.tr_mul(&own);
    }
    let pole = model.poles[r];
    let (of_pole, of_rest) = (correlated_pole(data, pole).sqrt(), correlated_residue(data, pole).sqrt());
    for row in 0..size {
        for column in 0..size {
            let factor = |at: usize| if at < 2 { of_pole } else { of_rest };
            covariance[(row, column)] *= factor(row) * factor(column);
        }
    }
    covariance
}

fn mode(
    data: &Data,
    model: &Model,
    r: usize,
    covariance: &DMatrix<f64>,
    significance: f64,
    driving: &[DrivingPoint],
) -> Mode {
    let (outputs, inputs) = (data.outputs, data.inputs);
    let unit = data.omega_ref;
    let pole = model.poles[r] * unit;
    let pole_covariance: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0) * (unit * unit);
    let omega = pole.norm();
    let by_frequency = nalgebra::RowVector2::new(pole.re, pole.im) / omega;
    let by_damping =
        nalgebra::RowVector2::new(-1.0 / omega, 0.0) + by_frequency * (pole.re / (omega * omega));
    let deviation =
        |by: nalgebra::RowVector2<f64>| (by * pole_covariance * by.transpose())[0].max(0.0).sqrt();
    // residues of the model are free of units
    let residue_unit = data.receptance_ref * unit;
    let shape: DVector<C> = model.shape.column(r) * C::from(residue_unit);
    let participation: DVector<C> = model.participation.column(r).into_owned();
    let mut amplitudes =
        covariance.view((2, 2), (2 * (outputs + inputs), 2 * (outputs + inputs))).into_owned();
    for at in 0..2 * outputs {
        amplitudes.row_mut(at).scale_mut(residue_unit);
        amplitudes.column_mut(at).scale_mut(residue_unit);
    }
    let scaled = Scaled::new(&shape, &participation, &amplitudes, driving);
    Mode {
        pole_per_s: pole,
        pole_covariance: pole_covariance.into(),
        frequency_hz: omega / TAU,
        frequency_std_hz: deviation(by_frequency) / TAU,
        damping_ratio: -pole.re / omega,
        damping_ratio_std: deviation(by_damping),
        scaling: scaled.scaling,
        shape: scaled.shape,
        shape_std: scaled.shape_std,
        participation: scaled.participation,
        participation_std: scaled.participation_std,
        evidence: significance,
    }
}

/// Shape and participation with a fixed scale, and their standard deviations.
struct Scaled {
    scaling: Scaling,
    shape: Vec<C>,
    shape_std: Vec<[f64; 2]>,
    participation: Vec<C>,
    participation_std: Vec<[f64; 2]>,
}

impl Scaled {
    /// Multiplies the shape by a factor c and divides the participation by it. `amplitudes` is the
    /// covariance of both.
    fn new(
        shape: &DVector<C>,
        participation: &DVector<C>,
        amplitudes: &DMatrix<f64>,
        driving: &[DrivingPoint],
    ) -> Scaled {
        let (outputs, inputs) = (shape.len(), participation.len());
        let power: f64 = driving.iter().map(|at| shape[at.output].norm_sqr()).sum();
        // the derivatives of c by all amplitudes
        let mut by = DVector::<C>::zeros(outputs + inputs);
        let (scaling, c) = if power > 0.0 {
            // c² so that c ψ = ± ℓ/c at the driving points, by least squares
            let sum: C =
                (driving.iter()).map(|at| shape[at.output].conj() * participation[at.input] * at.sign).sum();
            let square = sum / power;
            let c = square.sqrt();
            for at in driving {
                let weight = shape[at.output].conj() / power;
                by[outputs + at.input] += weight * at.sign / (c * 2.0);
                by[at.output] -= weight * square / (c * 2.0);
            }
            (Scaling::UnitModalA, c)
        } else {
            let largest = shape.map(|v| v.norm_sqr()).imax();
            let c = shape[largest].inv();
            by[largest] = -c * c;
            (Scaling::LargestOutputIsOne, c)
        };
        let deviations = |by: &DVector<C>| {
            let mut real = DMatrix::zeros(2 * by.len(), 2);
            for (k, by) in by.iter().enumerate() {
                (real[(2 * k, 0)], real[(2 * k + 1, 0)]) = (by.re, -by.im);
                (real[(2 * k, 1)], real[(2 * k + 1, 1)]) = (by.im, by.re);
            }
            let covariance = real.tr_mul(&(amplitudes * &real));
            [covariance[(0, 0)].max(0.0).sqrt(), covariance[(1, 1)].max(0.0).sqrt()]
        };
        let shape_std = (0..outputs).map(|o| {
            let mut by = &by * shape[o];
            by[o] += c;
            deviations(&by)
        });
        let participation_std = (0..inputs).map(|i| {
            let mut by = &by * (-participation[i] / (c * c));
            by[outputs + i] += c.inv();
            deviations(&by)
        });
        Scaled {
            scaling,
            shape_std: shape_std.collect(),
            participation_std: participation_std.collect(),
            shape: shape.iter().map(|v| v * c).collect(),
            participation: participation.iter().map(|v| v / c).collect(),
        }
    }
}

/// The residual terms with their standard deviations, lowest power first.
fn terms(
    data: &Data,
    model: &Model,
    normal: &Normal,
    factors: &Factors,
    eliminated: &[DMatrix<f64>],
    variance: f64,
) -> Vec<ResidualTerm> {
    let (n, inputs, count) = (model.poles.len(), data.inputs, model.powers.len());
    let of_cell = |cell: usize| -> Vec<f64> {
        let Some((chol, coupling)) = normal.terms_of(cell) else { return vec![] };
        let (o, i) = (cell / inputs, cell % inputs);
        let inverse = chol.inverse();
        // the terms change by −(this) times the change of residues and poles
        let by = chol.solve(coupling);
        let multiplied = |from: usize, of: &dyn Fn(usize) -> C| {
            DMatrix::from_fn(2 * n, count, |at, k| {
                let (r, part) = (at / 2, at % 2);
                let (x, y) = (by[(k, from + 2 * r)], by[(k, from + 2 * r + 1)]);
                let z = of(r);
                if part == 0 { x * z.re + y * z.im } else { y * z.re - x * z.im }
            })
        };
        let by_shape = multiplied(0, &|r| model.participation[(i, r)]);
        let by_participation = multiplied(0, &|r| model.shape[(o, r)]);
        let by_pole = multiplied(2 * n, &|r| model.residue(cell, r));
        let mut shared = -transposed_times(&eliminated[o], &by_shape);
        let mut to = shared.rows_mut(0, 2 * n);
        to += by_pole;
        let mut to = shared.rows_mut(2 * n * (i + 1), 2 * n);
        to += by_participation;
        factors.shared.l_dirty().solve_lower_triangular_mut(&mut shared);
        let mut own = by_shape;
        factors.outputs[o].0.l_dirty().solve_lower_triangular_mut(&mut own);
        let deviation = |k: usize| {
            let sum = inverse[(k, k)] + shared.column(k).norm_squared() + own.column(k).norm_squared();
            (variance * data.noise_at_start() * sum).sqrt()
        };
        (0..count).map(deviation).collect()
    };
    let deviations: Vec<Vec<f64>> = (0..data.cells()).into_par_iter().map(of_cell).collect();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&k| model.powers[k]);
    let term = |&k: &usize| {
        let unit = data.receptance_ref * data.omega_ref.powi(-model.powers[k]);
        let matrix = |value: &dyn Fn(usize) -> f64| {
            DMatrix::from_fn(data.outputs, inputs, |o, i| unit * value(o * inputs + i))
        };
        ResidualTerm {
            power: model.powers[k],
            value: matrix(&|cell| model.terms[(k, cell)]),
            std: matrix(&|cell| deviations[cell].get(k).copied().unwrap_or(f64::NAN)),
        }
    };
    order.iter().map(term).collect()
}
