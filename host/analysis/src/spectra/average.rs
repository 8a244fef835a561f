//! Spectra of many hits, one at a time: auto- and cross-spectra accumulate, the signals are gone when the hit is in.

use super::SpectraError;
use super::cross_spectra::{CrossSpectra, OutputSums};
use super::half_length::{HalfLength, Lines, check_finite};
use super::jackknife;
use super::lent::Lent;
use crate::parallel::{self, prelude::*};
use crate::vectors::wide;
use bytemuck::zeroed_vec;
use num_complex::Complex;
use std::mem::take;
use std::ops::Range;
use std::sync::Arc;

/// Sums of spectra over the hits so far.
pub struct SpectraAverage {
    fs_hz: f64,
    samples: usize,
    transform: Arc<HalfLength>,
    hits: usize,
    s_ff: Vec<f64>,
    /// The lines that the outputs' sums hold.
    lines: Range<usize>,
    outputs: Vec<Output>,
    failed: Option<SpectraError>,
    keep_hits: bool,
    kept_force: Vec<Vec<Complex<f64>>>,
}

/// A response and its sums.
struct Output {
    s_xf: Vec<Complex<f64>>,
    s_xx: Vec<f64>,
    kept: Vec<Vec<Complex<f64>>>,
}

impl Output {
    fn of(lines: usize) -> Self {
        // zeros from the system: whoever sums first touches them first, on every core
        Output { s_xf: zeroed_vec(lines), s_xx: zeroed_vec(lines), kept: Vec::new() }
    }

    /// Keeps the lines of one hit's response.
    fn keep(&mut self, transform: &HalfLength, lines: &Range<usize>, response: &Lent) {
        let mut own = vec![Complex::default(); lines.len()];
        transform.put(response, lines.start, &mut own);
        self.kept.push(own);
    }
}

/// The sums that a hit's lines enter, from line `first` on, and its force at every line.
struct Sums<'a> {
    first: usize,
    output: &'a mut Output,
    force: &'a [Complex<f64>],
}

impl Lines for Sums<'_> {
    #[inline]
    fn take(&mut self, lines: Range<usize>, values: impl Iterator<Item = Complex<f64>>) {
        let place = lines.start - self.first..lines.end - self.first;
        let (s_xf, s_xx) = (&mut self.output.s_xf[place.clone()], &mut self.output.s_xx[place]);
        let force = &self.force[lines];
        wide(|| {
            for ((s_xf, s_xx), (x, f)) in s_xf.iter_mut().zip(s_xx).zip(values.zip(force)) {
                *s_xf += x * f.conj();
                *s_xx += x.norm_sqr();
            }
        });
    }
}

fn add_power(sums: &mut [f64], spectrum: &[Complex<f64>]) {
    wide(|| sums.iter_mut().zip(spectrum).for_each(|(sum, f)| *sum += f.norm_sqr()));
}

impl SpectraAverage {
    /// For records of `samples` samples (zero padding included) and `outputs` responses.
    pub fn new(fs_hz: f64, samples: usize, outputs: usize) -> Self {
        Self::of_band(fs_hz, samples, outputs, [f64::NEG_INFINITY, f64::INFINITY])
    }

    /// The same, which sums the responses at the lines with `low_hz` ≤ f ≤ `high_hz` alone; the force is summed at all of them.
    pub fn of_band(fs_hz: f64, samples: usize, outputs: usize, [low_hz, high_hz]: [f64; 2]) -> Self {
        let transform = HalfLength::of(samples);
        let mut average = SpectraAverage {
            fs_hz,
            samples,
            hits: 0,
            s_ff: vec![0.0; transform.lines()],
            transform,
            lines: 0..0,
            outputs: Vec::new(),
            failed: None,
            keep_hits: false,
            kept_force: Vec::new(),
        };
        let frequency_hz = average.frequency_hz();
        let from = frequency_hz.partition_point(|f| *f < low_hz);
        let to = frequency_hz.partition_point(|f| *f <= high_hz).max(from);
        average.lines = from..to;
        average.outputs = (0..outputs).map(|_| Output::of(to - from)).collect();
        average
    }

    /// Frequency of every line, Hz.
    fn frequency_hz(&self) -> Vec<f64> {
        (0..self.s_ff.len()).map(|l| l as f64 * self.fs_hz / self.samples as f64).collect()
    }

    /// Keeps the spectra of every hit, so that `finish` can leave each out in turn: hits × channels × lines complex numbers.
    #[must_use]
    pub fn with_jackknife(mut self) -> Self {
        self.keep_hits = true;
        self
    }

    /// Adds one hit: its windowed force, N, and its windowed responses, SI.
    ///
    /// # Errors
    /// When the number of samples or responses differs from the others, or a value is not a number.
    pub fn add(&mut self, force_n: &[f64], responses: &[Vec<f64>]) -> Result<(), SpectraError> {
        if responses.len() != self.outputs.len() {
            return Err(SpectraError::Responses { found: responses.len(), expected: self.outputs.len() });
        }
        for signal in std::iter::once(force_n).chain(responses.iter().map(Vec::as_slice)) {
            if signal.len() != self.samples {
                return Err(SpectraError::Samples { found: signal.len(), expected: self.samples });
            }
            // before anything is summed: a refused hit leaves the average as it was
            check_finite(signal)?;
        }
        self.add_with(|out| out.copy_from_slice(force_n), |o, out| out.copy_from_slice(&responses[o]))
    }

    /// Adds one hit whose windowed force and responses (by output) are written straight into the transforms' memory, which
    /// holds other values before. See [`SpectraAverage::add_hits`].
    ///
    /// # Errors
    /// As of `add_hits`.
    pub fn add_with(
        &mut self,
        force: impl Fn(&mut [f64]) + Sync,
        response: impl Fn(usize, &mut [f64]) + Sync,
    ) -> Result<(), SpectraError> {
        self.add_hits(&[()], |(), out| force(out), |(), o, out| response(o, out))
    }

    /// Adds several hits at once, which keeps every core busy and costs the memory of their force spectra. The windowed force
    /// and responses (by output) of a hit are written straight into the transforms' memory, which holds other values before.
    ///
    /// # Errors
    /// A value that is not a number. Some responses of the hits may be in the sums then, so that the average is spent: this
    /// and [`SpectraAverage::finish`] give the same error from then on.
    pub fn add_hits<H: Sync>(
        &mut self,
        hits: &[H],
        force: impl Fn(&H, &mut [f64]) + Sync,
        response: impl Fn(&H, usize, &mut [f64]) + Sync,
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

    fn sum<H: Sync>(
        &mut self,
        hits: &[H],
        force: impl Fn(&H, &mut [f64]) + Sync,
        response: impl Fn(&H, usize, &mut [f64]) + Sync,
    ) -> Result<(), SpectraError> {
        let (transform, lines, keep) = (&*self.transform, &self.lines, self.keep_hits);
        let forces = hits.par_iter().map(|hit| {
            let spectrum = transform.transform(|out| force(hit, out))?;
            let mut own = Lent::of(transform.lines());
            transform.put(&spectrum, 0, &mut own);
            Ok(own)
        });
        let forces = forces.collect::<Result<Vec<Lent>, SpectraError>>()?;
        // one hit by itself comes of a loop over cells, which keeps every core busy
        let at_least = if hits.len() == 1 { self.outputs.len() } else { 1 };
        let outputs = self.outputs.par_chunks_mut(1).enumerate().with_min_len(at_least);
        let summed = outputs.map(|(o, output)| {
            for (hit, force) in hits.iter().zip(&forces) {
                let spectrum = transform.transform(|out| response(hit, o, out))?;
                for output in &mut *output {
                    let mut sums = Sums { first: lines.start, output, force };
                    transform.read(&spectrum, lines.clone(), &mut sums);
                    if keep {
                        output.keep(transform, lines, &spectrum);
                    }
                }
            }
            Ok(())
        });
        summed.collect::<Result<(), SpectraError>>()?;
        let share = self.s_ff.len().div_ceil(parallel::threads()).max(1);
        self.s_ff.par_chunks_mut(share).enumerate().for_each(|(part, sums)| {
            for force in &forces {
                add_power(sums, &force[part * share..]);
            }
        });
        if keep {
            self.kept_force.extend(forces.iter().map(|force| force[lines.clone()].to_vec()));
        }
        self.hits += hits.len();
        Ok(())
    }

    /// The spectra on s = σ + iω, where σ is the damping of the window that the signals went through.
    ///
    /// A channel measured late by `delay_s[output]` relative to the force is corrected by e^(+sτ). Missing delays are 0.
    ///
    /// # Errors
    /// When no hit was added, or adding one failed half way.
    pub fn finish(&self, sigma_per_s: f64, delay_s: &[f64]) -> Result<CrossSpectra, SpectraError> {
        let sums = self.outputs.iter().map(|output| (output.s_xf.clone(), output.s_xx.clone()));
        self.spectra(sums.collect(), sigma_per_s, delay_s)
    }

    /// As [`SpectraAverage::finish`] of an average to which nothing more is added: its sums are not copied.
    ///
    /// # Errors
    /// As of `finish`.
    pub fn finished(mut self, sigma_per_s: f64, delay_s: &[f64]) -> Result<CrossSpectra, SpectraError> {
        let sums = self.outputs.iter_mut().map(|output| (take(&mut output.s_xf), take(&mut output.s_xx)));
        let sums = sums.collect();
        self.spectra(sums, sigma_per_s, delay_s)
    }

    /// Of the outputs' sums.
    fn spectra(
        &self,
        sums: Vec<(Vec<Complex<f64>>, Vec<f64>)>,
        sigma_per_s: f64,
        delay_s: &[f64],
    ) -> Result<CrossSpectra, SpectraError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let frequency_hz = self.frequency_hz()[self.lines.clone()].to_vec();
        let delay_s_of = |o: usize| delay_s.get(o).copied().unwrap_or(0.0);
        let outputs = sums.into_iter().enumerate();
        let outputs = outputs.map(|(o, (s_xf, s_xx))| OutputSums { s_xf, s_xx, delay_s: delay_s_of(o) });
        let (s_ff, outputs) = (self.s_ff[self.lines.clone()].to_vec(), outputs.collect());
        let spectra = CrossSpectra::new(self.fs_hz, frequency_hz, sigma_per_s, self.hits, s_ff, outputs)?;
        Ok(spectra.with_jackknife(self.keep_hits.then(|| self.jackknife(sigma_per_s, delay_s))))
    }

    /// The force alone, at every line, whatever lines the responses are summed at.
    ///
    /// # Errors
    /// As of [`SpectraAverage::finish`].
    pub fn force(&self, sigma_per_s: f64) -> Result<CrossSpectra, SpectraError> {
        let s_ff = self.s_ff.clone();
        CrossSpectra::new(self.fs_hz, self.frequency_hz(), sigma_per_s, self.hits, s_ff, Vec::new())
    }

    /// Variance by leaving out each hit in turn, \[line\]\[output\].
    fn jackknife(&self, sigma_per_s: f64, delay_s: &[f64]) -> Vec<Vec<f64>> {
        (0..self.lines.len())
            .into_par_iter()
            .map(|l| {
                let force: Vec<_> = self.kept_force.iter().map(|f| f[l]).collect();
                let of_output = |(o, output): (usize, &Output)| {
                    let response: Vec<_> = output.kept.iter().map(|x| x[l]).collect();
                    // |e^(sτ)|², for the advance that H is multiplied with
                    let gain = (2.0 * sigma_per_s * delay_s.get(o).copied().unwrap_or(0.0)).exp();
                    gain * jackknife::variance_of_part(&force, &response)
                };
                self.outputs.iter().enumerate().map(of_output).collect()
            })
            .collect()
    }
}
