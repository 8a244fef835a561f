//! A figure as a description: what is shown, never how. Renderers make SVG, CSV, PNG and the page's live charts of it.
//!
//! There are no pixels and no colours here: a [`Role`] says what a mark stands for, and [`role`] alone says how that looks.
//! Curves are kept as 32-bit numbers, which hold the six significant digits of the curves of `results.json` exactly.

mod axis;
mod mark;
mod origin;
mod packed;
pub mod role;
mod scene;
mod trim;

pub use axis::{Axis, Spread};
pub use mark::{Along, Bars, Drawn, Mark, Marker, Shape};
pub use origin::{How, Origin, Second};
pub use packed::{Packed, six_digits};
pub use role::Role;
pub use scene::{Body, Scene, Spot};

use serde::Serialize;

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Its name: of its files and of its place in the page; small letters, digits, hyphens.
    pub name: &'static str,
    /// The figure of the paper that it corresponds to.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub number: &'static str,
    /// What it is called.
    pub title: String,
    /// What to see in it.
    pub say: String,
    /// What it was made from.
    pub from: Source,
    /// Panels side by side; fewer where there is no room.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// What a figure was made from.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Source {
    /// Ids of the records, as closed ranges; empty where all of the campaign's are in it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub records: Vec<[i64; 2]>,
    /// The campaign file.
    pub file: String,
    /// Whether the rig was simulated.
    pub simulated: bool,
    /// The program's version.
    pub version: String,
}

/// How high a panel is beside the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Height {
    /// For what is read closely.
    Tall,
    /// As most are.
    #[default]
    Usual,
    /// For what runs along beneath another panel.
    Low,
    /// As wide as high.
    Square,
    /// By the rows of a list of names on the upright axis.
    Rows,
}

/// One plot of a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Panel {
    /// What this panel shows, where the figure has several.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// Whether its names stand in the legend of a panel above it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub named_above: bool,
    /// How high it is.
    pub height: Height,
    /// The horizontal axis.
    pub x: Axis,
    /// The upright axis.
    pub y: Axis,
    /// What is drawn, the first at the bottom.
    pub marks: Vec<Mark>,
}

impl Panel {
    /// An empty panel.
    pub fn new(x: Axis, y: Axis) -> Self {
        Panel { title: String::new(), named_above: false, height: Height::Usual, x, y, marks: Vec::new() }
    }

    /// The same with this title.
    #[must_use]
    pub fn titled(self, title: impl Into<String>) -> Self {
        Panel { title: title.into(), ..self }
    }

    /// The same, this high.
    #[must_use]
    pub fn high(self, height: Height) -> Self {
        Panel { height, ..self }
    }

    /// The same, whose names stand in the legend of a panel above it.
    #[must_use]
    pub fn named_above(self) -> Self {
        Panel { named_above: true, ..self }
    }

    /// The same with one more mark.
    #[must_use]
    pub fn with(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// The same with more marks.
    #[must_use]
    pub fn with_all(mut self, marks: impl IntoIterator<Item = Mark>) -> Self {
        self.marks.extend(marks);
        self
    }

    /// Names and looks for its legend, each once, in the order drawn.
    pub fn legend(&self) -> Vec<(&str, Role, Drawn)> {
        let mut entries: Vec<(&str, Role, Drawn)> = Vec::new();
        for mark in self.marks.iter().filter(|mark| !mark.name.is_empty() && !self.named_above) {
            if !entries.iter().any(|(name, role, _)| *name == mark.name && *role == mark.role) {
                entries.push((&mark.name, mark.role, mark.shape.drawn()));
            }
        }
        entries
    }
}

impl Figure {
    /// An empty figure about results from `from`.
    pub fn new(
        name: &'static str,
        number: &'static str,
        title: impl Into<String>,
        say: impl Into<String>,
    ) -> Self {
        Figure {
            name,
            number,
            title: title.into(),
            say: say.into(),
            from: Source::default(),
            columns: 1,
            panels: Vec::new(),
        }
    }

    /// The same with this many panels side by side.
    #[must_use]
    pub fn across(self, columns: usize) -> Self {
        Figure { columns, ..self }
    }

    /// The same with one more panel.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The same, made from these records.
    #[must_use]
    pub fn of_records(mut self, records: Vec<[i64; 2]>) -> Self {
        self.from.records = records;
        self
    }

    /// Its name with the number of the paper's figure.
    pub fn heading(&self) -> String {
        if self.number.is_empty() {
            self.title.clone()
        } else {
            format!("{} (Fig. {} of the paper)", self.title, self.number)
        }
    }
}
