//! Friction laws: parameters of a contact's law from measured loops, and the loops of a law.
//!
//! Processing order: [`loops`] (a measured loop with its noise) → [`mod@fit`] (one law fitted to
//! all loops of a contact, with covariance) → [`choice`] (which law the loops support, and which
//! they refuse). [`law`] defines the laws and steps a displacement history to a force history.
//! [`coefficient`] reads the three friction coefficients off a loop and says to which ends of the
//! stroke its plateaus rise.
//!
//! All laws are independent of the rate: the force depends on the path of the displacement, not on
//! time. Displacement is in m, force in N, stiffness in N/m, energy in J.

pub mod choice;
pub mod coefficient;
mod curve;
pub mod fit;
pub mod law;
pub mod loops;

pub use choice::{JudgedLaw, LawChoice, LawRefusal, choose};
pub use coefficient::{FrictionCoefficients, LoopEnds, SlidingLoop};
pub use fit::{FittedLaw, FittedLoop, FittedParameter, fit};
pub use law::{FrictionLaw, LawKind, LawParameter, LawState, SliderElement};
pub use loops::{LoopNoise, MeasuredLoop};

/// Why there is no law, or no loop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrictionError {
    /// Displacement and force differ in length, or are too short.
    #[error(
        "the loop has {displacement} displacements and {force} forces: both need the same number, at least {least}"
    )]
    Lengths {
        /// Points of the displacement.
        displacement: usize,
        /// Points of the force.
        force: usize,
        /// Fewest points of a loop.
        least: usize,
    },
    /// A value is NaN or infinite.
    #[error("point {point} of the loop is not a number: leave this loop out, or measure it again")]
    NotFinite {
        /// Index of the first such point.
        point: usize,
    },
    /// Displacement or force is constant.
    #[error("displacement or force of the loop is constant: there is no loop; check the channels")]
    NoMotion,
    /// The stated noise is negative, not finite, or its correlation is not between −1 and 1.
    #[error(
        "the loop's noise is stated as {displacement_m} m, {force_n} N, correlation {correlation}: standard deviations of 0 or more (force: more than 0) and a correlation between −1 and 1 are needed"
    )]
    Noise {
        /// Standard deviation of the displacement, m.
        displacement_m: f64,
        /// Standard deviation of the force, N.
        force_n: f64,
        /// Correlation of the force noise of neighbouring points.
        correlation: f64,
    },
    /// Too few cycles to tell their scatter.
    #[error(
        "{cycles} cycles of the same length are needed to read the noise from their scatter, at least {least}: record longer, or state the noise"
    )]
    Cycles {
        /// Cycles given.
        cycles: usize,
        /// Fewest.
        least: usize,
    },
    /// No loops.
    #[error("no loop is given: a law needs at least one")]
    NoLoops,
    /// A parameter is outside its range.
    #[error("{law}: {parameter} is {value}, which is outside {range}")]
    Parameter {
        /// Name of the law.
        law: &'static str,
        /// Name of the parameter, with its unit.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// Its range, in words.
        range: &'static str,
    },
    /// A law has another number of parameters.
    #[error("{law} has {expected} parameters, but {given} are given")]
    ParameterCount {
        /// Name of the law.
        law: &'static str,
        /// Its number of parameters.
        expected: usize,
        /// Those given.
        given: usize,
    },
    /// No start of the search gave finite residuals.
    #[error(
        "{law} cannot be fitted: its loops are not finite for any start of the search; check the units of displacement (m) and force (N)"
    )]
    NoStart {
        /// Name of the law.
        law: &'static str,
    },
}

#[cfg(test)]
mod law_tests;

#[cfg(test)]
mod recovery_tests;
