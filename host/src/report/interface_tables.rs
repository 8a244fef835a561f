//! The tables about joint and interface as a whole: the estimate to quote, the virtual points' quality.

use super::drawing::escape;
use super::tables::{Table, UNKNOWN};
use crate::report::words;
use crate::report::words::number::{band, decimals, short};
use crate::results::Results;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The estimates to quote, with their intervals, and what hits drawn anew say.
pub fn recommended(results: &Results) -> Option<String> {
    if results.recommended.is_empty() {
        return None;
    }
    let mut html = String::from(
        "<p>Recommended: Eq. A.1, averaged as an admittance before it is inverted, with 95 % intervals.</p>",
    );
    let heads = [
        "direction",
        "band",
        "K",
        "95 % interval",
        "of noise, σ",
        "of positions and angles, σ",
        "bias taken out",
        "C",
        "",
    ];
    let mut table = Table::new(1, &heads);
    for estimate in &results.recommended {
        for (dof, k) in &estimate.joint {
            let (scale, unit) = if dof.is_translation() { (1e-6, "N/µm") } else { (1.0, "N m/rad") };
            let shown = |value: f64| short(scale * value);
            table.row([
                format!("{dof}, {unit}"),
                band(estimate.band_hz),
                if k.identified { shown(k.stiffness) } else { UNKNOWN.into() },
                if k.identified {
                    format!("{} … {}", shown(k.ci95[0]), shown(k.ci95[1]))
                } else if k.ci95[0] <= 0.0 {
                    UNKNOWN.into()
                } else {
                    format!("above {}", shown(k.ci95[0]))
                },
                if estimate.noise_known { shown(k.std_noise) } else { UNKNOWN.into() },
                shown(k.std_geometry),
                shown(k.bias),
                short(k.damping),
                if k.identified { String::new() } else { "not identified".into() },
            ]);
        }
    }
    html.push_str(&table.finish());
    let sentences =
        results.recommended.iter().filter_map(|r| Some(format!("{}: {}", band(r.band_hz), r.statement()?)));
    let sentences = sentences.chain(results.bootstrap.as_ref().map(words::bootstrapped));
    html.push_str("<ul class=\"notes\">");
    for sentence in sentences {
        write!(html, "<li>{}</li>", escape(&sentence)).expect("writing into a String cannot fail");
    }
    html.push_str("</ul>");
    Some(html)
}

/// How well the virtual points hold what was measured.
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
    let mut table = Table::new(1, &heads);
    for point in &results.virtual_points {
        let worst = |all: &BTreeMap<String, f64>| {
            all.iter()
                .min_by(|a, b| a.1.total_cmp(b.1))
                .map_or(UNKNOWN.into(), |(name, value)| format!("{name} {}", decimals(*value, 2)))
        };
        let passive = point.passivity.values().copied().fold(f64::INFINITY, f64::min);
        table.row([
            format!("{} alone", point.substructure),
            point.idms.to_string(),
            short(point.condition_responses),
            short(point.condition_impacts),
            decimals(point.overall_sensor, 3),
            decimals(point.overall_impact, 3),
            worst(&point.sensors),
            worst(&point.impacts),
            format!("{} %", decimals(100.0 * passive, 0)),
            decimals(point.reciprocity, 3),
        ]);
    }
    Some(format!(
        "<p>Quality of the virtual points. Condition numbers take rotations at 40 mm; consistency is the part of motion or force that the modes hold (mean over the main \
         band, 1 for a rigid interface); passive lines are those of the worst mode.</p>{}",
        table.finish()
    ))
}
