//! The search for the joint: start values, then Levenberg–Marquardt, with the errors of geometry
//! integrated out and linearised again at their current estimate.

use super::FitError;
use super::chart::{Chart, FreeEntries};
use super::large_matrix::{Factor, crossed};
use super::model::Layout;
use super::problem::{Corrected, Problem};
use super::weight::{Point, Weight};
use crate::Line;
use crate::errors_in_variables::NoiseInflation;
use crate::parallel::join;
use crate::parallel::prelude::*;
use crate::substructuring::idm::IdmSet;
use crate::substructuring::joint_over_bands::median;
use crate::substructuring::pseudo_inverse::full_rank_inverse;
use nalgebra::{Complex, DMatrix, DVector};

/// Number of evaluations of geometry, weights and bias. Tilts have a second-order effect too, which
/// the second pass removes. Many passes do harm: the derivatives contain the noise of the FRFs, and
/// the spurious information from it accumulates.
const PASSES: usize = 4;
/// Largest number of steps of one pass; a few suffice from a good start.
const STEPS: usize = 40;
/// The search ends if a step gains less than this in χ²: a hundredth of a standard deviation is
/// left.
const GAIN: f64 = 1e-4;
/// The same if another pass follows, which continues from there: a tenth.
const COARSE_GAIN: f64 = 1e-2;
/// Gain relative to χ² below which a descent with too small variances ends: χ² then shows by which
/// factor to enlarge them.
const SHOWN: f64 = 1e-3;
/// χ² per degree of freedom above which geometry is far from linear with these weights: variances
/// are enlarged for the pass, at most `MILDER` times.
const STEEP: f64 = 1.5;
const MILDER: usize = 4;
/// χ² per degree of freedom after the second pass that no further pass would improve sufficiently.
const HOPELESS: f64 = 100.0;
/// A κ whose standard deviation is below this fraction of κ (1 − κ) determines its stiffness to
/// about 60 %.
const TOLD: f64 = 0.3;

/// A direction in which noise contributes more than this fraction of the information counts as not
/// measured: its interval is widened tenfold, and it is not corrected, because the correction would
/// amplify noise tenfold.
const FEIGNED_MOST: f64 = 0.9;

/// Result of a search.
#[derive(Debug, Clone)]
pub(super) struct SearchResult {
    pub(super) p: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// χ² per degree of freedom.
    pub(super) chi_square: f64,
    /// Largest estimated error of geometry, in standard deviations of its prior.
    pub(super) largest_error: f64,
    /// Whether the last pass changed no parameter by more than half a standard deviation, without
    /// enlarged variances.
    pub(super) settled: bool,
}

/// Parameters and their covariance.
type Estimate = (DVector<f64>, DMatrix<f64>);

/// The cost at one point without its derivatives, which suffices to reject a step.
struct Tried {
    cost: f64,
    residual: Products,
}

/// The cost and its derivatives at one point.
struct Score {
    cost: f64,
    chi: f64,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// L⁻¹Gᵀ N⁻¹ r, where L Lᵀ is the matrix with which the nuisance parameters are integrated out.
    pulled: DMatrix<f64>,
}

/// Everything that stays fixed during a pass.
struct Linear<'a> {
    problem: &'a Problem,
    chart: &'a Chart,
    data: &'a Corrected,
    weight: &'a Weight,
    /// G η₀ per band: the residual is evaluated at η₀, while the prior is about zero.
    believed: Vec<DMatrix<f64>>,
}

/// Columns and the sums of their products over the bands.
#[derive(Clone)]
struct NormalSums {
    /// In units of their noise, one matrix for each band.
    columns: Vec<DMatrix<f64>>,
    /// Gᵀ N⁻¹ times the columns.
    pulled: DMatrix<f64>,
    /// Products of each column with each.
    all: DMatrix<f64>,
}

/// Residual and derivatives at the start of a descent.
#[derive(Clone)]
struct Start {
    residual: NormalSums,
    slopes: NormalSums,
}

impl Linear<'_> {
    /// Sums for the columns that `of` returns for each band, in units of their noise.
    fn sums(
        &self,
        of: impl Fn(usize) -> Result<DMatrix<f64>, FitError> + Send + Sync,
    ) -> Result<NormalSums, FitError> {
        let by_band: Vec<_> = (0..self.weight.bands.len())
            .into_par_iter()
            .map(|band| {
                let (weight, columns) = (&self.weight.bands[band], of(band)?);
                let pulled = weight.g.pulled(self.problem, &weight.whitening, &columns);
                Ok((crossed(&columns, &columns), pulled, columns))
            })
            .collect::<Result<_, FitError>>()?;
        let count = by_band.first().map_or(0, |(own, ..)| own.nrows());
        let mut all = DMatrix::zeros(count, count);
        let mut pulled = DMatrix::zeros(self.weight.information.nrows(), count);
        let mut columns = Vec::with_capacity(by_band.len());
        for (own, by_nuisance, of_band) in by_band {
            all += own;
            pulled += by_nuisance;
            columns.push(of_band);
        }
        Ok(NormalSums { columns, pulled, all })
    }

    fn residual(&self, p: &DVector<f64>) -> Result<NormalSums, FitError> {
        self.sums(|band| {
            // r falls if the model rises
            let residual =
                self.problem.residual(self.chart, p, self.data, self.problem.bands[band].clone())?;
            Ok(self.weight.bands[band].whitening.of(residual) + &self.believed[band])
        })
    }

    fn slopes(&self, p: &DVector<f64>) -> Result<NormalSums, FitError> {
        self.sums(|band| {
            let slopes = self.problem.slopes(self.chart, p, self.data, self.problem.bands[band].clone())?;
            Ok(self.weight.bands[band].whitening.of(slopes))
        })
    }

    fn start(&self, p: &DVector<f64>) -> Result<Start, FitError> {
        Ok(Start { residual: self.residual(p)?, slopes: self.slopes(p)? })
    }

    /// The factor of I + Gᵀ N⁻¹ G / mild, with which the nuisance parameters are integrated out if
    /// variances are larger by the factor `mild`.
    fn marginal(&self, mild: f64) -> Result<Factor, FitError> {
        let mut marginal = self.weight.information.map(|v| v / mild);
        for i in 0..marginal.nrows() {
            marginal[(i, i)] += 1.0;
        }
        Factor::of(marginal).ok_or(FitError::NoiseSingular)
    }
}

/// Everything that stays fixed while the joint changes.
struct Pass<'a> {
    linear: &'a Linear<'a>,
    /// Factor by which variances are enlarged.
    mild: f64,
    /// See [`Linear::marginal`].
    marginal: Factor,
    prior: DVector<f64>,
}

/// Columns and the sums of their products, with the nuisance parameters integrated out.
struct Products {
    /// In units of their noise, one matrix for each band.
    columns: Vec<DMatrix<f64>>,
    /// L⁻¹Gᵀ N⁻¹ times the columns.
    pulled: DMatrix<f64>,
    /// Products of each column with each.
    all: DMatrix<f64>,
}

impl Pass<'_> {
    fn products(&self, sums: NormalSums) -> Products {
        let NormalSums { columns, mut pulled, all } = sums;
        self.marginal.forward(&mut pulled);
        let all = self.integrated(all, &pulled, &pulled);
        Products { columns, pulled, all }
    }

    /// Sums of products without the part that the nuisance parameters explain.
    fn integrated(&self, all: DMatrix<f64>, one: &DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
        (all - crossed(one, other) / self.mild) / self.mild
    }

    fn tried(&self, p: &DVector<f64>, residual: NormalSums) -> Tried {
        let residual = self.products(residual);
        Tried { cost: residual.all[(0, 0)] + p.dot(&self.prior.component_mul(p)), residual }
    }

    /// The score at `p`, given its cost.
    fn score(&self, p: &DVector<f64>, tried: Tried, slopes: NormalSums) -> Score {
        let Tried { cost, residual } = tried;
        let slopes = self.products(slopes);
        let mut downhill = DMatrix::zeros(p.len(), 1);
        for (slopes, residual) in slopes.columns.iter().zip(&residual.columns) {
            downhill += crossed(slopes, residual);
        }
        let downhill = self.integrated(downhill, &slopes.pulled, &residual.pulled);
        Score {
            cost,
            chi: residual.all[(0, 0)],
            gradient: downhill.column(0) - self.prior.component_mul(p),
            hessian: slopes.all + DMatrix::from_diagonal(&self.prior),
            pulled: residual.pulled,
        }
    }

    /// The estimate of the nuisance parameters there, in standard deviations of their priors.
    fn eta(&self, at: &Score) -> DVector<f64> {
        let mut eta = at.pulled.clone();
        self.marginal.backward(&mut eta);
        eta.column(0) / self.mild
    }

    /// The minimum corrected for the spurious information from noise in the derivatives (errors in
    /// variables), and its covariance; none if the information is noise only.
    fn corrected(&self, p: &DVector<f64>, at: &Score) -> Result<Option<Estimate>, FitError> {
        let count = p.len();
        let weight = self.linear.weight;
        let all = self.products(self.linear.sums(|band| Ok(weight.bands[band].noise_inflation.clone()))?).all;
        let pull = all.view((1, 0), (count, 1));
        let noise_inflation = all.view((1, 1), (count, count)).clone_owned();
        let Some(noise_inflation) = NoiseInflation::of(at.hessian.clone(), &noise_inflation) else {
            return Ok(None);
        };
        let inverse =
            noise_inflation.weighed(|f| if f < FEIGNED_MOST { 1.0 / (1.0 - f.max(0.0)) } else { 0.0 });
        let mut rest = &at.gradient - pull.column(0);
        for i in 0..count {
            if self.linear.chart.held(p, i, rest[i] > 0.0) {
                rest[i] = 0.0;
            }
        }
        let next = self.linear.chart.bounded(&(p + &inverse * rest));
        let mut covariance = noise_inflation.weighed(|f| {
            let left = 1.0 - f.clamp(0.0, FEIGNED_MOST);
            1.0 / (left * left)
        });
        // from one draw and first order only: the uncertainty of the correction is its own size
        for (i, step) in (&next - p).iter().enumerate() {
            covariance[(i, i)] += step * step;
        }
        Ok(Some((next, covariance)))
    }

    /// Descends from `p` until `enough` accepts a step's gain.
    fn descend(
        &self,
        p: &DVector<f64>,
        start: Start,
        enough: impl Fn(f64, &Score) -> bool,
    ) -> Result<(DVector<f64>, Score), FitError> {
        let Start { residual, slopes } = start;
        let (mut p, mut here) = (p.clone(), self.score(p, self.tried(p, residual), slopes));
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let mut damped = here.hessian.clone();
            let mut downhill = here.gradient.clone();
            for i in 0..p.len() {
                damped[(i, i)] *= 1.0 + damping;
                // a parameter at its bound whose step points beyond it is fixed, and the other
                // steps take this into account
                if self.linear.chart.held(&p, i, here.gradient[i] > 0.0) {
                    damped.row_mut(i).fill(0.0);
                    damped.column_mut(i).fill(0.0);
                    damped[(i, i)] = 1.0;
                    downhill[i] = 0.0;
                }
            }
            let step = damped.cholesky().map(|c| c.solve(&downhill));
            let next = step.map(|step| self.linear.chart.bounded(&(&p + step)));
            let tried =
                next.map(|next| (self.linear.residual(&next).map(|sums| self.tried(&next, sums)), next));
            match tried {
                Some((Ok(tried), next)) if tried.cost <= here.cost => {
                    let gain = here.cost - tried.cost;
                    // about two steps in five increase the cost: derivatives are computed for
                    // accepted steps only
                    (here, p) = (self.score(&next, tried, self.linear.slopes(&next)?), next);
                    damping = (damping / 10.0f64).max(1e-9);
                    if enough(gain, &here) {
                        break;
                    }
                }
                // the cost increased or cannot be computed: a shorter step
                _ => damping *= 10.0,
            }
            if damping > 1e9 {
                break;
            }
        }
        Ok((p, here))
    }
}

/// The most likely joint near `start`.
pub(super) fn search(
    problem: &Problem,
    chart: &Chart,
    start: &DVector<f64>,
) -> Result<SearchResult, FitError> {
    let nuisances = problem.nuisances.std.len();
    let freedom = (2 * problem.entries() * problem.bands.len()) as f64;
    let freedom = (freedom - chart.count() as f64).max(1.0);
    let mut p = start.clone();
    let mut eta = DVector::zeros(nuisances);
    let mut found: Option<SearchResult> = None;
    for pass in 0..PASSES {
        let data = problem.corrected(chart, &p, eta.as_slice())?;
        let cells = [0, 1, 2].map(|place| problem.cells(place, eta.as_slice()));
        let weight = Weight::of(Point { problem, chart, p: &p, cells: &cells, data: &data })?;
        let believed = (weight.bands.par_iter())
            .map(|band| band.g.times(problem, &band.whitening, eta.as_slice()))
            .collect();
        let linear = Linear { problem, chart, data: &data, weight: &weight, believed };
        let mut mild = 1.0;
        let (mut marginal, start) = join(|| linear.marginal(mild), || linear.start(&p));
        let mut trial = 0;
        let (chi, found_eta, (next, covariance)) = loop {
            let here = Pass { linear: &linear, mild, marginal: marginal?, prior: chart.prior() };
            let last = if pass + 1 < PASSES { COARSE_GAIN } else { GAIN };
            let (next, score) = here.descend(&p, start.clone()?, |gain, at| {
                let again = at.chi / freedom >= STEEP && trial < MILDER;
                gain < last || (again && gain < SHOWN * at.cost)
            })?;
            trial += 1;
            if score.chi / freedom < STEEP || trial > MILDER {
                let corrected = here.corrected(&next, &score)?.ok_or(FitError::NoMinimum)?;
                break (score.chi, here.eta(&score), corrected);
            }
            mild *= score.chi / freedom;
            marginal = linear.marginal(mild);
        };
        // the change by this pass adds to the uncertainty
        let mut covariance = covariance;
        if found.is_some() {
            for i in 0..p.len() {
                covariance[(i, i)] += (next[i] - p[i]).powi(2);
            }
        }
        if (0..p.len()).any(|i| covariance[(i, i)].is_nan() || covariance[(i, i)] <= 0.0) {
            return Err(FitError::NoMinimum);
        }
        // parameters that the data do not determine may change
        let told = |i: usize| match chart.shape {
            FreeEntries::Diagonal => {
                i < chart.n() && covariance[(i, i)].sqrt() < TOLD * next[i] * (1.0 - next[i])
            }
            FreeEntries::Full => true,
        };
        let moved = (0..p.len()).any(|i| told(i) && (next[i] - p[i]).abs() > 0.5 * covariance[(i, i)].sqrt());
        eta = found_eta;
        found = Some(SearchResult {
            p: next.clone(),
            covariance,
            chi_square: chi * mild / freedom,
            largest_error: eta.amax(),
            settled: !moved && mild == 1.0,
        });
        p = next;
        if pass > 0 && found.as_ref().is_some_and(|f| f.chi_square > HOPELESS) {
            // errors of geometry have been corrected, and the model still does not fit
            break;
        }
    }
    found.ok_or(FitError::NoMinimum)
}

/// Range of κ: from a joint with hardly any stiffness to one with hardly any compliance.
const ENDS: [f64; 2] = [1e-3, 0.999];

/// The chart whose unit is the magnitude of Y^A + Y^B, the median over the lines of the band.
pub(super) fn chart(problem: &Problem) -> Chart {
    let w: Vec<Line> = (0..problem.s.len())
        .map(|l| {
            let parts = [0, 1].map(|side: usize| {
                let block = &problem.parts[side];
                block.reduce(&block.cells[l])
            });
            problem.layout.interface([&parts[0], &parts[1]])
        })
        .collect();
    let unit = (0..problem.layout.n)
        .map(|d| median(&w.iter().map(|w| w[(d, d)].norm()).collect::<Vec<f64>>()))
        .collect();
    let omega = problem.s.iter().map(|s| s.im).sum::<f64>() / problem.s.len() as f64;
    Chart::diagonal(unit, omega)
}

/// Start values to be tried in this order until one fits.
///
/// If the assembly's virtual points are measured, translations start from `inverse`: the median of
/// κ over lines, which is robust against single lines. Rotations start soft, then from `inverse`
/// too: for a small contact they have hardly any effect compared with the arms' inertia, and noise
/// makes them look stiff in `inverse`. Without virtual points in the assembly, translations start
/// at three sizes.
pub(super) fn candidates(problem: &Problem, chart: &Chart, idms: IdmSet) -> Vec<DVector<f64>> {
    let n = chart.n();
    let rotation = |d: usize| idms.dofs()[d].is_rotation();
    let from = |kappa: &dyn Fn(usize) -> f64| {
        DVector::from_fn(2 * n, |i, _| if i < n { kappa(i).clamp(ENDS[0], ENDS[1]) } else { 0.0 })
    };
    match by_inverse(problem, chart) {
        Some(kappa) => vec![
            from(&|d| if rotation(d) { ENDS[0] } else { kappa[d] }),
            from(&|d| kappa[d]),
            from(&|d| if rotation(d) { 0.1 } else { kappa[d] }),
        ],
        None => [0.7, 0.95, 0.3]
            .iter()
            .map(|translation| from(&|d| if rotation(d) { ENDS[0] } else { *translation }))
            .collect(),
    }
}

/// κ of each degree of freedom by Eq. (A.1); none if a virtual point is missing or a line singular.
fn by_inverse(problem: &Problem, chart: &Chart) -> Option<Vec<f64>> {
    let n = chart.n();
    let Layout { rows, columns, .. } = &problem.layout;
    let corners = [0, 1].map(|side| problem.layout.corner(side));
    let places = |first: [usize; 2]| -> Vec<usize> { first.iter().flat_map(|f| *f..f + n).collect() };
    let out = places([corners[0].0 + rows[0].first[0], corners[1].0 + rows[1].first[0]]);
    let input = places([corners[0].1 + columns[0].first[0], corners[1].1 + columns[1].first[0]]);
    if !(out.iter().all(|r| problem.rows.contains(r)) && input.iter().all(|c| problem.columns.contains(c))) {
        return None;
    }
    let z: Vec<Line> = (problem.ajb.cells.iter())
        .map(|cells| {
            let y = problem.ajb.reduce(cells).select_rows(&out).select_columns(&input);
            full_rank_inverse(&y, "the assembly's interface admittance").ok()
        })
        .collect::<Option<_>>()?;
    Some(
        (0..n)
            .map(|d| {
                let kappa: Vec<f64> = z
                    .iter()
                    .map(|z| {
                        let joint: Complex<f64> = -(z[(d, n + d)] + z[(n + d, d)]) * 0.5 * chart.unit[d];
                        (joint / (1.0 + joint)).re
                    })
                    .collect();
                median(&kappa)
            })
            .collect(),
    )
}
