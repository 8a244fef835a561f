//! docs/rigs.md describes exactly the fields that a rig has.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use toml::Value;

const PAGE: &str = include_str!("../../../docs/rigs.md");
const DEFAULT: &str = include_str!("../../rigs/default.toml");
/// A rig with a user-defined structure.
const OWN: &str = include_str!("../../rigs/clamped-tips.toml");
/// A rig with a manual hammer and fixed vibrometers.
const BY_HAND: &str = include_str!("../../rigs/by-hand.toml");
/// A rig with accelerometers instead of lasers.
const ACCELEROMETERS: &str = include_str!("../../rigs/accelerometers.toml");

/// A rig whose contact wears.
const WEARING: &str = include_str!("../../rigs/wearing.toml");
/// A rig whose bodies bend.
const ELASTIC: &str = include_str!("../../rigs/elastic.toml");

/// Path of every field, with dots between table names; the tables of a list share one path.
fn fields(path: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Table(table) if !table.is_empty() => {
            for (name, inner) in table {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                fields(&path, inner, found);
            }
        }
        Value::Array(all) if all.first().is_some_and(Value::is_table) => {
            for inner in all {
                fields(path, inner, found);
            }
        }
        _ => {
            found.insert(path.into());
        }
    }
}

/// The names in the first column of the page's tables.
fn patterns() -> Vec<String> {
    let rows = PAGE.lines().filter(|line| line.starts_with("| `"));
    let first = rows.map(|line| line.split('|').nth(1).unwrap());
    first.flat_map(|cell| cell.split('`').skip(1).step_by(2).map(String::from)).collect()
}

fn is_meant(pattern: &str, path: &str) -> bool {
    match pattern.split_once('*') {
        Some((head, tail)) => {
            path.len() >= head.len() + tail.len() && path.starts_with(head) && path.ends_with(tail)
        }
        None => pattern == path,
    }
}

#[test]
fn the_page_and_the_rig_have_the_same_fields() {
    let mut known = BTreeSet::new();
    fields("", &toml::from_str(DEFAULT).unwrap(), &mut known);
    assert!(known.len() > 100, "{}", known.len());
    fields("", &toml::from_str(OWN).unwrap(), &mut known);
    fields("", &toml::from_str(BY_HAND).unwrap(), &mut known);
    fields("", &toml::from_str(ACCELEROMETERS).unwrap(), &mut known);
    fields("", &toml::from_str(ELASTIC).unwrap(), &mut known);
    fields("", &toml::from_str(WEARING).unwrap(), &mut known);
    // fields that the examples omit: every spring is in all configurations, there is no load cell,
    // the converters have 16 bits, sections are aligned with the rig, own bodies are rigid, and
    // nothing is off except what is drawn
    known.extend(
        [
            "contact.drift_per_hit",
            "contact.drift_per_s",
            "contact.patches.offset_m",
            "contact.patches.share",
            "errors.offset_m",
            "errors.tilt_rad",
            "paths.axes",
            "paths.between",
            "paths.in",
            "structure.load_cells_between",
            "structure.springs.in",
            "structure.load_cells_on",
            "sensors.bits",
            "bodies.arm_a.beam.first_edge",
            "structure.bodies.beam.young_pa",
        ]
        .map(String::from),
    );
    let patterns = patterns();
    for path in &known {
        assert!(patterns.iter().any(|pattern| is_meant(pattern, path)), "`{path}` is not on the page");
    }
    for pattern in &patterns {
        assert!(known.iter().any(|path| is_meant(pattern, path)), "`{pattern}` is no field of a rig");
    }
}
