//! The cells of a plan, and the order in which they are measured.

use super::{ConfigurationPlan, Plan, configuration_named};
use jointrig_protocol::request::Configuration;
use serde::Deserialize;
use serde::de::IgnoredAny;
use toml::Spanned;

/// Maximum number of cells in a plan; the paper's campaign has 252, and a cell takes minutes.
pub const MOST_CELLS: usize = 20_000;

/// Position in the text where a plan exceeds [`MOST_CELLS`], and the error message. Every impact of
/// a configuration forms a cell with every response, so two long lists soon exceed any memory. This
/// is therefore checked before anything else.
pub(super) fn too_many(text: &str) -> Option<(usize, String)> {
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
