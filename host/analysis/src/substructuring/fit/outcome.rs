//! From parameters to K and C with intervals, and to warnings where the data do not determine them.

use super::chart::{Chart, FreeEntries};
use super::solver::SearchResult;
use super::{Fitted, Options};
use crate::band::Band;
use crate::identified::FITTED_HALF_WIDTH;
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::interface_data::balance;
use crate::substructuring::joint_over_bands::{BandStatistic, JointRow, NORMAL_95};
use nalgebra::DVector;
use serde::Serialize;
use std::collections::BTreeMap;

/// A loss factor with at least this standard deviation is determined by its prior, not by the data.
const LOSS_UNKNOWN: f64 = 0.5;
/// χ² per degree of freedom above which a warning is given and intervals are widened: with
/// thousands of residuals it scatters by a few per cent only, and a model that describes them gives
/// 0.8 to 1.
pub(super) const POOR: f64 = 1.15;

/// One degree of freedom of the fitted joint. N/m and N s/m; N m/rad and N m s/rad for rotations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FittedDof {
    /// Stiffness; infinite for a rigid joint.
    pub stiffness: f64,
    /// Its standard deviation, to first order.
    pub std: f64,
    /// 95 % interval: that of κ, which is normally distributed, converted. It may reach below zero,
    /// or to infinity.
    pub ci95: [f64; 2],
    /// Whether the interval is narrow enough to quote the stiffness as a number.
    pub identified: bool,
    /// Damping.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_std: f64,
    /// Whether the damping is determined by the data and not by its prior.
    pub damping_identified: bool,
}

impl FittedDof {
    /// From κ and the loss factor with their standard deviations, in the chart's unit `u` (m/N or
    /// rad/(N m)).
    fn of(kappa: f64, kappa_std: f64, loss: [f64; 2], unit: f64, omega: f64) -> FittedDof {
        let stiffness = |kappa: f64| if kappa < 1.0 { kappa / (1.0 - kappa) / unit } else { f64::INFINITY };
        let k = stiffness(kappa);
        let ci95 = [stiffness(kappa - NORMAL_95 * kappa_std), stiffness(kappa + NORMAL_95 * kappa_std)];
        let std = kappa_std / ((1.0 - kappa) * (1.0 - kappa)) / unit;
        let identified = k > 0.0 && k.is_finite() && (ci95[1] - ci95[0]) / 2.0 < FITTED_HALF_WIDTH * k;
        FittedDof {
            stiffness: k,
            std,
            ci95,
            identified,
            damping: k * loss[0] / omega,
            damping_std: (k.abs() * loss[1] / omega).hypot(std * loss[0] / omega),
            damping_identified: identified && loss[1] < LOSS_UNKNOWN,
        }
    }
}

/// All degrees of freedom, and for the full form the stiffness between them (`y-z`: N/m, N/rad or N
/// m/rad).
pub(super) fn joint(
    chart: &Chart,
    found: &SearchResult,
    idms: IdmSet,
    mounting: f64,
) -> (BTreeMap<Dof, FittedDof>, BTreeMap<String, [f64; 2]>) {
    let n = chart.n();
    let d = balance(idms);
    // if the residuals exceed the noise, the result is less certain than the noise suggests
    let widen = if found.chi_square > POOR { found.chi_square.sqrt() } else { 1.0 };
    let unit = |i: usize| chart.unit[i] / (d[i] * d[i]);
    // if the admittance is W (1 + g) instead of W, κ appears as κ + g (1 − κ)
    let mounted = |kappa: f64, std: f64| std.hypot(mounting * (1.0 - kappa));
    match chart.shape {
        FreeEntries::Diagonal => {
            let std = |i: usize| widen * found.covariance[(i, i)].sqrt();
            let dofs = idms
                .dofs()
                .iter()
                .enumerate()
                .map(|(i, dof)| {
                    let loss = [found.p[n + i], std(n + i)];
                    (*dof, FittedDof::of(found.p[i], mounted(found.p[i], std(i)), loss, unit(i), chart.omega))
                })
                .collect();
            (dofs, BTreeMap::new())
        }
        FreeEntries::Full => {
            let entry = |which: usize, r: usize, c: usize| {
                let value = |p: &DVector<f64>| {
                    let (k, loss) = chart.matrices(p);
                    if which == 0 { k[(r, c)] } else { loss[(r, c)] }
                };
                // the entries are quadratic, so a central difference is exact
                let slope = DVector::from_fn(found.p.len(), |i, _| {
                    let mut p = found.p.clone();
                    p[i] += 0.5;
                    let high = value(&p);
                    p[i] -= 1.0;
                    high - value(&p)
                });
                [value(&found.p), widen * slope.dot(&(&found.covariance * &slope)).max(0.0).sqrt()]
            };
            let dofs = idms
                .dofs()
                .iter()
                .enumerate()
                .map(|(i, dof)| {
                    let ([k, k_std], [c, c_std]) = (entry(0, i, i), entry(1, i, i));
                    let (kappa, kappa_std) = (k / (1.0 + k), k_std / ((1.0 + k) * (1.0 + k)));
                    let kappa_std = mounted(kappa, kappa_std);
                    (*dof, FittedDof::of(kappa, kappa_std, [c / k, c_std / k], unit(i), chart.omega))
                })
                .collect();
            let mut couplings = BTreeMap::new();
            for (i, one) in idms.dofs().iter().enumerate() {
                for (j, other) in idms.dofs().iter().enumerate().skip(i + 1) {
                    let scale = 1.0 / (unit(i) * unit(j)).sqrt();
                    couplings.insert(format!("{one}-{other}"), entry(0, i, j).map(|v| v * scale));
                }
            }
            (dofs, couplings)
        }
    }
}

impl Fitted {
    /// The fit as a row of the results, with identified values only. The others are in the
    /// warnings, with their limits.
    pub fn row(&self) -> JointRow {
        let known = |value: f64, std: f64, ci95: [f64; 2]| BandStatistic {
            mean: value,
            std,
            median: value,
            ci95: Some(ci95),
        };
        let around =
            |value: f64, std: f64| known(value, std, [value - NORMAL_95 * std, value + NORMAL_95 * std]);
        let identified = self.joint.iter().filter(|(_, j)| j.identified);
        JointRow {
            method: super::NAME.into(),
            idms: self.idms,
            modes: self.joint.keys().copied().collect(),
            band_hz: self.band_hz,
            stiffness_n_per_m: identified.map(|(dof, j)| (*dof, known(j.stiffness, j.std, j.ci95))).collect(),
            damping_n_s_per_m: (self.joint.iter())
                .filter(|(_, j)| j.damping_identified)
                .map(|(dof, j)| (*dof, around(j.damping, j.damping_std)))
                .collect(),
            coupling_si: self.coupling_si.iter().map(|(k, [v, std])| (k.clone(), around(*v, *std))).collect(),
            // the damping between degrees of freedom is a parameter of the full joint, and not a
            // value to quote
            coupling_damping_si: BTreeMap::new(),
            lines: self.lines,
            warnings: self.warnings(),
        }
    }

    /// Warnings to read before using the values.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.chi_square_per_dof > POOR {
            warnings.push(format!(
                "a poor fit: the residuals are {:.1} times what noise and the assumed errors of geometry allow (χ² {:.1} per degree of freedom); \
                 the intervals are widened by that, but something is not in the model: A or B changed between the configurations, a flexible \
                 interface, a joint that is not K + sC, or larger errors of geometry than stated",
                self.chi_square_per_dof.sqrt(),
                self.chi_square_per_dof
            ));
        }
        if !self.converged {
            warnings.push(
                "the search was stopped before it converged: the estimate still moved by more than half its standard deviation, or it moved only \
                 after the data were given less weight".into(),
            );
        }
        if self.largest_error > 5.0 {
            warnings.push(format!(
                "one error of geometry would have to be {:.0} times its assumed standard deviation: look for a swapped or misplaced point, or state larger errors",
                self.largest_error
            ));
        }
        for (dof, j) in self.joint.iter().filter(|(_, j)| !j.identified) {
            let unit = if dof.is_rotation() { "N m/rad" } else { "N/m" };
            let [low, high] = j.ci95;
            let says = match (low > 0.0, high.is_finite()) {
                (true, true) => format!("between {low:.3e} and {high:.3e} {unit}"),
                (true, false) => format!("above {low:.3e} {unit}"),
                (false, true) => format!("below {high:.3e} {unit}"),
                (false, false) => "no limit".into(),
            };
            warnings.push(format!("k_{dof} is not identified; 95 % limits: {says}"));
        }
        warnings
    }
}

/// The public result for a fit over `lines` lines of `band_hz`.
pub(super) fn fitted(
    chart: &Chart,
    found: &SearchResult,
    idms: IdmSet,
    band_hz: Band,
    lines: usize,
    options: &Options,
) -> Fitted {
    let (joint, coupling_si) = joint(chart, found, idms, options.mounting);
    Fitted {
        band_hz,
        lines,
        idms: idms.count(),
        priors: options.priors,
        mounting: options.mounting,
        shape: chart.shape,
        joint,
        coupling_si,
        chi_square_per_dof: found.chi_square,
        largest_error: found.largest_error,
        converged: found.settled,
    }
}
