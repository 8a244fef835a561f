//! The contents of a panel: curves, points, bands, words.
//!
//! A mark states in words what it is, its numbers, and where they are in `results.json`
//! ([`Origin`]). The numbers of curves are written as compact text ([`Packed`]): `f32:` and base64
//! of 32-bit floats, little endian.

use super::Scene;
use super::role::Role;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::{Serialize, Serializer};

/// One mark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mark {
    /// Its shape and values.
    #[serde(flatten)]
    pub shape: Shape,
    /// What it represents.
    pub role: Role,
    /// Its name in the legend; a mark without a name is not listed there.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Where its numbers are in `results.json`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub origin: Vec<Origin>,
}

/// Positions of a curve's points along the horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Along {
    /// At a constant step.
    Regular {
        /// The first position.
        first: f64,
        /// The step.
        step: f64,
        /// Number of points.
        count: usize,
    },
    /// At arbitrary positions.
    List(Packed),
}

impl Along {
    /// Position of point `i`.
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Along::Regular { first, step, .. } => first + step * i as f64,
            Along::List(values) => values.0.get(i).copied().map_or(f64::NAN, f64::from),
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Along::Regular { count, .. } => *count,
            Along::List(values) => values.0.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Equidistant values become regular steps, others a list.
    pub fn of(values: &[f64]) -> Self {
        if let [first, second, ..] = values {
            let step = second - first;
            let even = values
                .iter()
                .enumerate()
                .all(|(i, v)| (v - first - step * i as f64).abs() < 1e-6 * step.abs());
            if even && step != 0.0 {
                return Along::Regular { first: *first, step, count: values.len() };
            }
        }
        Along::List(Packed::of(values.iter().copied()))
    }
}

/// Ends of the error bars of points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bars {
    /// `x` or `y`: the axis along which they are drawn.
    pub along: &'static str,
    /// Their lower ends.
    pub low: Packed,
    /// Their upper ends.
    pub high: Packed,
}

/// The marker of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Marker {
    /// A filled dot.
    #[default]
    Dot,
    /// A ring.
    Ring,
    /// A filled square.
    Square,
    /// An empty square.
    Frame,
    /// A vertical stroke.
    Stroke,
    /// A diagonal cross: not to be believed.
    Cross,
}

/// How a mark is drawn in a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drawn {
    /// As a line.
    Line,
    /// As points.
    Points(Marker),
    /// As an area.
    Area,
}

/// A mark's shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// A curve; `y` breaks where it is NaN.
    Line {
        /// Positions of its points.
        x: Along,
        /// Its values.
        y: Packed,
    },
    /// The area between two curves.
    Ribbon {
        /// Positions of the points.
        x: Along,
        /// The lower curve.
        low: Packed,
        /// The upper curve.
        high: Packed,
    },
    /// Single points, with or without error bars.
    Points {
        /// Their positions.
        x: Packed,
        /// Their values.
        y: Packed,
        /// Their error bars.
        #[serde(skip_serializing_if = "Option::is_none")]
        bars: Option<Bars>,
        /// Horizontal offset at which they are drawn, px, so that points at the same place are
        /// visible side by side.
        #[serde(skip_serializing_if = "is_zero")]
        aside: f64,
        /// Their marker.
        marker: Marker,
        /// Tooltip of each point.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        says: Vec<String>,
    },
    /// A curve whose x is not monotonic.
    Loop {
        /// Horizontal values.
        x: Packed,
        /// Vertical values.
        y: Packed,
    },
    /// A horizontal line at `at` on the vertical axis, between two positions on the horizontal axis
    /// (over all of it if absent).
    Level {
        /// The vertical position.
        at: f64,
        /// The two positions.
        #[serde(skip_serializing_if = "Option::is_none")]
        between: Option<[f64; 2]>,
    },
    /// A vertical line at this position on the horizontal axis.
    Upright {
        /// The position.
        at: f64,
    },
    /// A shaded part of the horizontal axis.
    Shade {
        /// Its ends.
        between: [f64; 2],
    },
    /// A ring around one position, with a word next to it.
    Ring {
        /// The position.
        at: [f64; 2],
        /// The word.
        text: String,
    },
    /// A word at one position.
    Text {
        /// The position.
        at: [f64; 2],
        /// The word.
        text: String,
    },
    /// Squares, one for each pair of names of the axes: 0…1, row by row; NaN where there is no
    /// value.
    Cells {
        /// The values.
        values: Packed,
        /// Tooltip of each square.
        says: Vec<String>,
    },
    /// One strip for each row of the vertical axis, with values 0…1 along the horizontal axis:
    /// drawn where the value is low.
    Strips {
        /// Positions of the values.
        x: Packed,
        /// Values, row by row; NaN where there is none.
        values: Packed,
        /// The rows' names.
        says: Vec<String>,
    },
    /// Bodies and places in space.
    Scene(Scene),
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Shape {
    /// How it is drawn in a legend.
    pub fn drawn(&self) -> Drawn {
        match self {
            Shape::Points { marker, .. } => Drawn::Points(*marker),
            Shape::Ribbon { .. } | Shape::Shade { .. } | Shape::Cells { .. } | Shape::Strips { .. } => {
                Drawn::Area
            }
            _ => Drawn::Line,
        }
    }
}

impl Mark {
    /// A mark without a name.
    pub fn new(role: Role, shape: Shape) -> Self {
        Mark { shape, role, name: String::new(), origin: Vec::new() }
    }

    /// A curve.
    pub fn line(role: Role, x: Along, y: impl IntoIterator<Item = f64>) -> Self {
        Mark::new(role, Shape::Line { x, y: Packed::of(y) })
    }

    /// A curve whose x is not monotonic.
    pub fn looped(role: Role, x: impl IntoIterator<Item = f64>, y: impl IntoIterator<Item = f64>) -> Self {
        Mark::new(role, Shape::Loop { x: Packed::of(x), y: Packed::of(y) })
    }

    /// Points without bars.
    pub fn points(role: Role, marker: Marker, at: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let (x, y): (Vec<f64>, Vec<f64>) = at.into_iter().map(|[x, y]| (x, y)).unzip();
        let shape = Shape::Points {
            x: Packed::of(x),
            y: Packed::of(y),
            bars: None,
            aside: 0.0,
            marker,
            says: Vec::new(),
        };
        Mark::new(role, shape)
    }

    /// The same points with error bars along `x` or `y`; other marks are unchanged.
    #[must_use]
    pub fn barred(mut self, along: &'static str, ends: impl IntoIterator<Item = [f64; 2]>) -> Self {
        if let Shape::Points { bars, .. } = &mut self.shape {
            let (low, high): (Vec<f64>, Vec<f64>) = ends.into_iter().map(|[low, high]| (low, high)).unzip();
            *bars = Some(Bars { along, low: Packed::of(low), high: Packed::of(high) });
        }
        self
    }

    /// The same points, drawn at this horizontal offset, px; other marks are unchanged.
    #[must_use]
    pub fn aside(mut self, px: f64) -> Self {
        if let Shape::Points { aside, .. } = &mut self.shape {
            *aside = px;
        }
        self
    }

    /// The same points, each with a tooltip; other marks are unchanged.
    #[must_use]
    pub fn saying(mut self, words: Vec<String>) -> Self {
        if let Shape::Points { says, .. } = &mut self.shape {
            *says = words;
        }
        self
    }

    /// A shaded part of the horizontal axis.
    pub fn shade(role: Role, between: impl Into<[f64; 2]>) -> Self {
        Mark::new(role, Shape::Shade { between: between.into() })
    }

    /// A horizontal line.
    pub fn level(role: Role, at: f64) -> Self {
        Mark::new(role, Shape::Level { at, between: None })
    }

    /// The same with a name in the legend.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        Mark { name: name.into(), ..self }
    }

    /// Records that the mark's list `of` is at `path` in `results.json`, and was multiplied by
    /// `factor`.
    #[must_use]
    pub fn from(mut self, of: &'static str, path: impl Into<String>, factor: f64) -> Self {
        self.origin.push(Origin { of, path: path.into(), factor, with: None });
        self
    }

    /// Records that the mark's list `of` was computed from the numbers at two paths.
    #[must_use]
    pub fn from_two(
        mut self,
        of: &'static str,
        path: impl Into<String>,
        how: How,
        second: impl Into<String>,
        factor: f64,
    ) -> Self {
        let with = Some(Second { how, path: second.into() });
        self.origin.push(Origin { of, path: path.into(), factor, with });
        self
    }

    /// The same points, whose values are at `path` and the ends of whose bars are in `ci95` next to
    /// it.
    #[must_use]
    pub fn estimate(self, of: &'static str, path: &str, factor: f64) -> Self {
        let beside = beside(path);
        self.from(of, path, factor).from("low", format!("{beside}/ci95/0"), factor).from(
            "high",
            format!("{beside}/ci95/1"),
            factor,
        )
    }

    /// The same points, whose values are at `path`, with bars of ± the `std` next to it.
    #[must_use]
    pub fn scatter(self, of: &'static str, path: &str, factor: f64) -> Self {
        let std = format!("{}/std", beside(path));
        self.from(of, path, factor).from_two("low", path, How::Minus, std.clone(), factor).from_two(
            "high",
            path,
            How::Plus,
            std,
            factor,
        )
    }

    /// Whether the origin of this list is recorded.
    pub fn tells(&self, of: &str) -> bool {
        self.origin.iter().any(|origin| origin.of == of)
    }
}

/// The path of the object that contains a number.
fn beside(path: &str) -> &str {
    path.rsplit_once('/').map_or(path, |(above, _)| above)
}

/// The values of a curve; NaN where unknown.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Packed(pub Vec<f32>);

impl Packed {
    /// From any sequence of numbers.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        Packed(values.into_iter().map(|v| v as f32).collect())
    }

    /// The range of the finite values.
    pub fn range(&self) -> Option<[f64; 2]> {
        let finite = || self.0.iter().copied().filter(|v| v.is_finite());
        let low = finite().reduce(f32::min)?;
        Some([low.into(), finite().fold(low, f32::max).into()])
    }
}

impl Serialize for Packed {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = self.0.iter().flat_map(|v| v.to_le_bytes()).collect();
        to.serialize_str(&format!("f32:{}", BASE64_STANDARD.encode(bytes)))
    }
}

/// A number with six significant digits, as used in csv files and readouts; empty if it is not
/// finite.
pub fn six_digits(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e9).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}

/// Where the numbers of a mark are in `results.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Origin {
    /// Which of the mark's lists: `x`, `y`, `low`, `high`, `values`; `first` and `step` of regular
    /// positions; `at` of a level.
    pub of: &'static str,
    /// The path; `*` stands for any key or index.
    pub path: String,
    /// Factor by which the numbers there were multiplied for the unit shown.
    pub factor: f64,
    /// A second number that was combined with them before that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with: Option<Second>,
}

/// The second number of a sum or quotient, as in `mean ± σ`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Second {
    /// The operation.
    pub how: How,
    /// Its path, with as many `*` as the first one's.
    pub path: String,
}

/// Operation applied with a second number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum How {
    /// The second number was added.
    Plus,
    /// The second number was subtracted.
    Minus,
    /// The first was multiplied by it.
    Times,
    /// The first was divided by it.
    Per,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_digits_survive_thirty_two_bits() {
        for value in [1.234_56e-9, 26.889_5, 999_999.0, -0.000_123_456] {
            assert_eq!(six_digits(f64::from(value as f32)), six_digits(value));
        }
        assert_eq!(six_digits(f64::NAN), "");
        assert_eq!(six_digits(1.234_567e-8), "1.23457e-8");
        assert_eq!(serde_json::to_string(&Packed::of([1.0])).expect("text"), "\"f32:AACAPw==\"");
    }
}
