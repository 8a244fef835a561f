//! One long transform as eight short ones: a pass of butterflies over the eight parts of a record, after which each piece is by itself.
//!
//! Of M points z(n) and q = M/8, piece p is y_p(j) = e^(−i2πpj/M) Σ_r e^(−i2πpr/8) z(j + rq), and its transform holds Z(8k + p) at k
//! (decimation in frequency). A long transform and its factors do not fit into the cache next to a core; a piece does.

use super::lent::Lent;
use crate::vectors::wide;
use num_complex::Complex;
use pulp::{Scalar, Simd, WithSimd, bytemuck};
use std::array::from_fn;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

type C = Complex<f64>;

/// Pieces of a transform.
pub(super) const PIECES: usize = 8;

/// Points of each part that are written and turned together: their record comes from far, and the faster the more of it comes at once;
/// those of all parts still fit into the cache next to the core.
const BLOCK: usize = 1024;

/// The factors of one length.
pub(super) struct Eighths {
    /// e^(−i2πj/M).
    once: Vec<C>,
    /// e^(−i2π4j/M): the factors of the other pieces are products of the two.
    four_times: Vec<C>,
}

impl Eighths {
    /// Of a transform of so many points, a multiple of eight.
    pub(super) fn of(points: usize) -> Eighths {
        let factors = |times: usize| {
            let angle = |j: usize| -2.0 * PI * (times * j) as f64 / points as f64;
            (0..points / PIECES).map(|j| C::cis(angle(j))).collect()
        };
        Eighths { once: factors(1), four_times: factors(4) }
    }

    /// Writes the eight pieces of the record that `fill` gives from any sample on, two samples to a point.
    pub(super) fn write(&self, fill: &dyn Fn(usize, &mut [f64]), pieces: &mut [C]) {
        let points = self.once.len();
        let mut parts = Lent::of(PIECES * BLOCK);
        for first in (0..points).step_by(BLOCK) {
            let block = first..points.min(first + BLOCK);
            for (part, own) in parts.chunks_exact_mut(BLOCK).enumerate() {
                fill(2 * (part * points + first), bytemuck::cast_slice_mut(&mut own[..block.len()]));
            }
            let mut rest = pieces.chunks_exact_mut(points);
            wide(Pass {
                parts: from_fn(|part| &parts[part * BLOCK..][..block.len()]),
                pieces: from_fn(|_| rest.next().map_or(&mut [][..], |piece| &mut piece[block.clone()])),
                factors: [&self.once[block.clone()], &self.four_times[block]],
            });
        }
    }
}

/// A block of every part and its place in every piece.
struct Pass<'a> {
    parts: [&'a [C]; PIECES],
    pieces: [&'a mut [C]; PIECES],
    factors: [&'a [C]; 2],
}

impl WithSimd for Pass<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (parts, factors) = (self.parts.map(S::as_simd_c64s), self.factors.map(S::as_simd_c64s));
        let mut pieces = self.pieces.map(S::as_mut_simd_c64s);
        let whole = pieces.each_mut().map(|(whole, _)| &mut **whole);
        Points(simd).pass(parts.map(|(whole, _)| whole), whole, factors.map(|(whole, _)| whole));
        let last = pieces.each_mut().map(|(_, last)| &mut **last);
        rest(parts.map(|(_, last)| last), last, factors.map(|(_, last)| last));
    }
}

/// What does not fill a vector.
#[inline(never)]
fn rest(parts: [&[C]; PIECES], pieces: [&mut [C]; PIECES], factors: [&[C]; 2]) {
    Points(Scalar).pass(parts, pieces, factors);
}

/// Vectors of points, which a processor adds and multiplies. What it does is inlined into where its vectors are known.
#[derive(Clone, Copy)]
struct Points<S>(S);

#[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
impl<S: Simd> Points<S> {
    /// A processor that multiplies and adds in one step rounds once where another rounds twice, as in the transforms' library: the last
    /// digit of a line depends on it.
    #[inline(always)]
    fn times(self, a: S::c64s, b: S::c64s) -> S::c64s {
        self.0.mul_e_c64s(a, b)
    }

    /// Times −i.
    #[inline(always)]
    fn turned(self, z: S::c64s) -> S::c64s {
        self.0.conj_c64s(self.0.swap_re_im_c64s(z))
    }

    #[inline(always)]
    fn two(self, a: S::c64s, b: S::c64s) -> [S::c64s; 2] {
        [self.0.add_c64s(a, b), self.0.sub_c64s(a, b)]
    }

    /// The transform of four points.
    #[inline(always)]
    fn four(self, [a, b, c, d]: [S::c64s; 4]) -> [S::c64s; 4] {
        let ([even, even_less], [odd, odd_less]) = (self.two(a, c), self.two(b, d));
        let ([y0, y2], [y1, y3]) = (self.two(even, odd), self.two(even_less, self.turned(odd_less)));
        [y0, y1, y2, y3]
    }

    /// The transform of eight points.
    #[inline(always)]
    fn eight(self, z: [S::c64s; 8]) -> [S::c64s; 8] {
        let eighth = self.0.splat_c64s(C::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2));
        let three_eighths = self.0.splat_c64s(C::new(-FRAC_1_SQRT_2, -FRAC_1_SQRT_2));
        let ([a0, b0], [a1, b1]) = (self.two(z[0], z[4]), self.two(z[1], z[5]));
        let ([a2, b2], [a3, b3]) = (self.two(z[2], z[6]), self.two(z[3], z[7]));
        let [y0, y2, y4, y6] = self.four([a0, a1, a2, a3]);
        let turned = [b0, self.times(b1, eighth), self.turned(b2), self.times(b3, three_eighths)];
        let [y1, y3, y5, y7] = self.four(turned);
        [y0, y1, y2, y3, y4, y5, y6, y7]
    }

    /// Eight parts to eight pieces, a vector of points of each at a time.
    #[inline(always)]
    fn pass(self, parts: [&[S::c64s]; 8], pieces: [&mut [S::c64s]; 8], [once, four_times]: [&[S::c64s]; 2]) {
        let count = once.len();
        let [z0, z1, z2, z3, z4, z5, z6, z7] = parts.map(|part| &part[..count]);
        let [y0, y1, y2, y3, y4, y5, y6, y7] = pieces.map(|piece| &mut piece[..count]);
        let four_times = &four_times[..count];
        for j in 0..count {
            let y = self.eight([z0[j], z1[j], z2[j], z3[j], z4[j], z5[j], z6[j], z7[j]]);
            let (f1, f4) = (once[j], four_times[j]);
            let f2 = self.times(f1, f1);
            let f3 = self.times(f2, f1);
            y0[j] = y[0];
            y1[j] = self.times(y[1], f1);
            y2[j] = self.times(y[2], f2);
            y3[j] = self.times(y[3], f3);
            y4[j] = self.times(y[4], f4);
            y5[j] = self.times(y[5], self.times(f4, f1));
            y6[j] = self.times(y[6], self.times(f4, f2));
            y7[j] = self.times(y[7], self.times(f4, f3));
        }
    }
}
