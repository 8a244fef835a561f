//! Positions of hammer and vibrometer in space (the paper's Fig. 4).

use crate::report::figure::{Axis, Body, Figure, Height, Mark, Panel, Role, Scene, Shape, Spot};
use crate::results::{Place, Results};

/// Margin between the outermost positions of an arm and the box that outlines it, m.
const ROOM_M: f64 = 0.004;

/// Every position of the plan, and the arms as boxes around the positions on their interfaces.
pub fn of_results(results: &Results) -> Option<Figure> {
    geometry(&results.geometry)
}

/// From positions only.
pub fn geometry(places: &[Place]) -> Option<Figure> {
    if places.is_empty() {
        return None;
    }
    let boxes = [(1, Role::ArmA), (2, Role::ArmB)]
        .into_iter()
        .filter_map(|(grouping, role)| body(places, grouping, role));
    let bodies = boxes.collect();
    let spots = places
        .iter()
        .map(|p| Spot { name: p.name.clone(), role: role(p.grouping), at: p.position_m, toward: p.direction })
        .collect();
    let panel = Panel::new(Axis::linear("", "", [0.0, 1.0]), Axis::linear("", "", [0.0, 1.0]))
        .high(Height::Square)
        .with(Mark::new(Role::Measured, Shape::Scene(Scene { bodies, spots })).from(
            "at",
            "/geometry/*/position_m/*",
            1.0,
        ));
    Some(
        Figure::new(
            "geometry",
            "4",
            "Where hammer and vibrometer went",
            "Arrows are impacts, squares are responses: orange on A, blue on B, green and grey away from the interface. Drag or use the arrow keys to turn it; x, y and z look along an axis.",
        )
        .with(panel),
    )
}

fn role(grouping: u8) -> Role {
    match grouping {
        1 | 5 => Role::SpecimenA,
        2 | 6 => Role::SpecimenB,
        3 => Role::Relative,
        _ => Role::Noise,
    }
}

fn body(places: &[Place], grouping: u8, role: Role) -> Option<Body> {
    let own: Vec<[f64; 3]> = places.iter().filter(|p| p.grouping == grouping).map(|p| p.position_m).collect();
    let end = |axis: usize, pick: fn(f64, f64) -> f64| own.iter().map(|p| p[axis]).reduce(pick);
    end(0, f64::min)?;
    let low = std::array::from_fn(|axis| end(axis, f64::min).unwrap_or(0.0) - ROOM_M);
    let high = std::array::from_fn(|axis| end(axis, f64::max).unwrap_or(0.0) + ROOM_M);
    Some(Body { role, low, high })
}
