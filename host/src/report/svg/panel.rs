//! One panel as a drawing: frame, grid, ticks and contents; or a scene in space, seen from one
//! side, which the page can rotate (`page/scene.js` draws the same).

use super::drawing::{Anchor, Area, Drawing, Stroke};
use super::marks;
use super::marks::PanelFrame;
use crate::report::figure::{Axis, Body, Height, Marker, Panel, Scene, Shape, Spot};
use crate::report::scale::{Lie, Scale, Tick};

const FRAME: Stroke<'_> = Stroke::new("frame", 1.0);
const GRID: Stroke<'_> = Stroke::new("grid", 1.0);
const MINOR: Stroke<'_> = Stroke::new("grid", 0.5);

/// Height of a row of a list, px: a line of words with its bar below.
pub const ROW: f64 = 42.0;
/// Width of a letter in tick labels, px.
const LETTER: f64 = 6.6;

/// The panel as a separate picture for the page, `width` px wide.
pub fn panel(panel: &Panel, name: &str, width: f64, meaning: &str) -> String {
    // the page itself writes the title
    let untitled = Panel { title: String::new(), ..panel.clone() };
    drawing(&untitled, name, width).finish(meaning)
}

/// The panel as a drawing; `name` makes its ids differ from all others of the page.
pub fn drawing(panel: &Panel, name: &str, width: f64) -> Drawing {
    let rows = panel.height == Height::Rows;
    let left = if rows {
        12.0
    } else if panel.y.names.is_empty() {
        64.0
    } else {
        20.0 + LETTER * panel.y.names.iter().map(|n| n.chars().count()).max().unwrap_or(0) as f64
    };
    let top = if panel.title.is_empty() { 10.0 } else { 28.0 };
    let inner = width - left - 20.0;
    let height = match panel.height {
        Height::Tall => 300.0,
        Height::Usual => 210.0,
        Height::Low => 120.0,
        Height::Square => (0.8 * inner).min(460.0),
        Height::Rows => ROW * panel.y.names.len() as f64,
    };
    let area = Area { left, top, width: inner, height };
    let mut drawing = Drawing::new(name, width, area.bottom() + 46.0);
    if !panel.title.is_empty() {
        drawing.text([left, 18.0], Anchor::Start, "title", &panel.title);
    }
    if let [mark] = &panel.marks[..]
        && let Shape::Scene(found) = &mark.shape
    {
        draw_scene(&mut drawing, Area { left: 0.0, width, height: height + 40.0, ..area }, found);
        return drawing;
    }
    let upright =
        if panel.y.names.is_empty() { [area.bottom(), area.top] } else { [area.top, area.bottom()] };
    let place = PanelFrame {
        area,
        x: Scale::of(&panel.x, [area.left, area.right()]),
        y: Scale::of(&panel.y, upright),
    };
    let (x_ticks, y_ticks) = (ticks(&panel.x, &place.x, Lie::Across), ticks(&panel.y, &place.y, Lie::Up));
    drawing.fill(area, "paper", 1.0);
    grid(&mut drawing, panel, &place, &x_ticks, &y_ticks);
    for mark in &panel.marks {
        drawing.clipped(area, |d| marks::draw(d, &place, mark));
    }
    axes(&mut drawing, panel, &place, &x_ticks, &y_ticks);
    if rows {
        for (i, name) in panel.y.names.iter().enumerate() {
            let y = place.y.place_within(i as f64) - 3.0;
            drawing.text([area.left + 8.0, y], Anchor::Start, "row", name);
        }
    }
    drawing
}

fn ticks(axis: &Axis, scale: &Scale, lie: Lie) -> Vec<Tick> {
    match axis.every {
        _ if !axis.names.is_empty() => axis
            .names
            .iter()
            .enumerate()
            .map(|(i, name)| Tick { value: i as f64, label: name.clone() })
            .collect(),
        Some(every) => scale.ticks_every(every),
        None => scale.ticks(lie),
    }
}

fn grid(drawing: &mut Drawing, panel: &Panel, place: &PanelFrame, x_ticks: &[Tick], y_ticks: &[Tick]) {
    let area = place.area;
    let stroke = |tick: &Tick| if tick.label.is_empty() { MINOR } else { GRID };
    if panel.x.names.is_empty() {
        for (tick, x) in x_ticks.iter().filter_map(|t| Some((t, place.x.place(t.value)?))) {
            drawing.line([x, area.top], [x, area.bottom()], stroke(tick));
        }
    }
    if panel.y.names.is_empty() {
        for (tick, y) in y_ticks.iter().filter_map(|t| Some((t, place.y.place(t.value)?))) {
            drawing.line([area.left, y], [area.right(), y], stroke(tick));
        }
    }
}

fn axes(drawing: &mut Drawing, panel: &Panel, place: &PanelFrame, x_ticks: &[Tick], y_ticks: &[Tick]) {
    let (left, right, top, bottom) =
        (place.area.left, place.area.right(), place.area.top, place.area.bottom());
    for (from, to) in [
        ([left, top], [right, top]),
        ([right, top], [right, bottom]),
        ([left, bottom], [right, bottom]),
        ([left, top], [left, bottom]),
    ] {
        drawing.line(from, to, FRAME);
    }
    let mut free = f64::NEG_INFINITY;
    for tick in x_ticks {
        let Some(at) = place.x.place(tick.value) else { continue };
        let half = 0.55 * LETTER * tick.label.chars().count() as f64;
        // names that would touch the previous one are omitted
        let shown = !tick.label.is_empty() && at - half >= free;
        drawing.line([at, bottom], [at, bottom + if shown { 5.0 } else { 3.0 }], FRAME);
        if shown {
            drawing.text([at, bottom + 18.0], Anchor::Middle, "tick", &tick.label);
            free = at + half + 8.0;
        }
    }
    for tick in y_ticks.iter().filter(|_| panel.height != Height::Rows) {
        let Some(at) = place.y.place(tick.value) else { continue };
        let length = if tick.label.is_empty() { 3.0 } else { 5.0 };
        drawing.line([left - length, at], [left, at], FRAME);
        drawing.text([left - 8.0, at + 4.0], Anchor::End, "tick", &tick.label);
    }
    drawing.text([f64::midpoint(left, right), bottom + 37.0], Anchor::Middle, "label", &panel.x.label());
    if panel.height != Height::Rows && panel.y.names.is_empty() {
        drawing.text_upwards([14.0, f64::midpoint(top, bottom)], "label", &panel.y.label());
    }
}

/// Initial viewing direction, rad: about the vertical, then down from the horizontal.
const YAW: f64 = 0.7;
const PITCH: f64 = 0.35;

/// A position in the picture (right, down, near), m: before rotation, z points right, y up, x
/// towards the reader.
fn seen([x, y, z]: [f64; 3]) -> [f64; 3] {
    let (right, near) = (z * YAW.cos() - x * YAW.sin(), z * YAW.sin() + x * YAW.cos());
    [right, -(y * PITCH.cos() - near * PITCH.sin()), y * PITCH.sin() + near * PITCH.cos()]
}

/// The whole scene within `area`.
fn draw_scene(drawing: &mut Drawing, area: Area, scene: &Scene) {
    let corners: Vec<[f64; 3]> =
        scene.bodies.iter().flat_map(corners).chain(scene.spots.iter().flat_map(ends)).map(seen).collect();
    let reach = |i: usize| {
        let all = corners.iter().map(|c| c[i]);
        [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
    };
    if corners.is_empty() {
        return;
    }
    let ([left, right], [top, bottom]) = (reach(0), reach(1));
    // leave space for names next to the outermost positions
    let size = ((area.width - 120.0) / (right - left).max(1e-3))
        .min((area.height - 40.0) / (bottom - top).max(1e-3));
    let centre = [area.left + 0.5 * area.width, area.top + 0.5 * area.height];
    let at = |p: [f64; 3]| {
        let s = seen(p);
        [
            centre[0] + size * (s[0] - f64::midpoint(left, right)),
            centre[1] + size * (s[1] - f64::midpoint(top, bottom)),
        ]
    };
    for body in &scene.bodies {
        let class = format!("s-{}", body.role.name());
        let all = corners_of(body);
        for (i, from) in all.iter().enumerate() {
            for bit in [1, 2, 4].into_iter().filter(|bit| i & bit == 0) {
                drawing.line(at(*from), at(all[i | bit]), Stroke::new(&class, 0.7));
            }
        }
    }
    scene_axes(drawing, size, [area.left + 46.0, area.top + area.height - 46.0]);
    let mut taken: Vec<[f64; 4]> = Vec::new();
    for spot in &scene.spots {
        let class = format!("s-{}", spot.role.name());
        let place = at(spot.at);
        if let Some(toward) = spot.toward {
            let from = std::array::from_fn(|i| spot.at[i] - 0.014 * toward[i]);
            drawing.line(at(from), place, Stroke::new(&class, 2.0));
        }
        if spot.moves.is_some() {
            let [rest, moved] = ends(spot).map(at);
            drawing.line(rest, moved, Stroke::new(&class, 2.0));
            marks::draw_marker(drawing, moved, spot.role, Marker::Dot);
        }
        let marker = if spot.toward.is_some() { Marker::Dot } else { Marker::Frame };
        marks::draw_marker(drawing, place, spot.role, marker);
        let width = 6.8 * spot.name.chars().count() as f64;
        let places =
            [[7.0, -5.0], [7.0, 14.0], [-7.0 - width, -5.0], [-7.0 - width, 14.0], [7.0, -17.0], [7.0, 26.0]];
        let free = places.into_iter().map(|by| [place[0] + by[0], place[1] + by[1]]).find(|[x, y]| {
            taken.iter().all(|t| x + width < t[0] || *x > t[2] || y + 2.0 < t[1] || y - 12.0 > t[3])
        });
        // a name that does not fit is only given in the table
        if let Some([x, y]) = free {
            taken.push([x, y - 12.0, x + width, y + 2.0]);
            drawing.text([x, y], Anchor::Start, "tick", &spot.name);
        }
    }
}

fn scene_axes(drawing: &mut Drawing, size: f64, origin: [f64; 2]) {
    let length = 34.0 / size;
    for (name, direction) in [("x", [length, 0.0, 0.0]), ("y", [0.0, length, 0.0]), ("z", [0.0, 0.0, length])]
    {
        let s = seen(direction);
        let end = [origin[0] + size * s[0], origin[1] + size * s[1]];
        drawing.line(origin, end, Stroke::new("frame", 1.4));
        drawing.text(
            [end[0] + 4.0 * (end[0] - origin[0]).signum(), end[1] - 4.0],
            Anchor::Middle,
            "label",
            name,
        );
    }
}

/// Where a spot is at rest and where it moves.
fn ends(spot: &Spot) -> [[f64; 3]; 2] {
    let moves = spot.moves.unwrap_or_default();
    [spot.at, std::array::from_fn(|i| spot.at[i] + moves[i])]
}

fn corners(body: &Body) -> impl Iterator<Item = [f64; 3]> {
    corners_of(body).into_iter()
}

fn corners_of(body: &Body) -> [[f64; 3]; 8] {
    std::array::from_fn(|i| {
        std::array::from_fn(|axis| if i >> axis & 1 == 1 { body.high[axis] } else { body.low[axis] })
    })
}
