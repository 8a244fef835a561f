//! Averaged FRFs, one hit at a time: auto- and cross-spectra accumulate, nothing else is kept.

use super::SpectraError;
use crate::substructuring::frf::{FrfMatrix, Quantity};
use nalgebra::DMatrix;
use num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use serde::Serialize;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Sums of spectra over the hits so far. Spectra are Fourier transforms (sum × Δt), so S has units of N² s² and so on.
pub struct SpectraAverage {
    fs_hz: f64,
    samples: usize,
    fft: Arc<dyn RealToComplex<f64>>,
    hits: usize,
    s_ff: Vec<f64>,
    s_xf: Vec<Vec<Complex<f64>>>,
    s_xx: Vec<Vec<f64>>,
}

/// FRFs of one impact position, averaged over its good hits. Per-line vectors are indexed \[line\]; per-output ones \[line\]\[output\].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AveragedFrf {
    /// Frequency of each line, Hz.
    pub frequency_hz: Vec<f64>,
    /// Damping of the exponential window, 1/s: the FRFs are on s = σ + iω.
    pub sigma_per_s: f64,
    /// Hits averaged.
    pub hits: usize,
    /// Mean auto-spectrum of the force, N² s².
    pub s_ff: Vec<f64>,
    /// H1 = S_xf / S_ff, response per newton.
    pub h1: Vec<Vec<Complex<f64>>>,
    /// H2 = S_xx / S_fx: biased by noise in the response, not in the force.
    pub h2: Vec<Vec<Complex<f64>>>,
    /// Hv: the phase of the cross-spectrum with the geometric mean of |H1| and |H2|.
    pub hv: Vec<Vec<Complex<f64>>>,
    /// γ² = |S_xf|² / (S_ff S_xx); NaN with a single hit, where it is 1 whatever the noise.
    pub coherence: Vec<Vec<f64>>,
    /// Variance of the real part of H1, and of its imaginary part: |H1|²(1 − γ²)/(2 n γ²). The complex variance E|δH|² is
    /// twice that. NaN with a single hit.
    pub variance: Vec<Vec<f64>>,
}

impl SpectraAverage {
    /// For records of `samples` samples and `outputs` responses.
    pub fn new(fs_hz: f64, samples: usize, outputs: usize) -> Self {
        let fft = RealFftPlanner::new().plan_fft_forward(samples);
        let lines = samples / 2 + 1;
        SpectraAverage {
            fs_hz,
            samples,
            fft,
            hits: 0,
            s_ff: vec![0.0; lines],
            s_xf: vec![vec![Complex::default(); lines]; outputs],
            s_xx: vec![vec![0.0; lines]; outputs],
        }
    }

    /// Adds one hit: its windowed force, N, and its windowed responses, SI.
    ///
    /// # Errors
    /// When the number of samples or responses differs from the others, or a value is not a number.
    pub fn add(&mut self, force_n: Vec<f64>, responses: Vec<Vec<f64>>) -> Result<(), SpectraError> {
        if responses.len() != self.s_xf.len() {
            return Err(SpectraError::Responses { found: responses.len(), expected: self.s_xf.len() });
        }
        let force = self.spectrum(force_n)?;
        // All transforms first: a hit that fails half way must leave the sums untouched.
        let responses: Vec<_> = responses.into_iter().map(|x| self.spectrum(x)).collect::<Result<_, _>>()?;
        for (sum, f) in self.s_ff.iter_mut().zip(&force) {
            *sum += f.norm_sqr();
        }
        for (output, x) in responses.iter().enumerate() {
            for line in 0..force.len() {
                self.s_xf[output][line] += x[line] * force[line].conj();
                self.s_xx[output][line] += x[line].norm_sqr();
            }
        }
        self.hits += 1;
        Ok(())
    }

    /// The averaged FRFs on s = σ + iω, where σ is the damping of the window that `add`'s signals went through.
    ///
    /// A channel measured late by `delay_s[output]` relative to the force is corrected by e^(+sτ). Missing delays are 0.
    ///
    /// # Errors
    /// When no hit was added.
    pub fn finish(&self, sigma_per_s: f64, delay_s: &[f64]) -> Result<AveragedFrf, SpectraError> {
        if self.hits == 0 {
            return Err(SpectraError::NoHits);
        }
        let n = self.hits as f64;
        let lines = self.s_ff.len();
        let outputs = self.s_xf.len();
        let frequency_hz: Vec<f64> =
            (0..lines).map(|l| l as f64 * self.fs_hz / self.samples as f64).collect();
        let mut out = AveragedFrf {
            frequency_hz,
            sigma_per_s,
            hits: self.hits,
            s_ff: self.s_ff.iter().map(|s| s / n).collect(),
            h1: Vec::with_capacity(lines),
            h2: Vec::with_capacity(lines),
            hv: Vec::with_capacity(lines),
            coherence: Vec::with_capacity(lines),
            variance: Vec::with_capacity(lines),
        };
        for line in 0..lines {
            let s = Complex::new(sigma_per_s, TAU * out.frequency_hz[line]);
            let mut rows = (vec![], vec![], vec![], vec![], vec![]);
            for output in 0..outputs {
                let (s_ff, s_xf, s_xx) = (self.s_ff[line], self.s_xf[output][line], self.s_xx[output][line]);
                let advance = (s * delay_s.get(output).copied().unwrap_or(0.0)).exp();
                let h1 = s_xf / s_ff;
                rows.0.push(h1 * advance);
                rows.1.push(s_xx / s_xf.conj() * advance);
                rows.2.push(s_xf / s_xf.norm() * (s_xx / s_ff).sqrt() * advance);
                // A single hit is always coherent with itself: that says nothing about noise.
                let coherence = if self.hits > 1 { s_xf.norm_sqr() / (s_ff * s_xx) } else { f64::NAN };
                rows.3.push(coherence);
                rows.4.push(variance_of_part(h1 * advance, coherence, self.hits));
            }
            out.h1.push(rows.0);
            out.h2.push(rows.1);
            out.hv.push(rows.2);
            out.coherence.push(rows.3);
            out.variance.push(rows.4);
        }
        Ok(out)
    }

    fn spectrum(&self, mut signal: Vec<f64>) -> Result<Vec<Complex<f64>>, SpectraError> {
        if signal.len() != self.samples {
            return Err(SpectraError::Samples { found: signal.len(), expected: self.samples });
        }
        if let Some(sample) = signal.iter().position(|v| !v.is_finite()) {
            return Err(SpectraError::NotFinite { sample });
        }
        let mut out = self.fft.make_output_vec();
        self.fft.process(&mut signal, &mut out).map_err(|e| SpectraError::Transform(e.to_string()))?;
        for value in &mut out {
            *value /= self.fs_hz;
        }
        Ok(out)
    }
}

/// |H|²(1 − γ²)/(2 n γ²): variance of the real, and of the imaginary part of H1 (Bendat and Piersol).
pub fn variance_of_part(h1: Complex<f64>, coherence: f64, hits: usize) -> f64 {
    h1.norm_sqr() * (1.0 - coherence).max(0.0) / (2.0 * hits as f64 * coherence)
}

impl AveragedFrf {
    /// Only the lines with `low_hz` ≤ f ≤ `high_hz`.
    #[must_use]
    pub fn band(&self, low_hz: f64, high_hz: f64) -> AveragedFrf {
        let from = self.frequency_hz.partition_point(|f| *f < low_hz);
        let to = self.frequency_hz.partition_point(|f| *f <= high_hz).max(from);
        AveragedFrf {
            frequency_hz: self.frequency_hz[from..to].to_vec(),
            sigma_per_s: self.sigma_per_s,
            hits: self.hits,
            s_ff: self.s_ff[from..to].to_vec(),
            h1: self.h1[from..to].to_vec(),
            h2: self.h2[from..to].to_vec(),
            hv: self.hv[from..to].to_vec(),
            coherence: self.coherence[from..to].to_vec(),
            variance: self.variance[from..to].to_vec(),
        }
    }

    /// H1 as an FRF matrix with one input.
    pub fn to_matrix(&self, quantity: Quantity, outputs: Vec<String>, input: String) -> FrfMatrix {
        let lines = self.h1.iter().map(|row| DMatrix::from_column_slice(row.len(), 1, row)).collect();
        FrfMatrix {
            frequency_hz: self.frequency_hz.clone(),
            sigma_per_s: self.sigma_per_s,
            quantity,
            outputs,
            inputs: vec![input],
            lines,
        }
    }
}
