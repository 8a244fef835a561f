//! A scene in space, seen from one side; the page can rotate it (`page/scene.js` draws the same).

use super::drawing::{Anchor, Area, Drawing, Stroke};
use super::marks;
use crate::report::figure::{Body, Marker, Scene};

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
pub fn draw(drawing: &mut Drawing, area: Area, scene: &Scene) {
    let corners: Vec<[f64; 3]> =
        scene.bodies.iter().flat_map(corners).chain(scene.spots.iter().map(|s| s.at)).map(seen).collect();
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
    axes(drawing, size, [area.left + 46.0, area.top + area.height - 46.0]);
    let mut taken: Vec<[f64; 4]> = Vec::new();
    for spot in &scene.spots {
        let class = format!("s-{}", spot.role.name());
        let place = at(spot.at);
        if let Some(toward) = spot.toward {
            let from = std::array::from_fn(|i| spot.at[i] - 0.014 * toward[i]);
            drawing.line(at(from), place, Stroke::new(&class, 2.0));
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

fn axes(drawing: &mut Drawing, size: f64, origin: [f64; 2]) {
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

fn corners(body: &Body) -> impl Iterator<Item = [f64; 3]> {
    corners_of(body).into_iter()
}

fn corners_of(body: &Body) -> [[f64; 3]; 8] {
    std::array::from_fn(|i| {
        std::array::from_fn(|axis| if i >> axis & 1 == 1 { body.high[axis] } else { body.low[axis] })
    })
}
