//! The plan of a campaign: what is struck and measured, how often, in which order, and what counts
//! as a good hit.
//!
//! A plan is a TOML file (`docs/plans/paper.toml` is the example). It also states who swings the
//! hammer, the synchronisation with another recorder, and the laboratory's measurement errors
//! (`[priors]`). Unknown fields are refused, and every error names file, line and field. Lengths
//! are in m, forces in N, times in s unless a name states otherwise.

use crate::contact::{Bulk, ContactPriors};
use crate::structure::Structure;
use faults::Faults;
use jointrig_protocol::request::Configuration;
use jointrig_protocol::sync::Clock;
use serde::Deserialize;
use serde::de::IgnoredAny;
use toml::Spanned;

pub use check::{KnownMassCell, OpenJointCells};
pub use places::measured_again;
pub use sensor::{CalibrationFile, GeometryPlan, ImpactPoint, ResponsePoint, SensorPlan, SensorPoint};
pub use structure::{StructurePlan, turned};

mod check;
mod faults;
pub mod level;
mod places;
mod sensor;
mod structure;

/// The paper's campaign: 252 cells of 8 hits.
pub const PAPER: &str = include_str!("../../../../docs/plans/paper.toml");
/// All cells of the paper's campaign and those on the specimen, three good hits in each.
pub const DEMO: &str = include_str!("../../../../docs/plans/demo.toml");
/// The minimum for the contact's own stiffness: 60 cells of six hits.
pub const CONTACT: &str = include_str!("../../../../docs/plans/contact.toml");
/// The paper's campaign and the cells on the specimen: yields both stiffnesses.
pub const PAPER_CONTACT: &str = include_str!("../../../../docs/plans/paper-contact.toml");
/// The contact's own stiffness without lasers: a manual hammer and accelerometers.
pub const CONTACT_BY_HAND: &str = include_str!("../../../../docs/plans/contact-by-hand.toml");
/// FRFs of one structure with a manual hammer and fixed accelerometers.
pub const FRF_ONLY: &str = include_str!("../../../../docs/plans/frf-only.toml");
/// A plan of a few cells.
pub const SMALL: &str = include_str!("../../../../docs/plans/small.toml");

/// An error in a plan, with its place.
#[derive(Debug, thiserror::Error)]
#[error(
    "{source_name}:{line}: {what} (docs/campaigns.md explains every field{})",
    if *more == 0 { String::new() } else { format!("; `jointrig plan check` lists {more} more") }
)]
pub struct PlanError {
    /// The file.
    pub source_name: String,
    /// Line in the file, from 1.
    pub line: usize,
    /// The error, with the field's name.
    pub what: String,
    /// Number of further errors.
    pub more: usize,
}

/// What a valid name consists of.
const PRINTABLE: &str = "one printable character or more, and no others";

/// Whether a name is unambiguous when printed.
fn printable(name: &str) -> bool {
    !name.trim().is_empty() && !name.chars().any(|c| c.is_control() || directs(c))
}

/// Characters that change the writing direction of the text after them.
fn directs(c: char) -> bool {
    matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A checked plan.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the plan's format: 1.
    pub version: Spanned<u32>,
    /// Name of the plan.
    pub name: Spanned<String>,
    /// Names of the structures, and the sliding direction; A, B, AJB and z if absent.
    pub structure: Option<Spanned<StructurePlan>>,
    /// How a record is cut.
    pub record: Spanned<RecordPlan>,
    /// Number of hits.
    pub hits: Spanned<Hits>,
    /// Who swings the hammer; the device's coil if absent.
    pub hammer: Option<Spanned<HammerPlan>>,
    /// Force of the hits.
    pub force: Spanned<Force>,
    /// How the device detects a hit.
    pub trigger: Spanned<TriggerPlan>,
    /// Limits beyond which a record is refused.
    pub limits: Spanned<Limits>,
    /// How long the hammer waits between hits.
    pub settle: Spanned<Settle>,
    /// How the FRFs are windowed.
    pub window: Spanned<Window>,
    /// When a cell's FRFs are good enough to stop before all wanted hits; never if absent.
    pub enough: Option<Spanned<Enough>>,
    /// Synchronisation with another recorder; none if absent.
    pub sync: Option<Spanned<SyncPlan>>,
    /// The shaker's levels before and after the campaign; none if absent.
    pub shaker: Option<Spanned<ShakerPlan>>,
    /// A wear run; none if absent.
    pub wear: Option<Spanned<WearPlan>>,
    /// Prior knowledge of contact and static arm; if absent, only the records count.
    pub contact: Option<Spanned<ContactPlan>>,
    /// The specimens' bulk; what is absent follows from their points, or widens the interval.
    pub specimens: Option<Spanned<SpecimensPlan>>,
    /// The free body of known mass on which hammer and vibrometers are compared; none if absent.
    pub known_mass: Option<Spanned<KnownMassPlan>>,
    /// The laboratory's measurement errors; if absent, the usual values for careful manual work.
    pub priors: Option<Spanned<PriorsPlan>>,
    /// The sensors on the device's channels; channels that are not listed are taken as the device
    /// describes them.
    #[serde(default)]
    pub channel: Vec<Spanned<SensorPlan>>,
    /// The structures, in the order in which they are measured. Blocks of the same name are merged.
    pub configuration: Vec<ConfigurationPlan>,
    /// Positions and directions.
    pub geometry: GeometryPlan,
}

/// How a record is cut from the stream.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordPlan {
    /// Scans per second, Hz.
    pub rate_hz: u32,
    /// Length from the trigger onwards, s.
    pub length_s: f64,
    /// Scans before the trigger.
    pub pre_trigger_scans: u32,
}

/// Number of hits per cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hits {
    /// Good hits wanted.
    pub wanted: u32,
    /// Good hits that suffice if the attempts run out or the FRFs are good enough; with fewer, the
    /// cell cannot be used.
    pub minimum: u32,
    /// Attempts after which a cell ends: settled with at least the minimum, given up with fewer.
    pub most: u32,
}

/// Force of the hits.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// Peak force wanted, N.
    pub target_n: f64,
    /// Peak force of every second good hit of a cell, as a fraction of the target: hits of two
    /// forces show whether the contact slips. If absent, all hits have the target force.
    pub softer: Option<f64>,
    /// Relative deviation from the target within which the pulse is not changed.
    pub tolerance: f64,
    /// First coil pulse, µs; not needed if a person swings the hammer.
    #[serde(default)]
    pub pulse_us: u32,
    /// Shortest and longest coil pulse to try, µs; not needed if a person swings the hammer.
    #[serde(default)]
    pub pulse_bounds_us: [u32; 2],
}

/// How the device detects a hit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriggerPlan {
    /// Force that counts as contact, N.
    pub level_n: f32,
    /// Maximum flight time of the bolt, s.
    pub flight_s: f64,
    /// How long the force is monitored for rebounds, s.
    pub listen_s: f64,
    /// How long the hammer rests after a shot, s.
    pub hold_off_s: f64,
}

/// Limits beyond which a record is refused.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// A weaker peak is refused, N.
    pub weak_n: f64,
    /// A stronger peak is refused, N.
    pub strong_n: f64,
    /// A later contact of at least this fraction of the peak is a double hit.
    pub rebound_ratio: f64,
    /// A later contact counts from this long after the first one onwards (start to start), s.
    pub rebound_after_s: f64,
    /// A record is refused if it is this many times noisier than the cell's others.
    pub noise_ratio: f64,
}

/// How long the hammer waits between hits.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settle {
    /// Residual motion allowed, as a fraction of the motion right after the last hit.
    pub quiet_relative: f64,
    /// Residual velocity that is always allowed, m/s rms.
    pub quiet_floor_m_per_s: f64,
    /// Length of the windows in which the device evaluates residual motion, in its decimated
    /// samples.
    pub window_samples: u16,
    /// Longest wait, s.
    pub bound_s: f64,
}

/// How the FRFs are windowed; used by the analysis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// Decay of the exponential window on force and response, 1/s.
    pub exponential_per_s: f64,
}

/// The shaker's levels: every frequency at every amplitude, measured before and after the hammer's
/// cells so that wear shows.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShakerPlan {
    /// Frequencies, Hz.
    pub frequencies_hz: Vec<f64>,
    /// Amplitudes of the specimens' relative displacement, m.
    pub amplitudes_m: Vec<f64>,
}

impl ShakerPlan {
    /// Number of levels before the cells, and again after them.
    pub fn levels(&self) -> usize {
        self.frequencies_hz.len() * self.amplitudes_m.len()
    }

    /// Instruction for measuring them, for a user whose plan contains levels.
    pub fn remark(&self, file: &std::path::Path) -> String {
        format!(
            "the plan has {} shaker levels, before and after the cells: measure them with `jointrig shaker {} --device ADDR`",
            self.levels(),
            crate::advice::quoted(file)
        )
    }
}

/// A wear run: the shaker slides the contact for many cycles, each of which is reduced and stored.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WearPlan {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the specimens' relative displacement, m.
    pub amplitude_m: f64,
    /// Cycles of all wear runs of the file after which it ends.
    pub cycles: u64,
    /// Energy dissipated in all wear runs of the file after which it ends, J; no limit if absent.
    pub energy_j: Option<f64>,
    /// Smallest and largest coefficient of friction; it ends outside. No limit if absent.
    pub friction_coefficient: Option<[f64; 2]>,
    /// Largest amplitude of a cycle, m; it ends above. If absent, only the device's own limit of
    /// 1.5 times the ordered amplitude.
    pub largest_amplitude_m: Option<f64>,
    /// Largest temperature of the specimen, °C; it ends above. No limit if absent.
    pub temperature_c: Option<f64>,
    /// Channels whose sum is the normal load; `contact.normal_load_n` if there are none.
    #[serde(default)]
    pub normal_load: Vec<String>,
}

/// Prior knowledge of contact and static arm, from drawings or a balance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactPlan {
    /// The normal load, N.
    pub normal_load_n: Option<f64>,
    /// Stiffness to ground in parallel with the load cells, relative to theirs.
    pub parallel_path: Option<f64>,
    /// Effective mass of the static arm at the contact, kg; identified if absent.
    pub effective_mass_kg: Option<f64>,
}

/// The specimens as beams between contact and clamp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecimensPlan {
    /// Specimen A.
    pub a: Option<SpecimenPlan>,
    /// Specimen B.
    pub b: Option<SpecimenPlan>,
}

impl SpecimensPlan {
    /// Both, A first, with the names of their fields.
    pub fn both(&self) -> [(&'static str, Option<SpecimenPlan>); 2] {
        [("a", self.a), ("b", self.b)]
    }
}

/// A specimen as a beam along y of a rectangular section.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecimenPlan {
    /// Edges of its section along x and along the sliding direction z, m.
    pub section_m: [f64; 2],
    /// Distance from the contact to the clamp, m.
    pub clamp_m: f64,
    /// Young's modulus, Pa.
    pub young_pa: f64,
    /// Poisson's ratio; 0.3 if absent.
    pub poisson: Option<f64>,
    /// Relative standard deviation of its compliances; 0.2 if absent.
    pub uncertainty: Option<f64>,
}

impl SpecimenPlan {
    /// Its bulk as the analysis takes it.
    pub fn known(&self) -> Bulk {
        let poisson = self.poisson.unwrap_or(0.3);
        let uncertainty = self.uncertainty.unwrap_or(0.2);
        Bulk::beam(self.section_m, self.young_pa, poisson, self.clamp_m, uncertainty)
    }
}

/// When a cell's FRFs are good enough.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enough {
    /// Relative random error of the averaged FRFs below which a cell ends, once it has at least
    /// `hits.minimum` good hits.
    pub random_error: f64,
    /// The band in which the error is evaluated, Hz.
    pub band_hz: [f64; 2],
}

/// Cells of one structure: every impact is combined with every response.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConfigurationPlan {
    /// `A`, `B` or `AJB`, or the name that `[structure]` gives it.
    pub name: Spanned<String>,
    /// Names of impact points.
    pub impacts: Vec<Spanned<String>>,
    /// Names of response points.
    pub responses: Vec<Spanned<String>>,
}

/// The analysis' structure for the controller's configuration.
pub fn structure(configuration: Configuration) -> Structure {
    match configuration {
        Configuration::A => Structure::A,
        Configuration::B => Structure::B,
        Configuration::Ajb => Structure::Ajb,
    }
}

/// The name of a configuration in plans, files and reports.
pub fn configuration_name(configuration: Configuration) -> &'static str {
    structure(configuration).name()
}

/// The configuration with that name.
pub fn configuration_named(name: &str) -> Option<Configuration> {
    structure::ALL.into_iter().find(|c| configuration_name(*c) == name)
}

impl Plan {
    /// What the plan states of the bulk of specimens A and B.
    pub fn known_specimens(&self) -> [Option<Bulk>; 2] {
        let stated = self.specimens.as_ref().map_or_else(SpecimensPlan::default, |own| *own.get_ref());
        stated.both().map(|(_, own)| own.as_ref().map(SpecimenPlan::known))
    }

    /// Samples of a record from the trigger onwards.
    pub fn post_trigger_scans(&self) -> u64 {
        let record = self.record.get_ref();
        (record.length_s * f64::from(record.rate_hz)).round() as u64
    }
}

/// The parser's message, with the line that it refers to.
fn field(text: &str, wrong: &toml::de::Error) -> String {
    let said = wrong.message().to_owned();
    let line = wrong.span().and_then(|span| {
        let from = text.get(..span.start)?.rfind('\n').map_or(0, |end| end + 1);
        Some(text.get(from..)?.lines().next()?.trim())
    });
    match line {
        Some(line) if !line.is_empty() && !said.contains(line) => format!("{said} (at `{line}`)"),
        _ => said,
    }
}

/// Synchronisation with another recorder; if absent, the device's own clock times the scans, and no
/// edges are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SyncPlan {
    /// The clock that times the scans.
    pub clock: ClockSource,
}

/// The clock that times the scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClockSource {
    /// The device's own crystal.
    Internal,
    /// The device's clock input, one edge per scan at `record.rate_hz`.
    External,
}

impl Plan {
    /// The clock to select; `None` if the plan does not specify one.
    pub fn clock(&self) -> Option<Clock> {
        self.sync.as_ref().map(Spanned::get_ref).map(|own| match own.clock {
            ClockSource::Internal => Clock::Internal,
            ClockSource::External => Clock::External { rate_hz: self.record.get_ref().rate_hz },
        })
    }
}

/// Default waiting time for a person to strike, s.
const PATIENCE_S: f64 = 600.0;
/// Longest permitted waiting time for a person to strike, s: a day.
const LONGEST_S: f64 = 86_400.0;

/// The hammer; if absent, the device's coil swings it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HammerPlan {
    /// Who swings it.
    pub by: Swung,
    /// How long to wait for a person to strike, s; ten minutes if absent.
    pub patience_s: Option<f64>,
}

/// Who swings the hammer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Swung {
    /// The device's coil, commanded by the host.
    Coil,
    /// A person: the host waits for the force.
    Hand,
}

impl Plan {
    /// How long to wait for a person to strike, s; `None` if the coil swings the hammer.
    pub fn by_hand(&self) -> Option<f64> {
        let own = self.hammer.as_ref().map(Spanned::get_ref).filter(|own| own.by == Swung::Hand)?;
        Some(own.patience_s.unwrap_or(PATIENCE_S))
    }

    fn check_hammer(&self, faults: &mut Faults) {
        let Some(own) = &self.hammer else { return };
        let at = own.span().start;
        faults.unless(
            own.get_ref().patience_s.is_none_or(|patience_s| (1.0..=LONGEST_S).contains(&patience_s)),
            at,
            format!("hammer.patience_s must be 1 to {LONGEST_S}"),
        );
        faults.unless(
            self.by_hand().is_none() || self.force.get_ref().softer.is_none(),
            at,
            "force.softer needs the coil: a hand-held hammer cannot hit with a chosen force (hammer.by)",
        );
    }
}

/// A free body of known mass, struck along the sliding direction while B alone is measured: the
/// points of grouping 7 are on it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownMassPlan {
    /// Its mass, kg.
    pub mass_kg: f64,
    /// Relative standard deviation of the comparison from the mass, and from hits and vibrometers
    /// beside its centre of gravity; 0.002 if absent.
    pub sigma: Option<f64>,
}

impl KnownMassPlan {
    /// Relative standard deviation of the comparison: the stated one, or the usual one.
    pub fn sigma(&self) -> f64 {
        self.sigma.unwrap_or(KNOWN_MASS_SIGMA)
    }
}

/// Relative standard deviation of a comparison on a known mass: a cube of 3 kg that is struck and
/// seen within 1 mm of its middle.
const KNOWN_MASS_SIGMA: f64 = 0.002;

/// Grouping of the points on the known mass: they are part of no structure.
pub const ON_KNOWN_MASS: u8 = 7;

/// Grouping of the points of side A that are used while the joint is open.
pub const JOINT_OPEN: u8 = 8;

/// The groupings of points that are on none of the structures A, B and AJB as they are analysed.
pub const SEPARATE: [u8; 2] = [ON_KNOWN_MASS, JOINT_OPEN];

/// Standard deviations; values that are absent default to those of careful manual work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorsPlan {
    /// Points and impacts on the arms, m along each axis.
    pub position_m: Option<f64>,
    /// Added at each aim of hammer and vibrometer, m along each axis.
    pub aim_m: Option<f64>,
    /// The hammer's tilt about each axis across its direction, rad.
    pub hammer_angle_rad: Option<f64>,
    /// The spots next to the contact, m along each axis.
    pub spot_m: Option<f64>,
    /// The contact's centre across the sliding direction, m along x.
    pub contact_across_m: Option<f64>,
    /// The height of the contact's faces, m along y.
    pub contact_height_m: Option<f64>,
    /// Points on the specimens, m along each axis.
    pub specimen_point_m: Option<f64>,
    /// Gains of the vibrometers, relative.
    pub gain: Option<f64>,
    /// Gain of the hammer's force cell, relative.
    pub hammer_gain: Option<f64>,
    /// Delays in addition to those that the device reports, s.
    pub skew_s: Option<f64>,
    /// Sensitivity of each axis of a fixed sensor to motion across it, relative: the tilt of its
    /// mounting in rad, and its own.
    pub transverse: Option<f64>,
}

impl PriorsPlan {
    /// The priors: the stated values, defaults for the others.
    pub fn known(&self) -> ContactPriors {
        let mut known = ContactPriors::default();
        for (stated, at) in [
            (self.position_m, &mut known.positions.position_m),
            (self.aim_m, &mut known.positions.aim_m),
            (self.hammer_angle_rad, &mut known.positions.hammer_angle_rad),
            (self.spot_m, &mut known.spot_m),
            (self.contact_across_m, &mut known.contact_across_m),
            (self.contact_height_m, &mut known.contact_height_m),
            (self.specimen_point_m, &mut known.specimen_point_m),
            (self.gain, &mut known.gain),
            (self.hammer_gain, &mut known.hammer_gain),
            (self.skew_s, &mut known.skew_s),
            (self.transverse, &mut known.transverse),
        ] {
            if let Some(stated) = stated {
                *at = stated;
            }
        }
        known
    }

    /// The stated values, by name.
    pub fn stated(&self) -> [(&'static str, Option<f64>); 11] {
        [
            ("position_m", self.position_m),
            ("aim_m", self.aim_m),
            ("hammer_angle_rad", self.hammer_angle_rad),
            ("spot_m", self.spot_m),
            ("contact_across_m", self.contact_across_m),
            ("contact_height_m", self.contact_height_m),
            ("specimen_point_m", self.specimen_point_m),
            ("gain", self.gain),
            ("hammer_gain", self.hammer_gain),
            ("skew_s", self.skew_s),
            ("transverse", self.transverse),
        ]
    }
}

/// Maximum number of cells in a plan; the paper's campaign has 252, and a cell takes minutes.
pub const MOST_CELLS: usize = 20_000;

/// Position in the text where a plan exceeds [`MOST_CELLS`], and the error message. Every impact of
/// a configuration forms a cell with every response, so two long lists soon exceed any memory. This
/// is therefore checked before anything else.
fn too_many(text: &str) -> Option<(usize, String)> {
    #[derive(Deserialize)]
    struct Lists {
        #[serde(default)]
        configuration: Vec<Spanned<List>>,
    }
    #[derive(Deserialize)]
    struct List {
        #[serde(default)]
        impacts: Vec<IgnoredAny>,
        #[serde(default)]
        responses: Vec<IgnoredAny>,
    }
    // other errors are reported when the text is parsed as a plan
    let lists: Lists = toml::from_str(text).ok()?;
    let mut cells = 0usize;
    lists.configuration.iter().find_map(|list| {
        let (impacts, responses) = (list.get_ref().impacts.len(), list.get_ref().responses.len());
        cells = cells.saturating_add(impacts.saturating_mul(responses));
        let what = || {
            format!(
                "configuration: {impacts} impacts with {responses} responses each make more than {MOST_CELLS} cells: leave points out, or make \
                 several campaigns"
            )
        };
        (cells > MOST_CELLS).then(|| (list.span().start, what()))
    })
}

/// One impact position with one response location, in one structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The configuration.
    pub configuration: Configuration,
    /// Name of the impact point.
    pub impact: String,
    /// Name of the response point.
    pub response: String,
    /// Number of good hits wanted.
    pub wanted: u32,
}

impl Plan {
    /// The cells in the order that moves hammer and laser least: the hammer goes to each impact
    /// once, and the laser goes through the responses back and forth (boustrophedon). Responses
    /// that further blocks of a configuration add at an impact come before the last response of its
    /// first block, because the next impact starts at that last response.
    pub fn cells(&self) -> Vec<Cell> {
        let mut names: Vec<&str> = Vec::new();
        for block in &self.configuration {
            if !names.contains(&block.name.get_ref().as_str()) {
                names.push(block.name.get_ref());
            }
        }
        let mut cells = Vec::new();
        for name in names {
            let Some(configuration) = configuration_named(name) else { continue };
            let blocks = || self.configuration.iter().filter(|block| block.name.get_ref() == name);
            let mut impacts: Vec<&str> = Vec::new();
            for impact in blocks().flat_map(|block| &block.impacts).map(Spanned::get_ref) {
                if !impacts.contains(&impact.as_str()) {
                    impacts.push(impact);
                }
            }
            for (place, impact) in impacts.into_iter().enumerate() {
                let here = blocks().filter(|block| block.impacts.iter().any(|own| own.get_ref() == impact));
                for response in there_and_back(here, place) {
                    cells.push(Cell {
                        configuration,
                        impact: impact.to_owned(),
                        response: response.to_owned(),
                        wanted: self.hits.get_ref().wanted,
                    });
                }
            }
        }
        cells
    }
}

/// The responses of the blocks that contain the impact with this index, in the order in which the
/// laser visits them.
fn there_and_back<'p>(blocks: impl Iterator<Item = &'p ConfigurationPlan>, place: usize) -> Vec<&'p str> {
    let mut of_blocks = blocks.map(|block| {
        let mut names: Vec<&str> = block.responses.iter().map(|name| name.get_ref().as_str()).collect();
        if place % 2 == 1 {
            names.reverse();
        }
        names
    });
    let mut all = of_blocks.next().unwrap_or_default();
    let last = all.pop();
    all.extend(of_blocks.flatten());
    all.extend(last);
    all
}

#[cfg(test)]
mod tests;
