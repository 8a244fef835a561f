//! The marker of a single point.

use super::drawing::{Drawing, Stroke};
use crate::report::figure::{Marker, Role};

/// Radius of a point, px.
pub const RADIUS: f64 = 4.0;

/// Draws the marker of a point.
pub fn marker(drawing: &mut Drawing, at: [f64; 2], role: Role, marker: Marker) {
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
