//! Effect of errors of geometry on the admittances that a block's cells reduce to.
//!
//! A cell's value is (response of its sensor) · Y · (port forces of its hit), linear in the ports'
//! admittance Y, and so is the reduction of all cells: one real matrix acting on the entries of Y,
//! the same for every line.

use super::block::{Block, Line};
use super::cell::CellGeometry;
use nalgebra::{Complex, DMatrix};

/// That matrix, acting on Y's entries in column-major order.
pub(super) struct Shift {
    matrix: DMatrix<f64>,
    shape: (usize, usize),
}

impl Shift {
    /// Difference of the reduction of `block` between cells at `moved` and cells at `nominal`.
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

    /// The change of each of `lines`.
    pub(super) fn added_to(&self, lines: &[Line]) -> Vec<Line> {
        let (rows, columns) = self.shape;
        let count = lines.len();
        // real parts of all lines, then imaginary parts
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
