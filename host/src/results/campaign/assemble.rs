//! Averaged cells into one FRF matrix per configuration, in the geometry's order, without holes.

use super::averages::CellAverage;
use crate::spectra::MotionQuantity;
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::{Configuration, Point};
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

/// Puts cells together. Where cells are missing, the impact or location with the most holes is left out, until
/// none remain: a substructuring matrix has no place for a guess.
pub fn assemble(
    points: &Configuration,
    cells: &[CellAverage],
    sigma_per_s: f64,
    quantity: MotionQuantity,
) -> Assembled {
    let input_names = points.input_names();
    let output_names = points.output_names();
    let locations = locations(points);
    let find = |impact: &str, location: &str| {
        cells.iter().find(|c| c.name.impact == impact && c.name.response == location)
    };
    let (impacts, kept_locations) = complete(points.impacts.len(), locations.len(), |i, l| {
        find(&points.impacts[i].name, locations[l]).is_some()
    });
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
    let first = impacts
        .first()
        .zip(kept_locations.first())
        .and_then(|(i, l)| find(&points.impacts[*i].name, locations[*l]));
    let frf = first.map(|first| {
        let mut lines =
            vec![DMatrix::<Complex<f64>>::zeros(channels.len(), impacts.len()); first.frequency_hz.len()];
        for (column, i) in impacts.iter().enumerate() {
            for (row, c) in channels.iter().enumerate() {
                let channel = &points.channels[*c];
                let cell = find(&points.impacts[*i].name, &channel.name)
                    .expect("only complete rows and columns are kept");
                for (line, y) in lines.iter_mut().enumerate() {
                    y[(row, column)] = along(cell, channel, line);
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
    fn holes_are_cut_out_with_little_loss() {
        // one cell of row 2 is missing: the row goes, or the column, not both
        let (rows, columns) = complete(4, 3, |r, c| (r, c) != (2, 1));
        assert_eq!(rows.len() * columns.len(), 8.max(9.min(rows.len() * columns.len())));
        assert!(rows.len() == 3 || columns.len() == 2);
        // an interrupted campaign: row 3 has not begun, row 2 is half done
        let (rows, columns) = complete(4, 4, |r, c| r < 2 || (r == 2 && c < 2));
        assert_eq!((rows, columns), (vec![0, 1], vec![0, 1, 2, 3]));
        assert_eq!(complete(2, 2, |_, _| false), (vec![], vec![]));
        assert_eq!(complete(0, 3, |_, _| true), (vec![], vec![]));
    }
}
