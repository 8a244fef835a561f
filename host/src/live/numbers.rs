//! A number of every cell for the matrix: how hard it was hit, how far noise alone moves its FRF, how much of the response the force explains.

use serde::Serialize;

use crate::campaign::plan::configuration_name;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::record_row::{Damaged, RecordRow};
use crate::report::cell_strip;
use crate::report::figure::{Figure, Shape};
use crate::results::MAIN_BAND;

/// A cell's numbers; none where there is none yet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellNumbers {
    /// The cell's id.
    pub cell: i64,
    /// Mean peak of its good hits, N.
    pub force_n: Option<f64>,
    /// Good hits in that mean.
    pub hits: usize,
    /// Random error of its FRF as the report's figure has it, %: median over the main band.
    pub random_error_percent: Option<f64>,
    /// Coherence as the report's figure has it: median over the main band.
    pub coherence: Option<f64>,
}

/// Of every cell, in the plan's order. Errors and coherence are those of the last analysis, whose `figures` these are.
pub fn of_cells(
    cells: &[CellRow],
    records: &[Result<RecordRow, Damaged>],
    figures: &[Figure],
) -> Vec<CellNumbers> {
    let named = |name: &str| figures.iter().find(|figure| figure.name == name);
    let (errors, coherences) = (named("random-error"), named("coherence"));
    let of_cell = |(place, row): (usize, &CellRow)| {
        let kept = records.iter().flatten().filter(|record| record.cell == row.id && record.kept());
        let peaks: Vec<f64> = kept.map(|record| record.peak_n).filter(|peak| *peak > 0.0).collect();
        let mean = peaks.iter().sum::<f64>() / peaks.len() as f64;
        let name = configuration_name(row.cell.configuration);
        let strip = cell_strip(&row.cell.impact, &row.cell.response);
        CellNumbers {
            cell: row.id,
            force_n: (!peaks.is_empty()).then_some(mean),
            hits: peaks.len(),
            random_error_percent: errors.and_then(|figure| point(figure, name, place)),
            coherence: coherences.and_then(|figure| median(figure, name, &strip)),
        }
    };
    cells.iter().enumerate().map(of_cell).collect()
}

/// The value of the point at this place of the plan.
fn point(figure: &Figure, configuration: &str, place: usize) -> Option<f64> {
    let mut own =
        figure.panels.iter().flat_map(|panel| &panel.marks).filter(|mark| mark.name == configuration);
    own.find_map(|mark| match &mark.shape {
        Shape::Points { x, y, .. } => {
            let at = x.0.iter().position(|x| f64::from(*x) == place as f64)?;
            y.0.get(at).map(|y| f64::from(*y))
        }
        _ => None,
    })
}

/// The median of a strip over the main band.
fn median(figure: &Figure, configuration: &str, strip: &str) -> Option<f64> {
    let own = figure
        .panels
        .iter()
        .find(|panel| panel.title.strip_prefix(configuration).is_some_and(|rest| rest.starts_with(':')))?;
    own.marks.iter().find_map(|mark| {
        let Shape::Strips { x, values, says } = &mark.shape else { return None };
        let row = says.iter().position(|name| name == strip)?;
        let values = values.0.chunks_exact(x.0.len().max(1)).nth(row)?;
        let inside =
            x.0.iter().zip(values).filter(|(f, v)| MAIN_BAND.contains(f64::from(**f)) && v.is_finite());
        let mut inside: Vec<f64> = inside.map(|(_, v)| f64::from(*v)).collect();
        inside.sort_by(f64::total_cmp);
        inside.get(inside.len() / 2).copied()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::Plan;
    use crate::campaign::store::Store;
    use crate::results::{self, Cells, Results};
    use std::collections::BTreeMap;

    #[test]
    fn numbers_are_those_of_the_report_and_belong_to_their_cell() {
        let text = include_str!("../../../docs/plans/small.toml");
        Plan::parse(text, "plan").expect("a good plan");
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::create(&folder.path().join("c.jrig"), text, "plan").expect("a file");
        let cells = store.cells().expect("cells");
        assert!(cells.iter().all(|row| row.id > 0) && cells.len() > 3);
        // the third cell was not heard; of the others, place n has the error (n + 1) ‰ and the coherence 0.9 + n/1000
        let rows = cells.iter().enumerate().map(|(n, row)| results::CellRow {
            configuration: configuration_name(row.cell.configuration).into(),
            impact: row.cell.impact.clone(),
            response: row.cell.response.clone(),
            wanted: 2,
            kept: 2,
            refused: BTreeMap::new(),
            coherence: if n == 2 { vec![] } else { vec![0.1, 0.9 + 1e-3 * n as f64, 0.2] },
            random_error: (n != 2).then(|| 1e-3 * (n + 1) as f64),
        });
        let cells_found = Cells { frequency_hz: vec![100.0, 400.0, 900.0], cells: rows.collect() };
        let results = Results { cells: Some(cells_found), ..Results::default() };
        let numbers = of_cells(&cells, &[], &crate::report::all_figures(&results));
        for (n, (own, row)) in numbers.iter().zip(&cells).enumerate() {
            assert_eq!((own.cell, own.force_n, own.hits), (row.id, None, 0));
            if n == 2 {
                assert_eq!((own.random_error_percent, own.coherence), (None, None));
                continue;
            }
            let (error, coherence) =
                (own.random_error_percent.expect("known"), own.coherence.expect("known"));
            assert!((error - 0.1 * (n + 1) as f64).abs() < 1e-5, "{own:?}");
            assert!((coherence - 0.9 - 1e-3 * n as f64).abs() < 1e-5, "{own:?}");
        }
        let nothing = of_cells(&cells, &[], &[]);
        assert!(nothing.iter().all(|own| own.random_error_percent.is_none() && own.coherence.is_none()));
    }
}
