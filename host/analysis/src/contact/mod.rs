//! The contact's own tangential stiffness k_T, from hits: what lies between the specimens, whatever their clamps do.
//!
//! T/Δx, read at spots beside the contact, is no k_T: the load cells' sum lacks arm B's inertia and what stands beside the cells, and a
//! specimen that turns in its clamp moves its spot. Both are measured here instead of assumed:
//!
//! 1. **Force.** In hits on B alone the force on B is the hammer's. Its part along z is a form of T and of arm B's motion at the contact
//!    (z_B, θ_x, θ_y), with terms in 1, s and s²; whatever mass, rod or load-cell gain there is, the form holds it. In the assembly the same
//!    form gives the contact's force.
//! 2. **Rotation.** Points on specimen A show how it moves as a rigid body; arm B's points show B.
//! 3. **One fit.** z_A − z_B = F/(k_T + s c_T) at the contact, for all lines, impacts and cells together. The motion of the bodies is
//!    eliminated at every line (`line`), so that noise in what the force is formed from does not pull k_T down. Spots, points, gains, delays, the
//!    hammer's tilt and each cell's aim are unknowns with priors ([`ContactPriors`]); the local resonances of the specimen calibrate them.
//!
//! The way through the room: `cell` what is measured, `block` the cells of an impact, `parameters` the unknowns, `form_scale` how large the form's may be, `model` the signals as
//! a linear map of the motion, `line` its elimination, `bins` their sums, `solver` the most likely parameters, `covariance` how well they are known, `unexplained` what the model leaves of a cell beyond
//! its noise, `trusted_band` where the bodies are rigid, `diagnosis` whether the assumptions hold, `outcome` the answer. `budget` where its interval comes from. `levels` reads the shaker's levels by what the hits
//! told, `driven` how bodies turn there, `joint` averages both.

mod bins;
mod block;
mod budget;
mod cell;
mod covariance;
mod diagnosis;
mod driven;
mod form_scale;
mod interval;
mod joint;
mod levels;
#[cfg(test)]
mod levels_tests;
mod line;
mod model;
mod outcome;
mod parameters;
mod priors;
mod reading;
mod solver;
#[cfg(test)]
mod tests;
mod trusted_band;
mod unexplained;

pub use cell::{ContactCell, SIGMA_PER_S};
pub use diagnosis::{Diagnosis, Doubt, Farthest, Left};
pub use interval::Interval;
pub use joint::{Joint, joint};
pub use levels::{LEVEL_LINES, LevelError, LevelStiffness, Shares, SteadyLevel, level_stiffness};
pub use outcome::{OfFrequency, Stiffness};
pub use priors::{Cause, ContactPriors};

use crate::band::Band;
use crate::substructuring::geometry::Grouping;
use block::{Block, blocks};
use budget::{Variances, of_sum};
use covariance::Certainty;
use nalgebra::DVector;
use parameters::Parameters;
use solver::Solution;
use trusted_band::trusted;

/// Where the contact is looked for, Hz: above the drift of hammer and windows, below the first bending modes of the paper's arms and specimens. Where
/// others bend sooner, the band ends there ([`Stiffness::band_hz`]).
pub const BAND: Band = Band { low_hz: 100.0, high_hz: 600.0 };

/// Where the search for the compliance begins: a contact of 150 N/µm, m/N.
const START_M_PER_N: f64 = 1.0 / 150e6;

/// Lines of the hits on the assembly without which nothing is fitted: k_T and c_T are two numbers, and k_T(f) is to be compared with k_T.
const FEWEST_LINES: usize = 8;

/// What the contact is read from.
#[derive(Debug, Clone)]
pub struct Input<'a> {
    /// The cells; those that are of no use here are left out.
    pub cells: Vec<ContactCell<'a>>,
    /// The contact, m: the virtual point.
    pub contact_m: [f64; 3],
    /// Where the vibrometers beside the contact look, on A and on B, m.
    pub spots_m: [[f64; 3]; 2],
    /// What is known beforehand.
    pub priors: ContactPriors,
    /// The lines used.
    pub band_hz: Band,
}

/// Why there is no k_T.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// Nothing at all.
    #[error(
        "no cell shows the contact: hits along z on the assembly are needed, with load cells and both spots"
    )]
    NoCells,
    /// What the force is calibrated with.
    #[error(
        "the force at the contact is not known: hit B alone along z at three points or more, each with three points of arm B's interface (grouping 2)"
    )]
    NoForce,
    /// What the specimen's rotation is told from.
    #[error(
        "the specimen's rotation is not known: its tilt between contact and spot cannot be told from the contact's own compliance. Measure three points \
         or more on specimen A (grouping 5) in the assembly, with three of arm B's interface (grouping 2), from hits along z on A or on the moving mass"
    )]
    NoRotation,
    /// The spots' places.
    #[error(
        "the plan does not say where the vibrometers beside the contact look: give the sensors LDV_A and LDV_B in [geometry]"
    )]
    NoSpots,
    /// One hit tells no noise.
    #[error(
        "every cell of {impact} has a single hit, so that the noise is not known: keep two or more in some"
    )]
    SingleHits {
        /// The impact.
        impact: String,
    },
    /// Spectra that do not belong together.
    #[error("cell {impact} × {point} has other lines or channels than the rest")]
    Unlike {
        /// The impact.
        impact: String,
        /// The point.
        point: String,
    },
    /// The fit found nothing.
    #[error("not identified: {0}")]
    NotIdentified(String),
}

impl ContactError {
    /// The hits on B alone leave the force open.
    fn no_force() -> Self {
        ContactError::NotIdentified("the hits do not tell the force at the contact".into())
    }
}

/// Finds k_T and c_T.
///
/// # Errors
/// [`ContactError`]: cells are missing, or the data do not tell it.
pub fn stiffness(input: &Input<'_>) -> Result<Stiffness, ContactError> {
    read(input).map(|(found, _)| found)
}

/// All parameters as the hits leave them: what a level of the shaker is corrected by.
#[derive(Debug, Clone)]
pub struct Known {
    p: Vec<f64>,
    parameters: Parameters,
    certainty: Certainty,
    /// By how much χ² exceeds what it should be; 1 at least.
    misfit: f64,
    hammer_gain: f64,
}

impl Known {
    /// Variances of Σ row_i p_i by cause.
    fn of_sum(&self, row: &DVector<f64>) -> Variances {
        of_sum(row, &self.parameters, &self.certainty, self.misfit)
    }

    /// Variance of Σ row_i p_i, the misfit counted.
    fn variance(&self, row: &DVector<f64>) -> f64 {
        (&self.certainty.covariance * row).dot(row) * self.misfit
    }
}

/// As [`stiffness`], with everything else that the fit found.
///
/// # Errors
/// As [`stiffness`].
pub fn read(input: &Input<'_>) -> Result<(Stiffness, Known), ContactError> {
    let mut input = input.clone();
    loop {
        let fit = fit(&input)?;
        let band_hz = trusted(&fit.blocks, &fit.solution.bins, input.band_hz);
        if band_hz == input.band_hz {
            return fit.told(&input);
        }
        // what strayed at an end has pulled the rest: the next fit tells more of it
        input.band_hz = band_hz;
    }
}

/// What the hits in a band say.
struct Fit {
    parameters: Parameters,
    blocks: Vec<Block>,
    solution: Solution,
}

impl Fit {
    fn told(self, input: &Input<'_>) -> Result<(Stiffness, Known), ContactError> {
        let Fit { parameters, blocks, solution } = self;
        let found = outcome::of(input, &blocks, &parameters, &solution)?;
        let Solution { p, certainty, chi_square, .. } = solution;
        let (misfit, hammer_gain) = (chi_square.max(1.0), input.priors.hammer_gain);
        Ok((found, Known { p, parameters, certainty, misfit, hammer_gain }))
    }
}

fn fit(input: &Input<'_>) -> Result<Fit, ContactError> {
    let spots = input.spots_m.map(|spot| std::array::from_fn(|axis| spot[axis] - input.contact_m[axis]));
    let mut parameters = Parameters::new(&input.priors, START_M_PER_N, spots);
    let mut blocks = blocks(input, &mut parameters)?;
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
            "only {lines} lines of the hits on the assembly are numbers with a known noise in every cell"
        )));
    }
    form_scale::scale_form(&mut parameters, &blocks);
    let sigma_per_s = input.cells[0].spectra.sigma_per_s();
    let solution = solver::solve(&mut blocks, &parameters, sigma_per_s)?;
    Ok(Fit { parameters, blocks, solution })
}

/// Whether a response point is of any use here.
pub fn serves(grouping: Grouping) -> bool {
    matches!(grouping, Grouping::InterfaceB | Grouping::SpecimenA | Grouping::SpecimenB)
}
