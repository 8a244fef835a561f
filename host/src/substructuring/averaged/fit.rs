//! `fit`: maximum likelihood of K and C over all lines of a band, with errors of position, aim and angle as nuisance parameters.
//!
//! Model of the joint's compliance by Eq. (A.1) at line s: y = 1/(K + sC) + Σ g_j θ_j + n, where g_j is the sensitivity to one error of
//! geometry, θ_j ~ N(0, its prior), and n the noise that the cells' H1 variances propagate to. θ enters linearly, so it is
//! integrated out exactly: the residuals have the covariance Σ = V + G Gᵀ, and K, C follow by Gauss–Newton on
//! rᵀ Σ⁻¹ r with the Jacobian −y², −s y². Unlike a mean, the fit sees that a wrong position bends y over frequency
//! in a way that no stiffness does.

use super::sensitivity::Sums;
use super::{AveragedError, Prepared, Priors, compliance, interval};
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::Geometry;
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::interface_data::balance;
use crate::substructuring::joint::{Band, stiffness_and_damping};
use crate::substructuring::noise::FrfNoise;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, Vector2};
use serde::Serialize;
use std::collections::BTreeMap;

/// Gauss–Newton converges in three or four steps from the mean compliance; more would mean that it does not.
const STEPS: usize = 20;

/// One degree of freedom fitted. N/m and N s/m; N m/rad and N m s/rad for rotations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FittedDof {
    /// Stiffness.
    pub stiffness: f64,
    /// Its standard deviation, from the Fisher matrix; widened where the fit is worse than its noise allows.
    pub std: f64,
    /// 95 % interval.
    pub ci95: [f64; 2],
    /// Damping.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_std: f64,
    /// Correlation of the two.
    pub correlation: f64,
    /// χ² of the residuals over their number less two: about 1 when model, noise and priors fit the data.
    pub chi_square_per_dof: f64,
    /// Whether the compliance differs from zero clearly enough for a number to be given.
    pub identified: bool,
}

/// The fit over one band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fitted {
    /// The band, Hz.
    pub band_hz: Band,
    /// Lines used.
    pub lines: usize,
    /// The interface deformation modes.
    pub idms: usize,
    /// What was assumed of positions and angles.
    pub priors: Priors,
    /// By degree of freedom.
    pub joint: BTreeMap<Dof, FittedDof>,
}

/// Fits K and C of every degree of freedom over `band` to the assembly's FRFs. `noise` is in the FRFs' own quantity.
///
/// # Errors
/// As [`super::averaged`]; [`AveragedError::NoiseUnknown`] where a cell's variance is not known;
/// [`AveragedError::NoConvergence`].
pub fn fit(
    ajb: &FrfMatrix,
    noise: &FrfNoise,
    geometry: &Geometry,
    idms: IdmSet,
    band: Band,
    priors: &Priors,
) -> Result<Fitted, AveragedError> {
    Prepared::of(ajb, Some(noise), geometry, idms, band, priors)?.fit()
}

impl Prepared {
    /// [`fit`] on what is prepared already.
    ///
    /// # Errors
    /// As [`fit`].
    pub fn fit(&self) -> Result<Fitted, AveragedError> {
        if self.assembly.variance.is_none() {
            return Err(AveragedError::NoiseUnknown);
        }
        let joint = (self.idms.dofs().iter().enumerate())
            .map(|(d, &dof)| Ok((dof, one(self, d)?.scaled(balance(self.idms)[d].powi(2)))))
            .collect::<Result<_, AveragedError>>()?;
        Ok(Fitted {
            band_hz: self.band_hz,
            lines: self.impedance.len(),
            idms: self.idms.count(),
            priors: self.priors,
            joint,
        })
    }
}

/// Lines gathered to chunks as wide as the window's correlation: chunks count as independent, and Σ stays small.
struct Data {
    s: Vec<Complex<f64>>,
    y: Vec<Complex<f64>>,
    /// Lower Cholesky factor of Σ over (real parts, imaginary parts).
    root: DMatrix<f64>,
}

impl Data {
    fn of(prepared: &Prepared, d: usize) -> Option<Data> {
        let Prepared { assembly, impedance, priors, .. } = prepared;
        let (lines, bias) = (&prepared.sums[d], &prepared.bias[d]);
        let shared = prepared.shared();
        let width = (shared.ceil() as usize).max(1);
        let chunks: Vec<Vec<usize>> =
            (0..lines.len()).collect::<Vec<_>>().chunks(width).map(<[usize]>::to_vec).collect();
        let n = chunks.len();
        let (mut s, mut y, mut variance) = (Vec::new(), Vec::new(), Vec::new());
        let mut columns: Vec<Vec<Complex<f64>>> = Vec::new();
        for chunk in &chunks {
            let precision: Vec<f64> = chunk.iter().map(|&l| 1.0 / lines[l].noise_variance).collect();
            let sum: f64 = precision.iter().sum();
            if !(sum.is_finite() && sum > 0.0) {
                return None;
            }
            let weights: Vec<f64> = precision.iter().map(|p| p / sum).collect();
            let mean = |value: &dyn Fn(usize) -> Complex<f64>| -> Complex<f64> {
                chunk.iter().zip(&weights).map(|(&l, w)| value(l) * *w).sum()
            };
            s.push(mean(&|l| assembly.s[l]));
            y.push(mean(&|l| compliance(&impedance[l], d) - bias[l]));
            variance.push(shared / sum);
            let own: Vec<Sums> = chunk.iter().map(|&l| lines[l].clone()).collect();
            columns.push(Sums::weighted(&own, &weights).columns(priors));
        }
        let nuisances = columns.first().map_or(0, Vec::len);
        let g = DMatrix::from_fn(2 * n, nuisances, |row, j| {
            let value = columns[row % n][j];
            if row < n { value.re } else { value.im }
        });
        let mut covariance = &g * g.transpose();
        for row in 0..2 * n {
            covariance[(row, row)] += variance[row % n];
        }
        // compliances of 1e-9 m/N: their squares are far from one, and Cholesky does not mind
        let root = covariance.cholesky()?.l();
        Some(Data { s, y, root })
    }

    /// Σ^-½ times a vector of complex values.
    fn whitened(&self, values: &[Complex<f64>]) -> Option<DVector<f64>> {
        let n = values.len();
        let stacked =
            DVector::from_fn(2 * n, |row, _| if row < n { values[row].re } else { values[row - n].im });
        self.root.solve_lower_triangular(&stacked)
    }
}

fn one(prepared: &Prepared, d: usize) -> Result<FittedDof, AveragedError> {
    let data = Data::of(prepared, d).ok_or(AveragedError::NoiseUnknown)?;
    let n = data.y.len() as f64;
    let mean_y = data.y.iter().sum::<Complex<f64>>() / n;
    let mean_s = data.s.iter().sum::<Complex<f64>>() / n;
    let (mut k, mut c) = stiffness_and_damping(mean_y.inv(), mean_s);
    // parameters of one size: stiffness over its start, damping over what would halve it at mid band
    let unit = (k.abs(), k.abs() / mean_s.norm());
    for _ in 0..STEPS {
        let model: Vec<Complex<f64>> = data.s.iter().map(|s| (k + s * c).inv()).collect();
        let residual: Vec<Complex<f64>> = data.y.iter().zip(&model).map(|(y, m)| y - m).collect();
        let by_k: Vec<Complex<f64>> = model.iter().map(|m| -m * m * unit.0).collect();
        let by_c: Vec<Complex<f64>> = model.iter().zip(&data.s).map(|(m, s)| -s * m * m * unit.1).collect();
        let (Some(r), Some(jk), Some(jc)) =
            (data.whitened(&residual), data.whitened(&by_k), data.whitened(&by_c))
        else {
            break;
        };
        let fisher = Matrix2::new(jk.dot(&jk), jk.dot(&jc), jc.dot(&jk), jc.dot(&jc));
        let Some(covariance) = fisher.try_inverse() else { break };
        let step = covariance * Vector2::new(jk.dot(&r), jc.dot(&r));
        (k, c) = (k + step[0] * unit.0, c + step[1] * unit.1);
        if step.norm() < 1e-9 {
            let freedom = (2.0 * n - 2.0).max(1.0);
            let chi = r.norm_squared() / freedom;
            // never narrower than the noise says: a lucky χ² is luck
            let widen = chi.max(1.0).sqrt();
            let std = covariance[(0, 0)].sqrt() * unit.0 * widen;
            let damping_std = covariance[(1, 1)].sqrt() * unit.1 * widen;
            let (ci95, identified) = interval(k, std);
            return Ok(FittedDof {
                stiffness: k,
                std,
                ci95,
                damping: c,
                damping_std,
                correlation: covariance[(0, 1)] / (covariance[(0, 0)] * covariance[(1, 1)]).sqrt(),
                chi_square_per_dof: chi,
                identified,
            });
        }
    }
    Err(AveragedError::NoConvergence { steps: STEPS })
}

impl FittedDof {
    fn scaled(self, scale: f64) -> FittedDof {
        FittedDof {
            stiffness: scale * self.stiffness,
            std: scale * self.std,
            ci95: self.ci95.map(|k| scale * k),
            damping: scale * self.damping,
            damping_std: scale * self.damping_std,
            ..self
        }
    }
}
