//! The unknowns of the fit: the contact, the form that gives its force, and all rig quantities that
//! are not known exactly, each with its prior; positions, angles, gains and delays have prior
//! standard deviations.

use super::elastic;
use super::known_mass::KnownMass;
use crate::substructuring::averaged::Priors as Positions;
use serde::Serialize;

/// 1/k_T, m/N.
pub const COMPLIANCE: usize = 0;
/// c_T/k_T, s.
pub const RETARDATION: usize = 1;
/// Index of the first coefficient of the force's form.
pub const FORM: usize = 2;
/// Number of its coefficients: 1 and s of T, then 1, s and s² of z_B, θ_x and θ_y.
pub const FORM_TERMS: usize = 11;
/// Index of specimen B's inertia as it moves relative to its arm: its mass (kg), then mass times y
/// and mass times x of its centre of gravity relative to the contact (kg m).
pub const INERTIA_B: usize = FORM + FORM_TERMS;
/// Number of its parameters.
pub const INERTIA_TERMS: usize = 3;
/// Index of the elastic shapes of specimens A and B (`elastic`).
pub const ELASTIC: usize = INERTIA_B + INERTIA_TERMS;
/// If specimen B has no points: displacement of its surface at the contact per newton relative to
/// arm B as measured by its points (m/N), then the ratio of its rotation about x to that
/// displacement (1/m).
pub const TIP_B: usize = ELASTIC + 2 * elastic::TERMS;
/// Logarithms of the contact's stiffnesses along x and y, N/m.
pub const LATERAL: usize = TIP_B + 2;
/// x and y of the contact's centre, at which its force acts, relative to the stated contact, m.
pub const CENTRE: usize = LATERAL + 2;
/// x and y of spot A, then of spot B, m.
pub const SPOTS: usize = CENTRE + 2;
/// Names of the parameters of the elastic shapes.
const ELASTIC_NAMES: [&str; 2 * elastic::TERMS] = [
    "the shear of specimen A",
    "the bending of specimen A along z",
    "the bending of specimen A along x",
    "the distance of specimen A's clamp",
    "the shear of specimen B relative to A's",
    "the bending of specimen B along z relative to A's",
    "the bending of specimen B along x relative to A's",
    "the distance of specimen B's clamp relative to A's",
];
/// Relative errors of gain: spot A, spot B, and the point's x, y, z.
pub const GAINS: usize = SPOTS + 4;
/// Errors of delay of the same channels, s.
pub const DELAYS: usize = GAINS + 5;
/// Relative error of gain of the hammer's force cell. All signals are per newton that the hammer
/// shows, so the fit's compliance is that of the contact times one minus this error.
pub const HAMMER: usize = DELAYS + 5;
/// Relative error of the known mass that was struck: of its weight, and of hits beside its centre
/// of gravity.
pub const KNOWN_MASS: usize = HAMMER + 1;
/// Index of the first coordinate of the points.
const POINTS: usize = KNOWN_MASS + 1;

/// The sensors with a gain and a delay, in order.
const SENSORS: [&str; 5] = [
    "the vibrometer on A's spot",
    "the vibrometer on B's spot",
    "the 3-D vibrometer along x",
    "the 3-D vibrometer along y",
    "the 3-D vibrometer along z",
];
/// Name of the hammer's gain, which hits on a known mass show relative to those of the vibrometers.
pub const HAMMER_GAIN: &str = "the gain of the hammer's force cell";
/// Name of the known mass's error.
pub const MASS_ERROR: &str = "the known mass";
/// Smallest prior standard deviation of the load cells' gain, relative. The load cells are springs,
/// so that T is itself a form of z_B, θ_x and θ_y, and the coefficients of these can absorb most of
/// an error of its gain and delay. Then only the priors determine gain and delay. This minimum
/// keeps every combination of them determined when they are stated as exact.
const LOAD_CELL_GAIN: f64 = 1e-3;
/// The same for the delay of the force relative to T, s: load cells and their mounts have losses,
/// c = βk with β of some 10 µs, so that the force leads their elastic force T by β.
const LOAD_CELL_SKEW_S: f64 = 2e-5;
/// Standard deviation of specimen B's mass, kg: that of steel, 20 × 20 × 60 mm. Where the specimen
/// moves with its arm, the data do not determine its mass and the fit finds one in the noise of
/// their difference, up to this many kilograms.
const SPECIMEN_KG: f64 = 0.2;
/// Upper bound of the distance of its centre of gravity from the contact, m.
const SPECIMEN_M: f64 = 0.03;
/// Upper bound of the compliance between arm B and specimen B's surface, m/N: a clamp of 30 N/µm.
const TIP_M_PER_N: f64 = 3e-8;
/// Change of the displacement of specimen B's material with the height over that of its surface,
/// 1/m, and the standard deviation: 1.5/L for a bent cantilever of the length L, 1/L for shear or
/// if it turns in its clamp, 0 if the clamp or arm B gives along z.
const TURN_PER_M: [f64; 2] = [110.0, 50.0];

/// Stiffnesses of a contact across the sliding direction and normal to it, N/m, and the standard
/// deviation of their logarithms: only the specimens' deformation shows them.
const LATERAL_N_PER_M: [f64; 2] = [1.5e8, 2.2e8];
const LATERAL_SPREAD: f64 = 0.6;

/// One parameter: start value, prior width, and the cause under which its share of the uncertainty
/// is listed.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name for messages.
    pub name: String,
    /// Prior mean, in the parameter's unit.
    pub start: f64,
    /// Prior standard deviation; infinite if nothing is known.
    pub sigma: f64,
    /// The cause in the budget.
    pub cause: Cause,
    /// Whether the prior is stated, so that a value far from it is a contradiction; otherwise it is
    /// a guess.
    pub stated: bool,
    /// Whether the stated value is per newton of force, while the parameter is per newton that the
    /// hammer shows.
    pub per_newton: bool,
    /// For the z component of a hit: that of the nominal direction, and the standard deviation of
    /// the hammer's tilt, rad.
    pub tilted: Option<[f64; 2]>,
}

impl Parameter {
    /// A parameter with a Gaussian prior.
    pub fn new(name: String, start: f64, sigma: f64, cause: Cause) -> Self {
        Parameter { name, start, sigma, cause, stated: true, per_newton: false, tilted: None }
    }

    /// The stated value with the hammer's gain of the parameters `p`.
    pub fn expected(&self, p: &[f64]) -> f64 {
        if self.per_newton { self.start * (1.0 + p[HAMMER]) } else { self.start }
    }

    /// Distance of `value`, one of the parameters `p`, from its stated value, in standard
    /// deviations. For the hammer's tilt it is computed from the angle: the z component of a hit
    /// along z falls with the square of the tilt, which has a long tail.
    pub fn deviations(&self, value: f64, p: &[f64]) -> f64 {
        match self.tilted {
            Some([z, tilt_rad]) if value.abs() <= 1.0 => (value.acos() - z.acos()).abs() / tilt_rad,
            _ => ((value - self.expected(p)) / self.sigma).abs(),
        }
    }
}

/// A sensor compared with the hammer on the known mass.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Index of the sensor's gain.
    gain: usize,
    /// Logarithm of the measured ratio: of (1 + the sensor's gain) / (1 + the hammer's gain), less
    /// the mass's error.
    value: f64,
    /// Standard deviation of its noise.
    sigma: f64,
}

impl Compared {
    /// The ratio at these parameters minus the measured one, in standard deviations, and its
    /// derivatives.
    pub fn deviation(&self, p: &[f64]) -> (f64, [(usize, f64); 3]) {
        let [sensor, hammer] = [1.0 + p[self.gain], 1.0 + p[HAMMER]];
        let value = (sensor / hammer).ln() - p[KNOWN_MASS];
        let by = [(self.gain, sensor.recip()), (HAMMER, -hammer.recip()), (KNOWN_MASS, -1.0)];
        ((value - self.value) / self.sigma, by.map(|(at, slope)| (at, slope / self.sigma)))
    }
}

/// All parameters, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    own: Vec<Parameter>,
    compared: Vec<Compared>,
}

impl Parameters {
    /// The parameters that every fit has. `spots_m` are the positions of the spots relative to the
    /// contact, `specimens` the priors of the specimens' shapes ([`elastic::priors`]).
    pub fn new(
        priors: &ContactPriors,
        compliance_m_per_n: f64,
        spots_m: [[f64; 3]; 2],
        specimens: [elastic::Prior; 2 * elastic::TERMS],
    ) -> Self {
        let named = |name: &str, start, sigma, cause| Parameter::new(name.to_owned(), start, sigma, cause);
        let free = |name: &str, start| named(name, start, f64::INFINITY, Cause::Noise);
        let mut all = vec![free("1/k_T", compliance_m_per_n), free("c_T/k_T", 0.0)];
        all.push(named("the load cells' gain", 1.0, priors.gain.max(LOAD_CELL_GAIN), Cause::Gains));
        all.push(named("the load cells' delay", 0.0, priors.skew_s.hypot(LOAD_CELL_SKEW_S), Cause::Skew));
        all.extend((2..FORM_TERMS).map(|_| free("the force's form", 0.0)));
        for lever in [1.0, SPECIMEN_M, SPECIMEN_M] {
            all.push(named("specimen B's inertia", 0.0, SPECIMEN_KG * lever, Cause::Noise));
        }
        for (what, own) in ELASTIC_NAMES.iter().zip(specimens) {
            let known = named(what, own.start, own.sigma, Cause::Bending);
            all.push(Parameter { stated: own.stated, ..known });
        }
        let guess = |name: &str, start, sigma| Parameter {
            stated: false,
            ..named(name, start, sigma, Cause::Bending)
        };
        all.push(guess("the compliance of specimen B and its clamp", 0.0, TIP_M_PER_N));
        let [turn, sigma] = TURN_PER_M;
        all.push(guess("the rotation of specimen B's surface", turn, sigma));
        for (axis, stiffness) in ["x", "y"].into_iter().zip(LATERAL_N_PER_M) {
            all.push(guess(&format!("the contact's stiffness along {axis}"), stiffness.ln(), LATERAL_SPREAD));
        }
        for (axis, sigma) in [("x", priors.contact_across_m), ("y", priors.contact_height_m)] {
            all.push(named(&format!("{axis} of the contact's centre"), 0.0, sigma, Cause::Centre));
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
        all.push(named(HAMMER_GAIN, 0.0, priors.hammer_gain, Cause::Gains));
        all.push(named(MASS_ERROR, 0.0, 0.0, Cause::Gains));
        debug_assert_eq!(all.len(), POINTS);
        Parameters { own: all, compared: Vec::new() }
    }

    /// Adds what the hits on a known mass show. The load cells' gain then counts per newton of force
    /// instead of per newton that the hammer shows: a hammer that is off must not seem to be load
    /// cells that are. Without a known mass it stays relative to the hammer, so that the load cells
    /// alone never change the scale of k_T.
    pub fn compare_on(&mut self, mass: &KnownMass) {
        self.own[KNOWN_MASS].sigma = mass.sigma;
        self.own[FORM].per_newton = true;
        let point = GAINS + 2 + mass.axis;
        let sensors = [(GAINS, mass.spots[0]), (GAINS + 1, mass.spots[1]), (point, mass.point)];
        let compared = |(gain, ratio): (usize, Option<[f64; 2]>)| {
            let [ratio, sigma] = ratio?;
            Some(Compared { gain, value: ratio.ln(), sigma: sigma / ratio })
        };
        self.compared = sensors.into_iter().filter_map(compared).collect();
    }

    /// The sensors that are compared with the hammer on a known mass.
    pub fn compared(&self) -> &[Compared] {
        &self.compared
    }

    /// Appends parameters; returns the index of the first.
    pub fn add(&mut self, own: impl IntoIterator<Item = Parameter>) -> usize {
        let at = self.own.len();
        self.own.extend(own);
        at
    }

    /// Makes a parameter exactly known.
    pub fn hold(&mut self, at: usize, value: f64) {
        self.own[at].start = value;
        self.own[at].sigma = 0.0;
    }

    /// Sets the prior standard deviation of a parameter.
    pub fn narrow(&mut self, at: usize, sigma: f64) {
        self.own[at].sigma = sigma;
    }

    /// The parameters.
    pub fn all(&self) -> &[Parameter] {
        &self.own
    }

    /// The parameters, to change their priors.
    pub fn all_mut(&mut self) -> &mut [Parameter] {
        &mut self.own
    }

    /// Their prior means.
    pub fn start(&self) -> Vec<f64> {
        self.own.iter().map(|p| p.start).collect()
    }
}

/// z component of the force of a hit on B alone, per newton of the hammer: the direction's z with
/// the prior of the tilt. A tilt σ about each of two axes changes the z component of a hit along z
/// by σ² on average, and of one across z by σ.
pub fn along_z(impact: &str, direction: [f64; 3], tilt_rad: f64) -> Parameter {
    let z = direction[2];
    let across = (1.0 - z * z).max(0.0).sqrt();
    let second = tilt_rad * tilt_rad * z.abs();
    Parameter {
        name: format!("the hammer's tilt in {impact} on B alone"),
        start: z * (1.0 - tilt_rad * tilt_rad),
        sigma: (tilt_rad * across).hypot(second),
        cause: Cause::HammerTilt,
        stated: true,
        per_newton: false,
        tilted: Some([z, tilt_rad]),
    }
}

/// Standard deviations of quantities that are not known exactly. They belong to the experiment, and
/// k_T's interval depends on them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactPriors {
    /// Sensors and hits on the arms: position, aim and the hammer's tilt.
    #[serde(flatten)]
    pub positions: Positions,
    /// Position of a vibrometer spot relative to the contact, m along each axis.
    pub spot_m: f64,
    /// Centre of the contact across the sliding direction, m along x: the load is not spread
    /// evenly over the faces.
    pub contact_across_m: f64,
    /// Height of the faces, m along y.
    pub contact_height_m: f64,
    /// Position of a point of the 3-D vibrometer on a specimen, m along each axis.
    pub specimen_point_m: f64,
    /// Gain of each vibrometer and axis, relative.
    pub gain: f64,
    /// Gain of the hammer's force cell, relative: k_T is proportional to it.
    pub hammer_gain: f64,
    /// Delay of each vibrometer and axis relative to the hammer, beyond what the device reports, s.
    pub skew_s: f64,
    /// Sensitivity of each axis of a fixed sensor to motion along each of the two directions across
    /// it, relative: the tilt of its mounting (rad) and its own transverse sensitivity.
    pub transverse: f64,
}

impl Default for ContactPriors {
    /// Spots placed to 0.05 mm, the contact's centre to 1 mm across and 0.05 mm in height, points
    /// on specimens to 0.3 mm, gains calibrated to 0.5 %, delays known to 2 µs, axes of fixed
    /// sensors to 0.02 (about one degree).
    fn default() -> Self {
        ContactPriors {
            positions: Positions::default(),
            spot_m: 5e-5,
            contact_across_m: 1e-3,
            contact_height_m: 5e-5,
            specimen_point_m: 3e-4,
            gain: 5e-3,
            hammer_gain: 5e-3,
            skew_s: 2e-6,
            transverse: 0.02,
        }
    }
}

/// Source of an estimate's uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// Noise of the signals.
    Noise,
    /// Positions of the spots next to the contact.
    Spots,
    /// The contact's centre.
    Centre,
    /// Positions of the points on the specimens.
    SpecimenPoints,
    /// Positions of the points on arm B.
    ArmPoints,
    /// Aim of hammer and vibrometer in each cell.
    Aim,
    /// The tilt of the hammer in the hits on B alone.
    HammerTilt,
    /// Gains of vibrometers, load cells and hammer.
    Gains,
    /// Delays between the channels.
    Skew,
    /// The directions of the fixed sensors' axes.
    SensorAxes,
    /// Bending and shear of the specimens between the sensors and the contact.
    Bending,
    /// The contact changed while it was hit.
    Drift,
    /// Part of the force passes beside the contact.
    SecondPath,
    /// The model does not describe the signals down to their noise.
    Misfit,
}

impl Cause {
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Noise => "noise",
            Cause::Spots => "spots",
            Cause::Centre => "centre",
            Cause::SpecimenPoints => "specimen-points",
            Cause::ArmPoints => "arm-points",
            Cause::Aim => "aim",
            Cause::HammerTilt => "hammer-tilt",
            Cause::Gains => "gains",
            Cause::Skew => "skew",
            Cause::SensorAxes => "sensor-axes",
            Cause::Bending => "bending",
            Cause::Drift => "drift",
            Cause::SecondPath => "second-path",
            Cause::Misfit => "misfit",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_deviation() {
        let mass = KnownMass { sigma: 0.002, spots: [None, Some([0.98, 0.001])], point: None, axis: 2 };
        let mut parameters = Parameters::new(
            &ContactPriors::default(),
            1e-8,
            [[0.0; 3]; 2],
            elastic::priors([None, None], 0.01),
        );
        parameters.compare_on(&mass);
        let [compared] = parameters.compared() else { panic!("one sensor") };
        let mut p = vec![0.0; KNOWN_MASS + 1];
        (p[GAINS + 1], p[HAMMER], p[KNOWN_MASS]) = (0.03, -0.02, 0.001);
        let (deviation, by) = compared.deviation(&p);
        assert!((deviation - ((1.03_f64 / 0.98 / 0.98).ln() - 0.001) / (0.001 / 0.98)).abs() < 1e-9);
        for (at, slope) in by {
            let mut moved = p.clone();
            moved[at] += 1e-6;
            let difference = (compared.deviation(&moved).0 - deviation) / 1e-6;
            // the second derivative is about 1/σ
            assert!((difference / slope - 1.0).abs() < 1e-5, "{at}: {difference} {slope}");
        }
    }
}
