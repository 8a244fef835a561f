//! The contact's own tangential stiffness k_T, from hits: the stiffness between the specimens,
//! independent of their clamps.
//!
//! T/Δx, read at spots next to the contact, is not k_T: the load cells' sum lacks arm B's inertia
//! and the forces parallel to the cells, and a specimen that rotates in its clamp moves its spot.
//! Both are measured here instead of assumed:
//!
//! 1. **Force.** In hits on B alone the force on B is the hammer's. Its z component is a linear
//!    form of T and of arm B's motion at the contact (z_B, θ_x, θ_y), with terms in 1, s and s²,
//!    which covers any mass, rod and load-cell gain. In the assembly the same form gives the
//!    contact's force.
//! 2. **Rotation.** Points on the specimens show their motion, or arm B's points that of B. Each
//!    specimen also bends and shears under the contact's force (`elastic`): k_T is the stiffness
//!    between the two surfaces, and the bulk between them and the sensors is fitted, not counted as
//!    contact. The points are those of a 3-D vibrometer, or fixed sensors (accelerometers) with
//!    known positions and axes; then spots next to the contact are not needed.
//! 3. **One fit.** z_A − z_B = F/(k_T + s c_T) at the contact, for all lines, impacts and cells
//!    together. The motion of the bodies is eliminated at every line (`model`), so that noise in
//!    the signals that the force is formed from does not pull k_T down. Spots, points, gains,
//!    delays, the hammer's tilt and each cell's aim are unknowns with priors ([`ContactPriors`]);
//!    the local resonances of the specimen calibrate them.
//!
//! Modules, in order of use:
//!
//! - `block`: the measured signals of each cell, and the cells of an impact
//! - `parameters`: the unknowns
//! - `known_mass`: the gains of vibrometers and hammer relative to each other
//! - `elastic`: how a specimen bends under the contact's force
//! - `model`: the signals of a line as a linear map of the motion, and its elimination
//! - `solver`: the most likely parameters and their uncertainty, with the residuals of a cell
//!   beyond its noise
//! - `contradictions`: stated quantities that the data contradict
//! - `outcome`: the result and the sources of its uncertainty, tests of the assumptions, and the
//!   band in which the bodies are rigid
//! - `forecast`: k_T's interval after further hits, without another fit
//! - `second_path`: the part of the force that passes beside the contact
//! - `driven`: the rotation of the bodies while the shaker runs
//! - `levels`: k_T of the shaker's levels, given the result of the hits; the average of both

use std::f64::consts::TAU;

mod block;
mod contradictions;
mod driven;
mod elastic;
#[cfg(test)]
mod fixed_tests;
mod forecast;
#[cfg(test)]
mod forecast_tests;
mod held_out;
mod known_mass;
mod levels;
#[cfg(test)]
mod levels_tests;
mod model;
mod outcome;
mod parameters;
mod second_path;
mod solver;
#[cfg(test)]
mod tests;

pub use block::{Axes, ContactCell, PlannedCell, SIGMA_PER_S, determines_motion};
pub use contradictions::Contradiction;
pub use elastic::Bulk;
pub use forecast::{Forecast, ForecastCell, forecast};
pub use held_out::HeldOut;
pub use known_mass::{KnownMass, mass_ratio};
pub use levels::{
    Joint, LEVEL_LINES, LevelError, LevelStiffness, Shares, SteadyLevel, joint, level_stiffness,
};
pub use outcome::{
    Diagnosis, Doubt, FORCE_BALANCE, Farthest, Interval, OfFrequency, SignalResidual, Stiffness,
};
pub use parameters::{Cause, ContactPriors, HAMMER_GAIN, MASS_ERROR};
pub use second_path::{HitsOnA, SecondPath};

use crate::band::Band;
use crate::substructuring::geometry::Grouping;
use block::{Block, Group, POINT, blocks};
use contradictions::Changes;
use nalgebra::DVector;
use outcome::{Variances, of_contact, of_sum, trusted};
use parameters::{ELASTIC, FORM, LATERAL, Parameters, TIP_B};
use solver::Certainty;
use solver::{Solution, Start};

/// The band in which the contact is evaluated, Hz: above the drift of hammer and windows, below the
/// first bending modes of the paper's arms and specimens. If others bend at lower frequencies, the
/// band ends there ([`Stiffness::band_hz`]).
pub const BAND: Band = Band { low_hz: 100.0, high_hz: 600.0 };

/// Start value of the compliance: a contact of 150 N/µm, m/N.
const START_M_PER_N: f64 = 1.0 / 150e6;

/// Fewest lines of the hits on the assembly for a fit: k_T and c_T are two numbers, and k_T(f) is
/// compared with k_T.
const FEWEST_LINES: usize = 8;

/// Input of the estimate.
#[derive(Debug, Clone)]
pub struct Input<'a> {
    /// The cells; those that are not usable here are left out.
    pub cells: Vec<ContactCell<'a>>,
    /// Position of the contact, m: the virtual point.
    pub contact_m: [f64; 3],
    /// Positions of the vibrometer spots next to the contact, on A and on B, m; none if only the
    /// points measure the specimens.
    pub spots_m: Option<[[f64; 3]; 2]>,
    /// What the plan states of the bulk of specimens A and B; `None` if nothing.
    pub specimens: [Option<Bulk>; 2],
    /// Stated stiffness to ground beside the load cells, relative to theirs; `None` if not stated.
    pub parallel_path: Option<f64>,
    /// Prior knowledge.
    pub priors: ContactPriors,
    /// What hits on a free body of known mass show of the gains; `None` without such hits.
    pub known_mass: Option<KnownMass>,
    /// The band of the lines used.
    pub band_hz: Band,
}

impl Input<'_> {
    /// Priors of the specimens' shapes.
    fn elastic_priors(&self) -> [elastic::Prior; 2 * elastic::TERMS] {
        let on_specimen = |cell: &&ContactCell<'_>| {
            matches!(cell.point_grouping, Grouping::SpecimenA | Grouping::SpecimenB)
        };
        let height = |cell: &ContactCell<'_>| (cell.point_m[1] - self.contact_m[1]).abs();
        let heights = self.cells.iter().filter(on_specimen).map(height);
        elastic::priors(self.specimens, heights.fold(0.0, f64::max))
    }

    /// Whether nothing measures specimen B itself: then its bulk and its clamp are part of k_T.
    fn includes_specimen_b(&self) -> bool {
        let on_b = self.cells.iter().any(|cell| cell.point_grouping == Grouping::SpecimenB);
        !on_b && !self.cells.iter().any(ContactCell::has_spots)
    }

    /// Positions of the spots relative to the contact, m.
    fn spots_from_contact(&self) -> Option<[[f64; 3]; 2]> {
        let relative = |spot: [f64; 3]| std::array::from_fn(|axis| spot[axis] - self.contact_m[axis]);
        self.spots_m.map(|spots| spots.map(relative))
    }
}

/// The reason why there is no k_T.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// No usable cell.
    #[error(
        "no cell has the signals of the contact: hits along z on the assembly are needed, with a load cell"
    )]
    NoCells,
    /// The impacts that calibrate the force are missing.
    #[error(
        "the force at the contact is not known: hit B alone along z at three points or more, each with three points of arm B's interface (grouping 2), or with fixed sensors whose axes determine all six motions of arm B"
    )]
    NoForce,
    /// The points that determine the specimen's rotation are missing.
    #[error(
        "the specimen's rotation is not known: its tilt between contact and spot cannot be distinguished from the contact's own compliance. Measure three points \
         or more on specimen A (grouping 5) in the assembly, with three of arm B's interface (grouping 2), from hits along z on A or on the moving mass; \
         or fix sensors to both whose axes determine all six motions of each"
    )]
    NoRotation,
    /// The positions of the spots are missing.
    #[error(
        "the plan does not state where the vibrometers next to the contact point: give the sensors LDV_A and LDV_B in [geometry]"
    )]
    NoSpots,
    /// A single hit does not determine its noise.
    #[error(
        "every cell of {impact} has a single hit, so the noise is not known: keep two or more hits in some of them"
    )]
    SingleHits {
        /// The impact.
        impact: String,
    },
    /// Spectra that do not belong together.
    #[error("the lines or channels of cell {impact} × {point} differ from those of the other cells")]
    Unlike {
        /// The impact.
        impact: String,
        /// The point.
        point: String,
    },
    /// The data do not determine the contact.
    #[error("not identified: {0}")]
    NotIdentified(String),
}

impl ContactError {
    /// The hits on B alone do not determine the force.
    fn no_force() -> Self {
        ContactError::NotIdentified("the force at the contact cannot be determined from the hits".into())
    }
}

/// Finds k_T and c_T.
///
/// # Errors
/// [`ContactError`] if cells are missing or the data do not determine the contact.
pub fn stiffness(input: &Input<'_>) -> Result<Stiffness, ContactError> {
    fitted(input).map(|(found, _)| found)
}

/// All parameters as fitted to the hits, for the correction of the shaker's levels.
#[derive(Debug, Clone)]
pub struct Known {
    p: Vec<f64>,
    parameters: Parameters,
    certainty: Certainty,
    /// Ratio of χ² to its expected value, at least 1.
    misfit: f64,
}

impl Known {
    /// The contact's compliance, m/N, and its derivatives by the parameters.
    fn of_contact(&self) -> (f64, DVector<f64>) {
        of_contact(&self.p)
    }

    /// Variances of Σ row_i p_i by cause.
    fn of_sum(&self, row: &DVector<f64>) -> Variances {
        of_sum(row, &self.parameters, &self.certainty, self.misfit)
    }

    /// The share of the stated error of parameter `at` in the variance of Σ row_i p_i.
    fn share(&self, at: usize, row: &DVector<f64>) -> f64 {
        let sigma = self.parameters.all()[at].sigma;
        let answer = (&self.certainty.answer * row)[at];
        if sigma > 0.0 { (answer / sigma).powi(2) } else { 0.0 }
    }

    /// Variance of Σ row_i p_i, including misfit.
    fn variance(&self, row: &DVector<f64>) -> f64 {
        (&self.certainty.covariance * row).dot(row) * self.misfit
    }
}

/// As [`stiffness`], with all other results of the fit and the cells that it predicts.
///
/// # Errors
/// As [`stiffness`].
pub fn read(input: &Input<'_>) -> Result<(Stiffness, Known), ContactError> {
    let (mut found, fit) = fitted(input)?;
    found.held_out = held_out::held_out(&fit);
    let Fit { parameters, solution, .. } = fit;
    let Solution { p, certainty, chi_square, .. } = solution;
    Ok((found, Known { p, parameters, certainty, misfit: chi_square.max(1.0) }))
}

/// The result, with the fit that it comes from.
fn fitted(input: &Input<'_>) -> Result<(Stiffness, Fit), ContactError> {
    let mut input = input.clone();
    loop {
        let prepared = Prepared::new(&input)?;
        let exchanged = Changes::of_exchanged(&prepared.blocks, prepared.parameters.all());
        let (fit, changes) = contradictions::resolved(&exchanged, |changes| prepared.fit(changes))?;
        let band_hz = trusted(&fit.blocks, &fit.solution.bins, input.band_hz);
        if band_hz == input.band_hz {
            // with wide priors the data may not determine the contact: then it is the fit with the
            // stated priors that is doubted
            return fit.told(&input, &changes).or_else(|error| {
                if changes == exchanged {
                    return Err(error);
                }
                prepared.fit(&exchanged)?.told(&input, &exchanged)
            });
        }
        // lines at the ends that contradict the model biased this fit: the next fit judges again
        input.band_hz = band_hz;
    }
}

/// The fit of the hits in a band.
struct Fit {
    parameters: Parameters,
    blocks: Vec<Block>,
    solution: Solution,
    /// Stiffness of the load cells together, about; `None` if no signal shows it.
    load_cells_n_per_m: Option<f64>,
}

impl Fit {
    fn told(self, input: &Input<'_>, changes: &Changes) -> Result<(Stiffness, Fit), ContactError> {
        Ok((outcome::of(input, &self, changes)?, self))
    }
}

/// The parameters with their stated priors, and the measured signals.
struct Prepared {
    parameters: Parameters,
    blocks: Vec<Block>,
    /// Damping of the window, 1/s.
    sigma_per_s: f64,
    /// As for [`Fit`].
    load_cells_n_per_m: Option<f64>,
}

impl Prepared {
    fn new(input: &Input<'_>) -> Result<Self, ContactError> {
        let spots = input.spots_from_contact();
        if spots.is_none() && input.cells.iter().any(ContactCell::has_spots) {
            return Err(ContactError::NoSpots);
        }
        // without spots no signal depends on their positions
        let mut parameters =
            Parameters::new(&input.priors, START_M_PER_N, spots.unwrap_or_default(), input.elastic_priors());
        if let Some(mass) = &input.known_mass {
            parameters.compare_on(mass);
        }
        let blocks = blocks(input, &mut parameters)?;
        if blocks.iter().filter(|block| block.along_z.is_some()).count() < 3 {
            return Err(ContactError::NoForce);
        }
        if !blocks.iter().any(|block| block.along_z.is_none()) {
            return Err(ContactError::NoRotation);
        }
        let lines: usize =
            blocks.iter().filter(|block| block.along_z.is_none()).map(|block| block.lines.len()).sum();
        if lines < FEWEST_LINES {
            return Err(ContactError::NotIdentified(format!(
                "only {lines} lines of the hits on the assembly have valid values and a known noise in every cell"
            )));
        }
        let load_cells_n_per_m = scale_form(&mut parameters, &blocks);
        if input.includes_specimen_b() {
            // no signal separates it from the contact
            parameters.narrow(TIP_B, 0.0);
        }
        let sigma_per_s = input.cells[0].spectra.sigma_per_s();
        Ok(Prepared { parameters, blocks, sigma_per_s, load_cells_n_per_m })
    }

    /// The fit with these changes of the priors.
    fn fit(&self, changes: &Changes) -> Result<Fit, ContactError> {
        let mut parameters = self.parameters.clone();
        changes.apply(parameters.all_mut());
        let starts = starts(&parameters);
        let (blocks, solution) = solver::solve(&self.blocks, &parameters, &starts, self.sigma_per_s)?;
        Ok(Fit { parameters, blocks, solution, load_cells_n_per_m: self.load_cells_n_per_m })
    }
}

/// Where the search begins. A point's height and the specimen's shear change the signals nearly
/// alike, so that specimens that bend and rigid ones are two minima.
fn starts(parameters: &Parameters) -> Vec<Start> {
    let known = |at: usize| (at, parameters.all()[at].start);
    let rigid = Start { held: vec![(ELASTIC, 0.0)], released: true };
    // specimens that hardly bend do not determine the contact's stiffnesses along x and y, and the
    // search may not settle with them
    let lateral = Start { held: vec![known(LATERAL), known(LATERAL + 1)], released: false };
    let stated = parameters.all()[ELASTIC].stated;
    [Start::default(), lateral].into_iter().chain((!stated).then_some(rigid)).collect()
}

/// Expected stiffness parallel to the load cells, relative to theirs, K = |T/z_B|.
const BESIDE: f64 = 0.5;

/// Damping over K, s.
const DAMPING_S: f64 = 3e-5;

/// Arm B's mass resonates on K above this frequency, Hz.
const LOWEST_HZ: f64 = 250.0;

/// Sets the priors of the form: for z_B these values, for rotations the same times the lever arm of
/// arm B's points. They keep the form from fitting noise where the hits hardly determine it.
/// Returns the load cells' stiffness K, N/m; `None` if no signal shows it.
fn scale_form(parameters: &mut Parameters, blocks: &[Block]) -> Option<f64> {
    let mut stiffness: Vec<f64> = Vec::new();
    let mut lever_m: f64 = 0.0;
    let start = |at: usize| parameters.all()[at].start;
    for block in blocks.iter().filter(|b| b.along_z.is_some_and(|at| start(at).abs() > 0.5)) {
        let place = |channel| block.rows.iter().position(|row| row.cell == 0 && row.channel == channel);
        // z of arm B: the spot, or an axis of a point along z
        let along_z = block.rows.iter().position(|row| {
            let cell = &block.cells[row.cell];
            let axis = row.channel.checked_sub(POINT).map(|axis| &cell.axes[axis]);
            cell.group == Group::ArmB && axis.is_some_and(|axis| axis.direction[2].abs() > 0.9)
        });
        if let (Some(t), Some(z)) = (place(0), place(1).or(along_z)) {
            stiffness.extend(block.lines.iter().map(|line| (line.value[t] / line.value[z]).norm()));
        }
        for cell in block.cells.iter().filter(|cell| cell.group == Group::ArmB) {
            lever_m = lever_m.max(start(cell.point).hypot(start(cell.point + 1)));
        }
    }
    stiffness.sort_by(f64::total_cmp);
    let k = stiffness.get(stiffness.len() / 2).copied()?;
    let mass = k / (TAU * LOWEST_HZ).powi(2);
    for (term, sigma) in [BESIDE * k, DAMPING_S * k, mass].into_iter().enumerate() {
        for (of, lever) in [1.0, lever_m, lever_m].into_iter().enumerate() {
            parameters.narrow(FORM + 2 + 3 * of + term, sigma * lever);
        }
    }
    Some(k)
}

/// Whether a response point is used here.
pub fn serves(grouping: Grouping) -> bool {
    matches!(grouping, Grouping::InterfaceB | Grouping::SpecimenA | Grouping::SpecimenB)
}
