//! A⁻¹ by Gauss–Jordan elimination with row pivoting, every line with its own pivots.

use super::super::pseudo_inverse::CLEAR;
use super::matrix::Matrix;
use super::number::{Cell, Lanes, Sure};
use pulp::{NullaryFnOnce, Simd};

pub(super) fn eliminated<S: Simd>(simd: S, mut a: Matrix<S>, sure: &mut Sure<S>) -> Matrix<S> {
    let n = a.rows();
    let mut scratch = Vec::with_capacity(n);
    let mut pivots = Vec::with_capacity(n);
    simd.vectorize(Elimination { simd, n, a: a.cells_mut(), x: &mut scratch, pivots: &mut pivots, sure });
    a
}

struct Elimination<'a, S: Simd> {
    simd: S,
    n: usize,
    a: &'a mut [Cell<S>],
    /// The column at work.
    x: &'a mut Vec<Cell<S>>,
    /// Each step's row, of each line.
    pivots: &'a mut Vec<Lanes<S>>,
    sure: &'a mut Sure<S>,
}

impl<S: Simd> NullaryFnOnce for Elimination<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        let Elimination { simd, n, a, x, pivots, sure } = self;
        let (all, none) = (|value| Lanes::all(simd, value), Lanes::all(simd, 0.0));
        let mut largest = none;
        for k in 0..n {
            let column = &mut a[k * n..(k + 1) * n];
            let (mut row, mut pivot) = (all(k as f64), none);
            for (r, v) in column.iter().enumerate().skip(k) {
                let size = v.norm_sqr();
                let larger = size.exceeds(pivot);
                (row, pivot) = (all(r as f64).where_or(larger, row), size.where_or(larger, pivot));
            }
            largest = pivot.where_or(pivot.exceeds(largest), largest);
            sure.only(pivot.exceeds(largest * all(CLEAR * CLEAR)));
            sure.only(all(f64::INFINITY).exceeds(largest));
            pivots.push(row);
            let swap = Swap::of(simd, k, row);
            swap.in_column(column);
            // column k makes room for that of the inverse, which starts as the unit vector; −1 puts row k itself in its place
            x.clear();
            x.extend_from_slice(column);
            let minus_inverse = -x[k].inv();
            x[k] = Cell::all(simd, -1.0);
            column.fill(Cell::all(simd, 0.0));
            column[k] = Cell::all(simd, 1.0);
            for (c, column) in a.chunks_exact_mut(n).enumerate() {
                if c != k {
                    swap.in_column(column);
                }
                let f = std::mem::replace(&mut column[k], Cell::all(simd, 0.0)) * minus_inverse;
                for (v, x) in column.iter_mut().zip(x.iter()) {
                    *v += *x * f;
                }
            }
        }
        for (k, row) in pivots.iter().enumerate().rev() {
            Swap::of(simd, k, *row).of_columns(a, n);
        }
    }
}

/// The exchange of row (or column) k with another one of each line.
enum Swap<S: Simd> {
    /// All lines have the same, as neighbours mostly do.
    Same(usize, usize),
    /// From k to the last row, and which it is.
    Own { k: usize, last: usize, row: Lanes<S>, simd: S },
}

impl<S: Simd> Swap<S> {
    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn of(simd: S, k: usize, row: Lanes<S>) -> Self {
        let [first, last] = row.range().map(|row| row as usize);
        if first == last { Swap::Same(k, last) } else { Swap::Own { k, last, row, simd } }
    }

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn in_column(&self, column: &mut [Cell<S>]) {
        match *self {
            Swap::Same(k, row) => column.swap(k, row),
            Swap::Own { k, last, row, simd } => {
                for r in k + 1..=last {
                    let here = row.equals(Lanes::all(simd, r as f64));
                    let (one, other) = (column[k], column[r]);
                    (column[k], column[r]) = (other.where_or(here, one), one.where_or(here, other));
                }
            }
        }
    }

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn of_columns(&self, a: &mut [Cell<S>], n: usize) {
        match *self {
            Swap::Same(k, row) if k == row => {}
            Swap::Same(k, row) => {
                for r in 0..n {
                    a.swap(k * n + r, row * n + r);
                }
            }
            Swap::Own { k, last, row, simd } => {
                for c in k + 1..=last {
                    let here = row.equals(Lanes::all(simd, c as f64));
                    for r in 0..n {
                        let (one, other) = (a[k * n + r], a[c * n + r]);
                        (a[k * n + r], a[c * n + r]) = (other.where_or(here, one), one.where_or(here, other));
                    }
                }
            }
        }
    }
}
