//! Sums and products, as [`product`](super::super::product) has them.

use super::matrix::Matrix;
use super::number::{Cell, Lanes};
use nalgebra::DMatrix;
use pulp::{NullaryFnOnce, Simd};
use std::ops::Mul;

/// A B.
pub(crate) fn product<S: Simd>(simd: S, a: &Matrix<S>, b: &Matrix<S>) -> Matrix<S> {
    assert_eq!(a.columns(), b.rows(), "A has as many columns as B has rows");
    let mut out = Matrix::zeros(simd, a.rows(), b.columns());
    let (rows, inner) = (a.rows(), a.columns());
    simd.vectorize(Sums { simd, out: out.cells_mut(), rows, columns: a.cells(), factors: b.cells(), inner });
    out
}

/// Y T with the real T.
pub(crate) fn times<S: Simd>(simd: S, y: &Matrix<S>, t: &DMatrix<f64>) -> Matrix<S> {
    assert_eq!(y.columns(), t.nrows(), "Y has as many columns as T has rows");
    let mut out = Matrix::zeros(simd, y.rows(), t.ncols());
    let (rows, inner) = (y.rows(), y.columns());
    simd.vectorize(Sums {
        simd,
        out: out.cells_mut(),
        rows,
        columns: y.cells(),
        factors: t.as_slice(),
        inner,
    });
    out
}

/// T Y with the real T.
pub(crate) fn to_left_of<S: Simd>(simd: S, t: &DMatrix<f64>, y: &Matrix<S>) -> Matrix<S> {
    assert_eq!(t.ncols(), y.rows(), "T has as many columns as Y has rows");
    let mut out = Matrix::zeros(simd, t.nrows(), y.columns());
    let (rows, inner) = t.shape();
    simd.vectorize(Sums {
        simd,
        out: out.cells_mut(),
        rows,
        columns: t.as_slice(),
        factors: y.cells(),
        inner,
    });
    out
}

/// A + B.
pub(crate) fn plus<S: Simd>(simd: S, mut a: Matrix<S>, b: &Matrix<S>) -> Matrix<S> {
    simd.vectorize(Added::<S, true> { a: a.cells_mut(), b: b.cells() });
    a
}

/// A − B.
pub(crate) fn minus<S: Simd>(simd: S, mut a: Matrix<S>, b: &Matrix<S>) -> Matrix<S> {
    simd.vectorize(Added::<S, false> { a: a.cells_mut(), b: b.cells() });
    a
}

struct Added<'a, S: Simd, const PLUS: bool> {
    a: &'a mut [Cell<S>],
    b: &'a [Cell<S>],
}

impl<S: Simd, const PLUS: bool> NullaryFnOnce for Added<'_, S, PLUS> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        for (a, b) in self.a.iter_mut().zip(self.b) {
            *a = if PLUS { *a + *b } else { *a - *b };
        }
    }
}

/// A factor of a product: a cell, or a real number for all lines.
pub(crate) trait Factor<S: Simd>: Copy {
    type In: Copy;
    fn ready(self, simd: S) -> Self::In;
}

impl<S: Simd> Factor<S> for Cell<S> {
    type In = Cell<S>;

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn ready(self, _: S) -> Cell<S> {
        self
    }
}

impl<S: Simd> Factor<S> for f64 {
    type In = Lanes<S>;

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn ready(self, simd: S) -> Lanes<S> {
        Lanes::all(simd, self)
    }
}

impl<S: Simd> Mul<Cell<S>> for Lanes<S> {
    type Output = Cell<S>;

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn mul(self, other: Cell<S>) -> Cell<S> {
        other * self
    }
}

/// A B, all by columns.
struct Sums<'a, S: Simd, A, B> {
    simd: S,
    out: &'a mut [Cell<S>],
    rows: usize,
    columns: &'a [A],
    factors: &'a [B],
    inner: usize,
}

/// So many rows of a sum stay in the processor's registers.
const TILE: usize = 3;

impl<S: Simd, A: Factor<S>, B: Factor<S>> NullaryFnOnce for Sums<'_, S, A, B>
where
    A::In: Mul<B::In, Output = Cell<S>>,
{
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        let Sums { simd, out, rows, columns, factors, inner } = self;
        for (sum, factors) in out.chunks_exact_mut(rows.max(1)).zip(factors.chunks_exact(inner.max(1))) {
            let mut row = 0;
            while row + TILE <= rows {
                add::<S, A, B, TILE>(simd, &mut sum[row..row + TILE], columns, rows, row, factors);
                row += TILE;
            }
            while row < rows {
                add::<S, A, B, 1>(simd, &mut sum[row..=row], columns, rows, row, factors);
                row += 1;
            }
        }
    }
}

/// R rows of a column, three terms at a time: the order of [`product`](super::super::product).
#[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
#[inline(always)]
fn add<S: Simd, A: Factor<S>, B: Factor<S>, const R: usize>(
    simd: S,
    out: &mut [Cell<S>],
    columns: &[A],
    rows: usize,
    row: usize,
    factors: &[B],
) where
    A::In: Mul<B::In, Output = Cell<S>>,
{
    let mut sum = [Cell::all(simd, 0.0); R];
    let part = |column: usize| -> &[A] { &columns[column * rows + row..][..R] };
    let mut threes = factors.chunks_exact(3);
    let mut column = 0;
    for f in threes.by_ref() {
        let f = [f[0].ready(simd), f[1].ready(simd), f[2].ready(simd)];
        let (x, y, z) = (part(column), part(column + 1), part(column + 2));
        for (r, sum) in sum.iter_mut().enumerate() {
            *sum += x[r].ready(simd) * f[0] + y[r].ready(simd) * f[1] + z[r].ready(simd) * f[2];
        }
        column += 3;
    }
    for f in threes.remainder() {
        let x = part(column);
        for (r, sum) in sum.iter_mut().enumerate() {
            *sum += x[r].ready(simd) * f.ready(simd);
        }
        column += 1;
    }
    out.copy_from_slice(&sum);
}
