//! The geometry of a plan.

use crate::campaign::plan::Plan;
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};

/// The plan's points in the shape that substructuring knows: every response along x, y and z.
pub fn geometry(plan: &Plan) -> Geometry {
    const AXES: [(&str, [f64; 3]); 3] =
        [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])];
    let mut geometry = Geometry {
        a: Configuration::default(),
        b: Configuration::default(),
        ajb: Configuration::default(),
        virtual_point_a_m: plan.geometry.virtual_point_m,
        virtual_point_b_m: plan.geometry.virtual_point_m,
    };
    for structure in &plan.configuration {
        let named = |names: &[toml::Spanned<String>], name: &str| names.iter().any(|n| n.get_ref() == name);
        let mut points = Configuration::default();
        for response in plan.geometry.response.iter().map(toml::Spanned::get_ref) {
            let Ok(grouping) = Grouping::try_from(response.grouping) else { continue };
            if named(&structure.responses, &response.name) {
                points.channels.extend(AXES.map(|(axis, direction)| Point {
                    name: response.name.clone(),
                    description: format!("{}:{axis}", response.name),
                    grouping,
                    position_m: response.position_m,
                    direction,
                }));
            }
        }
        for impact in plan.geometry.impact.iter().map(toml::Spanned::get_ref) {
            let Ok(grouping) = Grouping::try_from(impact.grouping) else { continue };
            if named(&structure.impacts, &impact.name) {
                points.impacts.push(Point {
                    name: impact.name.clone(),
                    description: impact.name.clone(),
                    grouping,
                    position_m: impact.position_m,
                    direction: impact.direction,
                });
            }
        }
        // a plan that was read names no other
        if let Some(structure) = Structure::from_name(structure.name.get_ref()) {
            *geometry.points_mut(structure) = points;
        }
    }
    geometry
}
