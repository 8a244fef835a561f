//! The geometry of a plan.

use crate::campaign::plan::{ConfigurationPlan, Plan};
use crate::results::Place;
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};

/// The plan's points in the shape that substructuring knows: every response along x, y and z. Blocks of one configuration add up.
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
    for of_plan in Structure::ALL {
        let blocks = || plan.configuration.iter().filter(|block| block.name.get_ref() == of_plan.name());
        let named = |of: fn(&ConfigurationPlan) -> &[toml::Spanned<String>], name: &str| {
            blocks().any(|block| of(block).iter().any(|n| n.get_ref() == name))
        };
        let mut points = Configuration::default();
        for response in plan.geometry.response.iter().map(toml::Spanned::get_ref) {
            let Ok(grouping) = Grouping::try_from(response.grouping) else { continue };
            if named(|block| &block.responses, &response.name) {
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
            if named(|block| &block.impacts, &impact.name) {
                points.impacts.push(Point {
                    name: impact.name.clone(),
                    description: impact.name.clone(),
                    grouping,
                    position_m: impact.position_m,
                    direction: impact.direction,
                });
            }
        }
        *geometry.points_mut(of_plan) = points;
    }
    geometry
}

/// Where hammer and vibrometer go, as the plan says: responses, then impacts.
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
    responses.chain(impacts).collect()
}
