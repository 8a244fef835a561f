//! The strongest frequency of a record of any length.
//!
//! Records after an impact begin at the onset of motion, so their lengths are arbitrary. An FFT of
//! such a length takes several times as long as one of a length with small prime factors, and
//! planning it takes as long again. Lengths with small factors are transformed directly. Other
//! records are zero-padded to the next such length to find where the spectrum is high; the lines of
//! the original length are then computed only there, each by direct summation with its phase
//! factors.

use crate::spectra::fft::forward;
use crate::vectors::wide;
use num_complex::Complex;
use pulp::NullaryFnOnce;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// Peaks of the padded spectrum below this fraction of the highest are ignored: a Hann-windowed
/// tone between two lines loses at most 28 % of its power.
const NEAR_HIGHEST: f64 = 0.25;
/// Maximum number of peaks that are examined one by one; with more, the record is noise, and all of
/// its lines are computed.
const PEAKS: usize = 6;

/// The strongest frequency (Hz) above two periods of the record, from a Hann-windowed spectrum with
/// parabolic refinement.
pub(super) fn dominant_frequency(x: &[f64], fs_hz: f64) -> Option<f64> {
    let n = x.len();
    if n < 32 {
        return None;
    }
    let windowed = windowed(x);
    // the range contains a power of two
    let smooth = (n..=2 * n).find(|size| only_small_factors(*size))?;
    let strongest = if smooth == n { None } else { Strongest::near_peaks(&windowed, smooth) };
    let strongest = match strongest {
        Some(found) => found,
        None => Strongest::of_all_lines(windowed)?,
    };
    strongest.frequency(fs_hz / n as f64)
}

/// Removes the straight line through the means of the first and last quarters: a drift has power at
/// low frequencies.
pub(super) fn level(x: &[f64]) -> Vec<f64> {
    let n = x.len();
    let quarter = (n / 4).max(1).min(n);
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (first, last) = (mean(&x[..quarter]), mean(&x[n - quarter..]));
    let slope = (last - first) / (n - quarter).max(1) as f64;
    x.iter().enumerate().map(|(i, v)| v - first - slope * (i as f64 - 0.5 * quarter as f64)).collect()
}

/// Removes the mean and applies a Hann window.
fn windowed(x: &[f64]) -> Vec<f64> {
    let n = x.len();
    let mean = x.iter().sum::<f64>() / n as f64;
    let turns = turns(0..n, TAU / n as f64);
    let half = Complex::from_polar(1.0, 0.5 * TAU / n as f64);
    x.iter().zip(&turns).map(|(v, turn)| (v - mean) * (0.5 - 0.5 * (half * turn).re)).collect()
}

/// Whether the length is even and has no prime factors other than 2, 3, 5 and 7: such lengths are
/// transformed quickly.
fn only_small_factors(size: usize) -> bool {
    let rest = [2, 3, 5, 7].into_iter().fold(size, |mut rest, factor| {
        while rest.is_multiple_of(factor) {
            rest /= factor;
        }
        rest
    });
    rest == 1 && size.is_multiple_of(2)
}

/// The strongest line of a spectrum.
#[derive(Debug, PartialEq)]
struct Strongest {
    line: usize,
    /// Power of the line before it, of the line itself, and of the line after it.
    power: [f64; 3],
}

impl Strongest {
    /// From the transform of the whole record.
    fn of_all_lines(mut windowed: Vec<f64>) -> Option<Strongest> {
        let power = powers(&mut windowed)?;
        let line = (2..power.len() - 1).max_by(|&a, &b| power[a].total_cmp(&power[b]))?;
        Some(Strongest { line, power: [power[line - 1], power[line], power[line + 1]] })
    }

    /// From the lines around the peaks of the record padded to `size`; `None` if there are too many
    /// peaks.
    fn near_peaks(windowed: &[f64], size: usize) -> Option<Strongest> {
        let n = windowed.len();
        let mut padded = windowed.to_vec();
        padded.resize(size, 0.0);
        let power = powers(&mut padded)?;
        let last = n / 2 - 1;
        // a line of the record's own spectrum that falls between two of the padded one
        let line_at = |at: usize| ((at as f64 * n as f64 / size as f64).round() as usize).clamp(2, last);
        // the first valid line is at or slightly above that of the padded spectrum
        let from = 2;
        let highest = power[from..].iter().copied().fold(0.0, f64::max);
        let level = NEAR_HIGHEST * highest;
        let rises = |at: usize| {
            let before = if at > from { power[at - 1] } else { 0.0 };
            power[at] >= level
                && power[at] >= before
                && power.get(at + 1).is_none_or(|after| power[at] >= *after)
        };
        let peaks: Vec<usize> = (from..power.len()).filter(|at| rises(*at)).take(PEAKS + 1).collect();
        if peaks.len() > PEAKS {
            return None;
        }
        let mut known = BTreeMap::new();
        let mut of = |line: usize| *known.entry(line).or_insert_with(|| line_power(windowed, line));
        let mut best: Option<(usize, f64)> = None;
        for peak in peaks {
            let mut line = line_at(peak);
            // climb until the line is higher than its neighbours
            while let Some(higher) = [line - 1, line + 1]
                .into_iter()
                .find(|other| (2..=last).contains(other) && of(*other) > of(line))
            {
                line = higher;
            }
            let power = of(line);
            if best.is_none_or(|(_, most)| power > most) {
                best = Some((line, power));
            }
        }
        let (line, _) = best?;
        Some(Strongest { line, power: [of(line - 1), of(line), of(line + 1)] })
    }

    /// Refined by the parabola through the logarithms; lines are `step_hz` apart. `None` if nothing
    /// moves.
    fn frequency(&self, step_hz: f64) -> Option<f64> {
        if self.power[1] <= f64::MIN_POSITIVE {
            return None;
        }
        let [l, m, r] = self.power.map(|power| power.max(f64::MIN_POSITIVE).ln());
        let bend = l - 2.0 * m + r;
        let shift = if bend < 0.0 { (0.5 * (l - r) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        Some((self.line as f64 + shift) * step_hz)
    }
}

/// |X|² of every line; overwrites the signal.
fn powers(signal: &mut [f64]) -> Option<Vec<f64>> {
    let fft = forward(signal.len());
    let mut spectrum = fft.make_output_vec();
    fft.process(signal, &mut spectrum).ok()?;
    Some(spectrum.iter().map(Complex::norm_sqr).collect())
}

/// |X|² of one line, by direct summation.
fn line_power(signal: &[f64], line: usize) -> f64 {
    line_sum(signal, -TAU * line as f64 / signal.len() as f64).norm_sqr()
}

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
    wide(LineSum { signal: x, step })
}

struct LineSum<'a> {
    signal: &'a [f64],
    step: f64,
}

impl NullaryFnOnce for LineSum<'_> {
    type Output = Complex<f64>;

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
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
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FS_HZ: f64 = 51_200.0;

    fn decay(n: usize, modes: &[[f64; 3]], noise: f64, seed: u64) -> Vec<f64> {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed);
        (0..n)
            .map(|i| {
                let t = i as f64 / FS_HZ;
                let own: f64 = StandardNormal.sample(&mut stream);
                let mode = |[hz, rate, size]: &[f64; 3]| size * (-rate * t).exp() * (TAU * hz * t).sin();
                modes.iter().map(mode).sum::<f64>() + noise * own
            })
            .collect()
    }

    /// The lines around the peaks give the same result as all lines, for any length, for one mode,
    /// two of nearly equal strength, a broad one, and modes in noise.
    #[test]
    fn a_padded_transform_finds_the_records_own_strongest_line() {
        let cases: [&[[f64; 3]]; 5] = [
            &[[211.7, 4.0, 1.0]],
            &[[180.2, 5.0, 1.0], [208.9, 5.0, 0.99]],
            &[[96.0, 120.0, 1.0], [640.0, 30.0, 0.4]],
            &[[180.0, 0.5, 1.0], [180.9, 0.5, 1.0]],
            &[[3.1, 1.0, 1.0]],
        ];
        let mut met = 0;
        for (seed, modes) in cases.into_iter().enumerate() {
            for n in [97, 1013, 20_011, 101_979, 102_149] {
                for noise in [0.0, 0.01, 1.0] {
                    let windowed = windowed(&decay(n, modes, noise, seed as u64));
                    let size = (n..=2 * n).find(|size| only_small_factors(*size)).expect("some length");
                    let whole = Strongest::of_all_lines(windowed.clone()).expect("a line");
                    let Some(near) = Strongest::near_peaks(&windowed, size) else { continue };
                    met += 1;
                    assert_eq!(near.line, whole.line, "{modes:?}, {n} samples, noise {noise}");
                    for (own, other) in near.power.iter().zip(&whole.power) {
                        // rounding of both transforms, relative to the highest line
                        assert!((own - other).abs() < 1e-11 * whole.power[1], "{near:?} {whole:?}");
                    }
                }
            }
        }
        // the other records have too many peaks to examine each
        assert!(met > 50, "{met} of 75");
    }

    #[test]
    fn noise_is_searched_line_by_line() {
        let windowed = windowed(&decay(102_149, &[], 1.0, 3));
        assert_eq!(Strongest::near_peaks(&windowed, 102_400), None);
    }

    #[test]
    fn a_tone_is_told_to_a_small_part_of_a_line_and_silence_is_none() {
        for n in [20_480, 20_483] {
            let found = dominant_frequency(&decay(n, &[[208.3, 0.0, 2.0]], 0.0, 0), FS_HZ).expect("a tone");
            // the interpolation error of the parabola for a Hann window
            assert!((found - 208.3).abs() < 0.05 * FS_HZ / n as f64, "{found}");
            assert_eq!(dominant_frequency(&vec![0.0; n], FS_HZ), None);
        }
        assert_eq!(dominant_frequency(&[1.0; 31], FS_HZ), None);
    }
}

#[cfg(test)]
mod line_sums_tests {
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
