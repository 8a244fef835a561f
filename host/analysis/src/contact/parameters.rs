//! What the fit may choose: the contact, the form that gives its force, and everything that nobody at the rig knows, each with its prior.

use super::priors::{Cause, ContactPriors};

/// 1/k_T, m/N.
pub const COMPLIANCE: usize = 0;
/// c_T/k_T, s.
pub const RETARDATION: usize = 1;
/// The first coefficient of the force's form.
pub const FORM: usize = 2;
/// Its coefficients: 1 and s of T, then 1, s and s² of z_B, θ_x and θ_y.
pub const FORM_TERMS: usize = 11;
/// Mass of specimen B where it moves against its arm, kg.
pub const MASS_B: usize = FORM + FORM_TERMS;
/// x and y of spot A, then of spot B, m.
pub const SPOTS: usize = MASS_B + 1;
/// Relative errors of gain: spot A, spot B, and the point's x, y, z.
pub const GAINS: usize = SPOTS + 4;
/// Errors of delay of the same channels, s.
pub const DELAYS: usize = GAINS + 5;
/// The first of the points' coordinates.
const POINTS: usize = DELAYS + 5;

/// The load cells' springs make T a form of z_B, θ_x and θ_y of its own: what its gain is wrong by goes into theirs, and T's own factor
/// and delay are held.
const LOAD_CELL_GAIN: f64 = 1e-3;
/// Of its delay, s.
const LOAD_CELL_SKEW_S: f64 = 1e-7;
/// A specimen weighs no more than this, kg.
const SPECIMEN_KG: f64 = 0.5;

/// One parameter: where it starts, how far it may go, and what its share of the uncertainty is called.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Prior mean, in the parameter's unit.
    pub start: f64,
    /// Prior standard deviation; infinite where nothing is known.
    pub sigma: f64,
    /// What it is called in the budget.
    pub cause: Cause,
}

/// All parameters, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters(Vec<Parameter>);

impl Parameters {
    /// Those that every fit has. The spots are where `spots_m` says, against the contact.
    pub fn new(priors: &ContactPriors, compliance_m_per_n: f64, spots_m: [[f64; 3]; 2]) -> Self {
        let free = |start| Parameter { start, sigma: f64::INFINITY, cause: Cause::Noise };
        let known = |start, sigma, cause| Parameter { start, sigma, cause };
        let mut all = vec![free(compliance_m_per_n), free(0.0)];
        all.push(known(1.0, LOAD_CELL_GAIN, Cause::Gains));
        all.push(known(0.0, LOAD_CELL_SKEW_S, Cause::Skew));
        all.extend([free(0.0); FORM_TERMS - 2]);
        all.push(known(0.0, SPECIMEN_KG, Cause::Noise));
        for spot in spots_m {
            all.extend([spot[0], spot[1]].map(|at| known(at, priors.spot_m, Cause::Spots)));
        }
        all.extend([known(0.0, priors.gain, Cause::Gains); 5]);
        all.extend([known(0.0, priors.skew_s, Cause::Skew); 5]);
        debug_assert_eq!(all.len(), POINTS);
        Parameters(all)
    }

    /// Adds parameters in a row; the place of the first.
    pub fn add(&mut self, own: impl IntoIterator<Item = Parameter>) -> usize {
        let at = self.0.len();
        self.0.extend(own);
        at
    }

    /// States how far a parameter may go.
    pub fn narrow(&mut self, at: usize, sigma: f64) {
        self.0[at].sigma = sigma;
    }

    /// The parameters.
    pub fn all(&self) -> &[Parameter] {
        &self.0
    }

    /// Their prior means.
    pub fn start(&self) -> Vec<f64> {
        self.0.iter().map(|p| p.start).collect()
    }
}

/// Force along z that a hit on B alone gives per newton of the hammer: the direction's z with the tilt's prior. A tilt σ about each
/// of two axes turns a hit along z by σ² in the mean, and one across it by σ.
pub fn along_z(direction: [f64; 3], tilt_rad: f64) -> Parameter {
    let z = direction[2];
    let across = (1.0 - z * z).max(0.0).sqrt();
    let second = tilt_rad * tilt_rad * z.abs();
    Parameter {
        start: z * (1.0 - tilt_rad * tilt_rad),
        sigma: (tilt_rad * across).hypot(second),
        cause: Cause::HammerTilt,
    }
}
