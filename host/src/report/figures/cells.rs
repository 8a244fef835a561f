//! Figures of the cells and their positions:
//!
//! - the matrix of cells: hits kept, compared with those planned
//! - the positions of hammer and vibrometer in space (the paper's Fig. 4)
//! - the slope from each impact, by impact position

use super::MICRO;
use crate::report::figure::{
    Axis, Body, Figure, Height, How, Mark, Marker, Packed, Panel, Role, Scene, Shape, Spot,
};
use crate::report::scale::middle_range;
use crate::report::words::number::{micro, stiffness};
use crate::results::{CellRow, Place, Results};
use crate::structure::Structure;
use std::collections::BTreeMap;

/// This many impacts fit into a third of the page.
const FEW: usize = 5;

/// `AJB: 192 cells`.
pub(super) fn counted(configuration: &str, cells: usize) -> String {
    format!("{configuration}: {cells} {}", if cells == 1 { "cell" } else { "cells" })
}

/// One matrix for each configuration: responses down, impacts across.
pub fn cells(results: &Results) -> Option<Figure> {
    let all = &results.cells.as_ref()?.cells;
    // with imported FRFs the plan's cells have no hits, which is no fault
    if all.iter().all(|c| c.kept == 0 && c.refused.values().all(|n| *n == 0)) {
        return None;
    }
    let mut figure = Figure::new(
        "cells",
        "",
        "Every cell",
        "The stronger the colour of a square, the more of the hits wanted were kept. A pale square lacks hits, an empty one was not measured.",
    );
    for configuration in Structure::ALL.map(Structure::name) {
        let own: Vec<&CellRow> = all.iter().filter(|c| c.configuration == configuration).collect();
        let (mut impacts, mut responses): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
        for cell in &own {
            for (names, name) in [(&mut impacts, &cell.impact), (&mut responses, &cell.response)] {
                if !names.contains(name) {
                    names.push(name.clone());
                }
            }
        }
        if own.is_empty() {
            continue;
        }
        let pairs = || responses.iter().flat_map(|r| impacts.iter().map(move |i| (r, i)));
        let found: Vec<Option<&&CellRow>> =
            pairs().map(|(r, i)| own.iter().find(|c| c.response == *r && c.impact == *i)).collect();
        let values = found.iter().map(|c| c.map_or(f64::NAN, |c| c.kept as f64 / c.wanted.max(1) as f64));
        let shape = Shape::Cells {
            values: Packed::of(values),
            // one for every position, even without a cell, because the page looks them up by index
            says: found.iter().map(|c| c.map_or_else(String::new, |c| said(c))).collect(),
        };
        let panel = Panel::new(Axis::named("impact", impacts), Axis::named("response", responses))
            .titled(counted(configuration, own.len()))
            .high(Height::Usual)
            .with(Mark::new(Role::BetweenArms, shape).from_two(
                "values",
                "/cells/cells/*/kept",
                How::Per,
                "/cells/cells/*/wanted",
                1.0,
            ));
        figure = figure.with(panel);
    }
    // a few cells do not need large squares
    let most = figure.panels.iter().map(|p| p.x.names.len()).max().unwrap_or(0);
    (!figure.panels.is_empty()).then(|| if most <= FEW { figure.across(3) } else { figure })
}

fn said(cell: &CellRow) -> String {
    let refused: Vec<String> =
        cell.refused.iter().filter(|(_, n)| **n > 0).map(|(verdict, n)| format!("{n} {verdict}")).collect();
    let refused =
        if refused.is_empty() { String::new() } else { format!("; refused: {}", refused.join(", ")) };
    format!(
        "{}, impact {}, response {}: {} of {} kept{refused}",
        cell.configuration, cell.impact, cell.response, cell.kept, cell.wanted
    )
}

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
        .map(|p| Spot {
            name: p.name.clone(),
            role: role(p.grouping),
            at: p.position_m,
            toward: p.direction,
            moves: None,
        })
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
            "Every accepted hit along z on A or on the moving mass. If the columns differ, the slope depends on where the structure is hit; a contact's stiffness does not.",
        )
        .with(panel.with(dots)),
    )
}
