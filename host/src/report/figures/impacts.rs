//! The slope from each impact, by impact position.

use super::MICRO;
use crate::report::figure::{Axis, Figure, Mark, Marker, Panel, Role};
use crate::report::scale::middle_range;
use crate::report::words::number::{micro, stiffness};
use crate::results::Results;
use std::collections::BTreeMap;

/// One point per record in a column per impact position; mean ± σ across all.
pub fn impacts(results: &Results) -> Option<Figure> {
    if results.impact_slopes.len() < 2 {
        return None;
    }
    let mut columns: BTreeMap<&str, Vec<(i64, f64)>> = BTreeMap::new();
    for slope in &results.impact_slopes {
        columns.entry(&slope.impact).or_default().push((slope.record, micro(slope.k_eq_n_per_m)));
    }
    let values = || columns.values().flatten().map(|(_, k)| *k);
    let range = middle_range(values(), 1.0, 0.15)?;
    let names: Vec<String> = columns.keys().map(|name| (*name).to_owned()).collect();
    let mut panel = Panel::new(Axis::named("hit at", names), Axis::linear("slope", "N/µm", range));
    let whole = panel.x.range;
    if let Some(k) = results.impact_loops().and_then(|h| h.k_eq_n_per_m) {
        let (mean, std) = (micro(k.mean), micro(k.std));
        let ribbon = crate::report::figure::Shape::Ribbon {
            x: crate::report::figure::Along::of(&whole),
            low: crate::report::figure::Packed::of([mean - std; 2]),
            high: crate::report::figure::Packed::of([mean + std; 2]),
        };
        panel = panel.with(Mark::new(Role::Loops, ribbon)).with(
            Mark::level(Role::Loops, mean).named(format!("all hits: {}", stiffness(k.mean, k.std))).from(
                "at",
                "/hysteresis/*/k_eq_n_per_m/mean",
                1.0 / MICRO,
            ),
        );
    }
    let points = columns.values().enumerate().flat_map(|(column, own)| {
        let step = 0.7 / own.len() as f64;
        own.iter().enumerate().map(move |(i, (_, k))| [column as f64 - 0.35 + (i as f64 + 0.5) * step, *k])
    });
    let says = columns.iter().flat_map(|(name, own)| {
        own.iter().map(move |(record, k)| format!("record {record}, {name}: {k:.1} N/µm"))
    });
    let dots = Mark::points(Role::Group1, Marker::Ring, points).saying(says.collect()).named("one hit").from(
        "y",
        "/impact_slopes/*/k_eq_n_per_m",
        1.0 / MICRO,
    );
    Some(
        Figure::new(
            "impacts",
            "",
            "The slope of every impact",
            "Every hit that counts, along z on A or on the moving mass. Columns that differ from one another say that the slope depends on where the structure is hit, as no contact's stiffness does.",
        )
        .with(panel.with(dots)),
    )
}
