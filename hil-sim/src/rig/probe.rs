//! A direction at a point of a body, for measurement or excitation: nominal, and the true one of
//! hammer and vibrometer with unknown errors.
//!
//! The error of a point belongs to its name and is constant during a campaign: its position, and
//! for an impact also the tilt at which the hammer's holder meets the surface. Each cell adds an
//! aiming error, except for points on a specimen: their marks are small, and the laser finds them
//! again with its own camera. All errors are keyed to (seed, purpose), so the order in which cells
//! are visited does not matter.
//!
//! The tilt belongs to the point because it results from holder and surface, not from the day of
//! measurement. If it were drawn separately for A and AJB, it would differ between the
//! configurations, would no longer cancel, and would reduce every decoupled stiffness by about 13
//! %.

use super::config::{BodyName, Errors, ImpactPoint, ResponsePoint, RigConfig, Spot};
use super::key::{Stream, normal, stream};
use super::{Configuration, RigError, normalized};

/// Unit vectors of the axes.
pub const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// One scalar output (motion along `direction`) or input (force along it).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// The body it sits on.
    pub body: BodyName,
    /// Position (m).
    pub position_m: [f64; 3],
    /// Unit vector.
    pub direction: [f64; 3],
}

impl Probe {
    /// Probe of a single-point vibrometer that measures along `direction`.
    pub fn at(spot: &Spot, direction: [f64; 3]) -> Self {
        Self { body: spot.body, position_m: spot.position_m, direction }
    }

    /// The same for a contact that slides along z.
    pub fn along_z(spot: &Spot) -> Self {
        Self::at(spot, AXES[2])
    }
}

impl ResponsePoint {
    /// x, y and z at the nominal position.
    pub fn probes(&self) -> [Probe; 3] {
        AXES.map(|direction| Probe { body: self.body, position_m: self.position_m, direction })
    }
}

impl ImpactPoint {
    /// Along the impact's direction at the nominal position.
    pub fn probe(&self) -> Probe {
        Probe { body: self.body, position_m: self.position_m, direction: normalized(self.direction) }
    }
}

impl RigConfig {
    /// All response points: the list, then the mark for all lasers if the list does not contain it.
    pub fn response_points(&self) -> impl Iterator<Item = &ResponsePoint> {
        let listed = |mark: &&ResponsePoint| self.responses.iter().any(|point| point.name == mark.name);
        self.responses.iter().chain(self.spots.mark.iter().filter(move |mark| !listed(mark)))
    }

    /// The response point `name`, if `configuration` has it.
    ///
    /// # Errors
    /// [`RigError::UnknownPoint`] listing the valid names.
    pub fn response(&self, configuration: Configuration, name: &str) -> Result<&ResponsePoint, RigError> {
        let of_mass = || self.known_mass_in(configuration).map(|mass| &mass.response);
        let of_open = || self.open_joint_in(configuration).map(|open| &open.response);
        let there = || {
            let own = self.response_points().filter(|point| self.has(configuration, point.body));
            own.chain(of_mass()).chain(of_open())
        };
        there().find(|point| point.name == name).ok_or_else(|| RigError::UnknownPoint {
            kind: "response",
            name: name.to_owned(),
            configuration,
            valid: there().map(|point| point.name.clone()).collect(),
        })
    }

    /// The impact point `name`, if `configuration` has it.
    ///
    /// # Errors
    /// [`RigError::UnknownPoint`] listing the valid names.
    pub fn impact(&self, configuration: Configuration, name: &str) -> Result<&ImpactPoint, RigError> {
        let of_mass = || self.known_mass_in(configuration).map(|mass| &mass.impact);
        let of_open = || self.open_joint_in(configuration).map(|open| &open.impact);
        let there = || {
            let own = self.impacts.iter().filter(|point| self.has(configuration, point.body));
            own.chain(of_mass()).chain(of_open())
        };
        there().find(|point| point.name == name).ok_or_else(|| RigError::UnknownPoint {
            kind: "impact",
            name: name.to_owned(),
            configuration,
            valid: there().map(|point| point.name.clone()).collect(),
        })
    }
}

/// True geometry of one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Aim {
    /// Position and direction of the hammer's impact.
    pub impact: Probe,
    /// Where the 3-D vibrometer measures, along x, y and z.
    pub response: [Probe; 3],
    /// Where the vibrometers of spots A and B measure, if they are aimed at the same mark.
    pub at_mark: Option<[Spot; 2]>,
}

impl Aim {
    /// Geometry of the cell `words` = (configuration, impact, response); with `at_mark`, the
    /// vibrometers of the spots are aimed at the response point too, once for all its cells.
    pub fn new(
        seed: u64,
        words: [&str; 3],
        errors: &Errors,
        impact: &ImpactPoint,
        response: &ResponsePoint,
        at_mark: bool,
    ) -> Self {
        let errors = errors.acting();
        let [configuration, hit, seen] = words;
        let cell = |purpose| stream(seed, &[configuration, hit, seen, purpose]);
        let mut impact_aim = cell("impact aim");
        let mut response_aim = cell("response aim");
        let mut hit_point = stream(seed, &["impact position", hit]);
        let mut seen_point = stream(seed, &["response position", seen]);
        let hit_m = shifted(
            shifted(errors.moved(hit, impact.position_m), errors.position_m, &mut hit_point),
            errors.aim_m,
            &mut impact_aim,
        );
        let (seen_sigma_m, aim_m) = if response.body.is_specimen() {
            (errors.specimen_point_m, 0.0)
        } else {
            (errors.position_m, errors.aim_m)
        };
        let own_m = response.sigma_m.filter(|_| !errors.none);
        let seen_sigma_m = own_m.unwrap_or(seen_sigma_m);
        let point_m = shifted(errors.moved(seen, response.position_m), seen_sigma_m, &mut seen_point);
        let seen_m = shifted(point_m, aim_m, &mut response_aim);
        let mut hammer = stream(seed, &["hammer angle", hit]);
        let stated = errors.tilted("hammer", impact.probe().direction);
        let direction = tilted(stated, errors.hammer_angle_rad, &mut hammer);
        Self {
            impact: Probe { body: impact.body, position_m: hit_m, direction },
            response: AXES.map(|axis| Probe {
                body: response.body,
                position_m: seen_m,
                direction: errors.tilted("vibrometer", axis),
            }),
            at_mark: at_mark.then(|| {
                ["ldv_a", "ldv_b"].map(|laser| Spot {
                    body: response.body,
                    position_m: shifted(point_m, aim_m, &mut stream(seed, &["aim at the mark", laser])),
                })
            }),
        }
    }
}

pub(super) fn shifted(position_m: [f64; 3], sigma_m: f64, stream: &mut Stream) -> [f64; 3] {
    position_m.map(|coordinate| coordinate + sigma_m * normal(stream))
}

/// `direction` rotated by a random angle about each of two axes normal to it.
fn tilted(direction: [f64; 3], sigma_rad: f64, stream: &mut Stream) -> [f64; 3] {
    let (about_first, about_second) = (sigma_rad * normal(stream), sigma_rad * normal(stream));
    let [first, second] = across(direction);
    // A rotation vector normal to the direction rotates it by the vector's length.
    let angle = about_first.hypot(about_second);
    if angle == 0.0 {
        return direction;
    }
    let axis: [f64; 3] = std::array::from_fn(|i| (first[i] * about_first + second[i] * about_second) / angle);
    let across = cross(axis, direction);
    std::array::from_fn(|i| direction[i] * angle.cos() + across[i] * angle.sin())
}

/// Two unit vectors at right angles to the unit vector `direction` and to each other.
pub(super) fn across(direction: [f64; 3]) -> [[f64; 3]; 2] {
    // The axis with the smallest component along the direction gives a well-conditioned first
    // perpendicular.
    let least = (0..3).min_by(|a, b| direction[*a].abs().total_cmp(&direction[*b].abs())).unwrap_or(0);
    let first = normalized(cross(direction, AXES[least]));
    [first, cross(direction, first)]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
