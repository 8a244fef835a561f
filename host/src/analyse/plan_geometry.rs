//! The geometry of a plan.

use crate::campaign::plan::{ConfigurationPlan, Plan, SEPARATE, turned};
use crate::results::Place;
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};

/// Converts the plan's points to the types of substructuring, in the interface's coordinates, whose
/// z is the sliding direction: one channel for each axis of a response, in the order in which
/// records hold them. Blocks of one configuration are merged.
pub fn geometry(plan: &Plan) -> Geometry {
    let rows = plan.to_interface();
    // if the sliding direction is already z, coordinates must stay exact, without rounding
    in_coordinates(plan, &|v| if plan.slides_along_z() { v } else { turned(&rows, v) })
}

/// The same in the plan's own coordinates, which the labels of files use.
pub fn geometry_as_planned(plan: &Plan) -> Geometry {
    in_coordinates(plan, &|v| v)
}

fn in_coordinates(plan: &Plan, to_interface: &dyn Fn([f64; 3]) -> [f64; 3]) -> Geometry {
    let mut geometry = Geometry {
        a: Configuration::default(),
        b: Configuration::default(),
        ajb: Configuration::default(),
        virtual_point_a_m: to_interface(plan.geometry.virtual_point_m),
        virtual_point_b_m: to_interface(plan.geometry.virtual_point_m),
    };
    for of_plan in Structure::ALL {
        let blocks = || plan.configuration.iter().filter(|block| block.name.get_ref() == of_plan.name());
        let named = |of: fn(&ConfigurationPlan) -> &[toml::Spanned<String>], name: &str| {
            blocks().any(|block| of(block).iter().any(|n| n.get_ref() == name))
        };
        let mut points = Configuration::default();
        for response in plan.geometry.response.iter().map(toml::Spanned::get_ref) {
            let Ok(grouping) = Grouping::try_from(response.grouping) else { continue };
            if named(|block| &block.responses, &response.name) {
                points.channels.extend(response.axes().into_iter().map(|(description, axis)| Point {
                    name: response.name.clone(),
                    description,
                    grouping,
                    position_m: to_interface(response.position_m),
                    direction: to_interface(axis),
                }));
            }
        }
        for impact in plan.geometry.impact.iter().map(toml::Spanned::get_ref) {
            let Ok(grouping) = Grouping::try_from(impact.grouping) else { continue };
            if named(|block| &block.impacts, &impact.name) {
                points.impacts.push(Point {
                    name: impact.name.clone(),
                    description: impact.name.clone(),
                    grouping,
                    position_m: to_interface(impact.position_m),
                    direction: to_interface(impact.direction),
                });
            }
        }
        *geometry.points_mut(of_plan) = points;
    }
    geometry
}

/// Positions of hammer and vibrometer on the structures according to the plan: responses, then
/// impacts. The known mass stands beside them, and those of the open joint are not of the joined
/// structure.
pub fn places(plan: &Plan) -> Vec<Place> {
    let geometry = &plan.geometry;
    let responses = geometry.response.iter().map(toml::Spanned::get_ref).map(|p| Place {
        name: p.name.clone(),
        kind: "response",
        grouping: p.grouping,
        position_m: p.position_m,
        direction: None,
    });
    let impacts = geometry.impact.iter().map(toml::Spanned::get_ref).map(|p| Place {
        name: p.name.clone(),
        kind: "impact",
        grouping: p.grouping,
        position_m: p.position_m,
        direction: Some(p.direction),
    });
    responses.chain(impacts).filter(|place| !SEPARATE.contains(&place.grouping)).collect()
}
