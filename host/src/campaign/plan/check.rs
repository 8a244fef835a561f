//! What is known of a plan before the measurement starts: the rules that it must satisfy beyond its
//! grammar, and which results its measurements can yield, with what is missing for each.

use super::faults::Faults;
use super::sensor::{ResponsePoint, WORST_GAIN, check_sensors};
use super::{
    Cell, ConfigurationPlan, JOINT_OPEN, ON_KNOWN_MASS, Plan, configuration_name, configuration_named, turned,
};
use crate::contact::determines_motion;
use jointrig_protocol::limits::{ARM_VALID_CAP_MS, COIL_PULSE_CAP_US, NAME_BYTES, SHAKE_SCANS_PER_CYCLE};
use jointrig_protocol::request::Configuration;
use std::collections::{BTreeSet, HashSet};
use toml::Spanned;

/// Largest plausible amplitude at the contact, m: catches a plan written in µm.
const LARGEST_AMPLITUDE_M: f64 = 1e-3;

/// Most cycles of the wear runs of a file: 210 MB.
const MOST_WEAR_CYCLES: u64 = 10_000_000;

impl Plan {
    pub(super) fn check(&self, faults: &mut Faults) {
        let mut require = |good: bool, at: usize, what: &str| faults.unless(good, at, what);
        require(
            *self.version.get_ref() == 1,
            self.version.span().start,
            "version: this program reads version 1",
        );
        let (record, at) = (self.record.get_ref(), self.record.span().start);
        require((1..=1_000_000).contains(&record.rate_hz), at, "record.rate_hz must be 1 to 1000000");
        require(
            record.length_s > 0.0 && record.length_s <= 60.0,
            at,
            "record.length_s must be over 0 and at most 60",
        );
        require(record.pre_trigger_scans <= 10_000, at, "record.pre_trigger_scans must be at most 10000");
        let (hits, at) = (self.hits.get_ref(), self.hits.span().start);
        require(hits.wanted > 0, at, "hits.wanted must be at least 1");
        require(
            hits.minimum <= hits.wanted && hits.wanted <= hits.most,
            at,
            "hits: minimum <= wanted <= most must hold",
        );
        let (force, at) = (self.force.get_ref(), self.force.span().start);
        require(force.target_n > 0.0, at, "force.target_n must be over 0");
        require(
            force.tolerance > 0.0 && force.tolerance < 1.0,
            at,
            "force.tolerance must lie between 0 and 1",
        );
        require(
            force.softer.is_none_or(|part| {
                part < 1.0 && part * force.target_n * (1.0 - force.tolerance) > self.limits.get_ref().weak_n
            }),
            at,
            "force.softer must be below 1, and its hits must stay above limits.weak_n",
        );
        let [shortest, longest] = force.pulse_bounds_us;
        require(
            self.by_hand().is_some()
                || shortest > 0
                    && shortest <= force.pulse_us
                    && force.pulse_us <= longest
                    && longest <= COIL_PULSE_CAP_US,
            at,
            "force: 0 < pulse_bounds_us[0] <= pulse_us <= pulse_bounds_us[1] <= 8000 must hold",
        );
        let (trigger, at) = (self.trigger.get_ref(), self.trigger.span().start);
        let bounded = |value: f64| (0.0..=1.0).contains(&value);
        require(trigger.level_n > 0.0, at, "trigger.level_n must be over 0");
        require(
            bounded(trigger.flight_s) && bounded(trigger.listen_s) && bounded(trigger.hold_off_s),
            at,
            "trigger: flight_s, listen_s and hold_off_s must lie between 0 and 1",
        );
        let (settle, at) = (self.settle.get_ref(), self.settle.span().start);
        require(
            settle.bound_s > 0.0 && settle.bound_s < f64::from(ARM_VALID_CAP_MS) / 1000.0 - 5.0,
            at,
            "settle.bound_s must lie between 0 and 55",
        );
        self.check_hammer(faults);
        self.check_structure(faults);
        self.check_limits(faults);
        self.check_shaker(faults);
        self.check_wear(faults);
        self.check_contact(faults);
        self.check_specimens(faults);
        self.check_priors(faults);
        check_sensors(&self.channel, faults);
        self.check_geometry(faults);
        self.check_configurations(faults);
        self.check_known_mass(faults);
        self.check_open_joint(faults);
    }

    fn check_limits(&self, faults: &mut Faults) {
        let (limits, at) = (self.limits.get_ref(), self.limits.span().start);
        for (good, what) in [
            (
                0.0 < limits.weak_n && limits.weak_n < limits.strong_n,
                "limits: 0 < weak_n < strong_n must hold",
            ),
            (
                0.0 < limits.rebound_ratio && limits.rebound_ratio < 1.0,
                "limits.rebound_ratio must lie between 0 and 1",
            ),
            (
                (0.0..1.0).contains(&limits.rebound_after_s),
                "limits.rebound_after_s must be at least 0 and under 1",
            ),
            (limits.noise_ratio > 1.0, "limits.noise_ratio must be over 1"),
        ] {
            faults.unless(good, at, what);
        }
        let Some(enough) = &self.enough else { return };
        let (wanted, at) = (enough.get_ref(), enough.span().start);
        let [low, high] = wanted.band_hz;
        faults.unless(
            wanted.random_error > 0.0 && wanted.random_error < 1.0,
            at,
            "enough.random_error must lie between 0 and 1",
        );
        faults.unless(
            0.0 <= low && low < high && high <= f64::from(self.record.get_ref().rate_hz) / 2.0,
            at,
            "enough.band_hz must be [low, high], at most half of record.rate_hz",
        );
    }

    fn check_shaker(&self, faults: &mut Faults) {
        let Some(shaker) = &self.shaker else { return };
        let (levels, at) = (shaker.get_ref(), shaker.span().start);
        // the device refuses frequencies above a tenth of the scan rate
        let highest = f64::from(self.record.get_ref().rate_hz) / f64::from(SHAKE_SCANS_PER_CYCLE);
        let within = |values: &[f64], most: f64| {
            !values.is_empty() && values.iter().all(|value| *value > 0.0 && *value <= most)
        };
        faults.unless(
            within(&levels.frequencies_hz, highest),
            at,
            format!("shaker.frequencies_hz must be over 0 and at most {highest}, one or more"),
        );
        faults.unless(
            within(&levels.amplitudes_m, LARGEST_AMPLITUDE_M),
            at,
            format!("shaker.amplitudes_m must be over 0 and at most {LARGEST_AMPLITUDE_M}, one or more"),
        );
    }

    fn check_wear(&self, faults: &mut Faults) {
        let Some(wear) = &self.wear else { return };
        let (run, at) = (wear.get_ref(), wear.span().start);
        let highest = f64::from(self.record.get_ref().rate_hz) / f64::from(SHAKE_SCANS_PER_CYCLE);
        let over_zero = |value: Option<f64>| value.is_none_or(|value| value > 0.0 && value.is_finite());
        for (good, what) in [
            (
                run.frequency_hz > 0.0 && run.frequency_hz <= highest,
                format!("wear.frequency_hz must be over 0 and at most {highest}"),
            ),
            (
                run.amplitude_m > 0.0 && run.amplitude_m <= LARGEST_AMPLITUDE_M,
                format!("wear.amplitude_m must be over 0 and at most {LARGEST_AMPLITUDE_M}"),
            ),
            (
                (1..=MOST_WEAR_CYCLES).contains(&run.cycles),
                format!("wear.cycles must be 1 to {MOST_WEAR_CYCLES}"),
            ),
            (over_zero(run.energy_j), "wear.energy_j must be over 0, in J".into()),
            (
                run.friction_coefficient.is_none_or(|[low, high]| 0.0 <= low && low < high),
                "wear.friction_coefficient is [smallest, largest], from 0".into(),
            ),
            (
                run.largest_amplitude_m.is_none_or(|most| most > run.amplitude_m),
                "wear.largest_amplitude_m must be over wear.amplitude_m".into(),
            ),
            (
                run.temperature_c.is_none_or(f64::is_finite),
                "wear.temperature_c must be a number, in °C".into(),
            ),
        ] {
            faults.unless(good, at, what);
        }
    }

    fn check_contact(&self, faults: &mut Faults) {
        let Some(contact) = &self.contact else { return };
        let (known, at) = (contact.get_ref(), contact.span().start);
        let within =
            |value: Option<f64>, least: f64| value.is_none_or(|value| value.is_finite() && value >= least);
        faults.unless(
            within(known.normal_load_n, f64::MIN_POSITIVE) && within(known.effective_mass_kg, 0.0),
            at,
            "contact: normal_load_n must be over 0, effective_mass_kg not negative",
        );
        faults.unless(
            within(known.parallel_path, 0.0) && known.parallel_path.is_none_or(|path| path < 1.0),
            at,
            "contact.parallel_path is a ratio of stiffness, from 0 to 1",
        );
    }

    fn check_specimens(&self, faults: &mut Faults) {
        let Some(specimens) = &self.specimens else { return };
        for (name, own) in specimens.get_ref().both() {
            let Some(own) = own else { continue };
            let length = |value: f64| value > 1e-4 && value < 1.0;
            faults.unless(
                own.section_m.iter().chain([&own.clamp_m]).all(|value| length(*value)),
                specimens.span().start,
                format!("specimens.{name}: section_m and clamp_m are in m, not in mm: from 0.0001 to 1"),
            );
            faults.unless(
                own.young_pa >= 1e8 && own.young_pa.is_finite(),
                specimens.span().start,
                format!("specimens.{name}.young_pa is in Pa, not in GPa: at least 1e8"),
            );
            faults.unless(
                own.poisson.is_none_or(|value| (0.0..=0.5).contains(&value)),
                specimens.span().start,
                format!("specimens.{name}.poisson is from 0 to 0.5"),
            );
            faults.unless(
                own.uncertainty.is_none_or(|value| (0.0..=2.0).contains(&value)),
                specimens.span().start,
                format!("specimens.{name}.uncertainty is relative: from 0 to 2"),
            );
        }
    }

    fn check_priors(&self, faults: &mut Faults) {
        let Some(priors) = &self.priors else { return };
        for (name, value) in priors.get_ref().stated() {
            faults.unless(
                value.is_none_or(|v| v >= 0.0 && v.is_finite()),
                priors.span().start,
                format!("priors.{name} is a standard deviation: zero or more"),
            );
        }
    }

    fn check_geometry(&self, faults: &mut Faults) {
        // an impact and a sensor at one point may share a name: they are never confused
        let (mut sensors, mut hammers) = (HashSet::new(), HashSet::new());
        let responses = self
            .geometry
            .response
            .iter()
            .map(|point| (true, point.span().start, &point.get_ref().name, point.get_ref().grouping));
        let impacts = self
            .geometry
            .impact
            .iter()
            .map(|point| (false, point.span().start, &point.get_ref().name, point.get_ref().grouping));
        for (is_response, at, name, grouping) in responses.chain(impacts) {
            faults.unless(
                !name.is_empty() && name.len() <= NAME_BYTES,
                at,
                format!("geometry: name `{name}` must have 1 to {NAME_BYTES} bytes"),
            );
            faults.unless(
                (1..=JOINT_OPEN).contains(&grouping),
                at,
                format!("geometry: grouping of `{name}` must be 1 to {JOINT_OPEN}"),
            );
            let (seen, kind) =
                if is_response { (&mut sensors, "response") } else { (&mut hammers, "impact") };
            faults.unless(
                seen.insert(name),
                at,
                format!("geometry: the name `{name}` is used twice: every {kind} needs its own name"),
            );
        }
        for point in &self.geometry.response {
            let ResponsePoint { name, sigma_m, .. } = point.get_ref();
            let axes = point.get_ref().axes();
            let length = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt();
            faults.unless(
                (1..=3).contains(&axes.len())
                    && axes.iter().all(|(_, axis)| (length(*axis) - 1.0).abs() <= 1e-3),
                point.span().start,
                format!("geometry: axes of `{name}` must be one, two or three directions of length 1"),
            );
            faults.unless(
                sigma_m.is_none_or(|sigma_m| sigma_m >= 0.0 && sigma_m.is_finite()),
                point.span().start,
                format!("geometry: sigma_m of `{name}` must be a standard deviation in m: 0 or more"),
            );
        }
        self.check_own_channels(faults);
        for point in self.geometry.response.iter().filter(|point| point.get_ref().lasers) {
            let (at, own) = (point.span().start, point.get_ref());
            faults.unless(
                [2, ON_KNOWN_MASS].contains(&own.grouping) && own.channels.is_none(),
                at,
                format!(
                    "geometry: lasers of `{}`: LDV_A and LDV_B are compared with the 3-D vibrometer on arm B or on the \
                     known mass, at a point of grouping 2 or {ON_KNOWN_MASS} without channels of its own",
                    own.name
                ),
            );
        }
        for point in &self.geometry.impact {
            let [x, y, z] = point.get_ref().direction;
            faults.unless(
                ((x * x + y * y + z * z).sqrt() - 1.0).abs() <= 1e-3,
                point.span().start,
                format!("geometry: direction of `{}` must have length 1", point.get_ref().name),
            );
        }
    }

    /// Checks that a fixed sensor has one channel per axis, and that no two sensors share a
    /// channel.
    fn check_own_channels(&self, faults: &mut Faults) {
        let mut taken = HashSet::new();
        for point in &self.geometry.response {
            let (at, own) = (point.span().start, point.get_ref());
            let (name, Some(channels)) = (&own.name, &own.channels) else { continue };
            let axes = own.axes().len();
            faults.unless(
                channels.len() == axes,
                at,
                format!(
                    "geometry: channels of `{name}` must be {axes}, one for each axis, not {}",
                    channels.len()
                ),
            );
            for channel in channels {
                faults.unless(
                    taken.insert(channel),
                    at,
                    format!("geometry: channels of `{name}`: `{channel}` is listed twice; a channel belongs to one point only"),
                );
            }
        }
    }

    /// Checks that the points of the known mass are stated together with it, and that hammer and
    /// vibrometer go to it together, while B is measured.
    fn check_known_mass(&self, faults: &mut Faults) {
        if let Some(own) = &self.known_mass {
            let (at, own) = (own.span().start, own.get_ref());
            let plausible = own.mass_kg.is_finite() && own.mass_kg > 0.0 && own.mass_kg < HEAVIEST_KG;
            faults.unless(
                plausible,
                at,
                format!("known_mass.mass_kg must be over 0 and below {HEAVIEST_KG} kg"),
            );
            faults.unless(
                own.sigma.is_none_or(|sigma| (0.0..WORST_GAIN).contains(&sigma)),
                at,
                format!("known_mass.sigma must be a relative standard deviation from 0 to {WORST_GAIN}"),
            );
        }
        for point in &self.geometry.impact {
            let (at, own) = (point.span().start, point.get_ref());
            let along = turned(&self.to_interface(), own.direction)[2].abs();
            faults.unless(
                own.grouping != ON_KNOWN_MASS || along > SAME_DIRECTION,
                at,
                format!(
                    "geometry: direction of `{}` must be the sliding direction: it hits the known mass",
                    own.name
                ),
            );
        }
        let mut separate = true;
        for block in &self.configuration {
            let (at, name) = (block.name.span().start, block.name.get_ref());
            let [any, all] = self.any_and_all(block, ON_KNOWN_MASS);
            if !any {
                continue;
            }
            separate &= all;
            faults.unless(
                all,
                at,
                format!(
                    "configuration `{name}`: points of grouping {ON_KNOWN_MASS} are on the known mass, which is connected to nothing: \
                     give it a block of its own"
                ),
            );
            faults.unless(
                self.configuration(name) == Some(Configuration::B) && self.known_mass.is_some(),
                at,
                format!(
                    "configuration `{name}`: points of grouping {ON_KNOWN_MASS} need [known_mass], and are measured in B"
                ),
            );
        }
        if let Some(own) = self.known_mass.as_ref().filter(|_| separate) {
            faults.unless(
                self.known_mass_cell().is_some(),
                own.span().start,
                format!(
                    "known_mass needs a block of configuration B with one impact and one response of grouping {ON_KNOWN_MASS}, \
                     which the 3-D vibrometer measures along the sliding direction"
                ),
            );
        }
    }

    /// Whether any of a block's points has this grouping, and whether all have.
    fn any_and_all(&self, block: &ConfigurationPlan, grouping: u8) -> [bool; 2] {
        let hit = block.impacts.iter().map(|own| self.impact_is(own.get_ref(), &[grouping]));
        let seen = block.responses.iter().map(|own| self.response_is(own.get_ref(), &[grouping]));
        let own: Vec<bool> = hit.chain(seen).collect();
        [own.contains(&true), !own.contains(&false)]
    }

    /// Checks that hammer and vibrometer use the points of the open joint together, in a block of
    /// the assembly, and that a cell with the joint closed can be compared with it.
    fn check_open_joint(&self, faults: &mut Faults) {
        for block in &self.configuration {
            let (at, name) = (block.name.span().start, block.name.get_ref());
            let [any, all] = self.any_and_all(block, JOINT_OPEN);
            if !any {
                continue;
            }
            faults.unless(
                all,
                at,
                format!(
                    "configuration `{name}`: the joint is open at points of grouping {JOINT_OPEN} and closed at all others: \
                     give those points a block of their own"
                ),
            );
            faults.unless(
                self.configuration(name) == Some(Configuration::Ajb),
                at,
                format!(
                    "configuration `{name}`: points of grouping {JOINT_OPEN} are measured in AJB, with both sides in place"
                ),
            );
            faults.unless(
                !all || self.open_joint_cells().is_some(),
                at,
                format!(
                    "configuration `{name}`: what passes beside the open joint is compared with the closed one. This needs one impact and \
                     one response of grouping {JOINT_OPEN}, and one cell of AJB with an impact and a response on A (grouping 1 or 3); the 3-D \
                     vibrometer measures both responses along the sliding direction, and LDV_B is stated in geometry.sensor"
                ),
            );
        }
    }

    fn check_configurations(&self, faults: &mut Faults) {
        faults.unless(!self.configuration.is_empty(), 0, "configuration: there must be at least one");
        let mut seen = HashSet::new();
        for structure in &self.configuration {
            let (name, at) = (structure.name.get_ref(), structure.name.span().start);
            faults.unless(
                self.configuration(name).is_some(),
                at,
                format!(
                    "configuration.name `{name}` must be A, B or AJB, or one of the names in [structure]"
                ),
            );
            faults.unless(
                !structure.impacts.is_empty() && !structure.responses.is_empty(),
                at,
                format!("configuration `{name}` needs impacts and responses"),
            );
            let known: HashSet<&str> =
                self.geometry.impact.iter().map(|point| &*point.get_ref().name).collect();
            check_names(&structure.impacts, &known, "impacts", faults);
            let known: HashSet<&str> =
                self.geometry.response.iter().map(|point| &*point.get_ref().name).collect();
            check_names(&structure.responses, &known, "responses", faults);
            // a name that occurs twice in one list is reported there
            let (impacts, responses) = (once(&structure.impacts), once(&structure.responses));
            for impact in &impacts {
                for response in &responses {
                    faults.unless(
                        seen.insert((name, *impact, *response)),
                        at,
                        format!("configuration `{name}`: the cell {impact} × {response} is listed twice"),
                    );
                }
            }
        }
    }
}

/// The distinct names, in their order.
fn once(names: &[Spanned<String>]) -> Vec<&String> {
    let mut seen = HashSet::new();
    names.iter().map(Spanned::get_ref).filter(|name| seen.insert(*name)).collect()
}

fn check_names(names: &[Spanned<String>], known: &HashSet<&str>, field: &str, faults: &mut Faults) {
    let mut seen = HashSet::new();
    for name in names {
        let (at, name) = (name.span().start, name.get_ref());
        faults.unless(
            known.contains(name.as_str()),
            at,
            format!("configuration.{field}: the geometry has no point `{name}`"),
        );
        faults.unless(seen.insert(name), at, format!("configuration.{field}: `{name}` is listed twice"));
    }
}

/// The cell on the known mass.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KnownMassCell {
    /// Name of the impact.
    pub impact: String,
    /// Name of the response point.
    pub response: String,
    /// Index of its axis along the sliding direction.
    pub axis: usize,
    /// Whether the vibrometers of the spots are aimed at it too.
    pub lasers: bool,
}

/// The cell with the joint open and the one with the joint closed that it is compared with: in
/// both, A is struck and its motion along the sliding direction is measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OpenJointCells {
    /// Impact and response of the cell with the joint open.
    pub open: [String; 2],
    /// The same with the joint closed.
    pub closed: [String; 2],
    /// Index of the axis along the sliding direction, of the open cell's response, then of the
    /// closed one's.
    pub axes: [usize; 2],
}

/// Response points needed to determine a rigid body's motion, and impacts needed to determine its
/// response.
const BODY: usize = 3;
/// Largest plausible known mass, kg: catches grams.
const HEAVIEST_KG: f64 = 200.0;
/// Least cosine between the hit on the known mass, or the vibrometer's axis, and the sliding
/// direction.
const SAME_DIRECTION: f64 = 0.99;
/// An impact counts as along z if the z component of its unit direction exceeds this.
const ALONG_Z: f64 = 0.9;

impl Plan {
    /// What is missing for the contact's own k_T; empty if nothing is.
    pub fn contact_needs(&self) -> Vec<String> {
        let mut needs = Vec::new();
        let struck_b = self.blocks(Configuration::B).filter(|block| self.known(block, 2));
        let struck_b: usize = struck_b.map(|block| self.hit_along_z(block, &[2, 4]).len()).sum();
        if struck_b < BODY {
            needs.push(format!(
                "hits along z on B alone at {BODY} places or more, each with sensors that determine the motion of arm B (grouping 2: \
                 {BODY} points along x, y and z that are not in a line, or fixed sensors); there are {struck_b}"
            ));
        }
        let struck = |grouping: u8| -> BTreeSet<&str> {
            let seeing = self.blocks(Configuration::Ajb).filter(|block| self.known(block, grouping));
            seeing.flat_map(|block| self.hit_along_z(block, &[1, 3])).collect()
        };
        if struck(5).intersection(&struck(2)).next().is_none() {
            needs.push(format!(
                "a hit along z on A in AJB with sensors that determine the motion of specimen A (grouping 5) and of arm B \
                 (grouping 2): {BODY} points along x, y and z that are not in a line, or fixed sensors, on each"
            ));
        }
        // lasers next to the contact are not needed, but one alone was probably forgotten
        let spots = ["LDV_A", "LDV_B"]
            .map(|spot| (spot, self.geometry.sensor.iter().any(|sensor| sensor.get_ref().name == spot)));
        for (spot, stated) in spots {
            if !stated && spots.iter().any(|(_, stated)| *stated) {
                needs.push(format!("the position of {spot} in geometry.sensor"));
            }
        }
        needs
    }

    /// The cell on the known mass; `None` unless the plan has exactly one, with a response that the
    /// 3-D vibrometer visits and of which an axis is the sliding direction.
    pub fn known_mass_cell(&self) -> Option<KnownMassCell> {
        let cells = self.cells();
        let mut on_mass = cells.iter().filter(|cell| {
            self.impact_is(&cell.impact, &[ON_KNOWN_MASS])
                && self.response_is(&cell.response, &[ON_KNOWN_MASS])
        });
        let cell = on_mass.next().filter(|_| on_mass.next().is_none())?;
        Some(KnownMassCell {
            impact: cell.impact.clone(),
            response: cell.response.clone(),
            axis: self.sliding_axis(&cell.response)?,
            lasers: self.response(&cell.response)?.lasers,
        })
    }

    /// The cells that show what passes beside the joint; `None` unless the plan has exactly one
    /// with the joint open, one with which to compare it, and a vibrometer next to the contact on
    /// B.
    pub fn open_joint_cells(&self) -> Option<OpenJointCells> {
        let cells = self.cells();
        let of = |impacts: &[u8], responses: &[u8]| -> Vec<([String; 2], usize)> {
            let own = cells.iter().filter(|cell| {
                cell.configuration == Configuration::Ajb
                    && self.impact_is(&cell.impact, impacts)
                    && self.response_is(&cell.response, responses)
            });
            own.filter_map(|cell| {
                Some(([cell.impact.clone(), cell.response.clone()], self.sliding_axis(&cell.response)?))
            })
            .collect()
        };
        let [(open, axis)] = &of(&[JOINT_OPEN], &[JOINT_OPEN])[..] else { return None };
        let place = |names: &[String; 2]| self.response(&names[1]).map(|point| point.position_m);
        let here = place(open)?;
        let apart = |(names, _): &([String; 2], usize)| {
            place(names).map_or(f64::INFINITY, |at| (0..3).map(|n| (at[n] - here[n]).powi(2)).sum::<f64>())
        };
        let closed = of(&[1, 3], &[1, 3]);
        let (closed, closed_axis) =
            closed.into_iter().min_by(|one, other| apart(one).total_cmp(&apart(other)))?;
        let ldv_b = self.geometry.sensor.iter().any(|sensor| sensor.get_ref().name == "LDV_B");
        ldv_b.then(|| OpenJointCells { open: open.clone(), closed, axes: [*axis, closed_axis] })
    }

    /// Whether the joint is open in this cell.
    pub fn opens_joint(&self, cell: &Cell) -> bool {
        self.impact_is(&cell.impact, &[JOINT_OPEN])
    }

    /// Index of the axis along the sliding direction of a response that the 3-D vibrometer visits.
    fn sliding_axis(&self, response: &str) -> Option<usize> {
        let point = self.response(response).filter(|point| point.channels.is_none())?;
        let rows = self.to_interface();
        let along = |(_, axis): &(String, [f64; 3])| turned(&rows, *axis)[2].abs() > SAME_DIRECTION;
        point.axes().iter().position(along)
    }

    /// What is missing for the stiffness between the arms; empty if nothing is.
    pub fn between_arms_needs(&self) -> Vec<String> {
        let mut needs = Vec::new();
        for (configuration, groupings) in
            [(Configuration::A, &[1][..]), (Configuration::B, &[2]), (Configuration::Ajb, &[1, 2])]
        {
            for grouping in groupings {
                let seen = self.names(
                    configuration,
                    |block| &block.responses,
                    |name| self.response_is(name, &[*grouping]),
                );
                let hit = self.names(
                    configuration,
                    |block| &block.impacts,
                    |name| self.impact_is(name, &[*grouping]),
                );
                let arm = if *grouping == 1 { "A" } else { "B" };
                let name = configuration_name(configuration);
                if seen < BODY {
                    needs.push(format!("{BODY} response points of arm {arm} (grouping {grouping}) in {name}; there are {seen}"));
                }
                if hit < BODY {
                    needs.push(format!("{BODY} impact points of arm {arm} (grouping {grouping}) or more in {name}; there are {hit}"));
                }
            }
        }
        needs
    }

    fn blocks(&self, of: Configuration) -> impl Iterator<Item = &ConfigurationPlan> {
        self.configuration.iter().filter(move |block| configuration_named(block.name.get_ref()) == Some(of))
    }

    /// Number of distinct names in these lists of a configuration that satisfy `wanted`.
    fn names<'p>(
        &'p self,
        of: Configuration,
        list: impl Fn(&'p ConfigurationPlan) -> &'p Vec<Spanned<String>>,
        wanted: impl Fn(&str) -> bool,
    ) -> usize {
        let names = self.blocks(of).flat_map(list).map(|name| name.get_ref().as_str());
        names.filter(|name| wanted(name)).collect::<BTreeSet<&str>>().len()
    }

    /// Whether the responses of a block that belong to this grouping determine the motion of a
    /// rigid body.
    fn known(&self, block: &ConfigurationPlan, grouping: u8) -> bool {
        let points = block.responses.iter().filter_map(|name| self.response(name.get_ref()));
        let sensors = points
            .filter(|point| point.grouping == grouping)
            .flat_map(|point| point.axes().into_iter().map(|(_, direction)| (point.position_m, direction)));
        determines_motion(&sensors.collect::<Vec<_>>())
    }

    /// The impacts of a block on these groupings that push along z.
    fn hit_along_z<'p>(&self, block: &'p ConfigurationPlan, groupings: &[u8]) -> Vec<&'p str> {
        let along = |name: &str| {
            let mut points = self.geometry.impact.iter().map(Spanned::get_ref);
            points.any(|p| p.name == name && turned(&self.to_interface(), p.direction)[2].abs() > ALONG_Z)
        };
        let names = block.impacts.iter().map(|name| name.get_ref().as_str());
        names.filter(|name| along(name) && self.impact_is(name, groupings)).collect()
    }

    fn response_is(&self, name: &str, groupings: &[u8]) -> bool {
        let mut points = self.geometry.response.iter().map(Spanned::get_ref);
        points.any(|p| p.name == name && groupings.contains(&p.grouping))
    }

    fn impact_is(&self, name: &str, groupings: &[u8]) -> bool {
        let mut points = self.geometry.impact.iter().map(Spanned::get_ref);
        points.any(|p| p.name == name && groupings.contains(&p.grouping))
    }
}

#[cfg(test)]
mod tests {
    use crate::campaign::plan::{CONTACT, CONTACT_BY_HAND, FRF_ONLY, PAPER, PAPER_CONTACT, Plan, SMALL};

    #[test]
    fn the_plans_answer_what_they_were_made_for() {
        for (text, contact, between) in [
            (CONTACT, true, false),
            (CONTACT_BY_HAND, true, false),
            (FRF_ONLY, false, false),
            (PAPER, false, true),
            (PAPER_CONTACT, true, true),
            (SMALL, false, false),
        ] {
            let plan = Plan::parse(text, "plan").expect("a good plan");
            let told = (plan.contact_needs(), plan.between_arms_needs());
            assert_eq!((told.0.is_empty(), told.1.is_empty()), (contact, between), "{told:?}");
        }
        let paper = Plan::parse(PAPER, "paper.toml").expect("a good plan").contact_needs();
        assert!(paper[0].contains("specimen A (grouping 5)"), "{paper:?}");
        let blind = CONTACT.replace("name = \"LDV_A\"", "name = \"camera\"");
        let needs = Plan::parse(&blind, "plan").expect("a good plan").contact_needs();
        assert!(needs.len() == 1 && needs[0].contains("LDV_A"), "{needs:?}");
    }
}
