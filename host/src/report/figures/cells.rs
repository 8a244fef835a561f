//! The matrix of cells: hits kept, compared with those planned.

use crate::report::figure::{Axis, Figure, Height, How, Mark, Packed, Panel, Role, Shape};
use crate::results::{CellRow, Results};
use crate::structure::Structure;

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
        "The stronger the square, the more of the hits wanted were kept. A pale one lacks hits, an empty one was never measured.",
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
        "{}, hit at {}, seen at {}: {} of {} kept{refused}",
        cell.configuration, cell.impact, cell.response, cell.kept, cell.wanted
    )
}
