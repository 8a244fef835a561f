//! The transform of a real record, computed by a complex one of half its length: even samples are
//! the real parts, odd ones the imaginary parts.
//!
//! The lines are separated only where they are read, which saves a pass through memory. With Z the
//! transform of half the length M = N/2, X(k) = ½ (Z(k) + Z*(M−k)) − ½ i e^(−i2πk/N) (Z(k) −
//! Z*(M−k)).

use super::lines::Lines;
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

type C = Complex<f64>;

/// A plan for records of one length.
pub(super) struct HalfLength {
    samples: usize,
    /// Transform of the points that [`HalfLength::pack`] makes.
    pub(super) fft: Arc<dyn Fft<f64>>,
    /// ½ e^(−i2πk/N) of lines k; empty for a record of odd length, which is transformed as a whole.
    twiddles: Vec<C>,
}

static PLANNER: LazyLock<Mutex<FftPlanner<f64>>> = LazyLock::new(|| Mutex::new(FftPlanner::new()));

impl HalfLength {
    pub(super) fn of(samples: usize) -> HalfLength {
        let even = samples.is_multiple_of(2);
        let points = if even { samples / 2 } else { samples };
        // the planner is valid even after a poisoned lock
        let fft = PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(points);
        let twiddle = |k: usize| C::cis(-2.0 * PI * k as f64 / samples as f64) * 0.5;
        let twiddles = if even { (0..points).map(twiddle).collect() } else { Vec::new() };
        HalfLength { samples, fft, twiddles }
    }

    /// Converts the samples at the start of the buffer to points: two samples per point, or one.
    pub(super) fn pack(&self, points: &mut [C]) {
        if self.fft.len() == self.samples {
            // backwards, so that no sample is overwritten before it is read
            for i in (0..self.samples).rev() {
                let samples: &[f64] = bytemuck::cast_slice(points);
                points[i] = C::from(samples[i]);
            }
        }
    }

    /// Passes these lines of the transformed points to `to`, as those of its first stretch.
    pub(super) fn read(&self, spectrum: &[C], within: Range<usize>, to: &mut impl Lines) {
        let points = spectrum.len();
        let part = |from: usize, until: usize| {
            from.clamp(within.start, within.end)..until.clamp(within.start, within.end)
        };
        if points == self.samples {
            // the mean is real
            to.take(0, part(0, 1), [C::from(spectrum[0].re)].iter().copied());
            let rest = part(1, within.end);
            return to.take(0, rest.clone(), spectrum[rest].iter().copied());
        }
        // the two ends are real
        let Complex { re, im } = spectrum[0];
        to.take(0, part(0, 1), [C::from(re + im)].iter().copied());
        let between = part(1, points);
        if !between.is_empty() {
            let mirrored = &spectrum[points + 1 - between.end..points + 1 - between.start];
            let own = spectrum[between.clone()].iter().zip(mirrored.iter().rev());
            let own = own.zip(&self.twiddles[between.clone()]);
            let taken_apart = own.map(|((z, mirrored), twiddle)| {
                let (sum, difference) = (z + mirrored, z - mirrored);
                let turned_re = sum.im * twiddle.re + difference.re * twiddle.im;
                let turned_im = sum.im * twiddle.im - difference.re * twiddle.re;
                C::new(0.5 * sum.re + turned_re, 0.5 * difference.im + turned_im)
            });
            to.take(0, between, taken_apart);
        }
        to.take(0, part(points, points + 1), [C::from(re - im)].iter().copied());
    }
}
