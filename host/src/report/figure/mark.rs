//! What stands in a panel: curves, points, bands, words.

use super::origin::{How, Origin, Second};
use super::packed::Packed;
use super::role::Role;
use super::scene::Scene;
use serde::Serialize;

/// One mark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mark {
    /// Its shape and numbers.
    #[serde(flatten)]
    pub shape: Shape,
    /// What it stands for.
    pub role: Role,
    /// Its name in the legend; without one it is part of the picture.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Where its numbers stand in `results.json`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub origin: Vec<Origin>,
}

/// Where the points of a curve lie along the horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Along {
    /// At regular steps.
    Regular {
        /// The first.
        first: f64,
        /// From one to the next.
        step: f64,
        /// How many.
        count: usize,
    },
    /// Anywhere.
    List(Packed),
}

impl Along {
    /// Where point `i` lies.
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Along::Regular { first, step, .. } => first + step * i as f64,
            Along::List(values) => values.0.get(i).copied().map_or(f64::NAN, f64::from),
        }
    }

    /// How many points there are.
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

    /// Of equidistant values as regular steps, of others as they are.
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

/// From where to where the bars of points go.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bars {
    /// `x` or `y`: the axis they lie along.
    pub along: &'static str,
    /// Their lower ends.
    pub low: Packed,
    /// Their upper ends.
    pub high: Packed,
}

/// The sign of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Marker {
    /// A full round one.
    #[default]
    Dot,
    /// A ring.
    Ring,
    /// A full square.
    Square,
    /// An empty square.
    Frame,
    /// An upright stroke.
    Stroke,
    /// A lying cross: not to be believed.
    Cross,
}

/// How a mark is drawn, as its entry in a legend shows it.
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
        /// Where its points lie.
        x: Along,
        /// Its values.
        y: Packed,
    },
    /// The area between two curves.
    Ribbon {
        /// Where their points lie.
        x: Along,
        /// The lower one.
        low: Packed,
        /// The upper one.
        high: Packed,
    },
    /// Single points, with bars or without.
    Points {
        /// Where they lie.
        x: Packed,
        /// Their values.
        y: Packed,
        /// How far they may be off.
        #[serde(skip_serializing_if = "Option::is_none")]
        bars: Option<Bars>,
        /// How far aside they are drawn, px, so that points of the same place are seen beside one another.
        #[serde(skip_serializing_if = "is_zero")]
        aside: f64,
        /// Their sign.
        marker: Marker,
        /// What is said of each when it is touched.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        says: Vec<String>,
    },
    /// A curve whose x goes to and fro.
    Loop {
        /// Horizontal.
        x: Packed,
        /// Upright.
        y: Packed,
    },
    /// A straight line across: `at` on the upright axis, between two places of the horizontal one (all of it without).
    Level {
        /// The height.
        at: f64,
        /// From where to where.
        #[serde(skip_serializing_if = "Option::is_none")]
        between: Option<[f64; 2]>,
    },
    /// A straight line upwards at this place of the horizontal axis.
    Upright {
        /// The place.
        at: f64,
    },
    /// A part of the horizontal axis.
    Shade {
        /// From where to where.
        between: [f64; 2],
    },
    /// A ring around one place, with a word beside it.
    Ring {
        /// The place.
        at: [f64; 2],
        /// The word.
        text: String,
    },
    /// A word at one place.
    Text {
        /// The place.
        at: [f64; 2],
        /// The word.
        text: String,
    },
    /// Squares, one for each pair of names of the axes: 0…1, row by row; NaN where there is none.
    Cells {
        /// The values.
        values: Packed,
        /// What is said of each when it is touched.
        says: Vec<String>,
    },
    /// One strip for each row of the upright axis, 0…1 along the horizontal one: drawn where it is low.
    Strips {
        /// Where the values lie.
        x: Packed,
        /// Row by row; NaN where there is none.
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
    /// How it looks in a legend.
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

    /// A curve whose x goes to and fro.
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

    /// The same points with bars along `x` or `y`; other marks stay as they are.
    #[must_use]
    pub fn barred(mut self, along: &'static str, ends: impl IntoIterator<Item = [f64; 2]>) -> Self {
        if let Shape::Points { bars, .. } = &mut self.shape {
            let (low, high): (Vec<f64>, Vec<f64>) = ends.into_iter().map(|[low, high]| (low, high)).unzip();
            *bars = Some(Bars { along, low: Packed::of(low), high: Packed::of(high) });
        }
        self
    }

    /// The same points, drawn this far aside, px; other marks stay as they are.
    #[must_use]
    pub fn aside(mut self, px: f64) -> Self {
        if let Shape::Points { aside, .. } = &mut self.shape {
            *aside = px;
        }
        self
    }

    /// The same points, each with what is said of it; other marks stay as they are.
    #[must_use]
    pub fn saying(mut self, words: Vec<String>) -> Self {
        if let Shape::Points { says, .. } = &mut self.shape {
            *says = words;
        }
        self
    }

    /// A part of the horizontal axis.
    pub fn shade(role: Role, between: impl Into<[f64; 2]>) -> Self {
        Mark::new(role, Shape::Shade { between: between.into() })
    }

    /// A straight line across.
    pub fn level(role: Role, at: f64) -> Self {
        Mark::new(role, Shape::Level { at, between: None })
    }

    /// The same with a name in the legend.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        Mark { name: name.into(), ..self }
    }

    /// The same, whose list `of` stands at `path` of `results.json` and was multiplied by `factor`.
    #[must_use]
    pub fn from(mut self, of: &'static str, path: impl Into<String>, factor: f64) -> Self {
        self.origin.push(Origin { of, path: path.into(), factor, with: None });
        self
    }

    /// The same, whose list `of` was made of the numbers at two paths.
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

    /// The same points, whose values stand at `path` and the ends of whose bars in `ci95` beside it.
    #[must_use]
    pub fn estimate(self, of: &'static str, path: &str, factor: f64) -> Self {
        let beside = beside(path);
        self.from(of, path, factor).from("low", format!("{beside}/ci95/0"), factor).from(
            "high",
            format!("{beside}/ci95/1"),
            factor,
        )
    }

    /// The same points, whose values stand at `path`, and whose bars reach as far as `std` beside it.
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

    /// Whether it is said where this list stands.
    pub fn tells(&self, of: &str) -> bool {
        self.origin.iter().any(|origin| origin.of == of)
    }
}

/// The path of what a number stands in.
fn beside(path: &str) -> &str {
    path.rsplit_once('/').map_or(path, |(above, _)| above)
}
