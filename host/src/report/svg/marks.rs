//! Draws the marks of a panel at the positions of its values (`page/marks.js` does the same in the
//! page), and the marker of a single point.

use super::drawing::{Anchor, Area, Drawing, Stroke};
use crate::report::figure::{Along, Bars, Mark, Marker, Packed, Role, Shape};
use crate::report::scale::Scale;

/// Draws one mark; the caller clips what lies outside the frame.
pub fn draw(drawing: &mut Drawing, place: &PanelFrame, mark: &Mark) {
    let role = mark.role;
    let class = format!("s-{}", role.name());
    let fill = format!("f-{}", role.name());
    let stroke = Stroke { class: &class, width: role.width(), dash: role.dash() };
    match &mark.shape {
        Shape::Line { x, y } => drawing.curve(&points(place, x, y), stroke),
        Shape::Loop { x, y } => drawing.curve(&points(place, &Along::List(x.clone()), y), stroke),
        Shape::Ribbon { x, low, high } => ribbon(drawing, place, [&fill, &class], x, [low, high], role),
        Shape::Points { x, y, bars, aside, marker, .. } => {
            let count = x.0.len().min(y.0.len());
            if bars.is_none() && count > MANY {
                let at = (0..count).filter_map(|i| inside(place, [f64::from(x.0[i]), f64::from(y.0[i])]));
                swarm(drawing, &at.map(|[x, y]| [x + aside, y]).collect::<Vec<_>>(), &class, *marker);
                return;
            }
            for i in 0..count {
                let at = [f64::from(x.0[i]), f64::from(y.0[i])];
                if let Some(bars) = bars {
                    bar(drawing, place, bars, i, at, *aside, stroke);
                }
                if let Some(at) = inside(place, at) {
                    draw_marker(drawing, [at[0] + aside, at[1]], role, *marker);
                }
            }
        }
        Shape::Level { at, between } => {
            let range = between.unwrap_or_else(|| place.x.range());
            if let Some(y) = place.y.place(*at) {
                drawing.line(
                    [place.x.place_within(range[0]), y],
                    [place.x.place_within(range[1]), y],
                    stroke,
                );
            }
        }
        Shape::Upright { at } => {
            if let Some(x) = place.x.place(*at) {
                drawing.line([x, place.area.top], [x, place.area.bottom()], stroke);
            }
        }
        Shape::Shade { between } => {
            let (left, right) = (place.x.place_within(between[0]), place.x.place_within(between[1]));
            drawing.fill(Area { left, width: right - left, ..place.area }, &fill, role.opacity());
        }
        Shape::Ring { at, text } => {
            let Some(at) = inside(place, *at) else { return };
            drawing.dot(at, 9.0, &format!("none {class}"));
            // above the ring, because curves leave it sideways
            let up = (at[1] - 14.0).max(place.area.top + 12.0);
            drawing.text([at[0], up], Anchor::Middle, "legend", text);
        }
        Shape::Text { at, text } => {
            let Some(at) = inside(place, *at) else { return };
            word(drawing, place, at, text);
        }
        Shape::Cells { values, .. } => cells(drawing, place, &fill, values),
        Shape::Strips { x, values, .. } => strips(drawing, place, &fill, x, values),
        Shape::Scene(_) => {}
    }
}

/// From this number on, points are drawn as one shape, which keeps the page small.
const MANY: usize = 60;

/// Many points in one shape: dots and rings are the round caps of lines of zero length.
fn swarm(drawing: &mut Drawing, at: &[[f64; 2]], class: &str, marker: Marker) {
    match marker {
        Marker::Dot | Marker::Square => drawing.ends(at, class, 2.0 * RADIUS, marker == Marker::Dot),
        Marker::Ring | Marker::Frame => {
            drawing.ends(at, class, 2.0 * RADIUS, marker == Marker::Ring);
            drawing.ends(at, "s-paper", 2.0 * RADIUS - 2.6, marker == Marker::Ring);
        }
        Marker::Stroke | Marker::Cross => drawing.crosses(at, class, RADIUS),
    }
}

/// A word that starts at `at`, or ends there if it would leave the frame.
fn word(drawing: &mut Drawing, place: &PanelFrame, at: [f64; 2], text: &str) {
    let width = 6.6 * text.chars().count() as f64;
    let (x, anchor) =
        if at[0] + width > place.area.right() { (at[0] - 26.0, Anchor::End) } else { (at[0], Anchor::Start) };
    drawing.text([x, at[1].max(place.area.top + 12.0)], anchor, "legend", text);
}

/// A value further outside than this fraction of the frame interrupts the curve: the lines to and
/// from such values would look like a hatched area.
const BEYOND: f64 = 0.5;

fn points(place: &PanelFrame, x: &Along, y: &Packed) -> Vec<Option<[f64; 2]>> {
    let area = place.area;
    let far = BEYOND * area.height;
    let near = |y: &f64| (area.top - far..=area.bottom() + far).contains(y);
    let of =
        |(i, v): (usize, &f32)| Some([place.x.place(x.at(i))?, place.y.place(f64::from(*v)).filter(near)?]);
    y.0.iter().enumerate().map(of).collect()
}

fn inside(place: &PanelFrame, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    Some([place.x.place(x)?, place.y.place(y)?])
}

fn ribbon(
    drawing: &mut Drawing,
    place: &PanelFrame,
    [fill, _]: [&str; 2],
    x: &Along,
    ends: [&Packed; 2],
    role: Role,
) {
    let edge = |values: &Packed| -> Vec<[f64; 2]> {
        (values.0.iter().enumerate())
            .filter_map(|(i, v)| Some([place.x.place(x.at(i))?, place.y.place_within(f64::from(*v))]))
            .collect()
    };
    let mut around = edge(ends[0]);
    around.extend(edge(ends[1]).into_iter().rev());
    drawing.area(&around, fill, role.opacity());
}

/// An error bar with caps; an end beyond the frame is drawn as an arrow at the frame.
fn bar(
    drawing: &mut Drawing,
    place: &PanelFrame,
    bars: &Bars,
    i: usize,
    at: [f64; 2],
    aside: f64,
    stroke: Stroke<'_>,
) {
    let Some((low, high)) = bars.low.0.get(i).zip(bars.high.0.get(i)) else { return };
    let across = bars.along == "x";
    let (scale, other) =
        if across { (&place.x, place.y.place(at[1])) } else { (&place.y, place.x.place(at[0])) };
    let Some(other) = other.map(|other| if across { other } else { other + aside }) else { return };
    let turned = |along: f64, aside: f64| if across { [along, aside] } else { [aside, along] };
    let ends = [*low, *high].map(|end| (f64::from(end), scale.place_within(f64::from(end))));
    let line = Stroke { width: stroke.width.max(1.4), dash: "", ..stroke };
    drawing.line(turned(ends[0].1, other), turned(ends[1].1, other), line);
    let [from, to] = scale.range();
    for (n, (value, place)) in ends.into_iter().enumerate() {
        let way = if (ends[1].1 > ends[0].1) == (n == 1) { 1.0 } else { -1.0 };
        if value < from || value > to || !value.is_finite() {
            for side in [-4.0, 4.0] {
                drawing.line(turned(place, other), turned(place - 6.0 * way, other + side), line);
            }
        } else {
            drawing.line(turned(place, other - 4.0), turned(place, other + 4.0), line);
        }
    }
}

fn cells(drawing: &mut Drawing, place: &PanelFrame, fill: &str, values: &Packed) {
    let [left, right] = place.x.range();
    let columns = (right - left).round() as usize;
    for (i, value) in values.0.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let (row, column) = ((i / columns.max(1)) as f64, (i % columns.max(1)) as f64);
        let (x, x2) = (place.x.place_within(column - 0.46), place.x.place_within(column + 0.46));
        let (y, y2) = (place.y.place_within(row - 0.44), place.y.place_within(row + 0.44));
        let area = Area { left: x, top: y.min(y2), width: x2 - x, height: (y2 - y).abs() };
        drawing.fill(area, fill, 0.06 + 0.94 * f64::from(value.clamp(0.0, 1.0)));
    }
}

/// Thresholds below which a strip is drawn, with the opacity: a few steps keep the drawing small,
/// and good data remains white.
const STEPS: [(f32, f64); 5] = [(0.5, 1.0), (0.7, 0.75), (0.9, 0.5), (0.95, 0.3), (0.99, 0.15)];

/// Opacity for a value of a strip; `None` if the value is good.
fn strength(value: f32) -> Option<f64> {
    STEPS.iter().find(|(below, _)| value < *below).map(|(_, strength)| *strength)
}

fn strips(drawing: &mut Drawing, place: &PanelFrame, fill: &str, x: &Packed, values: &Packed) {
    let columns = x.0.len();
    let edge = |i: usize| place.x.place_within(f64::from(x.0[i.min(columns - 1)]));
    // all runs of the same opacity are one shape
    for (_, opacity) in STEPS {
        let mut areas = Vec::new();
        for (row, strip) in values.0.chunks(columns.max(1)).enumerate() {
            let (a, b) = (place.y.place_within(row as f64 - 0.5), place.y.place_within(row as f64 + 0.5));
            let mut from = 0;
            for run in strip.chunk_by(|a, b| strength(*a) == strength(*b)) {
                let to = from + run.len();
                if strength(run[0]) == Some(opacity) {
                    let (left, width) = (edge(from), edge(to) - edge(from));
                    areas.push(Area { left, top: a.min(b), width, height: (b - a).abs() });
                }
                from = to;
            }
        }
        drawing.fills(&areas, fill, opacity);
    }
}

/// Radius of a point, px.
pub const RADIUS: f64 = 4.0;

/// Draws the marker of a point.
pub fn draw_marker(drawing: &mut Drawing, at: [f64; 2], role: Role, marker: Marker) {
    let name = role.name();
    let stroke = format!("s-{name}");
    match marker {
        Marker::Dot => drawing.dot(at, RADIUS, &format!("f-{name} s-{name}")),
        Marker::Ring => drawing.dot(at, RADIUS, &format!("paper s-{name}")),
        Marker::Square => drawing.square(at, RADIUS, &format!("f-{name} s-{name}")),
        Marker::Frame => drawing.square(at, RADIUS, &format!("paper s-{name}")),
        Marker::Stroke => {
            drawing.line([at[0], at[1] - 7.0], [at[0], at[1] + 7.0], Stroke::new(&stroke, 1.6));
        }
        Marker::Cross => {
            for side in [-1.0, 1.0] {
                let (a, b) =
                    ([at[0] - RADIUS, at[1] - side * RADIUS], [at[0] + RADIUS, at[1] + side * RADIUS]);
                drawing.line(a, b, Stroke::new(&stroke, 1.8));
            }
        }
    }
}

/// A panel with its frame and axes in pixels.
pub struct PanelFrame {
    /// The frame.
    pub area: Area,
    /// The horizontal axis.
    pub x: Scale,
    /// The vertical axis.
    pub y: Scale,
}
