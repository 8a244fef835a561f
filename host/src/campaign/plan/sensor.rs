//! The sensors of a plan: what is on a channel, as described by the plan or a laboratory's
//! calibration file, and where it measures.
//!
//! The channels of a response are those of the vibrometer, which moves from point to point, or
//! those of a fixed sensor; the load cells measure the force along the sliding direction. Impacts,
//! responses and fixed sensors have positions.
//!
//! Implausible values are looked for as well: lengths in mm, angles in degrees, excessive numbers.
//! A new campaign is refused with them; an existing campaign that was measured with them can still
//! be read.

use super::faults::{Faults, first, read};
use super::structure::{dot, unit};
use super::{Cell, PRINTABLE, Plan, PlanError, configuration_name, printable};
use crate::device::channels::ChannelMap;
use crate::substructuring::geometry::{FARTHEST_M, too_far};
use jointrig_protocol::channel::Role;
use serde::Deserialize;
use std::collections::HashSet;
use toml::Spanned;

/// The sensor on a channel of the device.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorPlan {
    /// The channel's name on the device.
    pub name: String,
    /// The sensor's model.
    pub model: Option<String>,
    /// Its serial number.
    pub serial: Option<String>,
    /// When it was calibrated, YYYY-MM-DD.
    pub calibrated: Option<String>,
    /// V per SI unit, without sign.
    pub sensitivity_v: Option<f64>,
    /// 1, or -1 where a positive quantity gives a negative voltage.
    pub polarity: Option<i8>,
    /// Delay of its signal, s.
    pub delay_s: Option<f64>,
    /// Relative standard uncertainty of the sensitivity.
    pub uncertainty: Option<f64>,
    /// Full scale in SI units.
    pub range: Option<f64>,
}

/// A laboratory's calibration file: its sensors, in the tables `[[channel]]` of a plan.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    /// The sensors.
    pub channel: Vec<Spanned<SensorPlan>>,
}

impl CalibrationFile {
    /// Reads one; errors call the text `source_name`.
    ///
    /// # Errors
    /// The text is not a calibration file, or a value of a sensor is impossible.
    pub fn parse(text: &str, source_name: &str) -> Result<Self, PlanError> {
        read(text, source_name, |file: &Self, faults| check_sensors(&file.channel, faults)).map_err(first)
    }
}

/// Records the errors of all sensors.
pub(super) fn check_sensors(channels: &[Spanned<SensorPlan>], faults: &mut Faults) {
    let mut seen = HashSet::new();
    for channel in channels {
        let (at, sensor) = (channel.span().start, channel.get_ref());
        let name = &sensor.name;
        let positive = |value: Option<f64>| value.is_none_or(|value| value > 0.0 && value.is_finite());
        let what = if !seen.insert(name) {
            format!("channel: `{name}` is listed twice")
        } else if !positive(sensor.sensitivity_v) || !positive(sensor.range) {
            format!("channel `{name}`: sensitivity_v and range must be over 0 (the sign is its polarity)")
        } else if sensor.polarity.is_some_and(|sign| sign.abs() != 1) {
            format!("channel `{name}`: polarity must be 1 or -1")
        } else if sensor.delay_s.is_some_and(|delay_s| !(0.0..=1.0).contains(&delay_s)) {
            format!("channel `{name}`: delay_s must be 0 to 1 s")
        } else if sensor.uncertainty.is_some_and(|part| !(0.0..1.0).contains(&part)) {
            format!("channel `{name}`: uncertainty is relative: 0.01 means 1 %")
        } else if sensor.calibrated.as_ref().is_some_and(|date| date.parse::<jiff::civil::Date>().is_err()) {
            format!("channel `{name}`: calibrated must be a date, YYYY-MM-DD")
        } else {
            continue;
        };
        faults.unless(false, at, what);
    }
}

/// A load cell is left out if the cosine between its direction and the sliding direction is below
/// this.
const FEELS: f64 = 1e-3;
/// A vibrometer on a specimen must look along the sliding direction, or against it, to within this
/// angle, degrees: its reading is taken for the motion along it, and the cosine of 5° is 0.996.
const OBLIQUE_DEG: f64 = 5.0;
/// The plan's names of the vibrometers on the specimens.
const SPOTS: [(Role, &str); 2] = [(Role::SpecimenA, "LDV_A"), (Role::SpecimenB, "LDV_B")];

impl Plan {
    /// The load cells that measure along the sliding direction: index in the map, and the factor of
    /// its reading in their sum. A cell's direction is that of the plan's sensor of the same name
    /// (`LC1` is the channel `lc_1`), or the sliding direction if the plan has none.
    pub fn load_cells(&self, map: &ChannelMap) -> Vec<(usize, f64)> {
        let places = map.places(Role::LoadCell).into_iter();
        places
            .map(|place| (place, self.sliding_part(&map.channels[place].name)))
            .filter(|(_, part)| part.abs() > FEELS)
            .collect()
    }

    /// The same channels with the vibrometers on the specimens positive along the sliding
    /// direction: if the plan's sensor `LDV_A` or `LDV_B` looks against it, the scale of that
    /// channel has the opposite sign.
    pub fn along_sliding(&self, mut map: ChannelMap) -> ChannelMap {
        for channel in &mut map.channels {
            let spot = SPOTS.into_iter().find(|(role, _)| *role == channel.role);
            if spot.is_some_and(|(_, name)| self.sliding_part(name) < 0.0) {
                channel.units_per_volt = -channel.units_per_volt;
            }
        }
        map
    }

    /// Cosine between the measurement direction of this channel's sensor and the sliding direction;
    /// 1 for a channel that the plan does not name.
    fn sliding_part(&self, channel: &str) -> f64 {
        let named = |name: &str| letters(name).eq(letters(channel));
        let mut sensors = self.geometry.sensor.iter().map(toml::Spanned::get_ref);
        let own = sensors.find(|sensor| named(&sensor.name));
        own.map_or(1.0, |sensor| dot(unit(sensor.direction), unit(self.sliding())))
    }
}

/// Letters and digits of a name, in lower case.
fn letters(name: &str) -> impl Iterator<Item = char> {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase)
}

impl Plan {
    /// The response point with that name.
    pub fn response(&self, name: &str) -> Option<&ResponsePoint> {
        self.geometry.response.iter().map(toml::Spanned::get_ref).find(|point| point.name == name)
    }

    /// Total number of good hits wanted: a hit that fills a row of cells counts once.
    pub fn hits_wanted(&self) -> u32 {
        let mut rows = HashSet::new();
        let mut struck = |cell: &Cell| {
            let row = (configuration_name(cell.configuration), cell.impact.clone());
            self.own_channels(&cell.response).is_none() || rows.insert(row)
        };
        self.cells().iter().filter(|cell| struck(cell)).map(|cell| cell.wanted).sum()
    }

    /// Whether a configuration has this response.
    pub fn is_measured(&self, response: &str) -> bool {
        self.configuration.iter().flat_map(|block| &block.responses).any(|name| name.get_ref() == response)
    }

    /// Names of the channels of the fixed sensor at this response point; `None` if the vibrometer
    /// measures it.
    pub fn own_channels(&self, response: &str) -> Option<&[String]> {
        self.response(response)?.channels.as_deref()
    }

    /// The point of the fixed sensor with this channel, and the channel's measurement direction;
    /// `None` for the vibrometer's channels.
    pub fn sensor_on(&self, channel: &str) -> Option<(&ResponsePoint, [f64; 3])> {
        self.geometry.response.iter().map(toml::Spanned::get_ref).find_map(|point| {
            let place = point.channels.as_ref()?.iter().position(|name| name == channel)?;
            point.axes().get(place).map(|(_, direction)| (point, *direction))
        })
    }

    /// Indices in `map` of the channels of the fixed sensor at this response point, in the order of
    /// its axes; `None` if there is no such sensor or one of its channels is missing.
    pub fn own_places(&self, response: &str, map: &ChannelMap) -> Option<Vec<usize>> {
        self.own_channels(response)?.iter().map(|name| map.named(name)).collect()
    }

    /// Indices in `map` of the channels that measure this response point in a record of its own
    /// cell: those of its fixed sensor, or the vibrometer's. An imported record holds only the
    /// point's signals, with arbitrary names.
    pub fn response_places(&self, response: &str, map: &ChannelMap) -> Option<Vec<usize>> {
        self.own_places(response, map).or_else(|| map.responses())
    }
}

/// Largest plausible position error, m: catches values in mm.
const WORST_PLACING_M: f64 = 0.05;
/// Largest plausible tilt of the hammer, rad: catches degrees.
const WORST_TILT_RAD: f64 = 0.5;
/// Largest plausible relative gain error.
pub(super) const WORST_GAIN: f64 = 0.5;
/// Largest plausible delay error, s: catches µs and ms.
const WORST_SKEW_S: f64 = 0.01;
/// Largest plausible mass of a sensor, g.
const HEAVIEST_G: f64 = 500.0;
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
                "window.exponential_per_s must be 0 to {STRONGEST_WINDOW_PER_S}: a negative one would make the window grow"
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
            "trigger.level_n must be below force.target_n, or no hit is detected",
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
                "gain" | "hammer_gain" | "transverse" => (WORST_GAIN, "relative, 0.01 for 1 %"),
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
                    "geometry: `{name}` is at {} m, and no position may be further than {FARTHEST_M} m from the origin: \
                     positions are in m, not in mm",
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
            let is_spot = SPOTS.iter().any(|(_, name)| letters(name).eq(letters(&sensor.name)));
            faults.unless(
                !is_spot || self.sliding_part(&sensor.name).abs() >= OBLIQUE_DEG.to_radians().cos(),
                at,
                format!(
                    "geometry: direction of `{}` must be the sliding direction or its opposite, to within \
                     {OBLIQUE_DEG}°: its reading is taken for the motion along it",
                    sensor.name
                ),
            );
        }
        for point in &geometry.response {
            let (point, at) = (point.get_ref(), point.span().start);
            let heavy = |mass_g: f64| !(0.0..=HEAVIEST_G).contains(&mass_g);
            faults.unless(
                !point.mass_g.is_some_and(heavy),
                at,
                format!("geometry: mass_g of `{}` must be 0 to {HEAVIEST_G}: it is in grams", point.name),
            );
            faults.unless(
                point.mass_g.is_none() || point.channels.is_some(),
                at,
                format!("geometry: mass_g of `{}` is that of a fixed sensor: list its channels", point.name),
            );
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

/// The geometry: x lateral, y vertical, z sliding (unless `[structure]` states otherwise); origin
/// at the contact centre.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeometryPlan {
    /// Position of both virtual points, m.
    pub virtual_point_m: [f64; 3],
    /// Response points, each measured along x, y and z or along the axes it lists.
    pub response: Vec<Spanned<ResponsePoint>>,
    /// Impact points.
    pub impact: Vec<Spanned<ImpactPoint>>,
    /// Fixed sensors.
    #[serde(default)]
    pub sensor: Vec<Spanned<SensorPoint>>,
}

/// A response point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponsePoint {
    /// Its name.
    pub name: String,
    /// 1 interface of A, 2 interface of B, 3 internal of A, 4 internal of B, 5 on specimen A, 6 on
    /// specimen B, 7 on the known mass.
    pub grouping: u8,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Standard deviation of the position along each axis, m; if absent, the value in `[priors]`
    /// for its kind of point applies.
    pub sigma_m: Option<f64>,
    /// Measurement direction of each channel of the sensor, one to three unit vectors; x, y and z
    /// if absent. Records hold the channels in this order.
    pub axes: Option<Vec<[f64; 3]>>,
    /// Names of the device's channels, one for each axis, to which a fixed sensor at this point is
    /// connected: all such sensors measure every hit simultaneously. If absent, the vibrometer is
    /// aimed at this point.
    pub channels: Option<Vec<String>>,
    /// Mass of the fixed sensor, g.
    pub mass_g: Option<f64>,
    /// Whether `LDV_A` and `LDV_B` are aimed at this point too while B alone is measured, which
    /// compares their gains with the 3-D vibrometer's. In the assembly they stay on their spots.
    #[serde(default)]
    pub lasers: bool,
}

impl ResponsePoint {
    /// The channels' names and directions: `A1:x`, `A1:y`, `A1:z`; with listed axes `A1` if there
    /// is one, else `A1:1`, `A1:2`, …
    pub fn axes(&self) -> Vec<(String, [f64; 3])> {
        let name = &self.name;
        match &self.axes {
            None => [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])]
                .map(|(axis, direction)| (format!("{name}:{axis}"), direction))
                .to_vec(),
            Some(axes) if axes.len() == 1 => vec![(name.clone(), axes[0])],
            Some(axes) => (1..).zip(axes).map(|(number, axis)| (format!("{name}:{number}"), *axis)).collect(),
        }
    }
}

/// An impact point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImpactPoint {
    /// Its name.
    pub name: String,
    /// 1 interface of A, 2 interface of B, 3 internal of A, 4 internal of B, 5 on specimen A, 6 on
    /// specimen B.
    pub grouping: u8,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Direction in which the hammer pushes, a unit vector.
    pub direction: [f64; 3],
}

/// A fixed sensor.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorPoint {
    /// Its name.
    pub name: String,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Its measurement direction, a unit vector.
    pub direction: [f64; 3],
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::CONTACT;
    use jointrig_protocol::channel::{Channel, Quantity};

    fn map() -> ChannelMap {
        let channel = |name: &str| Channel {
            name: name.parse().expect("a short name"),
            role: Role::LoadCell,
            quantity: Quantity::Force,
            units_per_volt: 1.0,
            range_v: 10.0,
            bits: 16,
            delay_ns: 0,
        };
        let channels = ["lc_1", "lc_2", "lc_3", "lc_4"].map(channel).to_vec();
        ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels }
    }

    #[test]
    fn each_cell_adds_what_it_feels_along_the_sliding_direction() {
        let plan = |old: &str, new: &str| {
            assert!(CONTACT.contains(old), "{old}");
            Plan::parse(&CONTACT.replace(old, new), "plan.toml").expect("a plan")
        };
        let cells = plan("LC1", "LC1").load_cells(&map());
        // the fourth is not in the plan
        assert_eq!(cells, [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)]);
        let lc1 = "{ name = \"LC1\", position_m = [-0.035, -0.015, -0.15], direction = [0, 0, 1] }";
        let turned = plan(lc1, &lc1.replace("[0, 0, 1]", "[0, 0, -1]"));
        assert_eq!(turned.load_cells(&map())[0], (0, -1.0));
        let inclined = plan(lc1, &lc1.replace("[0, 0, 1]", "[0, 0.6, 0.8]"));
        assert!((inclined.load_cells(&map())[0].1 - 0.8).abs() < 1e-12);
        let across = plan(lc1, &lc1.replace("[0, 0, 1]", "[0, 1, 0]"));
        assert_eq!(across.load_cells(&map()).iter().map(|cell| cell.0).collect::<Vec<_>>(), [1, 2, 3]);
    }

    #[test]
    fn a_vibrometer_that_looks_against_the_sliding_direction_is_turned() {
        let ldv_a = "{ name = \"LDV_A\", position_m = [0.0006, 0.0005, 0.0], direction = [0, 0, 1] }";
        assert!(CONTACT.contains(ldv_a));
        let plan = |direction: &str| {
            let text = CONTACT.replace(ldv_a, &ldv_a.replace("[0, 0, 1]", direction));
            Plan::parse_new(&text, "plan.toml").map_err(|error| error.to_string())
        };
        let mut channels = map();
        channels.channels[0].role = Role::SpecimenA;
        channels.channels[1].role = Role::SpecimenB;
        let scales = |direction: &str| {
            let turned = plan(direction).expect("a plan").along_sliding(channels.clone());
            turned.channels.iter().map(|channel| channel.units_per_volt).collect::<Vec<_>>()
        };
        assert_eq!(scales("[0, 0, 1]"), [1.0; 4]);
        assert_eq!(scales("[0, 0, -1]"), [-1.0, 1.0, 1.0, 1.0]);
        // 3° and 8°
        assert_eq!(scales("[0, 0.0523, -0.9986]"), [-1.0, 1.0, 1.0, 1.0]);
        for oblique in ["[0, 0.1392, -0.9903]", "[1, 0, 0]"] {
            let said = plan(oblique).expect_err("too oblique");
            assert!(said.contains("direction of `LDV_A` must be the sliding direction"), "{said}");
        }
    }
}
