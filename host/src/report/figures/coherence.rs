//! Coherence of every cell, one strip each.

use crate::report::figure::{Axis, Figure, Height, Mark, Packed, Panel, Role, Shape, Spread};
use crate::results::{CellRow, Cells, Results};
use crate::structure::Structure;

/// A panel for each configuration.
pub fn coherence(results: &Results) -> Option<Figure> {
    let cells = results.cells.as_ref()?;
    let mut figure = Figure::new(
        "coherence",
        "",
        "Coherence of every cell",
        "One strip for each cell, along the hit's own direction. White is 0.99 and more; the darker, the less of the response the hammer's force explains.",
    )
    .across(3);
    let range = [*cells.frequency_hz.first()?, *cells.frequency_hz.last()?];
    for configuration in Structure::ALL.map(Structure::name) {
        figure.panels.extend(panel(cells, configuration, range));
    }
    (!figure.panels.is_empty() && range[0] < range[1]).then_some(figure)
}

fn panel(cells: &Cells, configuration: &str, range: [f64; 2]) -> Option<Panel> {
    let lines = cells.frequency_hz.len();
    let own: Vec<&CellRow> = cells
        .cells
        .iter()
        .filter(|c| c.configuration == configuration && c.coherence.len() == lines)
        .collect();
    if own.is_empty() {
        return None;
    }
    let shape = Shape::Strips {
        x: Packed::of(cells.frequency_hz.iter().copied()),
        values: Packed::of(own.iter().flat_map(|c| c.coherence.iter().copied())),
        says: own.iter().map(|c| format!("{} seen at {}", c.impact, c.response)).collect(),
    };
    let mark = Mark::new(Role::Refused, shape)
        .named("coherence below 0.99")
        .from("values", "/cells/cells/*/coherence/*", 1.0)
        .from("x", "/cells/frequency_hz/*", 1.0);
    let y = Axis::linear("cell", "", [-0.5, own.len() as f64 - 0.5]);
    Some(
        Panel::new(Axis::frequency(Spread::Log, range), y)
            .titled(super::cells::counted(configuration, own.len()))
            .high(Height::Tall)
            .with(mark),
    )
}
