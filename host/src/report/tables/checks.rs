//! The checks on which the credibility of the numbers rests, among them the quality of the virtual
//! points: each with its outcome, its meaning and its figures.

use super::{HtmlTable, key, number, words};
use crate::report::html::escaped;
use crate::report::words;
use crate::report::words::number::{count, decimals, short};
use crate::results::Results;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Checks with their outcome, meaning and figures.
pub fn checks(results: &Results) -> Option<String> {
    if results.checks.is_empty() {
        return None;
    }
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"checks\"><caption>Checks</caption><thead><tr><th scope=\"col\">check</th><th scope=\"col\">outcome</th>\
         <th scope=\"col\">what it means</th></tr></thead><tbody>",
    );
    for (i, check) in results.checks.iter().enumerate() {
        let (class, sign) = match check.ok {
            Some(true) => ("good", "✓"),
            Some(false) => ("bad", "✗"),
            None => ("open", "?"),
        };
        let mut figures: Vec<String> = check
            .frequency_hz
            .iter()
            .map(|f| {
                format!(
                    "<span data-path=\"/checks/{i}/frequency_hz\">{}</span>",
                    escaped(&format!("at {} Hz", short(*f)))
                )
            })
            .collect();
        figures.extend(check.values.iter().map(|(name, value)| {
            let path = escaped(&format!("/checks/{i}/{name}"));
            format!("<span data-path=\"{path}\">{}</span>", escaped(&figure(name, *value)))
        }));
        let name = escaped(&check.name);
        let _ = write!(
            html,
            "<tr id=\"check-{name}\"><th scope=\"row\">{}</th><td><span class=\"{class}\">{sign} {}</span></td><td>{} <small>{}</small></td></tr>",
            escaped(&check.name.replace('-', " ")),
            words::outcome(check.ok),
            escaped(&check.meaning),
            figures.join("; ")
        );
    }
    html.push_str("</tbody></table></div>");
    Some(html)
}

/// `series_stiffness_n_per_m`, 3.1e7 → `series stiffness 31.0 N/µm`; counts and ranks have no
/// decimals.
fn figure(name: &str, value: f64) -> String {
    const UNITS: [(&str, f64, &str); 6] = [
        ("_n_per_m", 1e-6, " N/µm"),
        ("_m_per_n", 1e6, " µm/N"),
        ("_hz", 1.0, " Hz"),
        ("_deg", 1.0, "°"),
        ("_percent", 1.0, " %"),
        ("_m", 1e6, " µm"),
    ];
    let (stem, scale, unit) = UNITS
        .into_iter()
        .find_map(|(end, scale, unit)| name.strip_suffix(end).map(|stem| (stem, scale, unit)))
        .unwrap_or((name, 1.0, ""));
    let counted =
        ["rank", "dofs", "modes", "impacts", "responses", "hits"].iter().any(|word| name.contains(word));
    let whole = value.fract() == 0.0 && value >= 0.0;
    let text = if counted && whole { count(value as u64) } else { short(value * scale) };
    format!("{} {text}{unit}", stem.replace('_', " "))
}

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
    let mut table = HtmlTable::new(1, "Quality of the virtual points", &heads);
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
        "<p>Condition numbers take rotations at 40 mm; consistency is the part of motion or force that the modes describe (mean over the main \
         band, 1 for a rigid interface); passive lines are those of the worst mode.</p>{}",
        table.finish()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_checks_carry_units() {
        assert_eq!(figure("series_stiffness_n_per_m", 31.2e6), "series stiffness 31.2 N/µm");
        assert_eq!(figure("ratio", 5.5), "ratio 5.50");
        assert_eq!(figure("rank_p", 6.0), "rank p 6");
    }
}
