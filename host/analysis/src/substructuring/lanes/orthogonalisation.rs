//! A⁺ = R⁻¹Qᴴ of a tall matrix by Gram–Schmidt, repeated at the lines where much cancels.

use super::super::pseudo_inverse::CLEAR;
use super::matrix::Matrix;
use super::number::{LaneCell, Lanes, Reliable};
use pulp::{NullaryFnOnce, Simd};

pub(super) fn orthogonalised<'p, S: Simd>(mut a: Matrix<'p, S>, reliable: &mut Reliable<S>) -> Matrix<'p, S> {
    let (simd, m, n) = (a.pool.simd, a.rows(), a.columns());
    let mut r = Matrix::any(a.pool, n, n);
    simd.vectorize(Orthogonalisation { simd, m, n, q: a.cells_mut(), r: r.cells_mut(), reliable });
    let mut inverse = a.adjoint();
    simd.vectorize(Substitution { n, x: inverse.cells_mut(), r: r.cells() });
    inverse
}

struct Orthogonalisation<'a, S: Simd> {
    simd: S,
    m: usize,
    n: usize,
    q: &'a mut [LaneCell<S>],
    r: &'a mut [LaneCell<S>],
    reliable: &'a mut Reliable<S>,
}

impl<S: Simd> NullaryFnOnce for Orthogonalisation<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let Orthogonalisation { simd, m, n, q, r, reliable } = self;
        let all = |value| Lanes::all(simd, value);
        let none = LaneCell::all(simd, 0.0);
        let mut largest = all(0.0);
        for k in 0..n {
            let (done, rest) = q.split_at_mut(k * m);
            let (v, r) = (&mut rest[..m], &mut r[k * n..=k * n + k]);
            r.fill(none);
            let mut square = square_of(simd, v);
            // first all lines, then those where much was subtracted
            let mut at = all(0.0).equals(all(0.0));
            for _ in 0..2 {
                for (q, r) in done.chunks_exact(m).zip(r.iter_mut()) {
                    let mut along = none;
                    for (q, v) in q.iter().zip(v.iter()) {
                        along += q.conj() * *v;
                    }
                    let along = along.where_or(at, none);
                    *r += along;
                    for (v, q) in v.iter_mut().zip(q) {
                        *v -= *q * along;
                    }
                }
                let (before, after) = (square, square_of(simd, v));
                square = after.where_or(at, before);
                // if little was subtracted, the component along the other columns that rounding
                // leaves is small
                let enough = all(1.0).where_or(square.exceeds(all(0.1) * before), all(0.0));
                if enough.range() == [1.0; 2] {
                    break;
                }
                at = all(0.5).exceeds(enough);
            }
            largest = square.where_or(square.exceeds(largest), largest);
            reliable.only(square.exceeds(largest * all(CLEAR * CLEAR)));
            reliable.only(all(f64::INFINITY).exceeds(largest));
            // the diagonal holds 1/Rₖₖ: multiplications instead of divisions
            let inverse = all(1.0).over(square.sqrt());
            r[k] = LaneCell { re: inverse, im: all(0.0) };
            for v in v {
                *v = *v * inverse;
            }
        }
    }
}

/// Multiplies each column by R⁻¹.
struct Substitution<'a, S: Simd> {
    n: usize,
    x: &'a mut [LaneCell<S>],
    r: &'a [LaneCell<S>],
}

impl<S: Simd> NullaryFnOnce for Substitution<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        for x in self.x.chunks_exact_mut(self.n.max(1)) {
            for (k, r) in self.r.chunks_exact(self.n).enumerate().rev() {
                let solved = x[k] * r[k].re;
                x[k] = solved;
                for (x, r) in x[..k].iter_mut().zip(r) {
                    *x -= *r * solved;
                }
            }
        }
    }
}

#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[inline(always)]
fn square_of<S: Simd>(simd: S, v: &[LaneCell<S>]) -> Lanes<S> {
    let mut sum = Lanes::all(simd, 0.0);
    for v in v {
        sum = sum + v.norm_sqr();
    }
    sum
}
