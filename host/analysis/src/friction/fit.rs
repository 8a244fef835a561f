//! One law fitted to all loops of a contact.
//!
//! The parameters minimise the sum of the squares of the whitened differences between measured
//! force and the law's steady loop at the measured displacement. Two things are fitted with them,
//! so that their uncertainty is contained in the covariance: each loop's mean force, and the
//! cosines and sines of its displacement, which are known with the noise of the displacement
//! (errors in variables; Fuller, Measurement Error Models, 1987, section 3.2). The search is
//! Levenberg's and Marquardt's, from the best points of a grid.

use super::FrictionError;
use super::law::{FrictionLaw, LawKind};
use super::loops::{MeasuredLoop, area};
use crate::identified::FITTED_HALF_WIDTH;
use nalgebra::{DMatrix, DVector};
use serde::{Serialize, Serializer};
use std::f64::consts::TAU;

/// Searches start from this many points of the grid.
const STARTS: usize = 3;

/// Most steps of one search.
const MOST_STEPS: usize = 60;

/// A search ends when a step gains less than this part of the sum of squares.
const CONVERGED: f64 = 1e-6;

/// Step of the differences by the parameters, on their scales.
const PARAMETER_STEP: f64 = 1e-5;

/// Step of the differences by the displacement's harmonics, as a fraction of its amplitude.
const MOTION_STEP: f64 = 1e-5;

/// A displacement whose noise is below this fraction of its amplitude is taken as exact.
const EXACT: f64 = 1e-6;

/// Highest harmonic of the residuals in [`FittedLaw::smooth_excess`]: a wrong law is off along
/// whole parts of the stroke, noise from point to point.
const SMOOTH: usize = 15;

/// 97.5 % quantile of the normal distribution.
const TWO_SIDED_95: f64 = 1.959_964;

/// A parameter with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FittedParameter {
    /// Name, with its unit unless it is a ratio.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// 95 % interval, symmetric on the parameter's scale (the logarithm of most), so not around the
    /// value.
    pub ci95: [f64; 2],
    /// Whether half the width of the interval is below 0.6 of the value; for a ratio that may be
    /// zero, below 0.6.
    pub identified: bool,
}

/// One loop in a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedLoop {
    /// Half the swing of the displacement, m.
    pub amplitude_m: f64,
    /// Mean force of the loop that the law does not explain (the load cells' zero), N.
    pub offset_n: f64,
    /// Root mean square of the force's residuals, N.
    pub residual_n: f64,
    /// Standard deviation of the force's noise, N.
    pub noise_n: f64,
    /// Measured energy per cycle, J.
    pub energy_j: f64,
    /// Its standard deviation, J.
    pub energy_std_j: f64,
    /// Energy per cycle of the law at the measured displacement, J.
    pub law_energy_j: f64,
}

/// A law fitted to loops.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedLaw {
    /// The law.
    #[serde(flatten)]
    pub law: FrictionLaw,
    /// Its parameters with their uncertainty, in the order of [`LawKind::parameters`].
    pub parameters: Vec<FittedParameter>,
    /// Covariance of the parameters, in the same order and their units; `None` where the loops do
    /// not determine all of them.
    #[serde(serialize_with = "rows")]
    pub covariance: Option<DMatrix<f64>>,
    /// Sum of the squared whitened residuals.
    pub chi_squared: f64,
    /// Its expectation: points less parameters and loops.
    pub freedom: usize,
    /// Bayes' information criterion: χ² + parameters · ln(points). Smaller is better; 10 more is
    /// decisive (Kass & Raftery, J. Am. Stat. Assoc. 90 (1995) 773).
    pub bic: f64,
    /// By how many standard deviations χ² exceeds its expectation.
    pub excess: f64,
    /// The same for the first 15 harmonics of the residuals of each loop.
    pub smooth_excess: f64,
    /// Its loops.
    pub loops: Vec<FittedLoop>,
}

// serde passes a reference to the field
#[allow(clippy::ref_option)]
fn rows<S: Serializer>(matrix: &Option<DMatrix<f64>>, to: S) -> Result<S::Ok, S::Error> {
    let rows: Option<Vec<Vec<f64>>> =
        matrix.as_ref().map(|m| m.row_iter().map(|row| row.iter().copied().collect()).collect());
    rows.serialize(to)
}

/// Fits a law to the loops of one contact: all have the same parameters.
///
/// # Errors
/// No loops, or none for which the law gives finite forces.
pub fn fit(kind: LawKind, loops: &[MeasuredLoop]) -> Result<FittedLaw, FrictionError> {
    if loops.is_empty() {
        return Err(FrictionError::NoLoops);
    }
    let problem = LawProblem::new(kind, loops);
    let best = problem
        .starts()
        .into_iter()
        .filter_map(|start| problem.search(start))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or(FrictionError::NoStart { law: kind.name() })?;
    problem.result(&best.0, best.1).ok_or(FrictionError::NoStart { law: kind.name() })
}

/// Residuals of all loops as a function of the unknowns: the parameters on their scales, then of
/// each loop the mean force over its noise, then the displacement's harmonics over theirs.
struct LawProblem<'a> {
    kind: LawKind,
    loops: &'a [MeasuredLoop],
    /// Of each loop, its first unknown and the number of its harmonics' unknowns.
    layout: Vec<(usize, usize)>,
    unknowns: usize,
}

impl<'a> LawProblem<'a> {
    fn new(kind: LawKind, loops: &'a [MeasuredLoop]) -> Self {
        let mut unknowns = kind.parameters().len();
        let layout = loops
            .iter()
            .map(|one| {
                let first = unknowns;
                let exact = one.noise().displacement_m < EXACT * one.amplitude_m();
                let own = if exact { 0 } else { one.basis().ncols() };
                unknowns += 1 + own;
                (first, own)
            })
            .collect();
        Self { kind, loops, layout, unknowns }
    }

    fn law(&self, scaled: &[f64]) -> Option<FrictionLaw> {
        let parameters = self.kind.parameters();
        let values: Vec<f64> = parameters.iter().zip(scaled).map(|(p, &v)| p.unscaled(v)).collect();
        FrictionLaw::new(self.kind, &values).ok()
    }

    /// The law's force at a loop's displacement with its harmonics changed, N.
    fn force(&self, law: &FrictionLaw, number: usize, unknowns: &DVector<f64>) -> Vec<f64> {
        let (first, own) = self.layout[number];
        let one = &self.loops[number];
        let mut x = DVector::from_column_slice(one.smooth_displacement_m());
        if own > 0 {
            x.gemv(one.harmonic_std_m(), one.basis(), &unknowns.rows(first + 1, own), 1.0);
        }
        law.steady(x.as_slice())
    }

    /// Whitened residuals of one loop's points.
    fn residual(&self, law: &FrictionLaw, number: usize, unknowns: &DVector<f64>) -> Vec<f64> {
        let one = &self.loops[number];
        let offset = unknowns[self.layout[number].0] * one.noise().force_n;
        let force = self.force(law, number, unknowns);
        let rest: Vec<f64> =
            one.force_n().iter().zip(&force).map(|(measured, f)| measured - offset - f).collect();
        one.whitened(&rest)
    }

    /// Sum of squares; `None` if it is not finite.
    fn squares(&self, unknowns: &DVector<f64>) -> Option<f64> {
        let law = self.law(unknowns.as_slice())?;
        let mut sum = 0.0;
        for (number, &(first, own)) in self.layout.iter().enumerate() {
            sum += self.residual(&law, number, unknowns).iter().map(|r| r * r).sum::<f64>();
            sum += unknowns.rows(first + 1, own).norm_squared();
        }
        Some(sum).filter(|sum| sum.is_finite())
    }

    /// JᵀJ and −Jᵀr.
    fn normal(&self, at: &DVector<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let law = self.law(at.as_slice())?;
        let shared = self.kind.parameters().len();
        let mut matrix = DMatrix::<f64>::zeros(self.unknowns, self.unknowns);
        let mut side = DVector::<f64>::zeros(self.unknowns);
        let moved: Vec<[FrictionLaw; 2]> = (0..shared)
            .map(|p| {
                let by = |step: f64| {
                    let mut scaled = at.as_slice()[..shared].to_vec();
                    scaled[p] += step;
                    self.law(&scaled)
                };
                Some([by(-PARAMETER_STEP)?, by(PARAMETER_STEP)?])
            })
            .collect::<Option<_>>()?;
        for (number, &(first, own)) in self.layout.iter().enumerate() {
            let one = &self.loops[number];
            let residual = DVector::from_vec(self.residual(&law, number, at));
            let mut columns: Vec<(usize, Vec<f64>)> = Vec::with_capacity(shared + 1 + own);
            for (p, [below, above]) in moved.iter().enumerate() {
                let (below, above) = (self.force(below, number, at), self.force(above, number, at));
                let slope: Vec<f64> =
                    above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * PARAMETER_STEP)).collect();
                columns.push((p, one.whitened(&slope)));
            }
            columns.push((first, one.whitened(&vec![one.noise().force_n; residual.len()])));
            let here = self.force(&law, number, at);
            let step = MOTION_STEP * one.amplitude_m() / one.harmonic_std_m();
            let mut changed = at.clone();
            for unknown in first + 1..first + 1 + own {
                changed[unknown] += step;
                let there = self.force(&law, number, &changed);
                changed[unknown] = at[unknown];
                let slope: Vec<f64> = there.iter().zip(&here).map(|(a, b)| (a - b) / step).collect();
                columns.push((unknown, one.whitened(&slope)));
            }
            let j = DMatrix::from_fn(residual.len(), columns.len(), |i, c| columns[c].1[i]);
            let own_matrix = j.tr_mul(&j);
            let own_side = j.tr_mul(&residual);
            for (a, (row, _)) in columns.iter().enumerate() {
                side[*row] += own_side[a];
                for (b, (column, _)) in columns.iter().enumerate() {
                    matrix[(*row, *column)] += own_matrix[(a, b)];
                }
            }
            for unknown in first + 1..first + 1 + own {
                matrix[(unknown, unknown)] += 1.0;
                side[unknown] -= at[unknown];
            }
        }
        let finite = matrix.iter().chain(side.iter()).all(|v: &f64| v.is_finite());
        finite.then_some((matrix, side))
    }

    /// From a start to the nearest minimum: the unknowns and their sum of squares.
    fn search(&self, start: DVector<f64>) -> Option<(DVector<f64>, f64)> {
        let mut at = start;
        let mut squares = self.squares(&at)?;
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            let (matrix, side) = self.normal(&at)?;
            let mut gained = None;
            while damping < 1e8 {
                let mut damped = matrix.clone();
                for i in 0..self.unknowns {
                    damped[(i, i)] += damping * matrix[(i, i)] + f64::MIN_POSITIVE;
                }
                let step = damped.cholesky().map(|root| root.solve(&side));
                let trial = step.map(|step| self.inside(&at + step));
                let found = trial.and_then(|trial| self.squares(&trial).map(|sum| (trial, sum)));
                match found {
                    Some((trial, sum)) if sum < squares => {
                        gained = Some(squares - sum);
                        (at, squares) = (trial, sum);
                        damping = (damping * 0.1).max(1e-12);
                        break;
                    }
                    _ => damping *= 8.0,
                }
            }
            if gained.is_none_or(|gained| gained < CONVERGED * (1.0 + squares)) {
                break;
            }
        }
        Some((at, squares))
    }

    /// The parameters moved to the nearest end of where they are looked for.
    fn inside(&self, mut unknowns: DVector<f64>) -> DVector<f64> {
        for (p, parameter) in self.kind.parameters().iter().enumerate() {
            unknowns[p] = unknowns[p].clamp(parameter.search[0], parameter.search[1]);
        }
        unknowns
    }

    /// The best points of a grid around the stiffness and the limit that the loops show.
    fn starts(&self) -> Vec<DVector<f64>> {
        let largest = self.loops.iter().map(MeasuredLoop::force_amplitude_n).fold(0.0, f64::max);
        let secant = |one: &MeasuredLoop| one.force_amplitude_n() / one.amplitude_m().max(f64::MIN_POSITIVE);
        let stiffest = self.loops.iter().map(|one| first_slope(one).max(secant(one))).fold(0.0, f64::max);
        let shapes: &[&[f64]] = match self.kind {
            LawKind::Jenkins | LawKind::Mindlin => &[&[]],
            LawKind::Dahl => &[&[0.4], &[1.0], &[2.0]],
            LawKind::Valanis => &[&[0.0, 0.3], &[0.0, 0.9], &[0.05, 0.6], &[0.3, 0.6]],
            LawKind::BoucWen => &[&[1.0, 0.5], &[1.0, 1.0], &[2.0, 0.7], &[4.0, 0.5]],
            LawKind::Iwan => &[&[-0.2, 0.1], &[-0.2, 1.5], &[-0.7, 0.1], &[-0.7, 1.5], &[0.5, 0.2]],
        };
        let mut found: Vec<(f64, DVector<f64>)> = Vec::new();
        for stiffness in [0.5, 0.75, 1.0, 1.3, 2.0] {
            for limit in [0.9, 1.0, 1.2, 2.0, 5.0] {
                for shape in shapes {
                    let values =
                        [stiffness * stiffest, limit * largest].into_iter().chain(shape.iter().copied());
                    let mut start = DVector::zeros(self.unknowns);
                    for (p, (parameter, value)) in self.kind.parameters().iter().zip(values).enumerate() {
                        start[p] = parameter.scaled(value);
                    }
                    for (number, &(first, _)) in self.layout.iter().enumerate() {
                        start[first] = self.mean_rest(&start, number).unwrap_or(0.0);
                    }
                    if let Some(squares) = self.squares(&start) {
                        found.push((squares, start));
                    }
                }
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().take(STARTS).map(|(_, start)| start).collect()
    }

    /// Mean difference between measured force and law in a loop, over its noise.
    fn mean_rest(&self, unknowns: &DVector<f64>, number: usize) -> Option<f64> {
        let law = self.law(unknowns.as_slice())?;
        let one = &self.loops[number];
        let force = self.force(&law, number, unknowns);
        let sum: f64 = one.force_n().iter().zip(&force).map(|(m, f)| m - f).sum();
        Some(sum / force.len() as f64 / one.noise().force_n)
    }

    fn result(&self, at: &DVector<f64>, chi_squared: f64) -> Option<FittedLaw> {
        let law = self.law(at.as_slice())?;
        let shared = self.kind.parameters().len();
        let scaled = self.normal(at).and_then(|(matrix, _)| inverse(&matrix, shared));
        let parameters: Vec<FittedParameter> = law
            .parameters()
            .enumerate()
            .map(|(p, (parameter, value))| {
                let std = scaled.as_ref().map_or(f64::INFINITY, |c| c[(p, p)].sqrt());
                let end = |by: f64| parameter.unscaled(parameter.scaled(value) + by * std);
                let ci95 = [end(-TWO_SIDED_95), end(TWO_SIDED_95)];
                let size = if parameter.unscaled(0.0) == 0.0 { 1.0 } else { value.abs() };
                let identified = 0.5 * (ci95[1] - ci95[0]) < FITTED_HALF_WIDTH * size;
                let std = parameter.derivative(value) * std;
                FittedParameter { name: parameter.name, value, std, ci95, identified }
            })
            .collect();
        let slopes = DVector::from_iterator(shared, law.parameters().map(|(p, v)| p.derivative(v)));
        let covariance = scaled.map(|c| c.component_mul(&(&slopes * slopes.transpose())));
        let points: usize = self.loops.iter().map(|one| one.force_n().len()).sum();
        let freedom = points.saturating_sub(shared + self.loops.len()).max(1);
        let doubt = self
            .loops
            .iter()
            .map(|one| one.noise_variance_doubt() * (one.force_n().len() as f64 / points as f64).powi(2))
            .sum::<f64>();
        let (mut smooth, mut loops) = (0.0, Vec::new());
        for (number, one) in self.loops.iter().enumerate() {
            let residual = self.residual(&law, number, at);
            smooth += smooth_squares(&residual);
            let offset_n = at[self.layout[number].0] * one.noise().force_n;
            let force = law.steady(one.smooth_displacement_m());
            let squares: f64 =
                one.force_n().iter().zip(&force).map(|(m, f)| (m - offset_n - f).powi(2)).sum();
            loops.push(FittedLoop {
                amplitude_m: one.amplitude_m(),
                offset_n,
                residual_n: (squares / force.len() as f64).sqrt(),
                noise_n: one.noise().force_n,
                energy_j: one.energy_j(),
                energy_std_j: one.energy_std_j(),
                law_energy_j: area(one.smooth_displacement_m(), &force),
            });
        }
        Some(FittedLaw {
            law,
            parameters,
            covariance,
            chi_squared,
            freedom,
            bic: chi_squared + shared as f64 * (points as f64).ln(),
            excess: excess(chi_squared, freedom as f64, doubt),
            smooth_excess: excess(smooth, (2 * SMOOTH * self.loops.len()) as f64, doubt),
            loops,
        })
    }
}

/// The first `shared` rows and columns of the inverse of a normal matrix; `None` where it is
/// singular.
fn inverse(matrix: &DMatrix<f64>, shared: usize) -> Option<DMatrix<f64>> {
    let scale = matrix.diagonal().map(f64::sqrt);
    if scale.iter().any(|s| *s <= 0.0 || !s.is_finite()) {
        return None;
    }
    let unit =
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] / (scale[i] * scale[j]));
    let inverse = unit.cholesky()?.inverse();
    let found = DMatrix::from_fn(shared, shared, |i, j| inverse[(i, j)] / (scale[i] * scale[j]));
    found.iter().all(|v| v.is_finite()).then_some(found)
}

/// Sum of squares of the first harmonics, each of unit variance for white residuals of unit
/// variance.
fn smooth_squares(residual: &[f64]) -> f64 {
    let n = residual.len();
    let mut sum = 0.0;
    for harmonic in 1..=SMOOTH {
        let turn = |i: usize| TAU * (harmonic * i % n) as f64 / n as f64;
        let (mut c, mut s) = (0.0, 0.0);
        for (i, r) in residual.iter().enumerate() {
            c += r * turn(i).cos();
            s += r * turn(i).sin();
        }
        sum += (c * c + s * s) * 2.0 / n as f64;
    }
    sum
}

/// By how many standard deviations a sum of squares exceeds χ² of this freedom (Wilson & Hilferty,
/// PNAS 17 (1931) 684); `doubt` is the relative variance of the noise's variance.
fn excess(squares: f64, freedom: f64, doubt: f64) -> f64 {
    let ninth = 2.0 / (9.0 * freedom);
    ((squares / freedom).cbrt() - (1.0 - ninth)) / (ninth + doubt / 9.0).sqrt()
}

/// Least-squares slope over the first quarter of the force's swing after the reversal at the
/// largest displacement, N/m.
fn first_slope(one: &MeasuredLoop) -> f64 {
    let (x, f) = (one.smooth_displacement_m(), one.force_n());
    let n = x.len();
    let (_, high) = one.ends_m();
    let top = x.iter().position(|v| *v >= high).unwrap_or(0);
    let part = 0.25 * 2.0 * one.force_amplitude_n();
    let used: Vec<usize> = (0..n / 2).map(|i| (top + i) % n).take_while(|&i| f[top] - f[i] <= part).collect();
    let count = used.len().max(1) as f64;
    let mean_x = used.iter().map(|&i| x[i]).sum::<f64>() / count;
    let mean_f = used.iter().map(|&i| f[i]).sum::<f64>() / count;
    let (mut xx, mut xf) = (0.0, 0.0);
    for &i in &used {
        xx += (x[i] - mean_x).powi(2);
        xf += (x[i] - mean_x) * (f[i] - mean_f);
    }
    if xx > 0.0 { xf / xx } else { 0.0 }
}
