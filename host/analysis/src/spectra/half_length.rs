//! The transform of a real record, by a complex one of half its length: even samples are the real parts, odd ones the imaginary.
//!
//! The lines are taken apart only where they are read, which spares a way through memory: Z being the transform of half the length
//! M = N/2, X(k) = ½ (Z(k) + Z*(M−k)) − ½ i e^(−i2πk/N) (Z(k) − Z*(M−k)).

use super::SpectraError;
use super::lent::Lent;
use crate::vectors::{all_finite, wide};
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::PI;
use std::iter::once;
use std::ops::Range;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

type C = Complex<f64>;

/// A plan for records of one length.
pub(super) struct HalfLength {
    samples: usize,
    fft: Arc<dyn Fft<f64>>,
    /// ½ e^(−i2πk/N) of the lines 1, 2, … below the middle; none of a record whose length is odd, which is transformed whole.
    twiddles: Vec<C>,
}

static PLANNER: LazyLock<Mutex<FftPlanner<f64>>> = LazyLock::new(|| Mutex::new(FftPlanner::new()));
static KEPT: Mutex<Vec<Arc<HalfLength>>> = Mutex::new(Vec::new());
/// Plans kept at most.
const PLANS: usize = 8;
impl HalfLength {
    /// Plans are kept, for lengths that come again and again.
    pub(super) fn of(samples: usize) -> Arc<HalfLength> {
        // both are whole even if a thread that used them panicked
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(plan) = kept.iter().find(|plan| plan.samples == samples) {
            return plan.clone();
        }
        let even = samples.is_multiple_of(2);
        let points = if even { samples / 2 } else { samples };
        let fft = PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(points);
        let step = -2.0 * PI / samples as f64;
        let twiddle = |k: usize| {
            let angle = step * k as f64;
            C::new(angle.cos(), angle.sin()) * 0.5
        };
        let twiddles = if even { (1..samples.div_ceil(4)).map(twiddle).collect() } else { Vec::new() };
        let plan = Arc::new(HalfLength { samples, fft, twiddles });
        if kept.len() == PLANS {
            kept.remove(0);
        }
        kept.push(plan.clone());
        plan
    }

    /// Lines of a record's spectrum.
    pub(super) fn lines(&self) -> usize {
        self.samples / 2 + 1
    }

    /// Transforms the record that `fill` writes. What comes is read by [`HalfLength::put`].
    ///
    /// # Errors
    /// A value that is not a number.
    pub(super) fn transform(&self, fill: impl Fn(&mut [f64])) -> Result<Lent, SpectraError> {
        if self.samples == 0 {
            let mut nothing = Lent::of(1);
            nothing.fill(C::default());
            return Ok(nothing);
        }
        let mut signal = Lent::of(self.fft.len());
        self.write(&fill, &mut signal);
        let mut spectrum = Lent::of(self.fft.len());
        let mut scratch = Lent::of(self.fft.get_outofplace_scratch_len());
        self.fft.process_outofplace_with_scratch(&mut signal, &mut spectrum, &mut scratch);
        // every sample is in every line, so that one line tells of a sample that is not a number
        let mut first = [C::default()];
        self.put(&spectrum, 0, &mut first);
        if !first[0].re.is_finite() {
            let mut samples = vec![0.0; self.samples];
            fill(&mut samples);
            check_finite(&samples)?;
            return Err(SpectraError::Transform("the sum of the samples is beyond an f64".into()));
        }
        Ok(spectrum)
    }

    /// Two samples in each point of half the length, one in each of the whole.
    fn write(&self, fill: impl Fn(&mut [f64]), signal: &mut [C]) {
        let samples: &mut [f64] = bytemuck::cast_slice_mut(signal);
        fill(&mut samples[..self.samples]);
        if self.fft.len() == self.samples {
            // from the last on, whose places hold no sample that is still to come
            for i in (0..self.samples).rev() {
                let samples: &[f64] = bytemuck::cast_slice(signal);
                signal[i] = C::from(samples[i]);
            }
        }
    }

    /// Puts the lines from `first` on into `out`.
    pub(super) fn put(&self, spectrum: &[C], first: usize, out: &mut [C]) {
        let lines = first..first + out.len();
        self.read(spectrum, lines, &mut Put { first, out });
    }

    /// Gives these lines to `to`.
    pub(super) fn read(&self, spectrum: &[C], lines: Range<usize>, to: &mut impl Lines) {
        if lines.is_empty() {
            return;
        }
        let part = |from: usize, until: usize| {
            from.clamp(lines.start, lines.end)..until.clamp(lines.start, lines.end)
        };
        if self.fft.len() == self.samples {
            // the mean is real
            to.take(part(0, 1), spectrum[..1].iter().map(|z| C::from(z.re)));
            let rest = part(1, self.lines());
            to.take(rest.clone(), spectrum[rest].iter().copied());
            return;
        }
        let (half, below) = (self.samples / 2, self.twiddles.len());
        let first = spectrum[0];
        to.take(part(0, 1), once(C::from(first.re + first.im)));
        let own = part(1, 1 + below);
        if !own.is_empty() {
            to.take(own.clone(), self.below(spectrum, own));
        }
        // the middle one of an odd number of lines is its own mirror image
        let own = part(1 + below, half - below);
        to.take(own.clone(), spectrum[own].iter().map(C::conj));
        let own = part(half - below, half);
        if !own.is_empty() {
            to.take(own.clone(), self.above(spectrum, own));
        }
        to.take(part(half.max(1), half + 1), once(C::from(first.re - first.im)));
    }

    /// Lines from 1 to below the middle.
    #[inline]
    fn below<'a>(&'a self, spectrum: &'a [C], lines: Range<usize>) -> impl Iterator<Item = C> + 'a {
        let mirrored = &spectrum[self.mirrored(&lines)];
        let twiddles = &self.twiddles[lines.start - 1..lines.end - 1];
        let own = spectrum[lines].iter().zip(mirrored.iter().rev()).zip(twiddles);
        own.map(|((z, mirrored), twiddle)| taken_apart(*z, *mirrored, *twiddle).0)
    }

    /// Lines from above the middle to below the last: those below it, from their other side.
    #[inline]
    fn above<'a>(&'a self, spectrum: &'a [C], lines: Range<usize>) -> impl Iterator<Item = C> + 'a {
        let below = self.mirrored(&lines);
        let twiddles = &self.twiddles[below.start - 1..below.end - 1];
        let own = spectrum[below].iter().zip(twiddles).rev();
        own.zip(&spectrum[lines]).map(|((z, twiddle), mirrored)| taken_apart(*z, *mirrored, *twiddle).1)
    }

    /// M − k of these lines k.
    fn mirrored(&self, lines: &Range<usize>) -> Range<usize> {
        let half = self.samples / 2;
        half + 1 - lines.end..half + 1 - lines.start
    }
}

/// The lines k and M − k of Z(k), Z(M − k) and ½ e^(−i2πk/N).
#[inline]
fn taken_apart(z: C, mirrored: C, twiddle: C) -> (C, C) {
    let (sum, difference) = (z + mirrored, z - mirrored);
    let turned_re = sum.im * twiddle.re + difference.re * twiddle.im;
    let turned_im = sum.im * twiddle.im - difference.re * twiddle.re;
    let line = C::new(0.5 * sum.re + turned_re, 0.5 * difference.im + turned_im);
    (line, C::new(0.5 * sum.re - turned_re, turned_im - 0.5 * difference.im))
}

/// What lines are for.
pub(super) trait Lines {
    /// Takes `lines`, one value for each, in a loop compiled for the processor at hand.
    fn take(&mut self, lines: Range<usize>, values: impl Iterator<Item = C>);
}

/// Lines that are written from `first` on.
struct Put<'a> {
    first: usize,
    out: &'a mut [C],
}

impl Lines for Put<'_> {
    #[inline]
    fn take(&mut self, lines: Range<usize>, values: impl Iterator<Item = C>) {
        let own = &mut self.out[lines.start - self.first..lines.end - self.first];
        wide(|| own.iter_mut().zip(values).for_each(|(own, value)| *own = value));
    }
}

/// Refuses NaN and infinite values, naming the first.
pub(super) fn check_finite(signal: &[f64]) -> Result<(), SpectraError> {
    if all_finite(signal) {
        return Ok(());
    }
    let sample = signal.iter().position(|v| !v.is_finite()).unwrap_or(0);
    Err(SpectraError::NotFinite { sample })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transforms::forward;

    fn record(samples: usize) -> Vec<f64> {
        let mut seed = samples as u64;
        let mut dice = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        (0..samples).map(|_| dice()).collect()
    }

    fn lines(record: &[f64], first: usize, count: usize) -> Vec<C> {
        let plan = HalfLength::of(record.len());
        let spectrum = plan.transform(|out| out.copy_from_slice(record)).expect("numbers");
        let mut found = vec![C::new(f64::NAN, f64::NAN); count];
        plan.put(&spectrum, first, &mut found);
        found
    }

    #[test]
    fn lines_are_the_sums_that_define_them() {
        for samples in (1..=24).chain([36, 60, 97, 98]) {
            let record = record(samples);
            for (k, found) in lines(&record, 0, samples / 2 + 1).into_iter().enumerate() {
                let turn = |n: usize| C::cis(-2.0 * PI * (k * n % samples) as f64 / samples as f64);
                let sum: C = record.iter().enumerate().map(|(n, x)| x * turn(n)).sum();
                // rounding of a sum of 98 numbers up to 1
                assert!((found - sum).norm() < 1e-13, "{samples} samples, line {k}: {found} for {sum}");
            }
        }
    }

    #[test]
    fn they_are_those_of_the_library_to_the_last_bit_wherever_a_band_begins_and_ends() {
        for samples in (1..=24).chain([100, 101, 102, 1_022, 1_024, 3_000]) {
            let (record, plan) = (record(samples), forward(samples));
            let mut whole = plan.make_output_vec();
            plan.process(&mut record.clone(), &mut whole).expect("lengths fit");
            let all = whole.len();
            let ends = [0, 1, 2, all / 4, all / 2, all / 2 + 1, all - 1, all].map(|end| end.min(all));
            for (first, end) in ends.iter().flat_map(|a| ends.iter().map(move |b| (*a, *b))) {
                if first <= end {
                    let found = lines(&record, first, end - first);
                    assert_eq!(found, whole[first..end], "{samples} samples, lines {first} to {end}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_number_is_named() {
        for samples in [5, 8] {
            let mut record = record(samples);
            record[3] = f64::INFINITY;
            let found = HalfLength::of(samples).transform(|out| out.copy_from_slice(&record));
            assert_eq!(found.err(), Some(SpectraError::NotFinite { sample: 3 }));
        }
    }
}
