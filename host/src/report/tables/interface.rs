//! Quality of the virtual points.

use super::{Table, key, number, words};
use crate::report::words::number::{decimals, short};
use crate::results::Results;
use std::collections::BTreeMap;

/// Fraction of the measurement that the virtual points reproduce.
pub fn virtual_points(results: &Results) -> Option<String> {
    if results.virtual_points.is_empty() {
        return None;
    }
    let heads = [
        "virtual point",
        "IDMs",
        "condition, sensors",
        "condition, impacts",
        "consistency, sensors",
        "consistency, impacts",
        "worst sensor",
        "worst impact",
        "passive lines",
        "reciprocity",
    ];
    let mut table = Table::new(1, "Quality of the virtual points", &heads);
    for (i, point) in results.virtual_points.iter().enumerate() {
        let at = |field: &str| format!("/virtual_points/{i}/{field}");
        let least = |all: &BTreeMap<String, f64>, field: &str| {
            let least = all.iter().min_by(|a, b| a.1.total_cmp(b.1));
            let place = least.map_or(String::new(), |(name, _)| at(&format!("{field}/{}", key(name))));
            number(least.map(|(name, value)| format!("{name} {}", decimals(*value, 2))), place)
        };
        let passive = point.passivity.iter().min_by(|a, b| a.1.total_cmp(b.1));
        table.row([
            words(format!("{} alone", point.substructure)),
            number(Some(point.idms.to_string()), at("idms")),
            number(Some(short(point.condition_responses)), at("condition_responses")),
            number(Some(short(point.condition_impacts)), at("condition_impacts")),
            number(Some(decimals(point.overall_sensor, 3)), at("overall_sensor")),
            number(Some(decimals(point.overall_impact, 3)), at("overall_impact")),
            least(&point.sensors, "sensors"),
            least(&point.impacts, "impacts"),
            number(
                passive.map(|(_, part)| format!("{} %", decimals(100.0 * part, 0))),
                passive.map_or(String::new(), |(dof, _)| at(&format!("passivity/{dof}"))),
            ),
            number(Some(decimals(point.reciprocity, 3)), at("reciprocity")),
        ]);
    }
    Some(format!(
        "<p>Condition numbers take rotations at 40 mm; consistency is the part of motion or force that the modes hold (mean over the main \
         band, 1 for a rigid interface); passive lines are those of the worst mode.</p>{}",
        table.finish()
    ))
}
