//! Sums and products, computed as in [`product`](super::super::product).

use super::matrix::Matrix;
use super::number::{LaneCell, Lanes};
use super::pool::Pool;
use nalgebra::DMatrix;
use pulp::{NullaryFnOnce, Simd};
use std::ops::Mul;

/// A B.
pub(crate) fn product<'p, S: Simd>(a: &Matrix<'p, S>, b: &Matrix<'p, S>) -> Matrix<'p, S> {
    assert_eq!(a.columns(), b.rows(), "A has as many columns as B has rows");
    let (rows, inner) = (a.rows(), a.columns());
    sums(a.pool, [rows, inner, b.columns()], a.cells(), b.cells())
}

/// Y T with a real T.
pub(crate) fn times<'p, S: Simd>(y: &Matrix<'p, S>, t: &DMatrix<f64>) -> Matrix<'p, S> {
    assert_eq!(y.columns(), t.nrows(), "Y has as many columns as T has rows");
    sums(y.pool, [y.rows(), y.columns(), t.ncols()], y.cells(), t.as_slice())
}

/// T Y with a real T.
pub(crate) fn to_left_of<'p, S: Simd>(t: &DMatrix<f64>, y: &Matrix<'p, S>) -> Matrix<'p, S> {
    assert_eq!(t.ncols(), y.rows(), "T has as many columns as Y has rows");
    sums(y.pool, [t.nrows(), t.ncols(), y.columns()], t.as_slice(), y.cells())
}

fn sums<'p, S: Simd, A: Factor<S>, B: Factor<S>>(
    pool: &'p Pool<S>,
    [rows, inner, count]: [usize; 3],
    columns: &[A],
    factors: &[B],
) -> Matrix<'p, S>
where
    A::In: Mul<B::In, Output = LaneCell<S>>,
{
    let mut out = Matrix::any(pool, rows, count);
    let simd = pool.simd;
    simd.vectorize(LaneSums { simd, out: out.cells_mut(), rows, columns, factors, inner });
    out
}

/// A + B.
pub(crate) fn plus<'p, S: Simd>(mut a: Matrix<'p, S>, b: &Matrix<'p, S>) -> Matrix<'p, S> {
    a.pool.simd.vectorize(Added::<S, true> { a: a.cells_mut(), b: b.cells() });
    a
}

/// A − B.
pub(crate) fn minus<'p, S: Simd>(mut a: Matrix<'p, S>, b: &Matrix<'p, S>) -> Matrix<'p, S> {
    a.pool.simd.vectorize(Added::<S, false> { a: a.cells_mut(), b: b.cells() });
    a
}

struct Added<'a, S: Simd, const PLUS: bool> {
    a: &'a mut [LaneCell<S>],
    b: &'a [LaneCell<S>],
}

impl<S: Simd, const PLUS: bool> NullaryFnOnce for Added<'_, S, PLUS> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        for (a, b) in self.a.iter_mut().zip(self.b) {
            *a = if PLUS { *a + *b } else { *a - *b };
        }
    }
}

/// A factor of a product: a cell, or a real number common to all lines.
pub(crate) trait Factor<S: Simd>: Copy {
    type In: Copy;
    fn ready(self, simd: S) -> Self::In;
}

impl<S: Simd> Factor<S> for LaneCell<S> {
    type In = LaneCell<S>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn ready(self, _: S) -> LaneCell<S> {
        self
    }
}

impl<S: Simd> Factor<S> for f64 {
    type In = Lanes<S>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn ready(self, simd: S) -> Lanes<S> {
        Lanes::all(simd, self)
    }
}

impl<S: Simd> Mul<LaneCell<S>> for Lanes<S> {
    type Output = LaneCell<S>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn mul(self, other: LaneCell<S>) -> LaneCell<S> {
        other * self
    }
}

/// A B, all column-major.
struct LaneSums<'a, S: Simd, A, B> {
    simd: S,
    out: &'a mut [LaneCell<S>],
    rows: usize,
    columns: &'a [A],
    factors: &'a [B],
    inner: usize,
}

/// Number of rows of a sum that are kept in the processor's registers.
const TILE: usize = 3;

impl<S: Simd, A: Factor<S>, B: Factor<S>> NullaryFnOnce for LaneSums<'_, S, A, B>
where
    A::In: Mul<B::In, Output = LaneCell<S>>,
{
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let LaneSums { simd, out, rows, columns, factors, inner } = self;
        for (column, sum) in out.chunks_exact_mut(rows.max(1)).enumerate() {
            let factors = &factors[column * inner..(column + 1) * inner];
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

/// R rows of a column, three terms at a time, in the order of [`product`](super::super::product).
#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[inline(always)]
fn add<S: Simd, A: Factor<S>, B: Factor<S>, const R: usize>(
    simd: S,
    out: &mut [LaneCell<S>],
    columns: &[A],
    rows: usize,
    row: usize,
    factors: &[B],
) where
    A::In: Mul<B::In, Output = LaneCell<S>>,
{
    let mut sum = [LaneCell::all(simd, 0.0); R];
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
