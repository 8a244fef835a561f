//! The joint K + sC as parameters, in a chart that covers both very soft and very stiff joints.
//!
//! For one degree of freedom, Eq. (1) depends on k only through k W / (1 + k W), with W the
//! admittance of A and B together: linear in k if the joint is soft compared with them, linear in
//! 1/k if it is stiff. So the diagonal's parameter is κ = k u / (1 + k u) with u the magnitude of
//! W: 0 for no joint, 1 for a rigid one, without a division by zero at either end. The damper's
//! parameter is the loss factor λ at mid band, c = k λ / ω.
//!
//! The full matrices are K = S⁻¹ L Lᵀ S⁻¹, C = S⁻¹ M Mᵀ S⁻¹ / ω with lower triangles L and M and
//! S = diag(√u): symmetric and positive semidefinite.

use crate::{C, Line};
use nalgebra::{DMatrix, DVector};

/// The entries of K and C that are free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FreeEntries {
    /// Diagonal: each degree of freedom independently.
    #[default]
    Diagonal,
    /// Full matrices, symmetric and positive semidefinite.
    Full,
}

/// Bounds of κ: the stiffness of a joint is between zero and infinity.
const KAPPA: [f64; 2] = [0.0, 1.0];
/// Bounds of the loss factor: a joint does not supply energy.
const LOSS: [f64; 2] = [0.0, 2.0];

/// The parametrisation of one problem.
#[derive(Debug, Clone)]
pub(super) struct Chart {
    pub(super) shape: FreeEntries,
    /// u per degree of freedom, m/N (rotations scaled).
    pub(super) unit: Vec<f64>,
    /// Middle of the band, rad/s.
    pub(super) omega: f64,
    /// For the full form: the magnitude of each row of L, from the diagonal's fit.
    size: Vec<f64>,
}

/// The joint at one s as D and E with G⁻¹ = (D W + E)⁻¹ D, where G = W + (K + sC)⁻¹.
pub(super) struct At {
    pub(super) d: Line,
    pub(super) e: Line,
    /// Their derivatives, if requested.
    pub(super) slopes: Option<Slopes>,
}

/// The derivatives of D and E by each parameter, as sums of dyads left dᵀ and left eᵀ.
///
/// Each matrix has a column for each dyad. Every parameter has the same number of dyads, in
/// contiguous columns.
pub(super) struct Slopes {
    pub(super) left: Line,
    pub(super) d: Line,
    pub(super) e: Line,
}

impl Chart {
    pub(super) fn diagonal(unit: Vec<f64>, omega: f64) -> Chart {
        Chart { shape: FreeEntries::Diagonal, size: vec![1.0; unit.len()], unit, omega }
    }

    /// The full form around a fitted diagonal, and its start values.
    pub(super) fn full(&self, diagonal: &DVector<f64>) -> (Chart, DVector<f64>) {
        let n = self.n();
        let floor = 1e-4;
        let stiffness = |d: usize| {
            let kappa = diagonal[d].clamp(floor, 1.0 - floor);
            kappa / (1.0 - kappa)
        };
        let size: Vec<f64> = (0..n).map(|d| stiffness(d).sqrt()).collect();
        let chart = Chart { shape: FreeEntries::Full, size, ..self.clone() };
        let mut start = DVector::zeros(chart.count());
        for (i, (r, c)) in triangle(n).enumerate() {
            if r == c {
                start[i] = chart.size[r];
                start[i + n * (n + 1) / 2] = chart.size[r] * diagonal[n + r].clamp(0.01, 1.0).sqrt();
            }
        }
        (chart, start)
    }

    pub(super) fn n(&self) -> usize {
        self.unit.len()
    }

    /// Number of parameters.
    pub(super) fn count(&self) -> usize {
        match self.shape {
            FreeEntries::Diagonal => 2 * self.n(),
            FreeEntries::Full => self.n() * (self.n() + 1),
        }
    }

    /// Inverse variances of the parameters' priors about zero. A loss factor is at most of the
    /// order of one; the couplings of a positive matrix are at most as large as its diagonal.
    /// Stiffness has no prior.
    pub(super) fn prior(&self) -> DVector<f64> {
        let n = self.n();
        match self.shape {
            FreeEntries::Diagonal => DVector::from_fn(2 * n, |i, _| if i < n { 0.0 } else { 1.0 }),
            FreeEntries::Full => {
                let half = n * (n + 1) / 2;
                let weights: Vec<f64> = triangle(n)
                    .map(|(r, c)| if r == c { 0.0 } else { self.size[r].powi(-2) })
                    .chain(triangle(n).map(|(r, _)| self.size[r].powi(-2)))
                    .collect();
                debug_assert_eq!(weights.len(), 2 * half);
                DVector::from_vec(weights)
            }
        }
    }

    /// The nearest allowed parameters.
    pub(super) fn bounded(&self, p: &DVector<f64>) -> DVector<f64> {
        match self.shape {
            FreeEntries::Diagonal => DVector::from_fn(p.len(), |i, _| {
                let [low, high] = if i < self.n() { KAPPA } else { LOSS };
                p[i].clamp(low, high)
            }),
            FreeEntries::Full => p.clone(),
        }
    }

    /// Whether the parameter is at a bound and `up` (the sign of the intended step) points beyond
    /// it.
    pub(super) fn held(&self, p: &DVector<f64>, i: usize, up: bool) -> bool {
        let [low, high] = match self.shape {
            FreeEntries::Diagonal if i < self.n() => KAPPA,
            FreeEntries::Diagonal => LOSS,
            FreeEntries::Full => return false,
        };
        if up { p[i] >= high } else { p[i] <= low }
    }

    pub(super) fn at(&self, p: &DVector<f64>, s: C, slopes: bool) -> At {
        match self.shape {
            FreeEntries::Diagonal => self.diagonal_at(p, s, slopes),
            FreeEntries::Full => self.full_at(p, s, slopes),
        }
    }

    fn diagonal_at(&self, p: &DVector<f64>, s: C, slopes: bool) -> At {
        let n = self.n();
        let mut at = At { d: Line::zeros(n, n), e: Line::zeros(n, n), slopes: None };
        let loss = |d: usize| 1.0 + s * (p[n + d] / self.omega);
        for d in 0..n {
            at.d[(d, d)] = loss(d) * (p[d] / self.unit[d]);
            at.e[(d, d)] = C::from(1.0 - p[d]);
        }
        if slopes {
            let mut of = Slopes::none(n, 2 * n);
            for d in 0..n {
                of.left[(d, d)] = C::from(1.0);
                of.d[(d, d)] = loss(d) / self.unit[d];
                of.e[(d, d)] = C::from(-1.0);
                of.left[(d, n + d)] = C::from(1.0);
                of.d[(d, n + d)] = s * (p[d] / self.unit[d] / self.omega);
            }
            at.slopes = Some(of);
        }
        at
    }

    fn full_at(&self, p: &DVector<f64>, s: C, slopes: bool) -> At {
        let n = self.n();
        let (l, m) = self.roots(p);
        let scale = |z: Line| Line::from_fn(n, n, |r, c| z[(r, c)] / (self.unit[r] * self.unit[c]).sqrt());
        let per = s / self.omega;
        let d = (&l * l.transpose()).map(C::from) + (&m * m.transpose()).map(|v| per * v);
        let mut at = At { d: scale(d), e: Line::identity(n, n), slopes: None };
        if slopes {
            let mut of = Slopes::none(n, 2 * self.count());
            let unit = |i: usize| self.unit[i].sqrt().recip();
            let entries = [(&l, C::from(1.0)), (&m, per)]
                .into_iter()
                .flat_map(|root| triangle(n).map(move |entry| (root, entry)));
            for (i, ((root, factor), (r, c))) in entries.enumerate() {
                // d(L Lᵀ) = e_r (column c of L)ᵀ + its transpose
                for k in 0..n {
                    let value = C::from(root[(k, c)] * unit(k));
                    of.d[(k, 2 * i)] = value * factor;
                    of.left[(k, 2 * i + 1)] = value;
                }
                of.left[(r, 2 * i)] = C::from(unit(r));
                of.d[(r, 2 * i + 1)] = C::from(unit(r)) * factor;
            }
            at.slopes = Some(of);
        }
        at
    }

    fn roots(&self, p: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.n();
        let (mut l, mut m) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
        for (i, (r, c)) in triangle(n).enumerate() {
            l[(r, c)] = p[i];
            m[(r, c)] = p[i + n * (n + 1) / 2];
        }
        (l, m)
    }

    /// K and ωC in units of 1/u (dimensionless, n × n), for the full form.
    pub(super) fn matrices(&self, p: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let (l, m) = self.roots(p);
        (&l * l.transpose(), &m * m.transpose())
    }
}

impl Slopes {
    fn none(n: usize, dyads: usize) -> Slopes {
        let none = || Line::zeros(n, dyads);
        Slopes { left: none(), d: none(), e: none() }
    }
}

/// Indices of a lower triangle, row by row.
fn triangle(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(|r| (0..=r).map(move |c| (r, c)))
}
