//! The transform of a real record, by a complex one of half its length: even samples are the real parts, odd ones the imaginary.
//!
//! The lines are taken apart only where they are read, which spares a way through memory: Z being the transform of half the length
//! M = N/2, X(k) = ½ (Z(k) + Z*(M−k)) − ½ i e^(−i2πk/N) (Z(k) − Z*(M−k)).
//!
//! A long record's is made in [eight pieces](super::eighths), each of which is read while the cache next to the core still holds it.

use super::SpectraError;
use super::eighths::{Eighths, PIECES};
use super::lent::Lent;
use super::order::Order;
use crate::vectors::{all_finite, wide};
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

type C = Complex<f64>;

/// A plan for records of one length.
pub(super) struct HalfLength {
    samples: usize,
    /// Of a record that is transformed in pieces.
    eighths: Option<Eighths>,
    /// Of a piece, or of all points.
    fft: Arc<dyn Fft<f64>>,
    /// ½ e^(−i2πl/N) of piece 0's lines l; none of a record whose length is odd, which is transformed whole.
    twiddles: Vec<C>,
}

static PLANNER: LazyLock<Mutex<FftPlanner<f64>>> = LazyLock::new(|| Mutex::new(FftPlanner::new()));
static KEPT: Mutex<Vec<Arc<HalfLength>>> = Mutex::new(Vec::new());
/// Plans kept at most.
const PLANS: usize = 8;
/// Samples from which on pieces pay: shorter transforms fit into the cache as they are.
const IN_PIECES: usize = 1 << 15;

impl HalfLength {
    /// Plans are kept, for lengths that come again and again.
    pub(super) fn of(samples: usize) -> Arc<HalfLength> {
        // both are whole even if a thread that used them panicked
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(plan) = kept.iter().find(|plan| plan.samples == samples) {
            return plan.clone();
        }
        let plan =
            Arc::new(Self::planned(samples, samples >= IN_PIECES && samples.is_multiple_of(2 * PIECES)));
        if kept.len() == PLANS {
            kept.remove(0);
        }
        kept.push(plan.clone());
        plan
    }

    fn planned(samples: usize, in_pieces: bool) -> HalfLength {
        let even = samples.is_multiple_of(2);
        let points = if even { samples / 2 } else { samples };
        let pieces = if in_pieces { PIECES } else { 1 };
        let own = points / pieces;
        let fft = PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(own);
        let twiddle = |j: usize| C::cis(-2.0 * PI * (pieces * j) as f64 / samples as f64) * 0.5;
        let twiddles = if even { (0..own).map(twiddle).collect() } else { Vec::new() };
        HalfLength { samples, eighths: in_pieces.then(|| Eighths::of(points)), fft, twiddles }
    }

    /// Lines of a record's spectrum.
    pub(super) fn lines(&self) -> usize {
        self.samples / 2 + 1
    }

    /// The order in which these lines are given.
    pub(super) fn order(&self, lines: Range<usize>) -> Order {
        Order::of(self.pieces(), lines)
    }

    fn pieces(&self) -> usize {
        if self.eighths.is_some() { PIECES } else { 1 }
    }

    /// Transforms the record that `fill` writes from any sample on, and gives the lines of an [order](HalfLength::order) to `to`.
    ///
    /// # Errors
    /// A value that is not a number; then no line was given.
    #[inline(never)]
    pub(super) fn transform(
        &self,
        fill: &dyn Fn(usize, &mut [f64]),
        order: &Order,
        to: &mut impl Lines,
    ) -> Result<(), SpectraError> {
        if self.samples == 0 {
            let within = order.within(0);
            to.take(0, within.clone(), [C::default()][within].iter().copied());
            return Ok(());
        }
        let (pieces, points) = (self.pieces(), self.fft.len());
        let mut spectrum = Lent::of(pieces * points);
        self.write(fill, &mut spectrum);
        let mut scratch = Lent::of(self.fft.get_inplace_scratch_len());
        // two pieces hold each other's mirror images
        for piece in 0..=pieces / 2 {
            let other = (pieces - piece) % pieces;
            let both = if other == piece { &[piece][..] } else { &[piece, other] };
            for own in both {
                self.fft.process_with_scratch(&mut spectrum[own * points..][..points], &mut scratch);
            }
            if piece == 0 {
                self.check(fill, spectrum[0])?;
            }
            for own in both {
                self.read(&spectrum, *own, order.within(*own), to);
            }
        }
        Ok(())
    }

    /// Two samples in each point of half the length, one in each of the whole.
    fn write(&self, fill: &dyn Fn(usize, &mut [f64]), points: &mut [C]) {
        if let Some(eighths) = &self.eighths {
            return eighths.write(fill, points);
        }
        let samples: &mut [f64] = bytemuck::cast_slice_mut(points);
        fill(0, &mut samples[..self.samples]);
        if self.fft.len() == self.samples {
            // from the last on, whose places hold no sample that is still to come
            for i in (0..self.samples).rev() {
                let samples: &[f64] = bytemuck::cast_slice(points);
                points[i] = C::from(samples[i]);
            }
        }
    }

    /// Every sample is in the first point of the spectrum, so that it tells of one that is not a number.
    fn check(&self, fill: &dyn Fn(usize, &mut [f64]), first: C) -> Result<(), SpectraError> {
        if (first.re + first.im).is_finite() {
            return Ok(());
        }
        let mut samples = vec![0.0; self.samples];
        fill(0, &mut samples);
        check_finite(&samples)?;
        Err(SpectraError::Transform("the sum of the samples is beyond an f64".into()))
    }

    /// Gives a piece's lines, by their number in the piece, to `to`.
    fn read(&self, spectrum: &[C], piece: usize, within: Range<usize>, to: &mut impl Lines) {
        let points = self.fft.len();
        let own = &spectrum[piece * points..][..points];
        let part = |from: usize, until: usize| {
            from.clamp(within.start, within.end)..until.clamp(within.start, within.end)
        };
        if points == self.samples {
            // the mean is real
            to.take(0, part(0, 1), [C::from(own[0].re)].iter().copied());
            let rest = part(1, within.end);
            return to.take(0, rest.clone(), own[rest].iter().copied());
        }
        if piece > 0 {
            let mirrored = points - within.end..points - within.start;
            let other = &spectrum[(self.pieces() - piece) * points..][..points];
            return to.take(piece, within.clone(), self.taken_apart(piece, own, &other[mirrored], within));
        }
        // the two ends are real
        to.take(0, part(0, 1), [C::from(own[0].re + own[0].im)].iter().copied());
        let between = part(1, points);
        if !between.is_empty() {
            let mirrored = points + 1 - between.end..points + 1 - between.start;
            to.take(0, between.clone(), self.taken_apart(0, own, &own[mirrored], between));
        }
        to.take(0, part(points, points + 1), [C::from(own[0].re - own[0].im)].iter().copied());
    }

    /// The lines k of Z(k), Z(M − k) of which the last comes first, and ½ e^(−i2πk/N).
    #[inline]
    fn taken_apart<'a>(
        &'a self,
        piece: usize,
        own: &'a [C],
        mirrored: &'a [C],
        within: Range<usize>,
    ) -> impl Iterator<Item = C> + 'a {
        let turn = C::cis(-2.0 * PI * piece as f64 / self.samples as f64);
        let own = own[within.clone()].iter().zip(mirrored.iter().rev()).zip(&self.twiddles[within]);
        own.map(move |((z, mirrored), twiddle)| {
            let twiddle = turn * twiddle;
            let (sum, difference) = (z + mirrored, z - mirrored);
            let turned_re = sum.im * twiddle.re + difference.re * twiddle.im;
            let turned_im = sum.im * twiddle.im - difference.re * twiddle.re;
            C::new(0.5 * sum.re + turned_re, 0.5 * difference.im + turned_im)
        })
    }
}

/// What lines are for.
pub(super) trait Lines {
    /// Takes lines of a piece, by their number in it: one value for each, in a loop compiled for the processor at hand.
    fn take(&mut self, piece: usize, within: Range<usize>, values: impl Iterator<Item = C>);
}

/// Lines that are written in their order.
pub(super) struct Put<'a> {
    pub(super) order: &'a Order,
    pub(super) out: &'a mut [C],
}

impl Lines for Put<'_> {
    #[inline]
    fn take(&mut self, piece: usize, within: Range<usize>, values: impl Iterator<Item = C>) {
        let own = &mut self.out[self.order.places(piece, &within)];
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

    fn lines(plan: &HalfLength, record: &[f64], band: Range<usize>) -> Vec<C> {
        let order = plan.order(band);
        let mut found = vec![C::new(f64::NAN, f64::NAN); order.len()];
        let fill = |first: usize, out: &mut [f64]| out.copy_from_slice(&record[first..first + out.len()]);
        plan.transform(&fill, &order, &mut Put { order: &order, out: &mut found }).expect("numbers");
        order.by_line(&found)
    }

    /// Every way to transform records of so many samples.
    fn plans(samples: usize) -> Vec<HalfLength> {
        let pieces = samples.is_multiple_of(2 * PIECES);
        [false, true]
            .into_iter()
            .filter(|way| pieces || !way)
            .map(|way| HalfLength::planned(samples, way))
            .collect()
    }

    #[test]
    fn lines_are_the_sums_that_define_them() {
        for samples in (1..=24).chain([32, 36, 60, 80, 96, 97, 98]) {
            let record = record(samples);
            for (plan, k) in plans(samples).iter().flat_map(|plan| (0..=samples / 2).map(move |k| (plan, k)))
            {
                let turn = |n: usize| C::cis(-2.0 * PI * (k * n % samples) as f64 / samples as f64);
                let sum: C = record.iter().enumerate().map(|(n, x)| x * turn(n)).sum();
                let found = lines(plan, &record, 0..samples / 2 + 1)[k];
                // rounding of a sum of 98 numbers up to 1
                assert!((found - sum).norm() < 1e-13, "{samples} samples, line {k}: {found} for {sum}");
            }
        }
    }

    #[test]
    fn a_band_is_the_same_lines_wherever_it_begins_and_ends() {
        for samples in (1..=24).chain([100, 101, 102, 304]) {
            let record = record(samples);
            for plan in plans(samples) {
                let all = plan.lines();
                let whole = lines(&plan, &record, 0..all);
                for (first, end) in (0..=all).flat_map(|first| (first..=all).map(move |end| (first, end))) {
                    let found = lines(&plan, &record, first..end);
                    assert_eq!(found, whole[first..end], "{samples} samples, lines {first} to {end}");
                }
            }
        }
    }

    #[test]
    fn they_are_as_exact_as_those_of_the_library() {
        for samples in [1_000, 1_001, 1_024, 3_000, 32_768, 51_200, 102_400, 102_402] {
            let (record, plan) = (record(samples), forward(samples));
            let mut whole = plan.make_output_vec();
            plan.process(&mut record.clone(), &mut whole).expect("lengths fit");
            let power: f64 = whole.iter().map(C::norm_sqr).sum();
            for plan in plans(samples) {
                let found = lines(&plan, &record, 0..plan.lines());
                let off: f64 = found.iter().zip(&whole).map(|(a, b)| (a - b).norm_sqr()).sum();
                // an f64 holds 1.1e-16, of which a transform gathers a little at each of its passes
                assert!((off / power).sqrt() < 1e-15, "{samples} samples: {:e}", (off / power).sqrt());
            }
        }
    }

    #[test]
    fn what_is_no_number_is_named() {
        for samples in [5, 8, 1 << 15] {
            let mut record = record(samples);
            record[3] = f64::INFINITY;
            let plan = HalfLength::of(samples);
            let order = plan.order(0..plan.lines());
            let mut out = vec![C::default(); order.len()];
            let fill = |first: usize, out: &mut [f64]| out.copy_from_slice(&record[first..first + out.len()]);
            let found = plan.transform(&fill, &order, &mut Put { order: &order, out: &mut out });
            assert_eq!(found, Err(SpectraError::NotFinite { sample: 3 }));
            assert_eq!(out, vec![C::default(); order.len()]);
        }
    }
}
