//! When a stiffness counts as identified: up to here it is given as a number, beyond only said not to be known.

/// Of the averaged estimate: half width of the compliance's 95 % interval over the compliance. Above it the compliance cannot be
/// told from zero well enough, so that the stiffness has no upper limit worth a name.
pub const COMPLIANCE_HALF_WIDTH: f64 = 0.6;

/// Of the fit: half width of the stiffness' 95 % interval over the stiffness.
pub const FITTED_HALF_WIDTH: f64 = 0.6;

/// Of a band's mean: standard deviation of the lines' stiffness over their mean.
pub const SCATTER_OF_LINES: f64 = 1.5;
