//! A⁻¹ by Gauss–Jordan elimination with row pivoting, with separate pivots for every line.

use super::super::pseudo_inverse::CLEAR;
use super::matrix::Matrix;
use super::number::{LaneCell, Lanes, Reliable};
use pulp::{NullaryFnOnce, Simd};

pub(super) fn eliminated<'p, S: Simd>(mut a: Matrix<'p, S>, reliable: &mut Reliable<S>) -> Matrix<'p, S> {
    let (simd, n) = (a.pool.simd, a.rows());
    let mut x = Matrix::any(a.pool, n, 1);
    let mut swaps = Vec::with_capacity(n);
    simd.vectorize(Elimination { simd, n, a: a.cells_mut(), x: x.cells_mut(), swaps: &mut swaps, reliable });
    a
}

struct Elimination<'a, S: Simd> {
    simd: S,
    n: usize,
    a: &'a mut [LaneCell<S>],
    /// The current column.
    x: &'a mut [LaneCell<S>],
    swaps: &'a mut Vec<Swap<S>>,
    reliable: &'a mut Reliable<S>,
}

impl<S: Simd> NullaryFnOnce for Elimination<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let Elimination { simd, n, a, x, swaps, reliable } = self;
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
            reliable.only(pivot.exceeds(largest * all(CLEAR * CLEAR)));
            reliable.only(all(f64::INFINITY).exceeds(largest));
            let swap = Swap::of(simd, k, row);
            swap.in_column(column);
            // column k is overwritten by that of the inverse, which starts as the unit vector; −1
            // lets the update below scale row k too
            x.copy_from_slice(column);
            let minus_inverse = -x[k].inv();
            x[k] = LaneCell::all(simd, -1.0);
            column.fill(LaneCell::all(simd, 0.0));
            column[k] = LaneCell::all(simd, 1.0);
            for (c, column) in a.chunks_exact_mut(n).enumerate() {
                if c != k {
                    swap.in_column(column);
                }
                let f = std::mem::replace(&mut column[k], LaneCell::all(simd, 0.0)) * minus_inverse;
                for (v, x) in column.iter_mut().zip(x.iter()) {
                    *v += *x * f;
                }
            }
            swaps.push(swap);
        }
        for swap in swaps.iter().rev() {
            swap.of_columns(a, n);
        }
    }
}

/// Upper bound of the lanes of a processor's vectors.
const MOST_LANES: usize = 8;

/// The exchange of row (or column) k with another one for each line.
struct Swap<S: Simd> {
    simd: S,
    k: usize,
    /// The other row of each line, and the distinct ones among them: neighbouring lines mostly have
    /// the same.
    row: Lanes<S>,
    others: [usize; MOST_LANES],
    count: usize,
}

impl<S: Simd> Swap<S> {
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn of(simd: S, k: usize, row: Lanes<S>) -> Self {
        let (mut others, mut count) = ([0; MOST_LANES], 0);
        for other in row.each().iter().map(|row| *row as usize) {
            if !others[..count].contains(&other) {
                others[count] = other;
                count += 1;
            }
        }
        Swap { simd, k, row, others, count }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn in_column(&self, column: &mut [LaneCell<S>]) {
        if self.count == 1 {
            return column.swap(self.k, self.others[0]);
        }
        for &other in &self.others[..self.count] {
            let here = self.row.equals(Lanes::all(self.simd, other as f64));
            let (one, two) = (column[self.k], column[other]);
            // if the other is k itself, both are the same
            column[self.k] = two.where_or(here, one);
            column[other] = one.where_or(here, two);
        }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn of_columns(&self, a: &mut [LaneCell<S>], n: usize) {
        for &other in self.others[..self.count].iter().filter(|other| **other != self.k) {
            let here = self.row.equals(Lanes::all(self.simd, other as f64));
            let (one, two) = a.split_at_mut(other * n);
            for (one, two) in one[self.k * n..(self.k + 1) * n].iter_mut().zip(two) {
                (*one, *two) = (two.where_or(here, *one), one.where_or(here, *two));
            }
        }
    }
}
