//! One long transform of a real record as four short ones: a pass over the eight parts of the record, after which each piece is by itself.
//!
//! Of N samples x(n) and q = N/8, piece p is y_p(j) = e^(−i2πpj/N) Σ_r e^(−i2πpr/8) x(j + rq), and its transform holds X(8k + p) at k
//! (decimation in frequency). Pieces 1, 2 and 3 hold the lines before each eighth one too: X(N − l) = X*(l). What is left, every
//! fourth line, is the transform of a real record of a quarter of the length, Σ_r x(j + 2rq): that is piece 0.
//!
//! A long transform and its factors do not fit into the cache next to a core; a piece does.

use super::window::RUN;
use super::windowed::Windowed;
use crate::vectors::wide;
use num_complex::Complex;
use pulp::{NullaryFnOnce, bytemuck};
use std::array::from_fn;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

type C = Complex<f64>;

/// Pieces of a transform.
pub(super) const PIECES: usize = 4;

/// Parts of a record.
pub(super) const PARTS: usize = 8;

/// Samples of each part that are folded together.
const BLOCK: usize = 256;
const _: () = assert!(BLOCK <= RUN, "weights are known for a run at a time");

/// The factors of one length.
pub(super) struct Quarters {
    /// e^(−i2πj/N); the other pieces' factors are products of it.
    factors: Vec<C>,
}

impl Quarters {
    /// Of a record of so many samples, a multiple of eight.
    pub(super) fn of(samples: usize) -> Quarters {
        let angle = |j: usize| -2.0 * PI * j as f64 / samples as f64;
        Quarters { factors: (0..samples / PARTS).map(|j| C::cis(angle(j))).collect() }
    }

    /// Writes the four pieces of a record; two samples of piece 0 are one point.
    pub(super) fn write(&self, record: Windowed<'_>, pieces: &mut [C]) {
        let q = self.factors.len();
        let mut own = pieces.chunks_exact_mut(q);
        let [zero, first, second, third] = from_fn(|_| own.next().unwrap_or_default());
        let (zero, zero_later) = bytemuck::cast_slice_mut(zero).split_at_mut(q);
        let mut gathered = [0.0; PARTS * BLOCK];
        for start in (0..q).step_by(BLOCK) {
            let block = start..q.min(start + BLOCK);
            let in_record: [usize; PARTS] = from_fn(|part| part * q + start);
            let direct = in_record.iter().all(|at| record.weights(*at, block.len()).is_some());
            let (from, at) = if direct {
                (record, in_record)
            } else {
                for (at, own) in in_record.into_iter().zip(gathered.chunks_exact_mut(BLOCK)) {
                    record.write(at, &mut own[..block.len()]);
                }
                (Windowed::plain(&gathered), from_fn(|part| part * BLOCK))
            };
            let weights = at.map(|at| from.weights(at, block.len()).expect("samples of one kind"));
            wide(Fold {
                samples: from.samples(),
                at,
                places: from.places(),
                weights,
                factors: &self.factors[block.clone()],
                zero: &mut zero[block.clone()],
                zero_later: &mut zero_later[block.clone()],
                first: &mut first[block.clone()],
                second: &mut second[block.clone()],
                third: &mut third[block],
            });
        }
    }
}

/// A block of every part, and its place in every piece.
struct Fold<'a> {
    samples: &'a [f64],
    /// Where each part's block begins.
    at: [usize; PARTS],
    places: &'a [f64],
    /// Each part's weight, times those of the places from one on.
    weights: [(f64, usize); PARTS],
    factors: &'a [C],
    zero: &'a mut [f64],
    zero_later: &'a mut [f64],
    first: &'a mut [C],
    second: &'a mut [C],
    third: &'a mut [C],
}

impl NullaryFnOnce for Fold<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        let Fold { samples, at, places, weights, factors, .. } = self;
        fold(
            (samples, at),
            (places, weights),
            factors,
            self.zero,
            self.zero_later,
            self.first,
            self.second,
            self.third,
        );
    }
}

/// The compiler knows of arguments, not of fields, that nothing else is at the same place: without that it adds one number at a time.
#[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
#[expect(clippy::too_many_arguments, reason = "see above")]
#[inline(always)]
fn fold(
    (samples, at): (&[f64], [usize; PARTS]),
    (places, weights): (&[f64], [(f64, usize); PARTS]),
    factors: &[C],
    zero: &mut [f64],
    zero_later: &mut [f64],
    first: &mut [C],
    second: &mut [C],
    third: &mut [C],
) {
    let count = factors.len();
    let x: [&[f64]; PARTS] = from_fn(|part| &samples[at[part]..][..count]);
    let weight: [&[f64]; PARTS] = from_fn(|part| &places[weights[part].1..][..count]);
    let scale = weights.map(|(scale, _)| scale);
    let (zero, zero_later) = (&mut zero[..count], &mut zero_later[..count]);
    let (first, second, third) = (&mut first[..count], &mut second[..count], &mut third[..count]);
    for j in 0..count {
        let x = |part: usize| x[part][j] * (scale[part] * weight[part][j]);
        let (x0, x1, x2, x3, x4, x5, x6, x7) = (x(0), x(1), x(2), x(3), x(4), x(5), x(6), x(7));
        let (s0, s1, s2, s3) = (x0 + x4, x1 + x5, x2 + x6, x3 + x7);
        let (d0, d1, d2, d3) = (x0 - x4, x1 - x5, x2 - x6, x3 - x7);
        zero[j] = s0 + s2;
        zero_later[j] = s1 + s3;
        let f1 = factors[j];
        let f2 = f1 * f1;
        let (less, more) = (FRAC_1_SQRT_2 * (d1 - d3), FRAC_1_SQRT_2 * (d1 + d3));
        first[j] = C::new(d0 + less, -(d2 + more)) * f1;
        second[j] = C::new(s0 - s2, s3 - s1) * f2;
        third[j] = C::new(d0 - less, d2 - more) * (f2 * f1);
    }
}
