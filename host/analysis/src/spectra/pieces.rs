//! Computes one long transform of a real record as eight short ones: one pass over the sixteen
//! parts of the record, after which each piece is independent.
//!
//! For N samples x(n) and q = N/16, piece p is y_p(j) = e^(−i2πpj/N) Σ_r e^(−i2πpr/16) x(j + rq),
//! and its transform holds X(16k + p) at k (decimation in frequency). Pieces 1 to 7 also contain
//! the mirrored lines 16k − p, because X(N − l) = X*(l). The remaining lines, every eighth one,
//! form the transform of a real record of an eighth of the length, Σ_r x(j + 2rq): this is piece 0.
//!
//! A long transform and its factors do not fit into a core's fastest cache; a piece does.

use super::window::RUN;
use super::windowed::Windowed;
use crate::vectors::wide;
use num_complex::Complex;
use pulp::{NullaryFnOnce, bytemuck};
use std::array::from_fn;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

type C = Complex<f64>;

/// Number of pieces of a transform.
pub(super) const PIECES: usize = 8;

/// Number of parts of a record.
pub(super) const PARTS: usize = 16;

/// cos π/8 and sin π/8.
const COS: f64 = 0.923_879_532_511_286_7;
const SIN: f64 = 0.382_683_432_365_089_8;

/// Samples of each part that are folded together: those of all parts fit into half of a core's
/// first-level cache.
const BLOCK: usize = 128;
const _: () = assert!(BLOCK <= RUN, "weights are known for a run at a time");

/// The twiddle factors for one length.
pub(super) struct Pieces {
    /// e^(−i2πj/N); the factors of the other pieces are products of these.
    factors: Vec<C>,
}

impl Pieces {
    /// For a record of `samples` samples, a multiple of sixteen.
    pub(super) fn of(samples: usize) -> Pieces {
        let angle = |j: usize| -2.0 * PI * j as f64 / samples as f64;
        Pieces { factors: (0..samples / PARTS).map(|j| C::cis(angle(j))).collect() }
    }

    /// Writes the pieces of a record; two samples of piece 0 form one point.
    pub(super) fn write(&self, record: Windowed<'_>, pieces: &mut [C]) {
        let q = self.factors.len();
        let (zero, complex) = pieces.split_at_mut(q);
        let (zero, zero_later) = bytemuck::cast_slice_mut(zero).split_at_mut(q);
        let mut complex = complex.chunks_exact_mut(q);
        let mut complex: [&mut [C]; PIECES - 1] = from_fn(|_| complex.next().unwrap_or_default());
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
                complex: complex.each_mut().map(|piece| &mut piece[block.clone()]),
            });
        }
    }
}

/// One block of every part, and its destination in every piece.
struct Fold<'a> {
    samples: &'a [f64],
    /// Start of each part's block.
    at: [usize; PARTS],
    places: &'a [f64],
    /// The weight of each part is this number times the entries of `places` from this index on.
    weights: [(f64, usize); PARTS],
    factors: &'a [C],
    zero: &'a mut [f64],
    zero_later: &'a mut [f64],
    /// Destinations in pieces 1 to 7.
    complex: [&'a mut [C]; PIECES - 1],
}

impl NullaryFnOnce for Fold<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) {
        let Fold { samples, at, places, weights, factors, .. } = self;
        let [p1, p2, p3, p4, p5, p6, p7] = self.complex;
        fold(
            (samples, at),
            (places, weights),
            factors,
            self.zero,
            self.zero_later,
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
            p7,
        );
    }
}

/// These are arguments rather than fields because the compiler assumes only for arguments that they
/// do not alias; otherwise it adds one number at a time.
#[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
#[expect(clippy::too_many_arguments, reason = "see above")]
#[inline(always)]
fn fold(
    (samples, at): (&[f64], [usize; PARTS]),
    (places, weights): (&[f64], [(f64, usize); PARTS]),
    factors: &[C],
    zero: &mut [f64],
    zero_later: &mut [f64],
    p1: &mut [C],
    p2: &mut [C],
    p3: &mut [C],
    p4: &mut [C],
    p5: &mut [C],
    p6: &mut [C],
    p7: &mut [C],
) {
    let count = factors.len();
    let x: [&[f64]; PARTS] = from_fn(|part| &samples[at[part]..][..count]);
    let weight: [&[f64]; PARTS] = from_fn(|part| &places[weights[part].1..][..count]);
    let scale = weights.map(|(scale, _)| scale);
    let (zero, zero_later) = (&mut zero[..count], &mut zero_later[..count]);
    let (p1, p2, p3, p4) = (&mut p1[..count], &mut p2[..count], &mut p3[..count], &mut p4[..count]);
    let (p5, p6, p7) = (&mut p5[..count], &mut p6[..count], &mut p7[..count]);
    for j in 0..count {
        let x = |part: usize| x[part][j] * (scale[part] * weight[part][j]);
        // sums and differences of parts half a record apart: even pieces are made of sums, odd ones
        // of differences
        let apart = |part: usize| {
            let (one, other) = (x(part), x(part + PARTS / 2));
            (one + other, one - other)
        };
        let ((s0, d0), (s1, d1), (s2, d2), (s3, d3)) = (apart(0), apart(1), apart(2), apart(3));
        let ((s4, d4), (s5, d5), (s6, d6), (s7, d7)) = (apart(4), apart(5), apart(6), apart(7));
        let f1 = factors[j];
        let f2 = f1 * f1;
        let (f3, f4) = (f2 * f1, f2 * f2);

        let (a0, a1, a2, a3) = (s0 + s4, s1 + s5, s2 + s6, s3 + s7);
        let (b0, b1, b2, b3) = (s0 - s4, s1 - s5, s2 - s6, s3 - s7);
        zero[j] = a0 + a2;
        zero_later[j] = a1 + a3;
        let (less, more) = (FRAC_1_SQRT_2 * (b1 - b3), FRAC_1_SQRT_2 * (b1 + b3));
        p2[j] = C::new(b0 + less, -(b2 + more)) * f2;
        p4[j] = C::new(a0 - a2, a3 - a1) * f4;
        p6[j] = C::new(b0 - less, b2 - more) * (f4 * f2);

        // e^(−iπpr/8) of parts r and 8 − r differ only in the sign of the real part
        let (u1, u2, u3) = (d1 - d7, FRAC_1_SQRT_2 * (d2 - d6), d3 - d5);
        let (v1, v2, v3) = (d1 + d7, FRAC_1_SQRT_2 * (d2 + d6), d3 + d5);
        let (near, far) = (d0 + u2, d0 - u2);
        let (late, early) = (v2 + d4, v2 - d4);
        let (outer, inner) = (COS * u1 + SIN * u3, SIN * u1 - COS * u3);
        let (steep, flat) = (SIN * v1 + COS * v3, COS * v1 - SIN * v3);
        p1[j] = C::new(near + outer, -(steep + late)) * f1;
        p3[j] = C::new(far + inner, -(flat + early)) * f3;
        p5[j] = C::new(far - inner, early - flat) * (f4 * f1);
        p7[j] = C::new(near - outer, late - steep) * (f4 * f3);
    }
}
