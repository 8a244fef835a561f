//! Averaged cells into one FRF matrix per configuration, in the geometry's order.
//!
//! A substructuring matrix has no place for a guess: where a cell is missing that Eq. (3) reads, its impact or its
//! response location is left out. A cell that Eq. (3) does not read (a spare response, a hit on B in the assembly)
//! costs nothing: its place holds NaN, and whoever asks for it is refused by name.

use super::averages::CellAverage;
use crate::spectra::MotionQuantity;
use crate::spectra::averaged::variance_of_part;
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::{Configuration, Grouping, Point};
use crate::substructuring::noise::FrfNoise;
use nalgebra::DMatrix;
use num_complex::Complex;

/// What came of a configuration.
#[derive(Debug)]
pub struct Assembled {
    /// The FRFs, if anything was measured.
    pub frf: Option<FrfMatrix>,
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

/// Whether Eq. (3), in either form, reads the cell of this impact and this response: Y^A from everything on A to A's
/// interface, Y^B from B's interface to everything on B, and across the joint from A to B in the assembly.
fn is_read(configuration: &str, impact: Grouping, response: Grouping) -> bool {
    let on_a = |g| matches!(g, Grouping::InterfaceA | Grouping::InternalA);
    match configuration {
        "A" => on_a(impact) && response == Grouping::InterfaceA,
        "B" => impact == Grouping::InterfaceB && !on_a(response),
        _ => on_a(impact) && !on_a(response),
    }
}

/// Puts the cells of a configuration together. Where cells are missing that are read, the impact or location with the
/// largest share of holes is left out, until none remain.
pub fn assemble(
    configuration: &str,
    points: &Configuration,
    cells: &[CellAverage],
    sigma_per_s: f64,
    quantity: MotionQuantity,
) -> Assembled {
    let input_names = points.input_names();
    let output_names = points.output_names();
    let locations = locations(points);
    let groupings: Vec<Grouping> = locations
        .iter()
        .filter_map(|l| points.channels.iter().find(|c| c.name == *l))
        .map(|c| c.grouping)
        .collect();
    let find = |impact: &str, location: &str| {
        cells.iter().find(|c| c.name.impact == impact && c.name.response == location)
    };
    let (impacts, kept_locations) = if cells.is_empty() {
        (Vec::new(), Vec::new())
    } else {
        complete(points.impacts.len(), locations.len(), |i, l| {
            !is_read(configuration, points.impacts[i].grouping, groupings[l])
                || find(&points.impacts[i].name, locations[l]).is_some()
        })
    };
    let left_out = |all: usize, kept: &[usize]| (0..all).filter(|i| !kept.contains(i)).collect::<Vec<_>>();
    let impacts_left_out = left_out(points.impacts.len(), &impacts)
        .into_iter()
        .map(|i| points.impacts[i].name.clone())
        .collect();
    let responses_left_out =
        left_out(locations.len(), &kept_locations).into_iter().map(|l| locations[l].to_owned()).collect();
    let channels: Vec<usize> = (0..points.channels.len())
        .filter(|c| kept_locations.iter().any(|l| locations[*l] == points.channels[*c].name))
        .collect();
    let hole = Complex::new(f64::NAN, f64::NAN);
    let frf = cells.first().filter(|_| !channels.is_empty() && !impacts.is_empty()).map(|first| {
        let mut lines =
            vec![DMatrix::<Complex<f64>>::zeros(channels.len(), impacts.len()); first.frequency_hz.len()];
        for (column, i) in impacts.iter().enumerate() {
            for (row, c) in channels.iter().enumerate() {
                let channel = &points.channels[*c];
                let cell = find(&points.impacts[*i].name, &channel.name)
                    .filter(|cell| cell.frequency_hz.len() == lines.len());
                for (line, y) in lines.iter_mut().enumerate() {
                    y[(row, column)] = cell.map_or(hole, |cell| along(cell, channel, line));
                }
            }
        }
        FrfMatrix {
            frequency_hz: first.frequency_hz.clone(),
            sigma_per_s,
            quantity: quantity.frf(),
            outputs: channels.iter().map(|c| output_names[*c].clone()).collect(),
            inputs: impacts.iter().map(|i| input_names[*i].clone()).collect(),
            lines,
        }
    });
    Assembled { frf, impacts_left_out, responses_left_out }
}

/// Variance of the real part of every cell of `frf`, from coherence and hits; NaN where a cell has a single hit, or none.
pub fn noise(points: &Configuration, frf: &FrfMatrix, cells: &[CellAverage]) -> FrfNoise {
    let place = |names: &[String], wanted: &String| names.iter().position(|n| n == wanted);
    let (outputs, inputs) = (points.output_names(), points.input_names());
    let (rows, columns) = (frf.outputs.len(), frf.inputs.len());
    let mut variance = vec![DMatrix::from_element(rows, columns, f64::NAN); frf.lines.len()];
    for (column, input) in frf.inputs.iter().enumerate() {
        for (row, output) in frf.outputs.iter().enumerate() {
            let (Some(i), Some(o)) = (place(&inputs, input), place(&outputs, output)) else { continue };
            let (impact, channel) = (&points.impacts[i], &points.channels[o]);
            let own = |c: &&CellAverage| c.name.impact == impact.name && c.name.response == channel.name;
            let Some(cell) = cells.iter().find(own).filter(|c| c.frequency_hz.len() == variance.len()) else {
                continue;
            };
            for (line, v) in variance.iter_mut().enumerate() {
                v[(row, column)] = (0..3)
                    .filter(|axis| channel.direction[*axis] != 0.0)
                    .map(|axis| {
                        let part = variance_of_part(
                            cell.h1[axis][line],
                            cell.coherence[axis][line],
                            cell.records.len(),
                        );
                        part * channel.direction[axis].powi(2)
                    })
                    .sum();
            }
        }
    }
    FrfNoise { variance }
}

/// The response along the channel's direction from the vibrometer's x, y, z.
fn along(cell: &CellAverage, channel: &Point, line: usize) -> Complex<f64> {
    (0..3)
        // 0 times a value is left out, so that an axis that is not needed cannot spoil the others
        .filter(|axis| channel.direction[*axis] != 0.0)
        .map(|axis| cell.h1[axis][line] * channel.direction[axis])
        .sum()
}

/// Rows and columns of the largest part without holes that leaving out the worst one, again and again, finds.
fn complete(rows: usize, columns: usize, there: impl Fn(usize, usize) -> bool) -> (Vec<usize>, Vec<usize>) {
    let (mut kept_rows, mut kept_columns): (Vec<usize>, Vec<usize>) =
        ((0..rows).collect(), (0..columns).collect());
    loop {
        let holes_of_row = |r: usize| kept_columns.iter().filter(|c| !there(r, **c)).count();
        let holes_of_column = |c: usize| kept_rows.iter().filter(|r| !there(**r, c)).count();
        // shares, so that a whole missing row goes before a column that it crosses
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
        assert!(!is_read("A", InterfaceA, InternalA) && !is_read("AJB", InterfaceB, InternalB));
        assert!(!is_read("AJB", InternalA, InterfaceA));
        assert!(is_read("A", InternalA, InterfaceA) && is_read("B", InterfaceB, InternalB));
        assert!(is_read("AJB", InternalA, InternalB) && is_read("AJB", InterfaceA, InterfaceB));
    }

    #[test]
    fn holes_are_cut_out_with_little_loss() {
        // one cell of row 2 is missing: the row is the smaller loss
        assert_eq!(complete(4, 3, |r, c| (r, c) != (2, 1)), (vec![0, 1, 3], vec![0, 1, 2]));
        // an interrupted campaign: row 3 has not begun, row 2 is half done
        let (rows, columns) = complete(4, 4, |r, c| r < 2 || (r == 2 && c < 2));
        assert_eq!((rows, columns), (vec![0, 1], vec![0, 1, 2, 3]));
        assert_eq!(complete(2, 2, |_, _| false), (vec![], vec![]));
        assert_eq!(complete(0, 3, |_, _| true), (vec![], vec![]));
    }
}
