//! The frequency of a record of any length: the strongest one, and the start times of a steady
//! record's cycles, at the stated frequency or at the measured one.
//!
//! Records after an impact begin at the onset of motion, so their lengths are arbitrary. An FFT of
//! such a length takes several times as long as one of a length with small prime factors, and
//! planning it takes as long again. Lengths with small factors are transformed directly. Other
//! records are zero-padded to the next such length to find where the spectrum is high; the lines of
//! the original length are then computed only there, each by direct summation with its phase
//! factors.

use super::HysteresisError;
use super::record::{HysteresisRecord, Relative};
use crate::parallel::prelude::*;
use crate::spectra::fft::forward;
use crate::vectors::{dot, mean, wide};
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

/// Phase deviation over a record from which its cycles count as off, rad: a smaller one changes an
/// average by less than 1 in 1000.
const OFF_RAD: f64 = 0.05;

/// The deviation must be this many times what the scatter of the cycles explains.
const SIGNIFICANT: f64 = 8.0;

/// Largest scatter of the cycles about a steady drift for which the drift is accepted, rad.
const SCATTER_RAD: f64 = 0.5;

/// With fewer cycles no drift can be found, only a frequency that differs from the stated one,
const FEWEST_CYCLES: usize = 8;

/// and with fewer than these not even that.
const FEWEST_PHASES: usize = 3;

/// The phases are computed again, at the frequency found, if it differs by more than this fraction:
/// a cycle cut too long or too short contains a part of its neighbour or lacks a part of its own.
const FURTHER: f64 = 5e-3;

/// A stated frequency is accepted if its tone alone has this fraction of the force's mean square in
/// stretches of this many cycles. A square wave's fundamental has 0.81 of it.
const EXPLAINED: f64 = 0.5;
const STRETCH: f64 = 16.0;

/// The strongest frequency is the stated one if they differ by less than this fraction of a line
/// (one over the record's duration).
const SAME_LINE: f64 = 0.7;

/// In the motion, the other frequency must have this many times the power of the stated one.
const STRONGER: f64 = 4.0;

/// The stated frequency is present in a signal if it has this fraction of the power of the
/// strongest one.
const PRESENT: f64 = 0.0625;

/// Frequency as a linear function of time over a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Timing {
    /// At the first sample, Hz.
    pub start_hz: f64,
    /// Rate of change, Hz/s.
    pub rate_hz_per_s: f64,
}

impl Timing {
    /// A constant frequency.
    pub fn steady(frequency_hz: f64) -> Self {
        Self { start_hz: frequency_hz, rate_hz_per_s: 0.0 }
    }

    /// When a cycle begins, s after the first sample.
    pub fn begin_s(&self, cycle: f64) -> f64 {
        if self.rate_hz_per_s == 0.0 {
            return cycle / self.start_hz;
        }
        let root = (self.start_hz.powi(2) + 2.0 * self.rate_hz_per_s * cycle).max(0.0).sqrt();
        2.0 * cycle / (self.start_hz + root)
    }

    /// Number of cycles in this time.
    pub fn cycles(&self, time_s: f64) -> f64 {
        (self.start_hz + 0.5 * self.rate_hz_per_s * time_s) * time_s
    }

    /// Frequency at this time, Hz.
    pub fn at(&self, time_s: f64) -> f64 {
        self.start_hz + self.rate_hz_per_s * time_s
    }

    /// The timing derived from the phase of `force`; `None` if it runs at `frequency_hz`
    /// throughout.
    pub fn tracked(force: &[f64], fs_hz: f64, frequency_hz: f64) -> Option<Self> {
        let first = Self::tracked_near(force, fs_hz, frequency_hz)?;
        let middle_hz = first.at(0.5 * force.len() as f64 / fs_hz);
        if (middle_hz / frequency_hz - 1.0).abs() < FURTHER {
            return Some(first);
        }
        // `None` means that the frequency found first holds for the whole record
        Some(Self::tracked_near(force, fs_hz, middle_hz).unwrap_or(Self::steady(middle_hz)))
    }

    fn tracked_near(force: &[f64], fs_hz: f64, frequency_hz: f64) -> Option<Self> {
        if frequency_hz.is_nan() || frequency_hz <= 0.0 {
            return None;
        }
        let period = fs_hz / frequency_hz;
        // tolerance, so that rounding does not make 7 cycles of 8
        let cycles = (force.len() as f64 / period + 1e-6).floor() as usize;
        if cycles < FEWEST_PHASES {
            return None;
        }
        // a drift shows as a curvature of the phase, which a few cycles do not resolve
        let terms = if cycles < FEWEST_CYCLES { 2 } else { 3 };
        let turn = TAU / period;
        let tone = |c: usize| {
            let edge = |c: usize| ((c as f64 * period).round() as usize).min(force.len());
            let (from, to) = (edge(c), edge(c + 1));
            let own = &force[from..to];
            let (rest, step) = (mean(own), Complex::from_polar(1.0, -turn));
            let mut wheel = Complex::from_polar(1.0, -turn * (from as f64 - c as f64 * period));
            let mut tone = Complex::<f64>::default();
            for value in own {
                tone += wheel * (value - rest);
                wheel *= step;
            }
            tone.arg()
        };
        let mut phases: Vec<f64> = (0..cycles).into_par_iter().map(tone).collect();
        let mut last = 0.0;
        for phase in &mut phases {
            last += wrapped(*phase - last);
            *phase = last;
        }
        // phase over u = -1…1 in Legendre polynomials, which are orthogonal over many cycles
        let n = cycles as f64;
        let u = |c: usize| (2.0 * c as f64 + 1.0) / n - 1.0;
        let basis = |c: usize| [1.0, u(c), 0.5 * (3.0 * u(c).powi(2) - 1.0)];
        let mut fit = [0.0; 3];
        for _ in 0..3 {
            // iterate, because sums over finitely many cycles are not quite orthogonal
            let mut left = [0.0; 3];
            let mut norm = [0.0; 3];
            for (c, phase) in phases.iter().enumerate() {
                let b = basis(c);
                let rest = phase - (0..terms).map(|i| fit[i] * b[i]).sum::<f64>();
                for i in 0..terms {
                    left[i] += rest * b[i];
                    norm[i] += b[i] * b[i];
                }
            }
            (0..terms).for_each(|i| fit[i] += left[i] / norm[i]);
        }
        let rest = |(c, phase): (usize, &f64)| {
            let b = basis(c);
            (phase - (0..3).map(|i| fit[i] * b[i]).sum::<f64>()).powi(2)
        };
        let scatter = (phases.iter().enumerate().map(rest).sum::<f64>() / (n - terms as f64)).sqrt();
        // from end to end the linear term rises by twice its coefficient, the quadratic one by 1.5
        // times
        let (line, bow) = (2.0 * fit[1], 1.5 * fit[2]);
        let limit = |over: f64| OFF_RAD.max(SIGNIFICANT * scatter * over / n.sqrt());
        if scatter > SCATTER_RAD || (line.abs() < limit(3.5) && bow.abs() < limit(3.4)) {
            return None;
        }
        let time_s = cycles as f64 / frequency_hz;
        // dφ/du at the beginning and the end; u goes from -1 to 1
        let [from_hz, to_hz] =
            [-1.0, 1.0].map(|u| frequency_hz + (fit[1] + 3.0 * fit[2] * u) * 2.0 / time_s / TAU);
        Some(Self { start_hz: from_hz, rate_hz_per_s: (to_hz - from_hz) / time_s })
    }
}

/// The actual frequency of a record with a stated one: the stated one, or that of force and motion
/// if both have next to no power at the stated one. Differences below a line's width are left to
/// [`Timing::tracked`].
///
/// # Errors
/// Neither force nor motion runs at the stated frequency, and they do not agree.
pub(super) fn runs_at(record: &HysteresisRecord, stated_hz: f64) -> Result<f64, HysteresisError> {
    let fs_hz = record.fs_hz;
    if explained(&record.force_n, fs_hz, stated_hz) > EXPLAINED {
        return Ok(stated_hz);
    }
    let line_hz = fs_hz / record.force_n.len() as f64;
    let same = |found_hz: f64, other_hz: f64| (found_hz - other_hz).abs() < SAME_LINE * line_hz;
    let force_hz = dominant_frequency(&level(&record.force_n), fs_hz);
    let Some(force_hz) = force_hz.filter(|found| !same(*found, stated_hz)) else { return Ok(stated_hz) };
    let (motion, order) = match record.relative() {
        Relative::Velocity(v) => (v, 1),
        Relative::Displacement(x) => (x, 0),
    };
    let motion = level(&motion);
    // power of the displacement, also if velocity was measured
    let power = |f: f64| tone_power(&motion, f / fs_hz) / f.powi(2 * order);
    let motion_hz = dominant_frequency(&motion, fs_hz).unwrap_or(force_hz);
    let [stated, of_force, of_motion] = [stated_hz, force_hz, motion_hz].map(power);
    if of_force > STRONGER * stated && (of_force >= of_motion || same(force_hz, motion_hz)) {
        return Ok(force_hz);
    }
    let in_force = |f: f64| tone_power(&level(&record.force_n), f / fs_hz);
    if stated >= PRESENT * of_motion || in_force(stated_hz) >= PRESENT * in_force(force_hz) {
        return Ok(stated_hz);
    }
    Err(HysteresisError::OtherFrequency { stated_hz, force_hz, motion_hz })
}

/// Fraction of a signal's variance that a tone of this frequency has, in stretches of [`STRETCH`]
/// cycles.
fn explained(x: &[f64], fs_hz: f64, frequency_hz: f64) -> f64 {
    let period = fs_hz / frequency_hz;
    let cycles = (x.len() as f64 / period + 1e-6).floor().clamp(1.0, STRETCH);
    let stretch = ((cycles * period).round() as usize).clamp(1, x.len().max(1));
    let of = |x: &[f64]| {
        let n = x.len() as f64;
        let rest = mean(x);
        // remove the mean's contribution to the sum, which matters only if the stretch is not a
        // whole number of cycles
        let turn = -TAU / period;
        let ones = Complex::from_polar(1.0, turn * n) - 1.0;
        let constant = ones / (Complex::from_polar(1.0, turn) - 1.0) * rest;
        let tone = 2.0 * (line_sum(x, turn) - constant).norm_sqr() / n;
        [tone, dot(x, x) - n * rest * rest]
    };
    let sums: Vec<[f64; 2]> = x.par_chunks(stretch).filter(|part| part.len() == stretch).map(of).collect();
    let [tone, all] = sums.iter().fold([0.0, 0.0], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
    if all > 0.0 { tone / all } else { 1.0 }
}

/// |X|² at a frequency (cycles per sample), with a Hann window.
fn tone_power(x: &[f64], frequency: f64) -> f64 {
    let n = x.len() as f64;
    let at = |turns: f64| line_sum(x, -TAU * turns);
    // the window is half a constant, minus a quarter of one turn in each direction; it is centred
    // by half a sample
    let half = Complex::from_polar(1.0, 0.5 * TAU / n);
    let [below, above] = [frequency - 1.0 / n, frequency + 1.0 / n].map(at);
    (0.5 * at(frequency) - 0.25 * (half * below + half.conj() * above)).norm_sqr()
}

/// Wraps to −π…π.
fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
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

#[cfg(test)]
mod timing_tests {
    use super::*;

    #[test]
    fn a_drift_is_tracked_and_a_steady_record_has_none() {
        for (start, rate) in [(200.0, 4.0), (198.0, 0.0), (61.0, -1.2), (200.0, 0.0)] {
            let truth = Timing { start_hz: start, rate_hz_per_s: rate };
            let force: Vec<f64> =
                (0..51_200).map(|i| (TAU * truth.cycles(f64::from(i) / 51_200.0)).sin()).collect();
            let stated = if start < 100.0 { 61.0 } else { 200.0 };
            let found = Timing::tracked(&force, 51_200.0, stated);
            if truth == Timing::steady(stated) {
                assert_eq!(found, None);
                continue;
            }
            let found = found.expect("it is off");
            assert!(
                (found.start_hz - start).abs() < 0.02 && (found.at(1.0) - truth.at(1.0)).abs() < 0.02,
                "{found:?}"
            );
            for cycle in [0.0, 17.0, 58.0] {
                assert!((found.cycles(found.begin_s(cycle)) - cycle).abs() < 1e-9);
            }
        }
    }
}
