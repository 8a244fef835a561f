//! The small matrices of several lines at once.
//!
//! A vector of the processor holds the same cell of as many lines as it has places, lanes: eight, four, two or one. What is done to one
//! line is then done to all of them by the same instructions, without a loop too short for vectors. Every number is computed by the
//! operations of [`pseudo_inverse`](super::pseudo_inverse) and [`product`](super::product) in their order, so that it is theirs to
//! the last bit. An inverse says at which lines its pivots leave no doubt of the rank; all others are for the careful way.

mod elimination;
mod matrix;
mod number;
mod orthogonalisation;
mod pool;
mod product;

pub(super) use matrix::{Matrix, lines};
pub(super) use number::{Cell, Sure};
pub(super) use pool::Pool;
pub(super) use product::{minus, plus, product, times, to_left_of};

use elimination::eliminated;
use orthogonalisation::orthogonalised;
use pulp::Simd;
use std::cmp::Ordering;

/// As [`full_rank_inverse`](super::pseudo_inverse::full_rank_inverse), at those lines that are sure.
pub(super) fn inverse<'p, S: Simd>(a: Matrix<'p, S>, sure: &mut Sure<S>) -> Matrix<'p, S> {
    match a.rows().cmp(&a.columns()) {
        Ordering::Equal => eliminated(a, sure),
        Ordering::Greater => orthogonalised(a, sure),
        Ordering::Less => orthogonalised(a.adjoint(), sure).adjoint(),
    }
}

#[cfg(test)]
mod tests;
