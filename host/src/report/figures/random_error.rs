//! The random error of each cell's FRF.

use crate::report::figure::{Axis, Figure, Mark, Marker, Panel, Role};
use crate::results::Results;
use crate::structure::Structure;

/// Cells in the order of the plan, with one role per configuration.
pub fn random_error(results: &Results) -> Option<Figure> {
    let cells = &results.cells.as_ref()?.cells;
    let known: Vec<(usize, f64)> = cells
        .iter()
        .enumerate()
        .filter_map(|(i, c)| Some((i, 100.0 * c.random_error.filter(|e| *e > 0.0)?)))
        .collect();
    let low = known.iter().map(|(_, e)| *e).reduce(f64::min)?;
    let high = known.iter().map(|(_, e)| *e).fold(low, f64::max);
    let mut panel = Panel::new(
        Axis::linear("cell, in the order of the plan", "", [-1.0, cells.len() as f64]),
        Axis::log("random error", "%", [0.8 * low, 1.25 * high]),
    );
    for (group, configuration) in Structure::ALL.map(Structure::name).into_iter().enumerate() {
        let own: Vec<&(usize, f64)> =
            known.iter().filter(|(i, _)| cells[*i].configuration == configuration).collect();
        if own.is_empty() {
            continue;
        }
        let says = own.iter().map(|(i, e)| {
            format!("{configuration}, hit at {}, seen at {}: {e:.2} %", cells[*i].impact, cells[*i].response)
        });
        panel.marks.push(
            Mark::points(Role::group(group), Marker::Ring, own.iter().map(|(i, e)| [*i as f64, *e]))
                .saying(says.collect())
                .named(configuration)
                .from("x", "/cells/cells/*", 1.0)
                .from("y", "/cells/cells/*/random_error", 100.0),
        );
    }
    Some(
        Figure::new(
            "random-error",
            "",
            "Random error by cell",
            "How far noise alone moves the FRF of each cell, from coherence and number of hits: median over the main band.",
        )
        .with(panel),
    )
}
