//! The transform of a windowed record, as a whole or in [pieces](super::pieces), with the lines in
//! the [order](super::order) in which they are computed.

use super::SpectraError;
use super::half_length::HalfLength;
use super::lent::Lent;
use super::lines::Lines;
use super::order::Order;
use super::pieces::{PARTS, PIECES, Pieces};
use super::windowed::Windowed;
use crate::vectors::all_finite;
use bytemuck::cast_slice_mut;
use num_complex::Complex;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

type C = Complex<f64>;

/// A plan for records of one length.
pub(super) struct RecordTransform {
    samples: usize,
    /// For a record that is transformed in pieces.
    pieces: Option<Pieces>,
    /// For piece 0, or for the whole record.
    real: HalfLength,
}

static KEPT: Mutex<Vec<Arc<RecordTransform>>> = Mutex::new(Vec::new());
/// Number of plans kept.
const PLANS: usize = 8;
/// Number of samples from which pieces are faster: shorter transforms fit into the cache as a
/// whole.
const LONG: usize = 1 << 15;

impl RecordTransform {
    /// Returns a plan; plans are kept, since the same lengths recur.
    pub(super) fn of(samples: usize) -> Arc<RecordTransform> {
        // the list is valid even after a poisoned lock
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(plan) = kept.iter().find(|plan| plan.samples == samples) {
            return plan.clone();
        }
        let in_pieces = samples >= LONG && samples.is_multiple_of(PARTS);
        let plan = Arc::new(Self::planned(samples, in_pieces));
        if kept.len() == PLANS {
            kept.remove(0);
        }
        kept.push(plan.clone());
        plan
    }

    fn planned(samples: usize, in_pieces: bool) -> RecordTransform {
        RecordTransform {
            samples,
            pieces: in_pieces.then(|| Pieces::of(samples)),
            real: HalfLength::of(if in_pieces { samples / PIECES } else { samples }),
        }
    }

    /// Number of lines of a record's spectrum.
    pub(super) fn lines(&self) -> usize {
        self.samples / 2 + 1
    }

    /// The order in which these lines are computed.
    pub(super) fn order(&self, lines: Range<usize>) -> Order {
        Order::of(self.samples, self.pieces.is_some(), lines)
    }

    /// Transforms a record, zero-padded to the plan's length, and passes the lines of an
    /// [order](RecordTransform::order) to `to`.
    ///
    /// # Errors
    /// A value that is not finite; then no line was passed.
    #[inline(never)]
    pub(super) fn transform(
        &self,
        record: Windowed<'_>,
        order: &Order,
        to: &mut impl Lines,
    ) -> Result<(), SpectraError> {
        if self.samples == 0 {
            let within = order.within(0);
            to.take(0, within.clone(), [C::default()][within].iter().copied());
            return Ok(());
        }
        let fft = &self.real.fft;
        let points = fft.len();
        let mut scratch = Lent::of(fft.get_inplace_scratch_len());
        let mut spectrum = Lent::of(points * if self.pieces.is_some() { PIECES } else { 1 });
        if let Some(pieces) = &self.pieces {
            pieces.write(record, &mut spectrum);
        } else {
            record.write(0, &mut cast_slice_mut(&mut spectrum)[..self.samples]);
            self.real.pack(&mut spectrum);
        }
        let mut stretches = order.stretches().iter().enumerate().peekable();
        for (piece, own) in spectrum.chunks_exact_mut(points).enumerate() {
            fft.process_with_scratch(own, &mut scratch);
            if piece == 0 {
                self.check(record, own[0])?;
                stretches.next();
                self.real.read(own, order.within(0), to);
            }
            while let Some((number, stretch)) = stretches.next_if(|(_, stretch)| stretch.piece == piece) {
                let within = order.within(number);
                let own = own[within.clone()].iter();
                if stretch.mirrored {
                    to.take(number, within, own.map(Complex::conj));
                } else {
                    to.take(number, within, own.copied());
                }
            }
        }
        Ok(())
    }

    /// Every sample contributes to the first point of the spectrum, so a value that is not finite
    /// shows there.
    fn check(&self, record: Windowed<'_>, first: C) -> Result<(), SpectraError> {
        if (first.re + first.im).is_finite() {
            return Ok(());
        }
        let mut samples = vec![0.0; self.samples];
        record.write(0, &mut samples);
        check_finite(&samples)?;
        Err(SpectraError::Transform("the sum of the samples is beyond an f64".into()))
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
    use super::super::lines::Put;
    use super::super::window::{ForceWeighting, Windowing};
    use super::*;
    use crate::transforms::forward;
    use std::f64::consts::PI;

    fn record(samples: usize) -> Vec<f64> {
        let mut seed = samples as u64;
        let mut dice = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        (0..samples).map(|_| dice()).collect()
    }

    fn lines(plan: &RecordTransform, record: &[f64], band: Range<usize>) -> Vec<C> {
        let order = plan.order(band);
        let mut found = vec![C::new(f64::NAN, f64::NAN); order.len()];
        let to = &mut Put { order: &order, out: &mut found };
        plan.transform(Windowed::plain(record), &order, to).expect("numbers");
        order.by_line(&found)
    }

    /// All methods available for records of this many samples.
    fn plans(samples: usize) -> Vec<RecordTransform> {
        let pieces = samples.is_multiple_of(PARTS);
        [false, true]
            .into_iter()
            .filter(|way| pieces || !way)
            .map(|way| RecordTransform::planned(samples, way))
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
                // the relative precision of an f64 is 1.1e-16, and each pass of a transform adds a
                // little
                assert!((off / power).sqrt() < 1e-15, "{samples} samples: {:e}", (off / power).sqrt());
            }
        }
    }

    /// Blocks within the window, across its origin, and beyond the record's end, where zeros are
    /// added.
    #[test]
    fn a_window_applied_on_the_way_in_is_that_of_the_windowed_record() {
        let (samples, recorded) = (6_400, 5_003);
        let record = record(recorded);
        for force_weighting in [ForceWeighting::Exponential, ForceWeighting::Rectangular] {
            let window = Windowing { sigma_per_s: 3.0, force_weighting, ..Windowing::default() };
            let decay = window.decay(5120.0, recorded);
            let weighting = window.of_response(&decay, 0.21);
            let mut windowed = vec![0.0; samples];
            weighting.response_into(&record, 0, &mut windowed);
            for plan in plans(samples) {
                let order = plan.order(0..plan.lines());
                let mut found = vec![C::default(); order.len()];
                let to = &mut Put { order: &order, out: &mut found };
                plan.transform(Windowed::response(&record, &weighting), &order, to).expect("numbers");
                let whole = lines(&plan, &windowed, 0..plan.lines());
                let power: f64 = whole.iter().map(C::norm_sqr).sum();
                let off: f64 =
                    order.by_line(&found).iter().zip(&whole).map(|(a, b)| (a - b).norm_sqr()).sum();
                // weights are rounded twice instead of once
                assert!((off / power).sqrt() < 1e-15, "{force_weighting:?}: {:e}", (off / power).sqrt());
            }
        }
    }

    #[test]
    fn what_is_no_number_is_named() {
        for samples in [5, 8, 1 << 15] {
            let mut record = record(samples);
            record[3] = f64::INFINITY;
            let plan = RecordTransform::of(samples);
            let order = plan.order(0..plan.lines());
            let mut out = vec![C::default(); order.len()];
            let to = &mut Put { order: &order, out: &mut out };
            let found = plan.transform(Windowed::plain(&record), &order, to);
            assert_eq!(found, Err(SpectraError::NotFinite { sample: 3 }));
            assert_eq!(out, vec![C::default(); order.len()]);
        }
    }
}
