//! A matrix for each line, column-major.

use super::number::{LaneCell, Lanes, Reliable};
use super::pool::Pool;
use nalgebra::{Complex, DMatrix};
use pulp::{NullaryFnOnce, Simd};

type Line = DMatrix<Complex<f64>>;

/// A matrix for each of as many lines as a vector holds.
pub(crate) struct Matrix<'p, S: Simd> {
    pub(super) pool: &'p Pool<S>,
    rows: usize,
    columns: usize,
    cells: Vec<LaneCell<S>>,
}

impl<S: Simd> Drop for Matrix<'_, S> {
    fn drop(&mut self) {
        self.pool.back(std::mem::take(&mut self.cells));
    }
}

/// The lines of a vector from `first` on; beyond the end, the last one is repeated.
pub(crate) fn lines<'a, S: Simd, T>(_: &Pool<S>, of: &'a [T], first: usize) -> Vec<&'a T> {
    (first..first + S::F64_LANES).filter_map(|line| of.get(line).or(of.last())).collect()
}

impl<'p, S: Simd> Matrix<'p, S> {
    /// A matrix with arbitrary values.
    pub(crate) fn any(pool: &'p Pool<S>, rows: usize, columns: usize) -> Self {
        Matrix { pool, rows, columns, cells: pool.cells(rows * columns) }
    }

    /// The given rows and columns of a vector's lines.
    pub(crate) fn read(pool: &'p Pool<S>, lines: &[&Line], rows: &[usize], columns: &[usize]) -> Self {
        let mut matrix = Matrix::any(pool, rows.len(), columns.len());
        pool.simd.vectorize(Read { into: &mut matrix.cells, lines, rows, columns });
        matrix
    }

    /// Whole matrices of a vector's lines, all of the same size.
    pub(crate) fn whole(pool: &'p Pool<S>, lines: &[&Line]) -> Self {
        let (rows, columns) = lines.first().map_or((0, 0), |line| line.shape());
        assert!(lines.iter().all(|line| line.shape() == (rows, columns)), "matrices of one size");
        let mut matrix = Matrix::any(pool, rows, columns);
        for (lane, line) in lines.iter().enumerate() {
            matrix.put_line(lane, line);
        }
        matrix
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    pub(super) fn cells(&self) -> &[LaneCell<S>] {
        &self.cells
    }

    pub(super) fn cells_mut(&mut self) -> &mut [LaneCell<S>] {
        &mut self.cells
    }

    /// The block of `rows` × `columns` from (`row`, `column`) on.
    pub(crate) fn block(&self, (row, column): (usize, usize), (rows, columns): (usize, usize)) -> Self {
        let mut block = Matrix::any(self.pool, rows, columns);
        let from = self.cells[column * self.rows..].chunks_exact(self.rows.max(1));
        for (to, from) in block.cells.chunks_exact_mut(rows.max(1)).zip(from) {
            to.copy_from_slice(&from[row..row + rows]);
        }
        block
    }

    /// Writes `block` at (`row`, `column`).
    pub(crate) fn put(&mut self, (row, column): (usize, usize), block: &Self) {
        let rows = self.rows.max(1);
        let to = self.cells[column * self.rows..].chunks_exact_mut(rows);
        for (to, from) in to.zip(block.cells.chunks_exact(block.rows.max(1))) {
            to[row..row + block.rows].copy_from_slice(from);
        }
    }

    pub(crate) fn adjoint(&self) -> Self {
        self.turned::<true>()
    }

    pub(crate) fn transpose(&self) -> Self {
        self.turned::<false>()
    }

    fn turned<const CONJUGATE: bool>(&self) -> Self {
        let mut turned = Matrix::any(self.pool, self.columns, self.rows);
        let columns = self.columns;
        self.pool.simd.vectorize(Turned::<S, CONJUGATE> {
            from: &self.cells,
            to: &mut turned.cells,
            columns,
        });
        turned
    }

    /// A copy.
    pub(crate) fn copy(&self) -> Self {
        self.block((0, 0), (self.rows, self.columns))
    }

    /// −Z.
    #[must_use]
    pub(crate) fn negated(mut self) -> Self {
        self.pool.simd.vectorize(Negated { cells: &mut self.cells });
        self
    }

    /// diag(d) Z diag(d) times `factor`, computed as in
    /// [`scaled`](super::super::interface_data::scaled).
    #[must_use]
    pub(crate) fn scaled(mut self, d: &[f64], factor: LaneCell<S>) -> Self {
        let (simd, rows) = (self.pool.simd, self.rows.max(1));
        simd.vectorize(Scaled { simd, cells: &mut self.cells, rows, d, factor });
        self
    }

    /// The lines at which all cells are finite.
    pub(crate) fn finite(&self) -> Reliable<S> {
        let simd = self.pool.simd;
        simd.vectorize(Finite { simd, cells: &self.cells })
    }

    /// Writes one line's matrix, of the same size, to its lane.
    pub(crate) fn put_line(&mut self, lane: usize, line: &Line) {
        self.pool.simd.vectorize(PutLine { cells: &mut self.cells, lane, line: line.as_slice() });
    }

    /// Copies the matrix of one line to `to`, of the same size.
    pub(crate) fn line_to(&self, lane: usize, to: &mut Line) {
        self.pool.simd.vectorize(OneLine { cells: &self.cells, lane, to: to.as_mut_slice() });
    }

    /// The matrix of one line.
    pub(crate) fn line(&self, lane: usize) -> Line {
        let mut line = Line::zeros(self.rows, self.columns);
        self.line_to(lane, &mut line);
        line
    }
}

struct Read<'a, S: Simd> {
    into: &'a mut [LaneCell<S>],
    lines: &'a [&'a Line],
    rows: &'a [usize],
    columns: &'a [usize],
}

impl<S: Simd> NullaryFnOnce for Read<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        self.bring_near();
        // a column of all lines at a time stays in the first-level cache
        for (into, &c) in self.into.chunks_exact_mut(self.rows.len().max(1)).zip(self.columns) {
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

impl<S: Simd> Read<'_, S> {
    /// Prefetches every column, one line after the other: the memory then delivers many cache lines
    /// in parallel, which it does not if each is awaited to be written to its lane.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn bring_near(&self) {
        let mut seen = 0.0;
        for y in self.lines {
            for &c in self.columns {
                // four complex numbers fill one cache line
                for value in y.as_slice()[c * y.nrows()..][..y.nrows()].iter().step_by(4) {
                    seen += value.re;
                }
            }
        }
        std::hint::black_box(seen);
    }
}

struct Turned<'a, S: Simd, const CONJUGATE: bool> {
    from: &'a [LaneCell<S>],
    to: &'a mut [LaneCell<S>],
    columns: usize,
}

impl<S: Simd, const CONJUGATE: bool> NullaryFnOnce for Turned<'_, S, CONJUGATE> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let rows = self.from.len() / self.columns.max(1);
        for (r, to) in self.to.chunks_exact_mut(self.columns.max(1)).enumerate() {
            for (c, to) in to.iter_mut().enumerate() {
                let from = self.from[c * rows + r];
                *to = if CONJUGATE { from.conj() } else { from };
            }
        }
    }
}

struct Negated<'a, S: Simd> {
    cells: &'a mut [LaneCell<S>],
}

impl<S: Simd> NullaryFnOnce for Negated<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        for cell in self.cells {
            *cell = -*cell;
        }
    }
}

struct Scaled<'a, S: Simd> {
    simd: S,
    cells: &'a mut [LaneCell<S>],
    rows: usize,
    d: &'a [f64],
    factor: LaneCell<S>,
}

impl<S: Simd> NullaryFnOnce for Scaled<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
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

struct Finite<'a, S: Simd> {
    simd: S,
    cells: &'a [LaneCell<S>],
}

impl<S: Simd> NullaryFnOnce for Finite<'_, S> {
    type Output = Reliable<S>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) -> Reliable<S> {
        let none = Lanes::all(self.simd, 0.0);
        let mut sum = none;
        for cell in self.cells {
            // NaN or infinity times 0 is NaN
            sum = sum + (cell.re * none + cell.im * none);
        }
        let mut reliable = Reliable::all(self.simd);
        reliable.only(sum.equals(none));
        reliable
    }
}

struct OneLine<'a, S: Simd> {
    cells: &'a [LaneCell<S>],
    lane: usize,
    to: &'a mut [Complex<f64>],
}

impl<S: Simd> NullaryFnOnce for OneLine<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        for (to, cell) in self.to.iter_mut().zip(self.cells) {
            *to = Complex::new(cell.re.each()[self.lane], cell.im.each()[self.lane]);
        }
    }
}

struct PutLine<'a, S: Simd> {
    cells: &'a mut [LaneCell<S>],
    lane: usize,
    line: &'a [Complex<f64>],
}

impl<S: Simd> NullaryFnOnce for PutLine<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        for (cell, value) in self.cells.iter_mut().zip(self.line) {
            cell.re.each_mut()[self.lane] = value.re;
            cell.im.each_mut()[self.lane] = value.im;
        }
    }
}
