//! The small matrices of several lines simultaneously.
//!
//! A processor vector holds the same cell of as many lines as it has lanes: eight, four, two or
//! one. Each operation is then applied to all these lines by the same instructions, without loops
//! that are too short for vectors. Every number is computed by the operations of
//! [`pseudo_inverse`](super::pseudo_inverse) and [`product`](super::product) in the same order, so
//! that it is identical to the last bit. An inverse reports the lines at which its pivots leave no
//! doubt of the rank; all others are left to the line-by-line computation.

mod elimination;
mod matrix;
mod number;
mod orthogonalisation;
mod pool;
mod product;

pub(super) use matrix::{Matrix, lines};
pub(super) use number::{LaneCell, Reliable};
pub(super) use pool::Pool;
pub(super) use product::{minus, plus, product, times, to_left_of};

use elimination::eliminated;
use orthogonalisation::orthogonalised;
use pulp::Simd;
use std::cmp::Ordering;

/// As [`full_rank_inverse`](super::pseudo_inverse::full_rank_inverse), at the lines whose rank is
/// beyond doubt.
pub(super) fn inverse<'p, S: Simd>(a: Matrix<'p, S>, reliable: &mut Reliable<S>) -> Matrix<'p, S> {
    match a.rows().cmp(&a.columns()) {
        Ordering::Equal => eliminated(a, reliable),
        Ordering::Greater => orthogonalised(a, reliable),
        Ordering::Less => orthogonalised(a.adjoint(), reliable).adjoint(),
    }
}

#[cfg(test)]
mod tests;
