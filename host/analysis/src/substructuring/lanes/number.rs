//! One number for each of several lines, real or complex.

use pulp::{Simd, bytemuck};
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A real number for each line.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<S: Simd> {
    simd: S,
    of: S::f64s,
}

impl<S: Simd> Lanes<S> {
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn all(simd: S, value: f64) -> Self {
        Lanes { simd, of: simd.splat_f64s(value) }
    }

    /// The numbers of the lines.
    #[inline]
    pub(crate) fn each(&self) -> &[f64] {
        bytemuck::cast_slice(std::slice::from_ref(&self.of))
    }

    #[inline]
    pub(crate) fn each_mut(&mut self) -> &mut [f64] {
        bytemuck::cast_slice_mut(std::slice::from_mut(&mut self.of))
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn over(self, other: Self) -> Self {
        Lanes { of: self.simd.div_f64s(self.of, other.of), ..self }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Lanes { of: self.simd.sqrt_f64s(self.of), ..self }
    }

    /// True where this is larger; false where either is NaN.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn exceeds(self, other: Self) -> S::m64s {
        self.simd.greater_than_f64s(self.of, other.of)
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn equals(self, other: Self) -> S::m64s {
        self.simd.equal_f64s(self.of, other.of)
    }

    /// This where `mask` is true, the other elsewhere.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn where_or(self, mask: S::m64s, other: Self) -> Self {
        Lanes { of: self.simd.select_f64s(mask, self.of, other.of), ..self }
    }

    /// The smallest and the largest value.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn range(self) -> [f64; 2] {
        [self.simd.reduce_min_f64s(self.of), self.simd.reduce_max_f64s(self.of)]
    }
}

macro_rules! operators {
    ($($name:ident::$call:ident by $of:ident, $in_place:ident::$call_in_place:ident);*) => {$(
        impl<S: Simd> $name for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $call(self, other: Self) -> Self {
                Lanes { of: self.simd.$of(self.of, other.of), ..self }
            }
        }

        impl<S: Simd> $name for LaneCell<S> {
            type Output = Self;

            #[inline(always)]
            fn $call(self, other: Self) -> Self {
                LaneCell { re: self.re.$call(other.re), im: self.im.$call(other.im) }
            }
        }

        impl<S: Simd> $in_place for LaneCell<S> {
            #[inline(always)]
            fn $call_in_place(&mut self, other: Self) {
                *self = self.$call(other);
            }
        }
    )*};
}

operators!(Add::add by add_f64s, AddAssign::add_assign; Sub::sub by sub_f64s, SubAssign::sub_assign);

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Lanes { of: self.simd.mul_f64s(self.of, other.of), ..self }
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes { of: self.simd.neg_f64s(self.of), ..self }
    }
}

/// A complex number for each line: a cell of their matrices.
#[derive(Clone, Copy)]
pub(crate) struct LaneCell<S: Simd> {
    pub(crate) re: Lanes<S>,
    pub(crate) im: Lanes<S>,
}

impl<S: Simd> LaneCell<S> {
    /// A real number, the same for all lines.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn all(simd: S, value: f64) -> Self {
        LaneCell { re: Lanes::all(simd, value), im: Lanes::all(simd, 0.0) }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn norm_sqr(self) -> Lanes<S> {
        self.re * self.re + self.im * self.im
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn conj(self) -> Self {
        LaneCell { im: -self.im, ..self }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn inv(self) -> Self {
        let square = self.norm_sqr();
        LaneCell { re: self.re.over(square), im: (-self.im).over(square) }
    }

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn where_or(self, mask: S::m64s, other: Self) -> Self {
        LaneCell { re: self.re.where_or(mask, other.re), im: self.im.where_or(mask, other.im) }
    }
}

impl<S: Simd> Neg for LaneCell<S> {
    type Output = Self;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn neg(self) -> Self {
        LaneCell { re: -self.re, im: -self.im }
    }
}

impl<S: Simd> Mul for LaneCell<S> {
    type Output = Self;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        LaneCell { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl<S: Simd> Mul<Lanes<S>> for LaneCell<S> {
    type Output = Self;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn mul(self, other: Lanes<S>) -> Self {
        LaneCell { re: self.re * other, im: self.im * other }
    }
}

/// The lines at which everything computed so far is reliable: finite, and inverted with a clear
/// rank.
#[derive(Clone, Copy)]
pub(crate) struct Reliable<S: Simd> {
    of: Lanes<S>,
}

impl<S: Simd> Reliable<S> {
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn all(simd: S) -> Self {
        Reliable { of: Lanes::all(simd, 1.0) }
    }

    /// Restricts it to the lines where `mask` is true.
    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    pub(crate) fn only(&mut self, mask: S::m64s) {
        self.of = self.of.where_or(mask, Lanes::all(self.of.simd, 0.0));
    }

    /// Restricts it to the lines of the other.
    #[inline]
    pub(crate) fn and(&mut self, other: Self) {
        for (one, other) in self.of.each_mut().iter_mut().zip(other.of.each()) {
            *one *= other;
        }
    }

    /// Whether this line is included.
    #[inline]
    pub(crate) fn at(&self, lane: usize) -> bool {
        self.of.each()[lane] > 0.0
    }
}
