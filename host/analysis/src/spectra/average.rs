//! Spectra of many hits, one hit at a time: only the auto- and cross-spectra are accumulated; the
//! signals of a hit need not be kept.
//!
//! The variance of H1 comes from the hits themselves, by leaving out one hit at a time (jackknife).
//! The coherence formula assumes that the force spectra of all hits have the same shape and that
//! the hits differ by noise only; the jackknife also includes other variations between hits (aim, a
//! loosening joint).

use super::SpectraError;
use super::cross_spectra::{CrossSpectra, OutputSums};
use super::fft::{Lines, Order, Put, RecordTransform, Scratch, Windowed, check_finite};
use crate::parallel;
use crate::parallel::prelude::*;
use crate::vectors::wide;
use bytemuck::{cast_slice, cast_slice_mut};
use num_complex::Complex;
use std::ops::Range;
use std::sync::Arc;

/// Hits that are summed together: enough that no core waits for another, few enough that their
/// force spectra are small compared with the records.
const TOGETHER: usize = 8;

/// Writes the windowed force of a hit, given its index.
pub type ForceOf<'a> = dyn Fn(usize, &mut [f64]) + Sync + 'a;

/// Returns a windowed response of a hit, given the indices of hit and output.
pub type ResponseOf<'a> = dyn Fn(usize, usize) -> Windowed<'a> + Sync + 'a;

/// Sums of spectra over the hits so far.
pub struct SpectraAverage {
    fs_hz: f64,
    samples: usize,
    transform: Arc<RecordTransform>,
    hits: usize,
    /// In the transform's order of lines, as all sums are.
    s_ff: Vec<f64>,
    /// All lines.
    all: Order,
    /// The lines for which the outputs are summed.
    band: Order,
    outputs: Vec<Output>,
    failed: Option<SpectraError>,
    keep_hits: bool,
    kept_force: Vec<Vec<Complex<f64>>>,
}

/// A response and its sums, in reused buffers: they live as long as one cell's average.
struct Output {
    s_xf: Scratch,
    /// Two real numbers are stored in each complex one.
    s_xx: Scratch,
    /// The lines of every hit, if hits are kept.
    kept: Vec<Vec<Complex<f64>>>,
}

impl Output {
    fn of(lines: usize) -> Self {
        Output { s_xf: Scratch::zeros(lines), s_xx: Scratch::zeros(lines.div_ceil(2)), kept: Vec::new() }
    }
}

/// The sums to which the lines of a hit are added, and its force at every line.
struct HitSums<'a> {
    all: &'a Order,
    band: &'a Order,
    output: &'a mut Output,
    force: &'a [Complex<f64>],
}

impl Lines for HitSums<'_> {
    #[inline]
    fn take(&mut self, stretch: usize, within: Range<usize>, values: impl Iterator<Item = Complex<f64>>) {
        let place = self.band.places(stretch, &within);
        let Output { s_xf, s_xx, .. } = &mut *self.output;
        let (s_xf, s_xx) = (&mut s_xf[place.clone()], &mut cast_slice_mut(s_xx)[place]);
        add(s_xf, s_xx, values, &self.force[self.all.places(stretch, &within)]);
    }
}

/// Adds the lines x of a response and those of the force to the sums.
#[inline]
fn add(
    s_xf: &mut [Complex<f64>],
    s_xx: &mut [f64],
    x: impl Iterator<Item = Complex<f64>>,
    force: &[Complex<f64>],
) {
    wide(|| {
        for ((s_xf, s_xx), (x, f)) in s_xf.iter_mut().zip(s_xx).zip(x.zip(force)) {
            *s_xf += x * f.conj();
            *s_xx += x.norm_sqr();
        }
    });
}

fn add_power(sums: &mut [f64], spectrum: &[Complex<f64>]) {
    wide(|| sums.iter_mut().zip(spectrum).for_each(|(sum, f)| *sum += f.norm_sqr()));
}

impl SpectraAverage {
    /// For records of `samples` samples (zero padding included) and `outputs` responses.
    pub fn new(fs_hz: f64, samples: usize, outputs: usize) -> Self {
        Self::of_band(fs_hz, samples, outputs, [f64::NEG_INFINITY, f64::INFINITY])
    }

    /// The same, but responses are summed only at the lines with `low_hz` ≤ f ≤ `high_hz`; the
    /// force is summed at all lines.
    pub fn of_band(fs_hz: f64, samples: usize, outputs: usize, [low_hz, high_hz]: [f64; 2]) -> Self {
        let transform = RecordTransform::of(samples);
        let mut average = SpectraAverage {
            fs_hz,
            samples,
            hits: 0,
            s_ff: vec![0.0; transform.lines()],
            all: transform.order(0..transform.lines()),
            band: transform.order(0..0),
            transform,
            outputs: Vec::new(),
            failed: None,
            keep_hits: false,
            kept_force: Vec::new(),
        };
        let frequency_hz: Vec<f64> = average.all.lines().map(|l| average.frequency_hz(l)).collect();
        let from = frequency_hz.partition_point(|f| *f < low_hz);
        let to = frequency_hz.partition_point(|f| *f <= high_hz).max(from);
        average.band = average.transform.order(from..to);
        average.outputs = (0..outputs).map(|_| Output::of(to - from)).collect();
        average
    }

    /// Frequency of a line, Hz.
    fn frequency_hz(&self, line: usize) -> f64 {
        line as f64 * self.fs_hz / self.samples as f64
    }

    /// Keeps the spectra of every hit, so that `finish` can leave out each of them: hits × channels
    /// × lines complex numbers.
    #[must_use]
    pub fn with_jackknife(mut self) -> Self {
        self.keep_hits = true;
        self
    }

    /// Adds one hit: its windowed force, N, and its windowed responses, SI.
    ///
    /// # Errors
    /// When the number of samples or responses differs from that of the other hits, or a value is
    /// not finite.
    pub fn add(&mut self, force_n: &[f64], responses: &[Vec<f64>]) -> Result<(), SpectraError> {
        if responses.len() != self.outputs.len() {
            return Err(SpectraError::Responses { found: responses.len(), expected: self.outputs.len() });
        }
        for signal in std::iter::once(force_n).chain(responses.iter().map(Vec::as_slice)) {
            if signal.len() != self.samples {
                return Err(SpectraError::Samples { found: signal.len(), expected: self.samples });
            }
            // checked before anything is summed: a refused hit leaves the average unchanged
            check_finite(signal)?;
        }
        self.add_with(|out| out.copy_from_slice(force_n), |o| Windowed::plain(&responses[o]))
    }

    /// Adds one hit: its windowed force, which `force` writes into a buffer that holds old values,
    /// and its windowed responses, by output. See [`SpectraAverage::add_hits`].
    ///
    /// # Errors
    /// As for `add_hits`.
    pub fn add_with<'a>(
        &mut self,
        force: impl Fn(&mut [f64]) + Sync,
        response: impl Fn(usize) -> Windowed<'a> + Sync,
    ) -> Result<(), SpectraError> {
        self.add_hits(1, &|_, out| force(out), &|_, o| response(o))
    }

    /// Adds `hits` hits in parallel on all cores. Responses shorter than the transform are padded
    /// with zeros.
    ///
    /// # Errors
    /// A value that is not finite. Some responses of the hits may already be in the sums, so the
    /// average becomes unusable: this function and [`SpectraAverage::finish`] return the same error
    /// from then on.
    pub fn add_hits(
        &mut self,
        hits: usize,
        force: &ForceOf<'_>,
        response: &ResponseOf<'_>,
    ) -> Result<(), SpectraError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let summed = self.sum(hits, force, response);
        if let Err(error) = &summed {
            self.failed = Some(error.clone());
        }
        summed
    }

    fn sum(
        &mut self,
        hits: usize,
        force: &ForceOf<'_>,
        response: &ResponseOf<'_>,
    ) -> Result<(), SpectraError> {
        for first in (0..hits).step_by(TOGETHER) {
            let hits = first..hits.min(first + TOGETHER);
            let forces = hits.clone().into_par_iter().map(|hit| self.force_of(&|out| force(hit, out)));
            let forces = forces.collect::<Result<Vec<_>, _>>()?;
            // a single hit is added from a loop over cells, which already keeps all cores busy
            let at_least = if hits.len() == 1 { self.outputs.len() } else { 1 };
            let (transform, all, band, keep) = (&*self.transform, &self.all, &self.band, self.keep_hits);
            let outputs = self.outputs.par_iter_mut().enumerate().with_min_len(at_least);
            let summed = outputs.map(|(o, output)| {
                for (hit, force) in hits.clone().zip(&forces) {
                    let record = response(hit, o);
                    if !keep {
                        transform.transform(record, band, &mut HitSums { all, band, output, force })?;
                        continue;
                    }
                    let mut own = vec![Complex::default(); band.len()];
                    transform.transform(record, band, &mut Put { order: band, out: &mut own })?;
                    let mut sums = HitSums { all, band, output, force };
                    for stretch in 0..band.stretches().len() {
                        let within = band.within(stretch);
                        let own = &own[band.places(stretch, &within)];
                        sums.take(stretch, within, own.iter().copied());
                    }
                    output.kept.push(own);
                }
                Ok(())
            });
            // runs in parallel with the outputs, so that no core waits for the last of them
            let share = self.s_ff.len().div_ceil(parallel::threads()).max(1);
            let powers = self.s_ff.par_chunks_mut(share).enumerate();
            let add_powers = || {
                powers.for_each(|(part, sums)| {
                    for force in &forces {
                        add_power(sums, &force[part * share..]);
                    }
                });
            };
            parallel::join(|| summed.collect::<Result<(), SpectraError>>(), add_powers).0?;
            if keep {
                self.kept_force.extend(forces.iter().map(|force| all.only(band, force)));
            }
            self.hits += hits.len();
        }
        Ok(())
    }

    /// The spectrum of a force, at all lines in the transform's order.
    fn force_of(&self, force: &dyn Fn(&mut [f64])) -> Result<Scratch, SpectraError> {
        let mut windowed = Scratch::of(self.samples.div_ceil(2));
        let windowed: &mut [f64] = &mut cast_slice_mut(&mut windowed)[..self.samples];
        force(windowed);
        let mut own = Scratch::of(self.all.len());
        let to = &mut Put { order: &self.all, out: &mut own };
        self.transform.transform(Windowed::plain(windowed), &self.all, to)?;
        Ok(own)
    }

    /// The spectra on s = σ + iω, where σ is the damping of the window that was applied to the
    /// signals.
    ///
    /// A channel that lags the force by `delay_s[output]` is corrected by e^(+sτ). Missing delays
    /// are 0.
    ///
    /// # Errors
    /// When no hit was added, or adding one failed partway.
    pub fn finish(&self, sigma_per_s: f64, delay_s: &[f64]) -> Result<CrossSpectra, SpectraError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let band = &self.band;
        let outputs = self.outputs.par_iter().enumerate().map(|(o, output)| OutputSums {
            s_xf: band.by_line(&output.s_xf),
            s_xx: band.by_line(&cast_slice(&output.s_xx)[..band.len()]),
            delay_s: delay_s.get(o).copied().unwrap_or(0.0),
        });
        let outputs = outputs.collect();
        let frequency_hz = band.lines().map(|l| self.frequency_hz(l)).collect();
        let s_ff = band.by_line(&self.all.only(band, &self.s_ff));
        let spectra = CrossSpectra::new(self.fs_hz, frequency_hz, sigma_per_s, self.hits, s_ff, outputs)?;
        Ok(spectra.with_jackknife(self.keep_hits.then(|| self.jackknife(sigma_per_s, delay_s))))
    }

    /// The force only, at all lines, independent of the lines at which the responses are summed.
    ///
    /// # Errors
    /// As for [`SpectraAverage::finish`].
    pub fn force(&self, sigma_per_s: f64) -> Result<CrossSpectra, SpectraError> {
        let frequency_hz = self.all.lines().map(|l| self.frequency_hz(l)).collect();
        CrossSpectra::new(
            self.fs_hz,
            frequency_hz,
            sigma_per_s,
            self.hits,
            self.all.by_line(&self.s_ff),
            Vec::new(),
        )
    }

    /// Jackknife variance, leaving out one hit at a time, \[line\]\[output\].
    fn jackknife(&self, sigma_per_s: f64, delay_s: &[f64]) -> Vec<Vec<f64>> {
        let variance: Vec<Vec<f64>> = (0..self.band.len())
            .into_par_iter()
            .map(|l| {
                let force: Vec<_> = self.kept_force.iter().map(|f| f[l]).collect();
                let of_output = |(o, output): (usize, &Output)| {
                    let response: Vec<_> = output.kept.iter().map(|x| x[l]).collect();
                    // |e^(sτ)|², since H is multiplied by e^(sτ)
                    let gain = (2.0 * sigma_per_s * delay_s.get(o).copied().unwrap_or(0.0)).exp();
                    gain * variance_of_part(&force, &response)
                };
                self.outputs.iter().enumerate().map(of_output).collect()
            })
            .collect();
        self.band.by_line(&variance)
    }
}

/// Variance of the real part of H1, which equals that of its imaginary part, at one line: half of
/// (n − 1)/n Σ |H₍₋ᵢ₎ − H̄|². NaN below two hits.
pub fn variance_of_part(force: &[Complex<f64>], response: &[Complex<f64>]) -> f64 {
    let n = force.len().min(response.len());
    if n < 2 {
        return f64::NAN;
    }
    let s_ff: f64 = force.iter().map(Complex::norm_sqr).sum();
    let s_xf: Complex<f64> = response.iter().zip(force).map(|(x, f)| x * f.conj()).sum();
    if s_ff == 0.0 {
        return f64::INFINITY;
    }
    let without: Vec<Complex<f64>> =
        response.iter().zip(force).map(|(x, f)| (s_xf - x * f.conj()) / (s_ff - f.norm_sqr())).collect();
    let mean = without.iter().sum::<Complex<f64>>() / n as f64;
    let scatter: f64 = without.iter().map(|h| (h - mean).norm_sqr()).sum();
    0.5 * (n as f64 - 1.0) / n as f64 * scatter
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_forces_give_the_variance_of_a_mean() {
        let force = vec![Complex::new(2.0, 0.0); 4];
        let h = [1.0, 2.0, 4.0, 9.0];
        let response: Vec<_> = h.iter().map(|h| Complex::new(2.0 * h, 0.0)).collect();
        // mean 4, squares 9 + 4 + 0 + 25 = 38; variance of the mean 38 / (3 · 4), half of it for
        // each part
        assert!((variance_of_part(&force, &response) - 38.0 / 24.0).abs() < 1e-12);
        assert!(variance_of_part(&force[..1], &response[..1]).is_nan());
    }
}
