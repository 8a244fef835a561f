//! What errors of geometry add to the admittances that a block's cells reduce to.
//!
//! A cell reads (what its sensor sees) · Y · (what its blow pushes), linear in the ports' admittance Y, and so does what the reduction
//! makes of all cells: one real matrix on the entries of Y, the same for every line.

use super::block::{Block, Line};
use super::cell::CellGeometry;
use nalgebra::{Complex, DMatrix};

/// That matrix, on Y's entries by columns.
pub(super) struct Shift {
    matrix: DMatrix<f64>,
    shape: (usize, usize),
}

impl Shift {
    /// How much more the reduction of `block` gives where its cells are at `moved` than where they are at `nominal`.
    pub(super) fn of(block: &Block, moved: &[CellGeometry], nominal: &[CellGeometry]) -> Shift {
        let (rows, columns) = (block.rows.count, block.columns.count);
        let mut matrix = DMatrix::zeros(rows * columns, rows * columns);
        for (cells, sign) in [(moved, 1.0), (nominal, -1.0)] {
            let mut cells = cells.iter();
            for i in 0..block.impacts.len() {
                for sensor in &block.sensors {
                    let Some(cell) = cells.next() else { continue };
                    let shown = block.t_u.select_columns(&sensor.rows) * &cell.seen;
                    for (q, push) in cell.pushed.iter().enumerate().filter(|(_, push)| **push != 0.0) {
                        for c in 0..columns {
                            let factor = sign * push * block.t_f[(i, c)];
                            if factor != 0.0 {
                                let mut at = matrix.view_mut((c * rows, q * rows), (rows, rows));
                                at += &shown * factor;
                            }
                        }
                    }
                }
            }
        }
        Shift { matrix, shape: (rows, columns) }
    }

    /// What it adds to each of `lines`.
    pub(super) fn added_to(&self, lines: &[Line]) -> Vec<Line> {
        let (rows, columns) = self.shape;
        let count = lines.len();
        // real parts of all lines, then imaginary ones
        let mut stacked = DMatrix::zeros(rows * columns, 2 * count);
        for (l, y) in lines.iter().enumerate() {
            for (at, v) in y.iter().enumerate() {
                stacked[(at, l)] = v.re;
                stacked[(at, count + l)] = v.im;
            }
        }
        let added = &self.matrix * stacked;
        (0..count)
            .map(|l| {
                let parts = added.column(l).into_iter().zip(added.column(count + l));
                Line::from_iterator(rows, columns, parts.map(|(re, im)| Complex::new(*re, *im)))
            })
            .collect()
    }
}
