//! Limits for reporting a stiffness: within them its value is given, beyond them it is reported as
//! not identified.

/// For the averaged estimate: half width of the compliance's 95 % interval over the compliance.
/// Above it the compliance is too close to zero, relative to its uncertainty, for the stiffness to
/// have a useful upper limit.
pub const COMPLIANCE_HALF_WIDTH: f64 = 0.6;

/// For the fit: half width of the stiffness' 95 % interval over the stiffness.
pub const FITTED_HALF_WIDTH: f64 = 0.6;

/// For a band's mean: standard deviation of the lines' stiffness over their mean.
pub const SCATTER_OF_LINES: f64 = 1.5;
