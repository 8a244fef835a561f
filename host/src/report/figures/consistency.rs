//! Fraction of the measurement that rigid motions of the virtual points reproduce, channel by
//! channel and impact by impact.

use crate::report::figure::{Axis, Figure, Mark, Marker, Panel, Role};
use crate::results::{Results, VirtualPoint};
use std::collections::BTreeMap;

/// Sensors on the left, impacts on the right, for the largest set of modes.
pub fn consistency(results: &Results) -> Option<Figure> {
    let most = results.virtual_points.iter().map(|p| p.idms).max()?;
    let shown: Vec<(usize, &VirtualPoint)> =
        results.virtual_points.iter().enumerate().filter(|(_, p)| p.idms == most).collect();
    let reciprocity: Vec<String> =
        shown.iter().map(|(_, p)| format!("{} alone {:.3}", p.substructure, p.reciprocity)).collect();
    let mut figure = Figure::new(
        "consistency",
        "",
        "Consistency of the virtual points",
        format!(
            "Part of the measured motion (left) and force (right) that the {most} modes hold: 1 for an interface that stays rigid. Reciprocity, hitting here and looking there against the other way round: {}.",
            reciprocity.join(", ")
        ),
    )
    .across(2);
    for (field, of) in [
        ("sensors", (|p| &p.sensors) as fn(&VirtualPoint) -> &BTreeMap<String, f64>),
        ("impacts", |p| &p.impacts),
    ] {
        let names: Vec<String> = shown.iter().flat_map(|(_, p)| of(p).keys().cloned()).collect();
        let low = shown.iter().flat_map(|(_, p)| of(p).values()).copied().fold(1.0, f64::min);
        let mut panel = Panel::new(
            Axis::named(field, names),
            Axis::linear("consistency", "", [(low - 0.05).max(0.0), 1.02]),
        );
        let mut from = 0;
        for (i, point) in &shown {
            let values = of(point);
            let role = if point.substructure == "A" { Role::SpecimenA } else { Role::SpecimenB };
            let at = values.values().enumerate().map(|(n, v)| [(from + n) as f64, *v]);
            panel.marks.push(
                Mark::points(role, Marker::Dot, at)
                    .saying(values.iter().map(|(name, v)| format!("{name}: {v:.4}")).collect())
                    .named(format!("{} alone", point.substructure))
                    .from("y", format!("/virtual_points/{i}/{field}/*"), 1.0),
            );
            from += values.len();
        }
        figure.panels.push(panel);
    }
    Some(figure)
}
