//! Auto- and cross-spectra of the hits of one impact position, from which H1, H2, Hv, coherence and
//! variance derive.
//!
//! H1, H2 and Hv of one line from S_ff (real), S_xf = Σ X F* and S_xx (real), all sums over the
//! same hits.
//!
//! Where the force or the cross-spectrum is zero, the estimate is 0 (and so is the coherence).

use super::SpectraError;
use crate::frf::{Frf, FrfError, MotionQuantity};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::f64::consts::TAU;

/// S_ff, S_xf and S_xx over n hits, on the lines s = σ + i2πf for an exponential window's damping
/// σ.
///
/// The sums are stored unscaled; each FRF is computed on request, by (line, output). Where the
/// force has no energy (0 Hz of a signal without mean), FRFs and coherence are 0 and the variance
/// is infinite.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossSpectra {
    fs_hz: f64,
    frequency_hz: Vec<f64>,
    sigma_per_s: f64,
    hits: usize,
    /// Number of differentiations of the responses since they were measured.
    order: i32,
    s_ff: Vec<f64>,
    outputs: Vec<OutputSums>,
    jackknife: Option<Vec<Vec<f64>>>,
}

/// The sums of one response in the measured quantity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OutputSums {
    /// Σ X F* per line.
    pub s_xf: Vec<Complex<f64>>,
    /// Σ |X|² per line.
    pub s_xx: Vec<f64>,
    /// Delay of the response relative to the force, s: FRFs are corrected by e^(+sτ).
    pub delay_s: f64,
}

impl CrossSpectra {
    /// Sums over `hits` hits of products of discrete transforms (plain sums over samples, taken at
    /// `fs_hz`).
    ///
    /// # Errors
    /// No hit, or an output without exactly one value per line.
    pub fn new(
        fs_hz: f64,
        frequency_hz: Vec<f64>,
        sigma_per_s: f64,
        hits: usize,
        s_ff: Vec<f64>,
        outputs: Vec<OutputSums>,
    ) -> Result<Self, SpectraError> {
        let lines = frequency_hz.len();
        let alike = |o: &OutputSums| o.s_xf.len() == lines && o.s_xx.len() == lines;
        if hits == 0 {
            return Err(SpectraError::NoHits);
        }
        if s_ff.len() != lines || !outputs.iter().all(alike) {
            return Err(SpectraError::Unlike);
        }
        Ok(CrossSpectra { fs_hz, frequency_hz, sigma_per_s, hits, order: 0, s_ff, outputs, jackknife: None })
    }

    /// Adds jackknife variances, \[line\]\[output\].
    pub(super) fn with_jackknife(self, jackknife: Option<Vec<Vec<f64>>>) -> Self {
        CrossSpectra { jackknife, ..self }
    }

    /// Frequency of each line, Hz.
    pub fn frequency_hz(&self) -> &[f64] {
        &self.frequency_hz
    }

    /// Damping of the exponential window, 1/s.
    pub fn sigma_per_s(&self) -> f64 {
        self.sigma_per_s
    }

    /// Number of hits summed.
    pub fn hits(&self) -> usize {
        self.hits
    }

    /// Number of lines.
    pub fn lines(&self) -> usize {
        self.frequency_hz.len()
    }

    /// Number of responses.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// The Laplace variable s = σ + i2πf of a line, 1/s.
    pub fn s(&self, line: usize) -> Complex<f64> {
        Complex::new(self.sigma_per_s, TAU * self.frequency_hz[line])
    }

    /// Mean auto-spectrum of the force, N² s².
    pub fn force(&self, line: usize) -> f64 {
        self.s_ff[line] / self.scale()
    }

    /// The same of every line.
    pub fn force_spectrum(&self) -> Vec<f64> {
        (0..self.lines()).map(|line| self.force(line)).collect()
    }

    /// Mean cross-spectrum of a response with the force, SI N s²; corrected for the response's
    /// delay.
    pub fn cross(&self, line: usize, output: usize) -> Complex<f64> {
        self.corrected(line, output, self.outputs[output].s_xf[line]) / self.scale()
    }

    /// H1 = S_xf / S_ff, response per newton: biased low by noise in the force.
    pub fn h1(&self, line: usize, output: usize) -> Complex<f64> {
        let h = h1(self.s_ff[line], self.outputs[output].s_xf[line]);
        self.corrected(line, output, h)
    }

    /// H2 = S_xx / S_fx: biased high by noise in the response.
    pub fn h2(&self, line: usize, output: usize) -> Complex<f64> {
        let sums = &self.outputs[output];
        self.corrected(line, output, h2(sums.s_xf[line], sums.s_xx[line]))
    }

    /// Hv for this ratio of noise powers, response over force, (SI/N)²; see [`hv`].
    pub fn hv(&self, line: usize, output: usize, noise_ratio: Option<f64>) -> Complex<f64> {
        let sums = &self.outputs[output];
        let h = hv(self.s_ff[line], sums.s_xf[line], sums.s_xx[line], noise_ratio);
        self.corrected(line, output, h)
    }

    /// γ² = |S_xf|² / (S_ff S_xx); NaN with a single hit, for which it would be 1 regardless of
    /// noise.
    pub fn coherence(&self, line: usize, output: usize) -> f64 {
        let sums = &self.outputs[output];
        match (self.hits, self.s_ff[line] * sums.s_xx[line]) {
            (1, _) => f64::NAN,
            (_, 0.0) => 0.0,
            (_, power) => sums.s_xf[line].norm_sqr() / power,
        }
    }

    /// Variance of the real part of H1, which equals that of its imaginary part: |H1|²(1 − γ²)/(2 n
    /// γ²). The complex variance E|δH|² is twice that. NaN with a single hit.
    pub fn variance(&self, line: usize, output: usize) -> f64 {
        let h = h1(self.s_ff[line], self.outputs[output].s_xf[line]) * self.advance(line, output);
        let variance = variance_of_part(h, self.coherence(line, output), self.hits);
        if self.order == 0 { variance } else { variance * self.s(line).powi(self.order).norm_sqr() }
    }

    /// The same variance by jackknife, leaving out one hit at a time, \[line\]\[output\], if it was
    /// requested.
    pub fn jackknife(&self) -> Option<Vec<Vec<f64>>> {
        let gain = |line: usize| self.s(line).powi(self.order).norm_sqr();
        let rows = self.jackknife.as_ref()?.iter().enumerate();
        Some(rows.map(|(line, row)| row.iter().map(|v| v * gain(line)).collect()).collect())
    }

    /// Values of `of` for every line and output, \[line\]\[output\].
    pub fn rows<T>(&self, of: impl Fn(&Self, usize, usize) -> T) -> Vec<Vec<T>> {
        let row = |line| (0..self.outputs()).map(|output| of(self, line, output)).collect();
        (0..self.lines()).map(row).collect()
    }

    /// Adds the hits of other spectra with the same lines, window and responses. Responses with a
    /// different delay are corrected first. Jackknife variances are discarded.
    ///
    /// # Errors
    /// [`SpectraError::Unlike`].
    pub fn add(&mut self, other: &CrossSpectra) -> Result<(), SpectraError> {
        let key = |s: &Self| (s.fs_hz, s.sigma_per_s, s.order, s.outputs.len());
        if key(self) != key(other) || self.frequency_hz != other.frequency_hz {
            return Err(SpectraError::Unlike);
        }
        let sum = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        for o in 0..self.outputs.len() {
            let theirs = if self.outputs[o].delay_s == other.outputs[o].delay_s {
                &other.outputs[o]
            } else {
                self.outputs[o] = self.in_step(o);
                &other.in_step(o)
            };
            let own = &mut self.outputs[o];
            own.s_xf.iter_mut().zip(&theirs.s_xf).for_each(|(a, b)| *a += b);
            sum(&mut own.s_xx, &theirs.s_xx);
        }
        sum(&mut self.s_ff, &other.s_ff);
        self.hits += other.hits;
        self.jackknife = None;
        Ok(())
    }

    /// Only the lines with `low_hz` ≤ f ≤ `high_hz`.
    #[must_use]
    pub fn band(&self, low_hz: f64, high_hz: f64) -> CrossSpectra {
        let from = self.frequency_hz.partition_point(|f| *f < low_hz);
        let to = self.frequency_hz.partition_point(|f| *f <= high_hz).max(from);
        let outputs = self.outputs.iter().map(|o| OutputSums {
            s_xf: o.s_xf[from..to].to_vec(),
            s_xx: o.s_xx[from..to].to_vec(),
            delay_s: o.delay_s,
        });
        CrossSpectra {
            frequency_hz: self.frequency_hz[from..to].to_vec(),
            s_ff: self.s_ff[from..to].to_vec(),
            outputs: outputs.collect(),
            jackknife: self.jackknife.as_ref().map(|v| v[from..to].to_vec()),
            ..*self
        }
    }

    /// The spectra of these outputs only.
    #[must_use]
    pub fn of_outputs(&self, outputs: std::ops::Range<usize>) -> CrossSpectra {
        CrossSpectra {
            frequency_hz: self.frequency_hz.clone(),
            s_ff: self.s_ff.clone(),
            jackknife: self
                .jackknife
                .as_ref()
                .map(|v| v.iter().map(|v| v[outputs.clone()].to_vec()).collect()),
            outputs: self.outputs[outputs].to_vec(),
            ..*self
        }
    }

    /// The same hits in another quantity: responses multiplied by s for each time derivative, or
    /// divided. A line at s = 0 cannot be divided by s and is omitted in that case.
    #[must_use]
    pub fn converted(&self, from: MotionQuantity, to: MotionQuantity) -> CrossSpectra {
        let order = to.order_of_s() - from.order_of_s();
        let lowest = if order < 0 && self.sigma_per_s == 0.0 { f64::MIN_POSITIVE } else { 0.0 };
        CrossSpectra { order: self.order + order, ..self.band(lowest, f64::INFINITY) }
    }

    /// H1 as FRFs with one input.
    ///
    /// # Errors
    /// The names of the outputs are not unique, or their number differs from that of the outputs.
    pub fn to_matrix(
        &self,
        quantity: MotionQuantity,
        outputs: Vec<String>,
        input: String,
    ) -> Result<Frf, FrfError> {
        let line = |line| DMatrix::from_fn(self.outputs(), 1, |output, _| self.h1(line, output));
        Frf::new(
            self.frequency_hz.clone(),
            self.sigma_per_s,
            quantity,
            outputs,
            vec![input],
            (0..self.lines()).map(line).collect(),
        )
    }

    /// Divisor that turns sums of products of discrete transforms into means of products of Fourier
    /// integrals.
    fn scale(&self) -> f64 {
        // a Fourier integral is the sum × Δt
        self.hits as f64 * self.fs_hz * self.fs_hz
    }

    /// e^(+sτ): compensates the delay of an output relative to the force.
    fn advance(&self, line: usize, output: usize) -> Complex<f64> {
        match self.outputs[output].delay_s {
            0.0 => Complex::new(1.0, 0.0),
            delay_s => (self.s(line) * delay_s).exp(),
        }
    }

    /// Corrects a value proportional to the response for its delay, and differentiates it.
    fn corrected(&self, line: usize, output: usize, value: Complex<f64>) -> Complex<f64> {
        let value = value * self.advance(line, output);
        if self.order == 0 { value } else { value * self.s(line).powi(self.order) }
    }

    /// The sums of an output with its delay removed.
    fn in_step(&self, output: usize) -> OutputSums {
        let sums = &self.outputs[output];
        let advance = |line| self.advance(line, output);
        OutputSums {
            s_xf: sums.s_xf.iter().enumerate().map(|(l, s)| s * advance(l)).collect(),
            s_xx: sums.s_xx.iter().enumerate().map(|(l, s)| s * advance(l).norm_sqr()).collect(),
            delay_s: 0.0,
        }
    }
}

/// S_xf / S_ff: biased low by noise in the force.
pub fn h1(s_ff: f64, s_xf: Complex<f64>) -> Complex<f64> {
    if s_ff == 0.0 { Complex::default() } else { s_xf / s_ff }
}

/// S_xx / S_fx: biased high by noise in the response.
pub fn h2(s_xf: Complex<f64>, s_xx: f64) -> Complex<f64> {
    if s_xf.norm_sqr() == 0.0 { Complex::default() } else { s_xx / s_xf.conj() }
}

/// Total least squares for noise in both, where κ = `noise_ratio` is the response's noise power
/// over the force's, (SI/N)²: (S_xx − κ S_ff + √((S_xx − κ S_ff)² + 4 κ |S_xf|²)) / (2 S_fx).
///
/// `None` uses κ = S_xx / S_ff on each line, i.e. noise in proportion to the signals. This gives
/// the phase of the cross-spectrum with the geometric mean of |H1| and |H2|, and does not depend on
/// units. κ → ∞ is H1, κ → 0 is H2.
pub fn hv(s_ff: f64, s_xf: Complex<f64>, s_xx: f64, noise_ratio: Option<f64>) -> Complex<f64> {
    let cross = s_xf.norm_sqr();
    if cross == 0.0 || s_ff == 0.0 {
        return Complex::default();
    }
    let Some(kappa) = noise_ratio else { return s_xf / cross.sqrt() * (s_xx / s_ff).sqrt() };
    let difference = s_xx - kappa * s_ff;
    let root = difference.hypot(2.0 * kappa.sqrt() * cross.sqrt());
    // for a negative difference the sum would suffer from cancellation: use the equivalent quotient
    let sum = if difference >= 0.0 { difference + root } else { 4.0 * kappa * cross / (root - difference) };
    sum / (2.0 * s_xf.conj())
}

/// |H|²(1 − γ²)/(2 n γ²): variance of the real part of H1, and of its imaginary part (Bendat and
/// Piersol). Infinite at γ² = 0.
pub fn variance_of_part(h1: Complex<f64>, coherence: f64, hits: usize) -> f64 {
    if coherence == 0.0 {
        return f64::INFINITY;
    }
    h1.norm_sqr() * (1.0 - coherence).max(0.0) / (2.0 * hits as f64 * coherence)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spectra(frequency_hz: &[f64], sigma_per_s: f64, delay_s: f64) -> CrossSpectra {
        let lines = frequency_hz.len();
        let sums = OutputSums { s_xf: vec![Complex::new(1.0, 2.0); lines], s_xx: vec![6.0; lines], delay_s };
        CrossSpectra::new(1e3, frequency_hz.to_vec(), sigma_per_s, 3, vec![1.0; lines], vec![sums])
            .expect("alike")
            .with_jackknife(Some(vec![vec![0.5]; lines]))
    }

    #[test]
    fn derivatives_multiply_by_s_and_variances_by_its_square() {
        use MotionQuantity::{Acceleration, Displacement, Velocity};
        let y = spectra(&[0.0, 10.0], 2.3, 0.0);
        let a = y.converted(Velocity, Acceleration);
        let s = Complex::new(2.3, TAU * 10.0);
        assert!((a.hv(1, 0, None) - s * y.hv(1, 0, None)).norm() < 1e-12);
        assert!((a.variance(1, 0) - y.variance(1, 0) * s.norm_sqr()).abs() < 1e-9);
        assert!((a.jackknife().expect("given")[1][0] - 0.5 * s.norm_sqr()).abs() < 1e-9);
        let back = a.converted(Acceleration, Displacement).converted(Displacement, Velocity);
        assert!((back.h1(0, 0) - y.h1(0, 0)).norm() < 1e-12 && back.frequency_hz() == y.frequency_hz());
        // without an exponential window 0 Hz has no receptance
        let plain = spectra(&[0.0, 10.0], 0.0, 0.0);
        assert_eq!(plain.converted(Velocity, Displacement).frequency_hz(), [10.0]);
        assert_eq!(plain.converted(Velocity, Acceleration).h1(0, 0).norm(), 0.0);
    }

    #[test]
    fn hits_that_were_late_by_other_times_are_added_in_step() {
        let (early, late) = (spectra(&[10.0, 200.0], 2.3, 20e-6), spectra(&[10.0, 200.0], 2.3, 50e-6));
        let mut twice = early.clone();
        twice.add(&early).expect("alike");
        assert_eq!((twice.h1(1, 0), twice.hits()), (early.h1(1, 0), 6));
        let mut both = early.clone();
        both.add(&late).expect("alike");
        let mean = (early.h1(1, 0) + late.h1(1, 0)) / 2.0;
        assert!((both.h1(1, 0) - mean).norm() < 1e-14 * mean.norm());
        assert!((both.cross(1, 0) - mean * both.force(1)).norm() < 1e-14 * both.cross(1, 0).norm());
        let powers = (early.h1(1, 0) * early.h2(1, 0).conj() + late.h1(1, 0) * late.h2(1, 0).conj()) / 2.0;
        assert!((both.h2(1, 0) * both.h1(1, 0).conj() - powers.conj()).norm() < 1e-12 * powers.norm());
        assert_eq!(both.add(&spectra(&[10.0], 2.3, 0.0)), Err(SpectraError::Unlike));
    }
}

#[cfg(test)]
mod estimators_tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        #[test]
        fn hv_lies_between_h1_and_h2(
            s_ff in 1e-6..1e6f64, s_xx in 1e-6..1e6f64, coherence in 1e-6..0.999_999f64, phase in 0.0..6.2f64, k in 1e-9..1e9f64,
        ) {
            let s_xf = Complex::from_polar((coherence * s_ff * s_xx).sqrt(), phase);
            for ratio in [None, Some(k)] {
                let v = hv(s_ff, s_xf, s_xx, ratio);
                prop_assert!(v.norm() >= h1(s_ff, s_xf).norm() * (1.0 - 1e-9));
                prop_assert!(v.norm() <= h2(s_xf, s_xx).norm() * (1.0 + 1e-9));
                prop_assert!((v / s_xf).im.abs() <= 1e-9 * (v / s_xf).norm());
            }
            // noise in proportion to the signals corresponds to one value of the ratio
            let same = hv(s_ff, s_xf, s_xx, Some(s_xx / s_ff));
            prop_assert!((same - hv(s_ff, s_xf, s_xx, None)).norm() <= 1e-9 * same.norm());
        }
    }

    #[test]
    fn nothing_is_made_of_nothing() {
        let zero = Complex::default();
        assert_eq!((h1(0.0, zero), h2(zero, 1.0), hv(0.0, zero, 1.0, Some(1.0))), (zero, zero, zero));
    }
}
