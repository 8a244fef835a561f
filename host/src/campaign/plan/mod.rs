//! The plan of a campaign: what is hit and measured, how often, and what counts as a good hit.
//!
//! A plan is a TOML file (`docs/plans/paper.toml` is the example). Unknown fields are refused, and every
//! error names file, line and field. Lengths are in m, forces in N, times in s unless a name says otherwise.

mod answers;
mod cells;
mod check;
mod faults;
mod geometry;
mod hammer;
pub mod level;
mod load_cells;
mod priors;
mod response_channels;
mod sense;
mod sensor;
mod structure;
mod sync;

pub use cells::{Cell, MOST_CELLS};
pub use geometry::{GeometryPlan, ImpactPoint, ResponsePoint, SensorPoint};
pub use hammer::{HammerPlan, Swung};
pub use priors::PriorsPlan;
pub use sensor::{CalibrationFile, SensorPlan};
pub use structure::{StructurePlan, turned};
pub use sync::{ClockSource, SyncPlan};

use crate::structure::Structure;
use jointrig_protocol::request::Configuration;
use serde::Deserialize;
use toml::Spanned;

/// The paper's campaign: 252 cells of 8 hits.
pub const PAPER: &str = include_str!("../../../../docs/plans/paper.toml");
/// All cells of the paper's campaign with those on the specimen, three good hits in each.
pub const DEMO: &str = include_str!("../../../../docs/plans/demo.toml");
/// What the contact's own stiffness needs, and no more: 63 cells of two hits.
pub const CONTACT: &str = include_str!("../../../../docs/plans/contact.toml");
/// The paper's campaign with the cells on the specimen: both stiffnesses.
pub const PAPER_CONTACT: &str = include_str!("../../../../docs/plans/paper-contact.toml");
/// A few cells.
pub const SMALL: &str = include_str!("../../../../docs/plans/small.toml");

/// What is wrong with a plan, and where.
#[derive(Debug, thiserror::Error)]
#[error(
    "{source_name}:{line}: {what} (docs/campaigns.md explains every field{})",
    if *more == 0 { String::new() } else { format!("; `jointrig plan check` tells {more} more") }
)]
pub struct PlanError {
    /// The file.
    pub source_name: String,
    /// Line in it, from 1.
    pub line: usize,
    /// What is wrong, with the field's name.
    pub what: String,
    /// How much else is wrong.
    pub more: usize,
}

/// What names must have.
const PRINTABLE: &str = "one printable character or more, and no others";

/// Whether a name shows as what it is, wherever it is printed.
fn printable(name: &str) -> bool {
    !name.trim().is_empty() && !name.chars().any(|c| c.is_control() || directs(c))
}

/// Characters that turn the direction of what stands after them.
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
    /// What the structures are called, and the sliding direction; A, B, AJB and z without it.
    pub structure: Option<Spanned<StructurePlan>>,
    /// How a record is cut.
    pub record: Spanned<RecordPlan>,
    /// How many hits.
    pub hits: Spanned<Hits>,
    /// Who swings the hammer; the device's coil, without it.
    pub hammer: Option<Spanned<HammerPlan>>,
    /// How hard.
    pub force: Spanned<Force>,
    /// How the device recognises a hit.
    pub trigger: Spanned<TriggerPlan>,
    /// Why a record is refused.
    pub limits: Spanned<Limits>,
    /// How long the hammer waits between hits.
    pub settle: Spanned<Settle>,
    /// How the FRFs are to be windowed.
    pub window: Spanned<Window>,
    /// When a cell's FRFs are good enough to stop before all wanted hits; never, without it.
    pub enough: Option<Spanned<Enough>>,
    /// In step with another recorder; by itself, without it.
    pub sync: Option<Spanned<SyncPlan>>,
    /// The shaker's levels before and after the campaign; none, without it.
    pub shaker: Option<Spanned<ShakerPlan>>,
    /// What is known of contact and static arm; without it, only what the records say.
    pub contact: Option<Spanned<ContactPlan>>,
    /// What the laboratory knows of its own errors; without it, what careful work by hand leaves.
    pub priors: Option<Spanned<PriorsPlan>>,
    /// What is behind the device's channels; those that are not named are taken as the device describes them.
    #[serde(default)]
    pub channel: Vec<Spanned<SensorPlan>>,
    /// The structures, in the order in which they are measured. Blocks of the same name add up.
    pub configuration: Vec<ConfigurationPlan>,
    /// Where everything is.
    pub geometry: GeometryPlan,
}

/// How a record is cut from the stream.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordPlan {
    /// Scans per second, Hz.
    pub rate_hz: u32,
    /// Length from the trigger on, s.
    pub length_s: f64,
    /// Scans before the trigger.
    pub pre_trigger_scans: u32,
}

/// How many hits a cell gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hits {
    /// Good ones wanted.
    pub wanted: u32,
    /// Good ones that are enough, if the attempts run out or the FRFs are good enough; below it a cell cannot be used.
    pub minimum: u32,
    /// Attempts after which a cell ends: settled with the minimum or more, given up with less.
    pub most: u32,
}

/// How hard the hammer hits.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// Peak force wanted, N.
    pub target_n: f64,
    /// Part of it that every second good hit of a cell is to have: hits of two forces tell whether the contact slips. Without it all are alike.
    pub softer: Option<f64>,
    /// Part of the target within which the pulse is left alone.
    pub tolerance: f64,
    /// First coil pulse, µs; a hammer by hand needs none.
    #[serde(default)]
    pub pulse_us: u32,
    /// Shortest and longest coil pulse to try, µs; a hammer by hand needs none.
    #[serde(default)]
    pub pulse_bounds_us: [u32; 2],
}

/// How the device recognises a hit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriggerPlan {
    /// Force that counts as contact, N.
    pub level_n: f32,
    /// How long the bolt may fly, s.
    pub flight_s: f64,
    /// How long rebounds are looked for, s.
    pub listen_s: f64,
    /// How long the hammer rests afterwards, s.
    pub hold_off_s: f64,
}

/// Why a record is refused.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// A weaker peak is refused, N.
    pub weak_n: f64,
    /// A stronger peak is refused, N.
    pub strong_n: f64,
    /// A later contact of this part of the peak is a double hit.
    pub rebound_ratio: f64,
    /// A later contact counts from this long after the first one on (start to start), s.
    pub rebound_after_s: f64,
    /// A record this many times noisier than the cell's others is refused.
    pub noise_ratio: f64,
}

/// How long the hammer waits between hits.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settle {
    /// Residual motion allowed, as a part of the motion right after the last hit.
    pub quiet_relative: f64,
    /// Residual velocity that is always allowed, m/s rms.
    pub quiet_floor_m_per_s: f64,
    /// Length of the windows in which the device judges residual motion, in its decimated samples.
    pub window_samples: u16,
    /// Longest wait, s.
    pub bound_s: f64,
}

/// How the FRFs are to be windowed; the analysis reads it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// Decay of the exponential window on force and response, 1/s.
    pub exponential_per_s: f64,
}

/// The shaker's levels: every frequency at every amplitude, measured before and after the hammer's cells so that wear shows.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShakerPlan {
    /// Frequencies, Hz.
    pub frequencies_hz: Vec<f64>,
    /// Amplitudes of the specimens' relative displacement, m.
    pub amplitudes_m: Vec<f64>,
}

impl ShakerPlan {
    /// How many levels there are, each time.
    pub fn levels(&self) -> usize {
        self.frequencies_hz.len() * self.amplitudes_m.len()
    }

    /// What is to be done about them, for whoever counts on them.
    pub fn remark(&self, file: &std::path::Path) -> String {
        format!(
            "the plan's {} levels of the shaker, before and after the cells: `jointrig shaker {} --device ADDR` measures them",
            self.levels(),
            crate::advice::quoted(file)
        )
    }
}

/// What is known of contact and static arm beforehand, from drawings or a balance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactPlan {
    /// The normal load, N.
    pub normal_load_n: Option<f64>,
    /// Stiffness to ground beside the load cells, over theirs.
    pub parallel_path: Option<f64>,
    /// Effective mass of the static arm at the contact, kg; identified where it is not given.
    pub effective_mass_kg: Option<f64>,
}

/// When a cell's FRFs are good enough.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enough {
    /// Random error of the averaged FRFs as a part of them; with `hits.minimum` good hits or more, less than this ends a cell.
    pub random_error: f64,
    /// The band that counts, Hz.
    pub band_hz: [f64; 2],
}

/// Cells of one structure: every impact is combined with every response.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConfigurationPlan {
    /// `A`, `B` or `AJB`, or what `[structure]` calls it.
    pub name: Spanned<String>,
    /// Names of impact points.
    pub impacts: Vec<Spanned<String>>,
    /// Names of response points.
    pub responses: Vec<Spanned<String>>,
}

/// What the controller calls a configuration, as the analysis calls it.
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

/// The configuration of that name.
pub fn configuration_named(name: &str) -> Option<Configuration> {
    structure::ALL.into_iter().find(|c| configuration_name(*c) == name)
}

impl Plan {
    /// Samples of a record from the trigger on.
    pub fn post_trigger_scans(&self) -> u64 {
        let record = self.record.get_ref();
        (record.length_s * f64::from(record.rate_hz)).round() as u64
    }
}

/// What toml says, with the line that it points at.
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

#[cfg(test)]
mod tests;
