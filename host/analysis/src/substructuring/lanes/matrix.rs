//! A matrix of each line, by columns.

use super::number::{Cell, Lanes, Sure};
use nalgebra::{Complex, DMatrix};
use pulp::{NullaryFnOnce, Simd};

type Line = DMatrix<Complex<f64>>;

/// A matrix of as many lines as a vector holds.
#[derive(Clone)]
pub(crate) struct Matrix<S: Simd> {
    rows: usize,
    columns: usize,
    cells: Vec<Cell<S>>,
}

/// The lines of a vector from `first` on; where they end, the last one again.
pub(crate) fn lines<S: Simd>(_: S, of: &[Line], first: usize) -> Vec<&Line> {
    (first..first + S::F64_LANES).filter_map(|line| of.get(line).or(of.last())).collect()
}

impl<S: Simd> Matrix<S> {
    pub(crate) fn zeros(simd: S, rows: usize, columns: usize) -> Self {
        simd.vectorize(Zeros { simd, rows, columns })
    }

    /// The named rows and columns of a vector's lines.
    pub(crate) fn read(simd: S, lines: &[&Line], rows: &[usize], columns: &[usize]) -> Self {
        let mut matrix = Matrix::zeros(simd, rows.len(), columns.len());
        simd.vectorize(Read { into: &mut matrix, lines, rows, columns });
        matrix
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    pub(crate) fn cells(&self) -> &[Cell<S>] {
        &self.cells
    }

    pub(crate) fn cells_mut(&mut self) -> &mut [Cell<S>] {
        &mut self.cells
    }

    /// Columns from `first` on, `count` of them.
    pub(crate) fn columns_from(&self, first: usize, count: usize) -> &[Cell<S>] {
        &self.cells[first * self.rows..(first + count) * self.rows]
    }

    pub(crate) fn adjoint(&self) -> Self {
        let cells = (0..self.rows)
            .flat_map(|r| self.cells.iter().skip(r).step_by(self.rows).map(|cell| cell.conj()))
            .collect();
        Matrix { rows: self.columns, columns: self.rows, cells }
    }

    /// The block of `rows` × `columns` from (`row`, `column`) on.
    pub(crate) fn block(&self, (row, column): (usize, usize), (rows, columns): (usize, usize)) -> Self {
        let cells = self
            .columns_from(column, columns)
            .chunks_exact(self.rows.max(1))
            .flat_map(|column| &column[row..row + rows])
            .copied()
            .collect();
        Matrix { rows, columns, cells }
    }

    /// One over the other, as many columns each.
    pub(crate) fn above([upper, lower]: [Self; 2]) -> Self {
        let rows = upper.rows + lower.rows;
        let both =
            upper.cells.chunks_exact(upper.rows.max(1)).zip(lower.cells.chunks_exact(lower.rows.max(1)));
        let cells = both.flat_map(|(upper, lower)| upper.iter().chain(lower)).copied().collect();
        Matrix { rows, columns: upper.columns, cells }
    }

    /// One beside the other, as many rows each.
    pub(crate) fn beside([mut left, right]: [Self; 2]) -> Self {
        left.cells.extend(right.cells);
        Matrix { columns: left.columns + right.columns, ..left }
    }

    /// The matrix of one line.
    pub(crate) fn line(&self, lane: usize) -> Line {
        let cells =
            self.cells.iter().map(|cell| Complex::new(cell.re.each()[lane], cell.im.each()[lane])).collect();
        Line::from_vec(self.rows, self.columns, cells)
    }
}

struct Zeros<S: Simd> {
    simd: S,
    rows: usize,
    columns: usize,
}

impl<S: Simd> NullaryFnOnce for Zeros<S> {
    type Output = Matrix<S>;

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) -> Matrix<S> {
        let Zeros { simd, rows, columns } = self;
        Matrix { rows, columns, cells: vec![Cell::all(simd, 0.0); rows * columns] }
    }
}

struct Read<'a, S: Simd> {
    into: &'a mut Matrix<S>,
    lines: &'a [&'a Line],
    rows: &'a [usize],
    columns: &'a [usize],
}

impl<S: Simd> NullaryFnOnce for Read<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        // a column of all lines at a time stays in the first cache
        for (into, &c) in self.into.cells.chunks_exact_mut(self.rows.len().max(1)).zip(self.columns) {
            for (lane, y) in self.lines.iter().enumerate() {
                let column = &y.as_slice()[c * y.nrows()..][..y.nrows()];
                for (cell, &r) in into.iter_mut().zip(self.rows) {
                    let Complex { re, im } = column[r];
                    cell.re.each_mut()[lane] = re;
                    cell.im.each_mut()[lane] = im;
                }
            }
        }
    }
}

impl<S: Simd> Matrix<S> {
    /// diag(d) Z diag(d) times `factor`, as [`scaled`](super::super::interface_data::scaled) does it.
    pub(crate) fn scaled(&mut self, simd: S, d: &[f64], factor: Cell<S>) {
        let rows = self.rows.max(1);
        simd.vectorize(Scaled { simd, cells: &mut self.cells, rows, d, factor });
    }
}

impl<S: Simd> Matrix<S> {
    /// −Z.
    pub(crate) fn negate(&mut self, simd: S) {
        simd.vectorize(Negated { cells: &mut self.cells });
    }

    /// Where all cells are numbers.
    pub(crate) fn finite(&self, simd: S) -> Sure<S> {
        simd.vectorize(Finite { simd, cells: &self.cells })
    }
}

struct Negated<'a, S: Simd> {
    cells: &'a mut [Cell<S>],
}

impl<S: Simd> NullaryFnOnce for Negated<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        for cell in self.cells {
            *cell = -*cell;
        }
    }
}

struct Finite<'a, S: Simd> {
    simd: S,
    cells: &'a [Cell<S>],
}

impl<S: Simd> NullaryFnOnce for Finite<'_, S> {
    type Output = Sure<S>;

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) -> Sure<S> {
        let none = Lanes::all(self.simd, 0.0);
        let mut sum = none;
        for cell in self.cells {
            // what is no number stays none
            sum = sum + (cell.re * none + cell.im * none);
        }
        let mut sure = Sure::all(self.simd);
        sure.only(sum.equals(none));
        sure
    }
}

struct Scaled<'a, S: Simd> {
    simd: S,
    cells: &'a mut [Cell<S>],
    rows: usize,
    d: &'a [f64],
    factor: Cell<S>,
}

impl<S: Simd> NullaryFnOnce for Scaled<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        for (column, right) in self.cells.chunks_exact_mut(self.rows).zip(self.d) {
            let factor = self.factor * Lanes::all(self.simd, *right);
            for (cell, left) in column.iter_mut().zip(self.d) {
                *cell = *cell * factor * Lanes::all(self.simd, *left);
            }
        }
    }
}
