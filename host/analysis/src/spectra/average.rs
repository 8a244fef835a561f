//! Spectra of many hits, one at a time: auto- and cross-spectra accumulate, the signals are gone when the hit is in.

use super::SpectraError;
use super::cross_spectra::{CrossSpectra, OutputSums};
use super::jackknife;
use crate::parallel::{self, prelude::*};
use crate::transforms::forward;
use crate::vectors::{all_finite, wide};
use num_complex::Complex;
use realfft::RealToComplex;
use std::ops::Range;
use std::sync::Arc;

/// Sums of spectra over the hits so far.
pub struct SpectraAverage {
    fs_hz: f64,
    samples: usize,
    fft: Arc<dyn RealToComplex<f64>>,
    hits: usize,
    /// Force spectra of the hits being added.
    forces: Vec<Vec<Complex<f64>>>,
    s_ff: Vec<f64>,
    /// The lines that the outputs' sums hold.
    lines: Range<usize>,
    outputs: Vec<Output>,
    /// One for each thread: a channel's working memory stays in that core's cache.
    workers: Vec<Channel>,
    failed: Option<SpectraError>,
    keep_hits: bool,
    kept_force: Vec<Vec<Complex<f64>>>,
}

/// Working memory of one channel's transform, used again for every channel and hit.
struct Channel {
    signal: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    /// Of the hit after it, so that the sums are read and written once for both.
    next: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

/// A response and its sums.
struct Output {
    s_xf: Vec<Complex<f64>>,
    s_xx: Vec<f64>,
    kept: Vec<Vec<Complex<f64>>>,
}

/// A response's spectrum and its force's, line by line.
#[derive(Clone, Copy)]
struct Pair<'a> {
    x: &'a [Complex<f64>],
    f: &'a [Complex<f64>],
}

impl Output {
    fn add_one(&mut self, Pair { x, f }: Pair<'_>) {
        let (s_xf, s_xx) = (&mut self.s_xf[..], &mut self.s_xx[..]);
        wide(|| {
            for ((s_xf, s_xx), (x, f)) in s_xf.iter_mut().zip(s_xx).zip(x.iter().zip(f)) {
                *s_xf += x * f.conj();
                *s_xx += x.norm_sqr();
            }
        });
    }

    /// As one after the other, to the last bit.
    fn add_two(&mut self, first: Pair<'_>, second: Pair<'_>) {
        let (s_xf, s_xx) = (&mut self.s_xf[..], &mut self.s_xx[..]);
        wide(|| {
            let products = first.x.iter().zip(first.f).zip(second.x.iter().zip(second.f));
            for ((s_xf, s_xx), ((x, f), (y, g))) in s_xf.iter_mut().zip(s_xx).zip(products) {
                *s_xf = *s_xf + x * f.conj() + y * g.conj();
                *s_xx = *s_xx + x.norm_sqr() + y.norm_sqr();
            }
        });
    }
}

fn add_power(sums: &mut [f64], spectrum: &[Complex<f64>]) {
    wide(|| sums.iter_mut().zip(spectrum).for_each(|(sum, f)| *sum += f.norm_sqr()));
}

impl Channel {
    fn new(fft: &dyn RealToComplex<f64>) -> Self {
        Channel {
            signal: fft.make_input_vec(),
            spectrum: fft.make_output_vec(),
            next: fft.make_output_vec(),
            scratch: fft.make_scratch_vec(),
        }
    }

    /// Transforms what `fill` writes into the signal.
    fn transform(
        &mut self,
        fft: &dyn RealToComplex<f64>,
        fill: impl Fn(&mut [f64]),
    ) -> Result<(), SpectraError> {
        fill(&mut self.signal);
        fft.process_with_scratch(&mut self.signal, &mut self.spectrum, &mut self.scratch)
            .map_err(|e| SpectraError::Transform(e.to_string()))?;
        // every sample is in every line, so that one line tells of a sample that is not a number
        if self.spectrum.first().is_some_and(|line| !line.re.is_finite()) {
            fill(&mut self.signal);
            check_finite(&self.signal)?;
            return Err(SpectraError::Transform("the sum of the samples is beyond an f64".into()));
        }
        Ok(())
    }
}

impl SpectraAverage {
    /// For records of `samples` samples (zero padding included) and `outputs` responses.
    pub fn new(fs_hz: f64, samples: usize, outputs: usize) -> Self {
        let fft = forward(samples);
        let lines = samples / 2 + 1;
        SpectraAverage {
            fs_hz,
            samples,
            hits: 0,
            forces: Vec::new(),
            s_ff: vec![0.0; lines],
            lines: 0..lines,
            outputs: (0..outputs)
                .map(|_| Output {
                    s_xf: vec![Complex::default(); lines],
                    s_xx: vec![0.0; lines],
                    kept: Vec::new(),
                })
                .collect(),
            workers: (0..parallel::threads().min(outputs).max(1)).map(|_| Channel::new(&*fft)).collect(),
            failed: None,
            fft,
            keep_hits: false,
            kept_force: Vec::new(),
        }
    }

    /// Sums the responses at the lines with `low_hz` ≤ f ≤ `high_hz` alone; the force is summed at all of them.
    #[must_use]
    pub fn with_band(mut self, low_hz: f64, high_hz: f64) -> Self {
        let frequency_hz = self.frequency_hz();
        let from = frequency_hz.partition_point(|f| *f < low_hz);
        let to = frequency_hz.partition_point(|f| *f <= high_hz).max(from);
        self.lines = from..to;
        for output in &mut self.outputs {
            *output = Output {
                s_xf: vec![Complex::default(); to - from],
                s_xx: vec![0.0; to - from],
                kept: Vec::new(),
            };
        }
        self
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
        let fft = &*self.fft;
        self.forces.resize_with(hits.len(), || fft.make_output_vec());
        let share = hits.len().div_ceil(self.workers.len()).max(1);
        let parts = self.forces.par_chunks_mut(share).zip(hits.par_chunks(share)).zip(&mut self.workers);
        let transformed = parts.map(|((spectra, hits), worker)| {
            for (spectrum, hit) in spectra.iter_mut().zip(hits) {
                worker.transform(fft, |out| force(hit, out))?;
                std::mem::swap(spectrum, &mut worker.spectrum);
            }
            Ok(())
        });
        transformed.collect::<Result<(), SpectraError>>()?;
        let forces = &self.forces;
        let (keep, lines) = (self.keep_hits, self.lines.clone());
        let share = self.outputs.len().div_ceil(self.workers.len()).max(1);
        let parts = self.outputs.par_chunks_mut(share).zip(&mut self.workers).enumerate();
        let summed = parts.map(|(part, (outputs, worker))| {
            for (i, output) in outputs.iter_mut().enumerate() {
                for (hits, forces) in hits.chunks(2).zip(forces.chunks(2)) {
                    for hit in hits {
                        std::mem::swap(&mut worker.spectrum, &mut worker.next);
                        worker.transform(fft, |out| response(hit, part * share + i, out))?;
                        if keep {
                            output.kept.push(worker.spectrum[lines.clone()].to_vec());
                        }
                    }
                    match forces {
                        [first, second] => {
                            let first = Pair { x: &worker.next[lines.clone()], f: &first[lines.clone()] };
                            let second =
                                Pair { x: &worker.spectrum[lines.clone()], f: &second[lines.clone()] };
                            output.add_two(first, second);
                        }
                        [only] => output
                            .add_one(Pair { x: &worker.spectrum[lines.clone()], f: &only[lines.clone()] }),
                        _ => {}
                    }
                }
            }
            Ok(())
        });
        summed.collect::<Result<(), SpectraError>>()?;
        let share = self.s_ff.len().div_ceil(self.workers.len()).max(1);
        let forces = &self.forces;
        self.s_ff.par_chunks_mut(share).enumerate().for_each(|(part, sums)| {
            for force in forces {
                add_power(sums, &force[part * share..]);
            }
        });
        if keep {
            self.kept_force.extend(self.forces.iter().map(|force| force[lines.clone()].to_vec()));
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
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let frequency_hz = self.frequency_hz()[self.lines.clone()].to_vec();
        let outputs = self.outputs.iter().enumerate().map(|(o, output)| OutputSums {
            s_xf: output.s_xf.clone(),
            s_xx: output.s_xx.clone(),
            delay_s: delay_s.get(o).copied().unwrap_or(0.0),
        });
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

/// Refuses NaN and infinite values, naming the first.
fn check_finite(signal: &[f64]) -> Result<(), SpectraError> {
    if all_finite(signal) {
        return Ok(());
    }
    let sample = signal.iter().position(|v| !v.is_finite()).unwrap_or(0);
    Err(SpectraError::NotFinite { sample })
}
