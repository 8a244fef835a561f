//! One plot: a frame with two axes, curves, bands and a legend above it.

use super::drawing::{Anchor, Area, Drawing, Stroke};
use super::scale::{Scale, Tick};

/// Colours that stay apart for colour-blind readers and in grey print (Okabe and Ito).
pub const BLUE: &str = "#0072b2";
/// See [`BLUE`].
pub const VERMILION: &str = "#d55e00";
/// See [`BLUE`].
pub const GREEN: &str = "#009e73";
/// Axes and text.
pub const INK: &str = "#333";
/// Grid lines.
pub const FAINT: &str = "#e4e4e4";
/// The shade of a band.
pub const SHADE: &str = "#f0b400";

const FRAME: Stroke = Stroke::new("#888", 1.0);
const GRID: Stroke = Stroke::new(FAINT, 1.0);

/// A plot's place and its two axes.
#[derive(Debug, Clone, Copy)]
pub struct Panel {
    /// The frame.
    pub area: Area,
    /// The horizontal axis.
    pub x: Scale,
    /// The vertical axis.
    pub y: Scale,
}

/// One entry of a legend.
pub type LegendEntry = (Stroke, String);

impl Panel {
    /// The grid, drawn first.
    pub fn grid(&self, drawing: &mut Drawing, x_ticks: &[Tick], y_ticks: &[Tick]) {
        drawing.fill(self.area, "#fff", 1.0);
        for x in x_ticks.iter().filter(|t| !t.label.is_empty()).filter_map(|t| self.x.place(t.value)) {
            drawing.line([x, self.area.top], [x, self.area.bottom()], GRID);
        }
        for y in y_ticks.iter().filter(|t| !t.label.is_empty()).filter_map(|t| self.y.place(t.value)) {
            drawing.line([self.area.left, y], [self.area.right(), y], GRID);
        }
    }

    /// Frame and ticks, drawn last. A side without label gets ticks but no numbers.
    pub fn axes(&self, drawing: &mut Drawing, x: (&[Tick], Option<&str>), y: (&[Tick], Option<&str>)) {
        let (left, right, top, bottom) =
            (self.area.left, self.area.right(), self.area.top, self.area.bottom());
        for (from, to) in [
            ([left, top], [right, top]),
            ([right, top], [right, bottom]),
            ([left, bottom], [right, bottom]),
            ([left, top], [left, bottom]),
        ] {
            drawing.line(from, to, FRAME);
        }
        for tick in x.0 {
            let Some(at) = self.x.place(tick.value) else { continue };
            let length = if tick.label.is_empty() { 3.0 } else { 5.0 };
            drawing.line([at, bottom], [at, bottom + length], FRAME);
            if x.1.is_some() {
                drawing.text([at, bottom + 18.0], Anchor::Middle, "tick", &tick.label);
            }
        }
        for tick in y.0 {
            let Some(at) = self.y.place(tick.value) else { continue };
            let length = if tick.label.is_empty() { 3.0 } else { 5.0 };
            drawing.line([left - length, at], [left, at], FRAME);
            if y.1.is_some() {
                drawing.text([left - 8.0, at + 4.0], Anchor::End, "tick", &tick.label);
            }
        }
        if let Some(label) = x.1 {
            drawing.text([f64::midpoint(left, right), bottom + 37.0], Anchor::Middle, "label", label);
        }
        if let Some(label) = y.1 {
            drawing.text_upwards([left - 46.0, f64::midpoint(top, bottom)], "label", label);
        }
    }

    /// Shades a range of the horizontal axis.
    pub fn shade(&self, drawing: &mut Drawing, range: [f64; 2], colour: &str, opacity: f64) {
        let (left, right) = (self.x.place_within(range[0]), self.x.place_within(range[1]));
        drawing.fill(Area { left, width: right - left, ..self.area }, colour, opacity);
    }

    /// A curve of values, cut off at the frame.
    pub fn curve(&self, drawing: &mut Drawing, points: impl Iterator<Item = (f64, f64)>, stroke: Stroke) {
        let points: Vec<Option<[f64; 2]>> =
            points.map(|(x, y)| Some([self.x.place(x)?, self.y.place(y)?])).collect();
        drawing.clipped(self.area, |d| d.curve(&points, stroke));
    }

    /// A level line over a range of the horizontal axis, if it lies within the frame.
    pub fn level(&self, drawing: &mut Drawing, range: [f64; 2], value: f64, stroke: Stroke) {
        let [low, high] = self.y.range();
        if let (true, Some(y)) = ((low..=high).contains(&value), self.y.place(value)) {
            drawing.line([self.x.place_within(range[0]), y], [self.x.place_within(range[1]), y], stroke);
        }
    }
}

/// A legend in one row that starts at `at`; it belongs above a frame, never over data.
pub fn legend(drawing: &mut Drawing, at: [f64; 2], entries: &[LegendEntry]) {
    let mut x = at[0];
    for (stroke, text) in entries {
        drawing.line(
            [x, at[1] - 4.0],
            [x + 22.0, at[1] - 4.0],
            Stroke { width: stroke.width.max(1.6), ..*stroke },
        );
        drawing.text([x + 28.0, at[1]], Anchor::Start, "legend", text);
        x += 28.0 + 6.6 * text.chars().count() as f64 + 20.0;
    }
}
