//! The figures, one file each. Each takes the results and returns a description, or `None` if the
//! results lack the data.
//!
//! A new figure needs one file and one line of [`ALL`].

mod answer;
mod backbone;
mod band_means;
mod budget;
mod cells;
mod comparison;
mod consistency;
mod contact_loop;
mod held_out;
mod joint_spectrum;
mod levels;
mod modes;
mod noise_floor;
mod receptances;
mod shaker_loops;
mod specimens;
mod wear;

pub use cells::geometry;
pub use receptances::frf_matrix;
pub use wear::wear;

use super::figure::{Figure, Panel, Source};
use crate::results::Results;

/// A chapter of the report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chapter {
    /// The first screen.
    Answer,
    /// Comparison of all methods.
    SideBySide,
    /// The joint by substructuring.
    Joint,
    /// The contact by loops.
    Loops,
    /// What was measured: positions, number and quality of the hits.
    Measured,
    /// Natural frequencies, damping and shapes.
    Modes,
    /// Frequency response functions.
    Frfs,
}

/// A figure of the report.
#[derive(Clone, Copy)]
pub struct Entry {
    /// Chapter in which it appears.
    pub chapter: Chapter,
    /// Title shown if it cannot be drawn.
    pub title: &'static str,
    /// Data that it needs.
    pub needs: &'static str,
    /// Function that makes it.
    pub make: fn(&Results) -> Option<Figure>,
}

const fn entry(
    chapter: Chapter,
    title: &'static str,
    needs: &'static str,
    make: fn(&Results) -> Option<Figure>,
) -> Entry {
    Entry { chapter, title, needs, make }
}

const IMPACTS: &str = "hits on the assembly with both vibrometers and the load cells";
const LEVELS: &str = "levels of the shaker, measured by `jointrig shaker`";
const CAMPAIGN: &str = "a campaign's own records";
const ALL_THREE: &str = "FRFs of A, B and the assembly";

/// All figures, in the order of the report.
pub const ALL: &[Entry] = &[
    entry(Chapter::Answer, "The answer", "an identified stiffness", answer::answer),
    entry(Chapter::SideBySide, "Every method side by side", ALL_THREE, comparison::comparison),
    entry(Chapter::SideBySide, "What makes the interval of k_T", "an identified k_T", budget::budget),
    entry(
        Chapter::SideBySide,
        "Cells predicted from the others",
        "a fit of the contact with points on specimen A",
        held_out::held_out,
    ),
    entry(Chapter::Measured, "Where hammer and vibrometer went", CAMPAIGN, cells::of_results),
    entry(Chapter::Measured, "Every cell", CAMPAIGN, cells::cells),
    entry(Chapter::Measured, "Coherence of every cell", "two hits or more in a cell", noise_floor::coherence),
    entry(Chapter::Measured, "Random error by cell", "two hits or more in a cell", noise_floor::random_error),
    entry(Chapter::Measured, "The hammer over the campaign", CAMPAIGN, noise_floor::pulses),
    entry(Chapter::Measured, "The usable band", CAMPAIGN, noise_floor::usable_bands),
    entry(Chapter::Joint, "Joint stiffness over frequency", ALL_THREE, joint_spectrum::joint_spectrum),
    entry(Chapter::Joint, "What coupling adds", ALL_THREE, consistency::interface_modes),
    entry(Chapter::Joint, "Which motions couple", ALL_THREE, consistency::participation),
    entry(Chapter::Joint, "Means over two bands", ALL_THREE, band_means::band_means),
    entry(Chapter::Joint, "Consistency of the virtual points", ALL_THREE, consistency::consistency),
    entry(Chapter::Loops, "A loop and its parts", LEVELS, contact_loop::loop_parts),
    entry(Chapter::Loops, "One impact at the contact", IMPACTS, contact_loop::contact_loop),
    entry(Chapter::Loops, "The first, third and fourth cycle", IMPACTS, contact_loop::decay_loops),
    entry(Chapter::Loops, "The slope of every impact", IMPACTS, cells::impacts),
    entry(Chapter::Loops, "The shaker's levels", LEVELS, levels::levels),
    entry(Chapter::Loops, "Loops of the shaker", LEVELS, shaker_loops::shaker_loops),
    entry(
        Chapter::Loops,
        "The contact against amplitude",
        "levels of the shaker at which the contact slips",
        backbone::backbone,
    ),
    entry(Chapter::Loops, "The wear run along its cycles", "a run of `jointrig wear`", wear::of_results),
    entry(Chapter::Loops, "FRFs at the contact", IMPACTS, specimens::specimens),
    entry(
        Chapter::Loops,
        "The decay put together from two sinusoids",
        "hits on the assembly in which a resonance of one specimen hides",
        contact_loop::rebuilt,
    ),
    entry(Chapter::Modes, "Stabilisation chart", "FRFs of several lines", modes::stabilisation),
    entry(Chapter::Modes, "Shapes of the modes", "modes at points whose positions are known", modes::shapes),
    entry(Chapter::Modes, "The first mode over the campaign", IMPACTS, modes::first_mode),
    entry(Chapter::Frfs, "Receptances", "records of hits, or imported FRFs", receptances::receptances),
    entry(
        Chapter::Frfs,
        "Noise floor and dynamic stiffness",
        "two hits or more in a cell of the assembly",
        noise_floor::noise_floor,
    ),
];

impl Entry {
    /// The figure of these results, with the source of its data.
    pub fn of(&self, results: &Results) -> Option<Figure> {
        let mut figure = (self.make)(results)?;
        figure.panels.iter_mut().for_each(Panel::trim);
        let source = &results.source;
        figure.from = Source {
            records: figure.from.records,
            file: source.file.clone(),
            simulated: source.simulated,
            version: source.software.version.clone(),
        };
        Some(figure)
    }
}

/// All figures for which these results have the data.
pub fn all(results: &Results) -> Vec<Figure> {
    ALL.iter().filter_map(|entry| entry.of(results)).collect()
}

/// Converts m to µm; N/m are divided by it to give N/µm.
const MICRO: f64 = 1e6;

/// Vertical position of the marker of row `i` on an axis of rows: below its name.
fn below_name(i: usize) -> f64 {
    i as f64 + 0.26
}
