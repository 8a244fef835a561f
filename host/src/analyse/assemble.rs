//! Assembles averaged cells into one FRF matrix per configuration, in the geometry's order.
//!
//! A substructuring matrix must not contain guesses: if a cell that Eq. (3) uses is missing, its
//! impact or its response location is left out. A cell that Eq. (3) does not use (a spare response,
//! a hit on B in the assembly) may be missing: its value is NaN, and selecting it is refused with
//! its name. Matrices written for other programs leave nothing out: they have a value for every
//! pair of the geometry. Points on specimens are not points of the arms: they are only in the
//! latter matrices.

use super::averages::CellAverage;
use crate::frf::Frf;
use crate::spectra::{CrossSpectra, MotionQuantity};
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Grouping, Point};
use nalgebra::DMatrix;
use num_complex::Complex;

/// The FRF matrix of a configuration.
#[derive(Debug)]
pub struct Assembled {
    /// H1 with its variance, if anything was measured; NaN for cells without measurement.
    pub measured: Option<Frf>,
    /// Impacts that had to be left out because cells are missing.
    pub impacts_left_out: Vec<String>,
    /// Response locations that had to be left out because cells are missing.
    pub responses_left_out: Vec<String>,
}

/// The response locations of a configuration: the distinct names of its channels, in order.
pub fn locations(points: &Configuration) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for channel in &points.channels {
        if !names.contains(&channel.name.as_str()) {
            names.push(&channel.name);
        }
    }
    names
}

/// Whether a response location is on an arm rather than on a specimen.
fn on_an_arm(points: &Configuration, location: &str) -> bool {
    !points.channels.iter().any(|c| c.name == location && c.grouping.is_specimen())
}

/// Whether Eq. (3), in either form, uses the cell of this impact and this response: Y^A from
/// everything on A to A's interface, Y^B from B's interface to everything on B, and across the
/// joint from A to B in the assembly.
fn is_read(configuration: Structure, impact: Grouping, response: Grouping) -> bool {
    let on_a = |g| matches!(g, Grouping::InterfaceA | Grouping::InternalA);
    match configuration {
        Structure::A => on_a(impact) && response == Grouping::InterfaceA,
        Structure::B => impact == Grouping::InterfaceB && !on_a(response),
        Structure::Ajb => on_a(impact) && !on_a(response),
    }
}

/// Assembles the cells of a configuration. If required cells are missing, the impact or location
/// with the largest fraction of missing cells is left out, repeatedly until none is missing.
pub fn assemble(
    configuration: Structure,
    points: &Configuration,
    cells: &[CellAverage],
    quantity: MotionQuantity,
) -> Assembled {
    let locations: Vec<&str> = locations(points).into_iter().filter(|name| on_an_arm(points, name)).collect();
    let groupings: Vec<Grouping> = locations
        .iter()
        .filter_map(|l| points.channels.iter().find(|c| c.name == *l))
        .map(|c| c.grouping)
        .collect();
    let on_arms: Vec<usize> =
        (0..points.impacts.len()).filter(|i| !points.impacts[*i].grouping.is_specimen()).collect();
    let (impacts, kept_locations) = if cells.is_empty() {
        (Vec::new(), Vec::new())
    } else {
        complete(on_arms.len(), locations.len(), |i, l| {
            let impact = &points.impacts[on_arms[i]];
            !is_read(configuration, impact.grouping, groupings[l])
                || find(cells, impact, locations[l]).is_some()
        })
    };
    let left_out = |all: usize, kept: &[usize]| (0..all).filter(|i| !kept.contains(i)).collect::<Vec<_>>();
    let impacts_left_out = left_out(on_arms.len(), &impacts)
        .into_iter()
        .map(|i| points.impacts[on_arms[i]].name.clone())
        .collect();
    let impacts: Vec<usize> = impacts.into_iter().map(|i| on_arms[i]).collect();
    let responses_left_out =
        left_out(locations.len(), &kept_locations).into_iter().map(|l| locations[l].to_owned()).collect();
    let channels: Vec<usize> = (0..points.channels.len())
        .filter(|c| kept_locations.iter().any(|l| locations[*l] == points.channels[*c].name))
        .collect();
    let measured = measured(points, &channels, &impacts, cells, quantity).map(|(frf, _)| frf);
    Assembled { measured, impacts_left_out, responses_left_out }
}

/// H1 of every pair of the geometry with its variance and coherence, measured or not; `None` if
/// nothing was measured.
pub fn everything(points: &Configuration, cells: &[CellAverage], quantity: MotionQuantity) -> Option<Frf> {
    let all = |count: usize| (0..count).collect::<Vec<_>>();
    let (channels, impacts) = (all(points.channels.len()), all(points.impacts.len()));
    let (frf, averages) = measured(points, &channels, &impacts, cells, quantity)?;
    let mut coherence =
        vec![DMatrix::from_element(channels.len(), impacts.len(), f64::NAN); frf.lines().len()];
    for Average { row, column, spectra, axis } in averages {
        for (line, coherence) in coherence.iter_mut().enumerate() {
            coherence[(row, column)] = spectra.coherence(line, axis);
        }
    }
    Some(frf.with_coherence(coherence).expect("one of each was made for every value"))
}

/// The cell and axis of one value of a matrix.
struct Average<'c> {
    row: usize,
    column: usize,
    spectra: &'c CrossSpectra,
    axis: usize,
}

/// Number of hits averaged in each FRF of [`everything`], outputs × inputs; 0 if there is none.
pub fn hits(points: &Configuration, cells: &[CellAverage]) -> DMatrix<usize> {
    DMatrix::from_fn(points.channels.len(), points.impacts.len(), |row, column| {
        let cell = find(cells, &points.impacts[column], &points.channels[row].name);
        cell.map_or(0, |cell| cell.spectra.hits())
    })
}

/// The FRFs of these channels and impacts with their noise, and the cell of each value.
fn measured<'c>(
    points: &Configuration,
    channels: &[usize],
    impacts: &[usize],
    cells: &'c [CellAverage],
    quantity: MotionQuantity,
) -> Option<(Frf, Vec<Average<'c>>)> {
    let first = &cells.first()?.spectra;
    if channels.is_empty() || impacts.is_empty() {
        return None;
    }
    let (rows, columns) = (channels.len(), impacts.len());
    let mut averages = Vec::new();
    for (column, i) in impacts.iter().enumerate() {
        for (row, c) in channels.iter().enumerate() {
            let Some(cell) = find(cells, &points.impacts[*i], &points.channels[*c].name) else { continue };
            let (spectra, axis) = (&cell.spectra, component(points, *c));
            if spectra.lines() == first.lines() && axis < spectra.outputs() {
                averages.push(Average { row, column, spectra, axis });
            }
        }
    }
    let hole = Complex::new(f64::NAN, f64::NAN);
    let mut lines = vec![DMatrix::from_element(rows, columns, hole); first.lines()];
    let mut variance = vec![DMatrix::from_element(rows, columns, f64::NAN); first.lines()];
    for Average { row, column, spectra, axis } in &averages {
        for line in 0..first.lines() {
            lines[line][(*row, *column)] = spectra.h1(line, *axis);
            variance[line][(*row, *column)] = spectra.variance(line, *axis);
        }
    }
    let (outputs, inputs) = (points.output_names(), points.input_names());
    let frf = Frf::new(
        first.frequency_hz().to_vec(),
        first.sigma_per_s(),
        quantity,
        channels.iter().map(|c| outputs[*c].clone()).collect(),
        impacts.iter().map(|i| inputs[*i].clone()).collect(),
        lines,
    );
    let whole = frf.and_then(|frf| frf.with_variance(variance));
    let whole =
        whole.expect("the geometry's names differ, and there is one matrix for each line of the first cell");
    Some((whole, averages))
}

/// Index of this channel within its location: records hold the channels in the geometry's order.
fn component(points: &Configuration, channel: usize) -> usize {
    let name = &points.channels[channel].name;
    points.channels[..channel].iter().filter(|before| before.name == *name).count()
}

/// The same index, from the channel itself.
pub fn component_of(points: &Configuration, channel: &Point) -> usize {
    points.channels.iter().position(|own| own == channel).map_or(0, |place| component(points, place))
}

/// The cell of this impact and response location.
fn find<'c>(cells: &'c [CellAverage], impact: &Point, location: &str) -> Option<&'c CellAverage> {
    cells.iter().find(|c| c.name.impact == impact.name && c.name.response == location)
}

/// Rows and columns of a complete part, found by repeatedly leaving out the worst row or column.
pub(super) fn complete(
    rows: usize,
    columns: usize,
    there: impl Fn(usize, usize) -> bool,
) -> (Vec<usize>, Vec<usize>) {
    let (mut kept_rows, mut kept_columns): (Vec<usize>, Vec<usize>) =
        ((0..rows).collect(), (0..columns).collect());
    loop {
        let holes_of_row = |r: usize| kept_columns.iter().filter(|c| !there(r, **c)).count();
        let holes_of_column = |c: usize| kept_rows.iter().filter(|r| !there(**r, c)).count();
        // fractions rather than counts, so that a row that is missing as a whole goes before a
        // column that it crosses
        let worst_row = kept_rows
            .iter()
            .map(|r| (holes_of_row(*r) as f64 / kept_columns.len().max(1) as f64, *r))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let worst_column = kept_columns
            .iter()
            .map(|c| (holes_of_column(*c) as f64 / kept_rows.len().max(1) as f64, *c))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let (Some((row_share, row)), Some((column_share, column))) = (worst_row, worst_column) else {
            return (Vec::new(), Vec::new());
        };
        if row_share == 0.0 && column_share == 0.0 {
            return (kept_rows, kept_columns);
        }
        if row_share >= column_share {
            kept_rows.retain(|r| *r != row);
        } else {
            kept_columns.retain(|c| *c != column);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_read_costs_nothing() {
        use Grouping::{InterfaceA, InterfaceB, InternalA, InternalB};
        // the spare response of A, and hits on B in the assembly
        assert!(
            !is_read(Structure::A, InterfaceA, InternalA) && !is_read(Structure::Ajb, InterfaceB, InternalB)
        );
        assert!(!is_read(Structure::Ajb, InternalA, InterfaceA));
        assert!(is_read(Structure::A, InternalA, InterfaceA) && is_read(Structure::B, InterfaceB, InternalB));
        assert!(
            is_read(Structure::Ajb, InternalA, InternalB) && is_read(Structure::Ajb, InterfaceA, InterfaceB)
        );
    }

    #[test]
    fn holes_are_cut_out_with_little_loss() {
        // one cell of row 2 is missing: the row is the smaller loss
        assert_eq!(complete(4, 3, |r, c| (r, c) != (2, 1)), (vec![0, 1, 3], vec![0, 1, 2]));
        // an interrupted campaign: row 3 has not begun, row 2 is half complete
        let (rows, columns) = complete(4, 4, |r, c| r < 2 || (r == 2 && c < 2));
        assert_eq!((rows, columns), (vec![0, 1], vec![0, 1, 2, 3]));
        assert_eq!(complete(2, 2, |_, _| false), (vec![], vec![]));
        assert_eq!(complete(0, 3, |_, _| true), (vec![], vec![]));
    }
}
