//! Single lines of a spectrum by direct summation, and the phase factors used for it.

use crate::vectors::wide;
use num_complex::Complex;
use pulp::NullaryFnOnce;
use std::ops::Range;

/// Number of samples per base angle: each phase factor is a product of two computed ones.
const SHARED: usize = 64;
/// Number of parallel partial sums.
const LANES: usize = 8;

/// e^(i `step` n) for every n of a range: each is the product of two computed factors, accurate to
/// a few units in the last place.
pub(super) fn turns(range: Range<usize>, step: f64) -> Vec<Complex<f64>> {
    let within: [Complex<f64>; SHARED] = std::array::from_fn(|i| Complex::from_polar(1.0, step * i as f64));
    let mut all = Vec::with_capacity(range.len());
    for first in range.clone().step_by(SHARED) {
        let base = Complex::from_polar(1.0, step * first as f64);
        all.extend(within[..SHARED.min(range.end - first)].iter().map(|turn| base * turn));
    }
    all
}

/// Σ x e^(i `step` n), n counted from the first sample.
pub(super) fn line_sum(x: &[f64], step: f64) -> Complex<f64> {
    wide(Line { signal: x, step })
}

struct Line<'a> {
    signal: &'a [f64],
    step: f64,
}

impl NullaryFnOnce for Line<'_> {
    type Output = Complex<f64>;

    #[expect(clippy::inline_always, reason = "only there the processor's vectors are known")]
    #[inline(always)]
    fn call(self) -> Complex<f64> {
        let (mut cos, mut sin) = ([0.0; SHARED], [0.0; SHARED]);
        for (i, (cos, sin)) in cos.iter_mut().zip(&mut sin).enumerate() {
            (*sin, *cos) = (self.step * i as f64).sin_cos();
        }
        let mut sum = Complex::default();
        for (block, x) in self.signal.chunks(SHARED).enumerate() {
            let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
            let lanes = x.chunks_exact(LANES);
            let rest = lanes.remainder();
            let turns = cos.chunks_exact(LANES).zip(sin.chunks_exact(LANES));
            for (x, (cos, sin)) in lanes.zip(turns) {
                for i in 0..LANES {
                    re[i] += x[i] * cos[i];
                    im[i] += x[i] * sin[i];
                }
            }
            let first = x.len() - rest.len();
            for ((i, x), (cos, sin)) in rest.iter().enumerate().zip(cos[first..].iter().zip(&sin[first..])) {
                re[i] += x * cos;
                im[i] += x * sin;
            }
            let own = Complex::new(re.iter().sum::<f64>(), im.iter().sum::<f64>());
            sum += own * Complex::from_polar(1.0, self.step * (block * SHARED) as f64);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_every_length_are_those_of_single_turns() {
        for n in [0, 1, 7, 8, 63, 64, 65, 1000] {
            let x: Vec<f64> = (0..n).map(|i| ((i * 7) % 11) as f64 - 5.0).collect();
            for step in [0.0, 0.37, -2.9] {
                let single: Complex<f64> =
                    x.iter().enumerate().map(|(i, x)| Complex::from_polar(*x, step * i as f64)).sum();
                // rounding of a thousand numbers below six
                assert!((line_sum(&x, step) - single).norm() < 1e-10);
                let by_turns: Complex<f64> = x.iter().zip(turns(0..n, step)).map(|(x, turn)| turn * x).sum();
                assert!((by_turns - single).norm() < 1e-10);
            }
        }
    }
}
