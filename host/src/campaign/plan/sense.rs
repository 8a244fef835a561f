//! Implausible values in a plan: lengths in mm, angles in degrees, excessive numbers. A new
//! campaign is refused with them; an existing campaign that was measured with them can still be
//! read.

use super::faults::Faults;
use super::structure::dot;
use super::{PRINTABLE, Plan, printable};
use crate::substructuring::geometry::{FARTHEST_M, too_far};

/// Largest plausible position error, m: catches values in mm.
const WORST_PLACING_M: f64 = 0.05;
/// Largest plausible tilt of the hammer, rad: catches degrees.
const WORST_TILT_RAD: f64 = 0.5;
/// Largest plausible relative gain error.
const WORST_GAIN: f64 = 0.5;
/// Largest plausible delay error, s: catches µs and ms.
const WORST_SKEW_S: f64 = 0.01;
/// Largest plausible force of a hammer of this kind, N.
const HARDEST_N: f64 = 1e5;
/// Exponential window that leaves nothing after a millisecond, 1/s.
const STRONGEST_WINDOW_PER_S: f64 = 1e3;
/// Longest window in which residual motion is evaluated, in the device's decimated samples: an
/// order of magnitude longer than is useful.
const LONGEST_QUIET_SAMPLES: u16 = 4096;

impl Plan {
    pub(super) fn check_sense(&self, faults: &mut Faults) {
        let (name, at) = (self.name.get_ref(), self.name.span().start);
        faults.unless(printable(name), at, format!("name must have {PRINTABLE}"));
        self.check_forces(faults);
        let (settle, at) = (self.settle.get_ref(), self.settle.span().start);
        faults.unless(
            (1..=LONGEST_QUIET_SAMPLES).contains(&settle.window_samples),
            at,
            format!("settle.window_samples must be 1 to {LONGEST_QUIET_SAMPLES}"),
        );
        faults.unless(
            settle.quiet_relative > 0.0 && settle.quiet_relative < 1.0,
            at,
            "settle.quiet_relative must lie between 0 and 1",
        );
        faults.unless(
            settle.quiet_floor_m_per_s > 0.0 && settle.quiet_floor_m_per_s < 1.0,
            at,
            "settle.quiet_floor_m_per_s must lie between 0 and 1",
        );
        faults.unless(
            (0.0..=STRONGEST_WINDOW_PER_S).contains(&self.window.get_ref().exponential_per_s),
            self.window.span().start,
            format!(
                "window.exponential_per_s must be 0 to {STRONGEST_WINDOW_PER_S}: a negative one would grow"
            ),
        );
        self.check_errors(faults);
        self.check_places(faults);
    }

    fn check_forces(&self, faults: &mut Faults) {
        let (force, at) = (self.force.get_ref(), self.force.span().start);
        faults.unless(
            force.target_n <= HARDEST_N,
            at,
            format!("force.target_n must be at most {HARDEST_N} N"),
        );
        let (trigger, at) = (self.trigger.get_ref(), self.trigger.span().start);
        faults.unless(
            f64::from(trigger.level_n) < force.target_n,
            at,
            "trigger.level_n must be below force.target_n, or no hit is seen",
        );
        let (limits, at) = (self.limits.get_ref(), self.limits.span().start);
        faults.unless(
            limits.strong_n.is_finite() && limits.noise_ratio.is_finite(),
            at,
            "limits: strong_n and noise_ratio must be numbers",
        );
        faults.unless(
            (limits.weak_n..=limits.strong_n).contains(&force.target_n),
            at,
            "limits: force.target_n must lie between weak_n and strong_n, or every hit is refused",
        );
    }

    fn check_errors(&self, faults: &mut Faults) {
        let Some(priors) = &self.priors else { return };
        let at = priors.span().start;
        for (name, value) in priors.get_ref().stated() {
            let (most, unit) = match name {
                "hammer_angle_rad" => (WORST_TILT_RAD, "rad"),
                "gain" | "hammer_gain" => (WORST_GAIN, "relative, 0.01 for 1 %"),
                "skew_s" => (WORST_SKEW_S, "s"),
                _ => (WORST_PLACING_M, "m"),
            };
            faults.unless(
                value.is_none_or(|value| value <= most),
                at,
                format!("priors.{name} must be at most {most}: it is in {unit}"),
            );
        }
    }

    fn check_places(&self, faults: &mut Faults) {
        let geometry = &self.geometry;
        let mut place = |at: usize, name: &str, position_m: [f64; 3]| {
            let far = too_far(position_m);
            faults.unless(
                far.is_none(),
                at,
                format!(
                    "geometry: `{name}` stands at {} m, and no place may be further than {FARTHEST_M} m from the origin: positions are in m, not in mm",
                    far.unwrap_or(0.0)
                ),
            );
        };
        let start = geometry.response.first().map_or(0, |point| point.span().start);
        place(start, "virtual_point_m", geometry.virtual_point_m);
        for point in &geometry.response {
            place(point.span().start, &point.get_ref().name, point.get_ref().position_m);
        }
        for point in &geometry.impact {
            place(point.span().start, &point.get_ref().name, point.get_ref().position_m);
        }
        for sensor in &geometry.sensor {
            place(sensor.span().start, &sensor.get_ref().name, sensor.get_ref().position_m);
        }
        for sensor in &geometry.sensor {
            let (sensor, at) = (sensor.get_ref(), sensor.span().start);
            let length = dot(sensor.direction, sensor.direction).sqrt();
            faults.unless(
                (length - 1.0).abs() <= 1e-3,
                at,
                format!("geometry: direction of `{}` must have length 1", sensor.name),
            );
        }
        for point in &geometry.response {
            let (point, at) = (point.get_ref(), point.span().start);
            faults.unless(
                point.sigma_m.is_none_or(|sigma_m| sigma_m <= WORST_PLACING_M),
                at,
                format!(
                    "geometry: sigma_m of `{}` must be at most {WORST_PLACING_M}: it is in m",
                    point.name
                ),
            );
        }
        let responses = geometry.response.iter().map(|point| (point.span().start, &point.get_ref().name));
        let impacts = geometry.impact.iter().map(|point| (point.span().start, &point.get_ref().name));
        let sensors = geometry.sensor.iter().map(|point| (point.span().start, &point.get_ref().name));
        for (at, name) in responses.chain(impacts).chain(sensors) {
            faults.unless(
                printable(name) && !name.contains(['/', '\\']),
                at,
                format!("geometry: the name {name:?} must have {PRINTABLE}, and no / or \\: files are named after it"),
            );
        }
    }
}
