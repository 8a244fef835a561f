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
/// Specimen B's inertia where it moves against its arm: its mass (kg), then the mass times y and times x of its centre of gravity against the
/// contact (kg m).
pub const INERTIA_B: usize = FORM + FORM_TERMS;
/// Its parameters.
pub const INERTIA_TERMS: usize = 3;
/// x and y of spot A, then of spot B, m.
pub const SPOTS: usize = INERTIA_B + INERTIA_TERMS;
/// Relative errors of gain: spot A, spot B, and the point's x, y, z.
pub const GAINS: usize = SPOTS + 4;
/// Errors of delay of the same channels, s.
pub const DELAYS: usize = GAINS + 5;
/// The first of the points' coordinates.
const POINTS: usize = DELAYS + 5;

/// The sensors with a gain and a delay, in order.
const SENSORS: [&str; 5] = [
    "the vibrometer on A's spot",
    "the vibrometer on B's spot",
    "the 3-D vibrometer along x",
    "the 3-D vibrometer along y",
    "the 3-D vibrometer along z",
];
/// The load cells' springs make T a form of z_B, θ_x and θ_y of its own, so that most of what its gain and delay are wrong by may go into
/// theirs. The priors alone hold them then: at this at least, so that no combination of them is left open where they are stated as exact.
const LOAD_CELL_GAIN: f64 = 1e-3;
/// Of its delay, s.
const LOAD_CELL_SKEW_S: f64 = 1e-7;
/// A specimen weighs no more than this, kg.
const SPECIMEN_KG: f64 = 0.5;
/// Its centre of gravity is no further from the contact than this, m.
const SPECIMEN_M: f64 = 0.03;

/// One parameter: where it starts, how far it may go, and what its share of the uncertainty is called.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// What it is, for people.
    pub name: String,
    /// Prior mean, in the parameter's unit.
    pub start: f64,
    /// Prior standard deviation; infinite where nothing is known.
    pub sigma: f64,
    /// What it is called in the budget.
    pub cause: Cause,
    /// Of a part of a hit along z: the direction's own, and how far the hammer may be tilted, rad.
    pub tilted: Option<[f64; 2]>,
}

impl Parameter {
    /// One with a Gaussian prior.
    pub fn new(name: String, start: f64, sigma: f64, cause: Cause) -> Self {
        Parameter { name, start, sigma, cause, tilted: None }
    }

    /// How far `value` is from what is stated, in standard deviations. For the hammer that is the tilt it would take: the part along z of a hit
    /// along z falls with the tilt's square, whose tail is long.
    pub fn deviations(&self, value: f64) -> f64 {
        match self.tilted {
            Some([z, tilt_rad]) if value.abs() <= 1.0 => (value.acos() - z.acos()).abs() / tilt_rad,
            _ => ((value - self.start) / self.sigma).abs(),
        }
    }
}

/// All parameters, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters(Vec<Parameter>);

impl Parameters {
    /// Those that every fit has. The spots are where `spots_m` says, against the contact.
    pub fn new(priors: &ContactPriors, compliance_m_per_n: f64, spots_m: [[f64; 3]; 2]) -> Self {
        let named = |name: &str, start, sigma, cause| Parameter::new(name.to_owned(), start, sigma, cause);
        let free = |name: &str, start| named(name, start, f64::INFINITY, Cause::Noise);
        let mut all = vec![free("1/k_T", compliance_m_per_n), free("c_T/k_T", 0.0)];
        all.push(named("the load cells' gain", 1.0, priors.gain.max(LOAD_CELL_GAIN), Cause::Gains));
        all.push(named("the load cells' delay", 0.0, priors.skew_s.max(LOAD_CELL_SKEW_S), Cause::Skew));
        all.extend((2..FORM_TERMS).map(|_| free("the force's form", 0.0)));
        for lever in [1.0, SPECIMEN_M, SPECIMEN_M] {
            all.push(named("specimen B's inertia", 0.0, SPECIMEN_KG * lever, Cause::Noise));
        }
        for (spot, side) in spots_m.into_iter().zip(["A", "B"]) {
            for (axis, of) in ["x", "y"].into_iter().enumerate() {
                let name = format!("{of} of the spot on {side}");
                all.push(named(&name, spot[axis], priors.spot_m, Cause::Spots));
            }
        }
        for (what, sigma, cause) in
            [("gain", priors.gain, Cause::Gains), ("delay", priors.skew_s, Cause::Skew)]
        {
            all.extend(SENSORS.map(|sensor| named(&format!("{what} of {sensor}"), 0.0, sigma, cause)));
        }
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
pub fn along_z(impact: &str, direction: [f64; 3], tilt_rad: f64) -> Parameter {
    let z = direction[2];
    let across = (1.0 - z * z).max(0.0).sqrt();
    let second = tilt_rad * tilt_rad * z.abs();
    Parameter {
        name: format!("the hammer's tilt in {impact} on B alone"),
        start: z * (1.0 - tilt_rad * tilt_rad),
        sigma: (tilt_rad * across).hypot(second),
        cause: Cause::HammerTilt,
        tilted: Some([z, tilt_rad]),
    }
}
