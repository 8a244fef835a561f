//! Test data: exact FRFs of two rigid bodies on suspensions, alone and joined by a known contact.

use super::geometry::{Configuration, Geometry, Grouping, Point};
use crate::Line;
use crate::frf::{Frf, MotionQuantity};
use nalgebra::{Complex, Vector3};
use std::f64::consts::TAU;

const SIGMA_PER_S: f64 = 2.3;
const AXES: [(&str, [f64; 3]); 3] = [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])];
/// Stiffness of the contact, N/m and N m/rad; its damping is 1.5e-5 s times the stiffness.
pub(super) const CONTACT: [f64; 6] = [180e6, 260e6, 180e6, 22.0, 10.0, 22.0];

/// FRFs of A, B and AJB from 250 to 650 Hz, and the geometry of three sensors and nine impacts on
/// each body.
pub(super) fn rig() -> ([Frf; 3], Geometry) {
    let (a, b) = (side("A", Grouping::InterfaceA, 1.0), side("B", Grouping::InterfaceB, -1.0));
    let ajb = Configuration {
        channels: [a.channels.clone(), b.channels.clone()].concat(),
        impacts: [a.impacts.clone(), b.impacts.clone()].concat(),
    };
    let frfs = [frf(&a, 0..6), frf(&b, 6..12), frf(&ajb, 0..12)];
    let origin = [0.0; 3];
    (frfs, Geometry { a, b, ajb, virtual_point_a_m: origin, virtual_point_b_m: origin })
}

fn side(letter: &str, grouping: Grouping, z: f64) -> Configuration {
    let (mut channels, mut impacts) = (Vec::new(), Vec::new());
    let sensors = [[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, 0.01]];
    let hits = [[-0.025, 0.01, 0.04], [0.025, 0.03, 0.02], [0.0, 0.05, 0.05]];
    for (i, (sensor, hit)) in sensors.into_iter().zip(hits).enumerate() {
        for (axis, direction) in AXES {
            let point = |name: String, description: String, [x, y, along]: [f64; 3]| {
                let position_m = [x, y, z * along];
                Point { name, description, grouping, position_m, direction }
            };
            let name = format!("{letter}{}", i + 1);
            channels.push(point(name.clone(), format!("{name}:{axis}"), sensor));
            impacts.push(point(format!("{letter}f{}{axis}", i + 1), String::new(), hit));
        }
    }
    Configuration { channels, impacts }
}

/// Motion of a point along its direction for each of the six motions of its body.
fn row(point: &Point, bodies: &std::ops::Range<usize>) -> Vec<Complex<f64>> {
    let (direction, moment) = (point.direction(), point.position().cross(&point.direction()));
    let of_body = [direction, moment].map(|v: Vector3<f64>| v.iter().copied().collect::<Vec<_>>()).concat();
    let first = if point.grouping == Grouping::InterfaceA { 0 } else { 6 };
    bodies.clone().map(|d| Complex::from(if d / 6 * 6 == first { of_body[d - first] } else { 0.0 })).collect()
}

/// Mobilities of the bodies that have these degrees of freedom; if there are two, the contact joins
/// them.
fn frf(points: &Configuration, bodies: std::ops::Range<usize>) -> Frf {
    let matrix = |points: &[Point]| {
        let rows: Vec<_> = points.iter().flat_map(|p| row(p, &bodies)).collect();
        Line::from_row_slice(points.len(), bodies.len(), &rows)
    };
    let (seen, hit) = (matrix(&points.channels), matrix(&points.impacts));
    let frequency_hz: Vec<f64> = (50..=130).map(|l| 5.0 * f64::from(l)).collect();
    let line = |f: &f64| {
        let s = Complex::new(SIGMA_PER_S, TAU * f);
        let mut z = Line::zeros(12, 12);
        for d in 0..6 {
            let (mass, suspension) =
                if d < 3 { ([4.0, 3.0], [8e6, 30e6]) } else { ([6e-3, 4e-3], [9e3, 2e4]) };
            let joint = if bodies.len() == 12 { CONTACT[d] * (1.0 + 1.5e-5 * s) } else { Complex::default() };
            for body in 0..2 {
                let own = mass[body] * s * s + suspension[body] * (1.0 + 2e-5 * s);
                z[(d + 6 * body, d + 6 * body)] = own + joint;
                z[(d + 6 * body, d + 6 - 6 * body)] = -joint;
            }
        }
        // each body alone is a separate block
        let y = z.try_inverse().expect("damped");
        let y = y.view((bodies.start, bodies.start), (bodies.len(), bodies.len()));
        &seen * y * hit.transpose() * s
    };
    let lines = frequency_hz.iter().map(line).collect();
    let (outputs, inputs) = (points.output_names(), points.input_names());
    Frf::new(frequency_hz, SIGMA_PER_S, MotionQuantity::Velocity, outputs, inputs, lines).expect("all agree")
}
