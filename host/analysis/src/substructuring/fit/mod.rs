//! `fit`: the joint's K and C by maximum likelihood over all measured blocks.
//!
//! Eq. (1) is the model of the assembly: Y^AJB(θ) = Y − Y Bᵀ (B Y Bᵀ + Y^J(θ))⁻¹ B Y, with Y =
//! blkdiag(Y^A, Y^B) as measured and Y^J = (K + sC)⁻¹. No matrix is inverted that noise could make
//! singular, so a degree of freedom that is far stiffer or softer than the noise can resolve
//! affects only its own estimate. Any set of rows and columns of the assembly can be used, also
//! fewer internals than interface degrees of freedom.
//!
//! The residual's covariance contains the noise of Y^AJB and, through Eq. (1)'s derivatives, of Y^A
//! and Y^B, and errors of position, aim and angle with Gaussian priors. The modules: `block`: the
//! measured data and its errors of geometry; `chart`: the parameters; `model`: Eq. (1) and its
//! derivatives; `problem`: the residuals; `weight`: their covariance (`noise`, `large_matrix`);
//! then `solver`, `outcome`.

mod block;
mod chart;
mod large_matrix;
mod model;
mod noise;
mod outcome;
mod problem;
mod solver;
mod weight;

pub use chart::FreeEntries;
pub use outcome::FittedDof;

use super::averaged::Priors;
use super::geometry::{Geometry, Grouping};
use super::idm::{Dof, IdmSet};
use super::interface_data::{InterfaceError, Measured};
use crate::band::Band;
use crate::frf::Frf;
use crate::frf::noise::shared_by_lines;
use crate::structure::Structure;
use block::{Nuisances, ReceptanceBlock, Side};
use model::Layout;
use problem::Problem;
use serde::Serialize;
use std::collections::BTreeMap;

/// The method's name in command lines and results.
pub const NAME: &str = "fit";

/// χ² per degree of freedom below which no other start is tried: at a wrong minimum it is far
/// higher.
const ENOUGH: f64 = 2.0;
/// χ² per degree of freedom above which no joint is returned.
const HOPELESS: f64 = 10.0;

/// Options of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Assumed errors of positions and angles.
    pub priors: Priors,
    /// The entries of K and C that are free.
    pub shape: FreeEntries,
    /// The points of the assembly that are used.
    pub points: Points,
    /// Assumed difference between A and B alone and A and B in the assembly: a standard deviation,
    /// as a fraction of their admittance, for a different suspension or mounting. A joint that is
    /// softer relative to the structures than this cannot be distinguished from it.
    pub mounting: f64,
}

impl Default for Options {
    /// Diagonal form, interface points, and 0.5 % between the configurations.
    fn default() -> Self {
        Options {
            priors: Priors::default(),
            shape: FreeEntries::default(),
            points: Points::default(),
            mounting: 0.005,
        }
    }
}

/// The points of the assembly that a fit uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Points {
    /// The interface's, and internal ones only if the assembly's file lacks the interface's.
    #[default]
    Interface,
    /// The interface's and all internal ones (Groupings 3 and 4) that the substructure's file has
    /// too.
    All,
}

/// The reason why there is no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The virtual points cannot be formed, or a cell is not a number.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
    /// A cell has no variance, or it is zero.
    #[error(
        "{file}: the noise of `{output}` from `{input}` is not known, and `fit` weighs every cell with it: store `variance` with the FRFs \
         (`jointrig frf --out` does, from two hits on) or state the noise"
    )]
    NoiseUnknown {
        /// Which file.
        file: Structure,
        /// The cell's output.
        output: String,
        /// The cell's input.
        input: String,
    },
    /// No line in the band.
    #[error("{file} has no line, or other lines than the other files, in the band {low_hz}–{high_hz} Hz")]
    EmptyBand {
        /// Which file.
        file: Structure,
        /// Lowest frequency, Hz.
        low_hz: f64,
        /// Highest frequency, Hz.
        high_hz: f64,
    },
    /// The assembly's file has no usable point.
    #[error(
        "AJB has no {kind} that `fit` can use: it needs the interface's points, or internal ones that are in the substructure's file too"
    )]
    NothingMeasured {
        /// `responses` or `impacts`.
        kind: &'static str,
    },
    /// Y^A + Y^B + Y^J is singular at a line.
    #[error(
        "at {frequency_hz} Hz: Y^A + Y^B + Y^J is singular, so A or B was not measured in every direction"
    )]
    Singular {
        /// The line, Hz.
        frequency_hz: f64,
    },
    /// The covariance of the noise cannot be factorised.
    #[error(
        "the residuals' covariance is singular: two channels or impacts are the same, or the variances differ by too many orders of magnitude"
    )]
    NoiseSingular,
    /// The cost has no clear minimum.
    #[error(
        "not identified: the likelihood has no clear maximum; use fewer IDMs, a wider band, or the diagonal form"
    )]
    NoMinimum,
    /// The model does not describe the data.
    #[error(
        "the model does not fit: χ² is {chi_square:.0} per degree of freedom from every start, so no K and C can be quoted; A or B changed \
         between the configurations, a point is misplaced, or the stated noise or errors of geometry are too small"
    )]
    Misfit {
        /// χ² per degree of freedom of the best start.
        chi_square: f64,
    },
}

/// A fitted joint over one band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fitted {
    /// The band, Hz.
    pub band_hz: Band,
    /// Lines used.
    pub lines: usize,
    /// The interface deformation modes.
    pub idms: usize,
    /// Assumed errors of positions and angles.
    pub priors: Priors,
    /// Assumed difference of A and B alone from the assembly, as a fraction.
    pub mounting: f64,
    /// The entries that were free.
    pub shape: FreeEntries,
    /// The diagonal by degree of freedom.
    pub joint: BTreeMap<Dof, FittedDof>,
    /// Stiffness between two degrees of freedom and its standard deviation, of the full form: N/m,
    /// N/rad or N m/rad.
    pub coupling_si: BTreeMap<String, [f64; 2]>,
    /// χ² of the residuals per degree of freedom: about 1 if model, noise and priors describe the
    /// data. The noise of neighbouring bands is slightly correlated, which lowers it to about 0.8
    /// with a strong exponential window.
    pub chi_square_per_dof: f64,
    /// The largest estimated error of geometry, in standard deviations of its prior.
    pub largest_error: f64,
    /// Whether the search converged.
    pub converged: bool,
}

/// Internal channels and impacts that are used.
#[derive(Debug, Default)]
struct Internals {
    outputs: Vec<String>,
    inputs: Vec<String>,
}

/// Fits K + sC to `ajb` over `band`, given A and B (all three with the same lines, quantity and
/// window).
///
/// # Errors
/// [`FitError`]; a joint that the data do not determine is not an error but has `identified:
/// false`.
pub fn fit(
    a: &Frf,
    b: &Frf,
    ajb: &Frf,
    geometry: &Geometry,
    idms: IdmSet,
    band: Band,
    options: &Options,
) -> Result<Fitted, FitError> {
    let problem = problem(a, b, ajb, geometry, idms, band, options)?;
    let chart = solver::chart(&problem);
    let mut best: Option<solver::SearchResult> = None;
    for candidate in solver::candidates(&problem, &chart, idms) {
        let found = match solver::search(&problem, &chart, &candidate) {
            Ok(found) => found,
            // another start may succeed
            Err(FitError::NoMinimum | FitError::NoiseSingular | FitError::Singular { .. }) => continue,
            Err(error) => return Err(error),
        };
        let better = best.as_ref().is_none_or(|best| found.chi_square < best.chi_square);
        if better {
            best = Some(found);
        }
        if best.as_ref().is_some_and(|best| best.chi_square < ENOUGH) {
            break;
        }
    }
    let diagonal = best.ok_or(FitError::NoMinimum)?;
    let (chart, found) = match options.shape {
        FreeEntries::Diagonal => (chart, diagonal),
        FreeEntries::Full => {
            let (chart, start) = chart.full(&diagonal.p);
            let found = solver::search(&problem, &chart, &start)?;
            (chart, found)
        }
    };
    if found.chi_square.is_nan() || found.chi_square > HOPELESS {
        return Err(FitError::Misfit { chi_square: found.chi_square });
    }
    Ok(outcome::fitted(&chart, &found, idms, band, problem.s.len(), options))
}

fn problem(
    a: &Frf,
    b: &Frf,
    ajb: &Frf,
    geometry: &Geometry,
    idms: IdmSet,
    band: Band,
    options: &Options,
) -> Result<Problem, FitError> {
    let files = [
        Measured { file: Structure::A, frf: a, points: &geometry.a },
        Measured { file: Structure::B, frf: b, points: &geometry.b },
        Measured { file: Structure::Ajb, frf: ajb, points: &geometry.ajb },
    ];
    let lines = files.each_ref().map(|file| ReceptanceBlock::lines(file, band));
    for (file, own) in files.iter().zip(&lines) {
        let alike = own.len() == lines[2].len()
            && own
                .iter()
                .zip(&lines[2])
                .all(|(l, m)| (file.frf.s(*l) - ajb.s(*m)).norm() <= 1e-6 * ajb.s(*m).norm());
        if own.is_empty() || !alike {
            return Err(FitError::EmptyBand { file: file.file, low_hz: band.low_hz, high_hz: band.high_hz });
        }
    }
    let internals = [Side::A, Side::B].map(|side| internals(side, &files, options.points));
    let both = Internals {
        outputs: internals.iter().flat_map(|i| i.outputs.clone()).collect(),
        inputs: internals.iter().flat_map(|i| i.inputs.clone()).collect(),
    };
    // A and B alone need complete virtual points
    files[0].virtual_point(Grouping::InterfaceA, geometry, idms)?;
    files[1].virtual_point(Grouping::InterfaceB, geometry, idms)?;
    let of = |file: usize, sides: &[Side], internals: &Internals| {
        ReceptanceBlock::of(&files[file], geometry, idms, band, sides, internals)
    };
    let parts = [of(0, &[Side::A], &internals[0])?, of(1, &[Side::B], &internals[1])?];
    let assembly = of(2, &[Side::A, Side::B], &both)?;
    let s: Vec<_> = lines[2].iter().map(|&l| ajb.s(l)).collect();
    let layout = Layout {
        n: idms.count(),
        rows: parts.each_ref().map(|p| p.rows.clone()),
        columns: parts.each_ref().map(|p| p.columns.clone()),
    };
    let nuisances = Nuisances::of(&[&parts[0], &parts[1], &assembly], &options.priors);
    let step_hz = if s.len() < 2 {
        f64::INFINITY
    } else {
        (s[s.len() - 1].im - s[0].im) / std::f64::consts::TAU / (s.len() - 1) as f64
    };
    let shared = shared_by_lines(ajb.sigma_per_s(), step_hz);
    let problem = Problem::new(parts, assembly, layout, s, nuisances, shared);
    if problem.rows.is_empty() {
        return Err(FitError::NothingMeasured { kind: "responses" });
    }
    if problem.columns.is_empty() {
        return Err(FitError::NothingMeasured { kind: "impacts" });
    }
    Ok(problem)
}

/// The internal points of a side that the assembly and the substructure both have, if they are
/// used.
fn internals(side: Side, files: &[Measured<'_>; 3], points: Points) -> Internals {
    let (interface, internal) = side.groupings();
    let (own, ajb) = (&files[usize::from(side == Side::B)], &files[2]);
    let wanted = |lacking: bool| points == Points::All || lacking;
    let shared = |own: Vec<String>, ajb: Vec<String>| -> Vec<String> {
        ajb.into_iter().filter(|name| own.contains(name)).collect()
    };
    let mut found = Internals::default();
    if wanted(ajb.outputs(&[interface]).at.is_empty()) {
        found.outputs = shared(own.outputs(&[internal]).names, ajb.outputs(&[internal]).names);
    }
    if wanted(ajb.inputs(&[interface]).at.is_empty()) {
        found.inputs = shared(own.inputs(&[internal]).names, ajb.inputs(&[internal]).names);
    }
    found
}

#[cfg(test)]
mod naive;
#[cfg(test)]
mod tests;
