//! A figure as a description of its content, independent of how it is drawn. Renderers turn it into
//! SVG, CSV, PNG and the page's live charts.
//!
//! It contains neither pixels nor colours: a [`Role`] states what a mark represents, and only
//! [`role`] defines its appearance. Curves are stored as 32-bit numbers, which hold the six
//! significant digits of the curves of `results.json` exactly.
//!
//! Positions in space: where hammer and vibrometer are placed on the two arms.
//!
//! Trims curves to what their panel can show, since nothing beyond the full range of an axis is
//! visible.

use serde::Serialize;

pub use mark::{Along, Bars, Drawn, How, Mark, Marker, Origin, Packed, Second, Shape, six_digits};
pub use role::Role;
pub use role::{Axis, Spread};

mod mark;
pub mod role;

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Its name, used for its files and its anchor in the page; lower-case letters, digits,
    /// hyphens.
    pub name: &'static str,
    /// The figure of the paper that it corresponds to.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub number: &'static str,
    /// Its title.
    pub title: String,
    /// What it shows, in one or two sentences.
    pub say: String,
    /// Source of its data.
    pub from: Source,
    /// Number of panels side by side; fewer on a narrow page.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// Source of a figure's data.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Source {
    /// Ids of the records, as closed ranges; empty if it includes all of the campaign's records.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub records: Vec<[i64; 2]>,
    /// The campaign file.
    pub file: String,
    /// Whether the rig was simulated.
    pub simulated: bool,
    /// The program's version.
    pub version: String,
}

/// Height of a panel relative to the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Height {
    /// For detailed reading.
    Tall,
    /// The default.
    #[default]
    Usual,
    /// For a panel that accompanies the one above.
    Low,
    /// Equal to the width.
    Square,
    /// Determined by the number of names on the vertical axis.
    Rows,
}

/// One plot of a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Panel {
    /// Title of this panel, if the figure has several.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// Whether its names are listed in the legend of a panel above it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub named_above: bool,
    /// Height.
    pub height: Height,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The marks, in drawing order: the first at the bottom.
    pub marks: Vec<Mark>,
}

impl Panel {
    /// An empty panel.
    pub fn new(x: Axis, y: Axis) -> Self {
        Panel { title: String::new(), named_above: false, height: Height::Usual, x, y, marks: Vec::new() }
    }

    /// The same panel with this title.
    #[must_use]
    pub fn titled(self, title: impl Into<String>) -> Self {
        Panel { title: title.into(), ..self }
    }

    /// The same panel with this height.
    #[must_use]
    pub fn high(self, height: Height) -> Self {
        Panel { height, ..self }
    }

    /// The same panel, with its names listed in the legend of a panel above it.
    #[must_use]
    pub fn named_above(self) -> Self {
        Panel { named_above: true, ..self }
    }

    /// The same panel with one more mark.
    #[must_use]
    pub fn with(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// The same panel with more marks.
    #[must_use]
    pub fn with_all(mut self, marks: impl IntoIterator<Item = Mark>) -> Self {
        self.marks.extend(marks);
        self
    }

    /// Names and appearance of its legend entries, without duplicates, in drawing order.
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
    /// An empty figure of results from `from`.
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

    /// The same figure with this many panels side by side.
    #[must_use]
    pub fn across(self, columns: usize) -> Self {
        Figure { columns, ..self }
    }

    /// The same figure with one more panel.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The same figure, marked as made from these records.
    #[must_use]
    pub fn of_records(mut self, records: Vec<[i64; 2]>) -> Self {
        self.from.records = records;
        self
    }

    /// Its title with the number of the paper's figure.
    pub fn heading(&self) -> String {
        if self.number.is_empty() {
            self.title.clone()
        } else {
            format!("{} (Fig. {} of the paper)", self.title, self.number)
        }
    }
}

/// Contents of a scene. Lengths in m; x lateral, y vertical, z horizontal along the sliding
/// direction.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Scene {
    /// Boxes that outline the bodies.
    pub bodies: Vec<Body>,
    /// Positions.
    pub spots: Vec<Spot>,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Body {
    /// What it represents.
    pub role: Role,
    /// One corner, m.
    pub low: [f64; 3],
    /// The opposite corner, m.
    pub high: [f64; 3],
}

/// A position.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spot {
    /// Its name.
    pub name: String,
    /// What it represents.
    pub role: Role,
    /// The position, m.
    pub at: [f64; 3],
    /// The hammer's direction; absent for a response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toward: Option<[f64; 3]>,
    /// How far the point moves in a mode, enlarged, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves: Option<[f64; 3]>,
}

impl Panel {
    /// Removes the points of curves that lie beyond the horizontal axis; one point on each side is
    /// kept, so that lines extend to the frame.
    pub fn trim(&mut self) {
        let range = self.x.range;
        for mark in &mut self.marks {
            mark.trim(range);
        }
    }
}

impl Mark {
    fn trim(&mut self, [low, high]: [f64; 2]) {
        let cut = |x: &mut Along, lists: [Option<&mut Packed>; 2]| {
            let inside = |i: &usize| (low..=high).contains(&x.at(*i));
            let (first, last) = ((0..x.len()).find(inside), (0..x.len()).rfind(inside));
            let Some((first, last)) = first.zip(last) else { return };
            let (from, to) = (first.saturating_sub(1), (last + 2).min(x.len()));
            for list in lists.into_iter().flatten() {
                let end = to.min(list.0.len());
                list.0 = list.0[from.min(end)..end].to_vec();
            }
            match x {
                Along::Regular { first, step, count } => {
                    (*first, *count) = (*first + *step * from as f64, to - from);
                }
                Along::List(values) => values.0 = values.0[from..to].to_vec(),
            }
        };
        match &mut self.shape {
            Shape::Line { x, y } => cut(x, [Some(y), None]),
            Shape::Ribbon { x, low, high } => cut(x, [Some(low), Some(high)]),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::{Axis, Role};

    #[test]
    fn what_is_beyond_the_axis_is_left_out() {
        let along = Along::Regular { first: 10.0, step: 0.5, count: 100 };
        let line = Mark::line(Role::Measured, along, (0..100).map(f64::from));
        let axis = |range| Axis::linear("f", "Hz", range);
        let mut panel = Panel::new(axis([20.0, 30.0]), axis([0.0, 1.0])).with(line.clone());
        panel.trim();
        let Shape::Line { x, y } = &panel.marks[0].shape else { panic!("a line") };
        assert_eq!((x.at(0), x.len(), y.0[0], y.0.len()), (19.5, 23, 19.0, 23));
        let mut whole = Panel::new(axis([0.0, 100.0]), axis([0.0, 1.0])).with(line.clone());
        whole.trim();
        assert_eq!(whole.marks[0], line);
    }
}
