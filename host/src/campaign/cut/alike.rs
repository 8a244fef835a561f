//! How much the structure's answer differs between two hits: the evidence that they were at the same
//! place.
//!
//! At one place, response over force is the same for every hit, however hard it was, and also for a
//! double hit, whose second pulse is in the force as well. At another place of hammer or sensor it
//! is not. [`Answers`] computes the ratio of the spectra of each hit on lines of a common band, with
//! its variance by the noise that was recorded before the hit. Both signals have the same
//! exponential window, which keeps the ratio exact (it becomes the FRF at s = σ + iω) and makes it
//! smooth, so that few lines describe it.

use num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Decay of the window over the compared length, in time constants: what follows is cut off at e⁻¹².
const DECAY: f64 = 12.0;
/// Most lines that are compared.
const LINES: usize = 160;
/// Lines are compared where the force has at least this fraction of its largest power.
const FORCE_FLOOR: f64 = 0.003;
/// A line is compared if one of the two answers has this many times the power of their noise.
const ABOVE_NOISE: f64 = 30.0;
/// Fewest lines, of all channels, that say something.
const FEWEST: usize = 12;
/// The band ends where a pulse of this duration leaves a tenth of the force, as a fraction of the
/// inverse of the duration.
const BAND: f64 = 1.2;

/// The ratio of response and force on one line, and the variance of its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnswerLine {
    /// The ratio, in units of the response per N.
    pub ratio: Complex<f64>,
    /// Its variance; infinite where the force is too weak.
    pub variance: f64,
}

/// The structure's answer to one hit: the lines of one channel after another.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Answer(pub Vec<AnswerLine>);

impl Answer {
    /// The relative difference of two answers: near 0 for hits at one place, near 1 for answers that
    /// have nothing in common. `None` where noise hides them.
    pub fn difference(&self, other: &Answer) -> Option<f64> {
        let (mut sum, mut lines) = (0.0, 0_usize);
        for (one, other) in self.0.iter().zip(&other.0) {
            let noise = one.variance + other.variance;
            let power = one.ratio.norm_sqr() + other.ratio.norm_sqr();
            if !noise.is_finite() || power < ABOVE_NOISE * noise || power == 0.0 {
                continue;
            }
            sum += ((one.ratio - other.ratio).norm_sqr() - noise) / power;
            lines += 1;
        }
        (lines >= FEWEST).then(|| (sum / lines as f64).max(0.0).sqrt())
    }
}

/// Computes answers of hits that are sampled alike.
pub struct Answers {
    samples: usize,
    weights: Vec<f64>,
    lines: Vec<usize>,
    transform: Arc<dyn RealToComplex<f64>>,
}

impl Answers {
    /// For hits of `samples` samples at `fs_hz` whose pulses last `width_s`.
    pub fn new(fs_hz: f64, samples: usize, width_s: f64) -> Self {
        let samples = samples.max(16) / 2 * 2;
        let sigma = DECAY / samples as f64;
        let highest = (BAND / width_s.max(2.0 / fs_hz)).min(0.4 * fs_hz);
        let last = ((highest * samples as f64 / fs_hz) as usize).clamp(2, samples / 2);
        // lines 0 and 1 contain the offset
        let step = (last / LINES).max(1);
        Self {
            samples,
            weights: (0..samples).map(|i| (-sigma * i as f64).exp()).collect(),
            lines: (2..=last).step_by(step).collect(),
            transform: RealFftPlanner::new().plan_fft_forward(samples),
        }
    }

    /// Number of samples that are compared, from the start of the record.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The answer of one hit. `quiet` has the samples of each channel just before the record, the
    /// force first: their mean is the channel's offset, their scatter its noise.
    pub fn of(&self, force_n: &[f64], responses: &[Vec<f64>], quiet: &[Vec<f64>]) -> Answer {
        let level = |place: usize| -> (f64, f64) {
            let before = quiet.get(place).map(Vec::as_slice).unwrap_or_default();
            let count = before.len().max(1) as f64;
            let mean = before.iter().sum::<f64>() / count;
            (mean, before.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count)
        };
        let energy: f64 = self.weights.iter().map(|w| w * w).sum();
        let (offset, _) = level(0);
        let force = self.spectrum(force_n, offset);
        let most = force.iter().map(Complex::norm_sqr).fold(0.0, f64::max);
        let mut lines = Vec::with_capacity(responses.len() * self.lines.len());
        for (channel, signal) in responses.iter().enumerate() {
            let (offset, power) = level(channel + 1);
            let response = self.spectrum(signal, offset);
            lines.extend(force.iter().zip(&response).map(|(f, x)| {
                if f.norm_sqr() < FORCE_FLOOR * most || most == 0.0 {
                    return AnswerLine { ratio: Complex::default(), variance: f64::INFINITY };
                }
                AnswerLine { ratio: x / f, variance: power * energy / f.norm_sqr() }
            }));
        }
        Answer(lines)
    }

    /// The windowed spectrum on the compared lines.
    fn spectrum(&self, signal: &[f64], offset: f64) -> Vec<Complex<f64>> {
        let mut windowed: Vec<f64> =
            signal.iter().zip(&self.weights).map(|(value, weight)| (value - offset) * weight).collect();
        windowed.resize(self.samples, 0.0);
        let mut spectrum = self.transform.make_output_vec();
        // both have the lengths that the transform asks for
        if self.transform.process(&mut windowed, &mut spectrum).is_err() {
            return vec![Complex::default(); self.lines.len()];
        }
        self.lines.iter().map(|line| spectrum[*line]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use std::f64::consts::{PI, TAU};

    const FS_HZ: f64 = 4096.0;
    /// Frequencies of the modes, Hz.
    const MODES: [f64; 3] = [90.0, 170.0, 310.0];

    /// Response of the modes, with these products of their shapes, to pulses (time in s, peak in
    /// N) of 3 ms.
    fn hit(shapes: [f64; 3], pulses: &[(f64, f64)], noise: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut dice = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut force = vec![0.0; 4096];
        for (at, peak) in pulses {
            for (i, value) in force.iter_mut().enumerate() {
                let t = (i as f64 / FS_HZ - at) / 3e-3;
                *value += if (0.0..1.0).contains(&t) { peak * (PI * t).sin() } else { 0.0 };
            }
        }
        let mut response = vec![0.0; force.len()];
        for (shape, hz) in shapes.iter().zip(MODES) {
            let pole = Complex::new(-0.01, 1.0) * (TAU * hz / FS_HZ);
            let mut state = Complex::new(0.0, 0.0);
            for (value, f) in response.iter_mut().zip(&force) {
                state = state * pole.exp() + f;
                *value += shape * state.im;
            }
        }
        for value in &mut response {
            let of: f64 = StandardNormal.sample(&mut dice);
            *value += noise * of;
        }
        (force, response)
    }

    fn difference(
        one: ([f64; 3], &[(f64, f64)]),
        other: ([f64; 3], &[(f64, f64)]),
        noise: f64,
    ) -> Option<f64> {
        let answers = Answers::new(FS_HZ, 2048, 3e-3);
        let of = |(shapes, pulses), seed| {
            let (force, response) = hit(shapes, pulses, noise, seed);
            // the hit is after half a second
            let quiet = [force[..1900].to_vec(), response[..1900].to_vec()];
            answers.of(&force[1980..], &[response[1980..].to_vec()], &quiet)
        };
        of(one, 1).difference(&of(other, 2))
    }

    #[test]
    fn hits_at_one_place_agree_however_hard_and_double_and_others_do_not() {
        let (here, there) = ([1.0, -0.7, 0.4], [0.6, 0.9, -0.3]);
        let (soft, hard, double) = ([(0.5, 20.0)], [(0.5, 70.0)], [(0.5, 50.0), (0.52, 20.0)]);
        for (noise, most) in [(0.0, 1e-3), (0.5, 0.06)] {
            for pulses in [&hard[..], &double[..]] {
                let same = difference((here, &soft), (here, pulses), noise).expect("lines");
                assert!(same < most, "{same} with noise {noise}");
                let different = difference((here, &soft), (there, pulses), noise).expect("lines");
                assert!(different > 0.6, "{different} with noise {noise}");
            }
        }
        // a place a little further: the shapes differ by 5 %
        let near = difference((here, &hard), ([1.05, -0.67, 0.42], &hard), 0.0).expect("lines");
        assert!((0.02..0.1).contains(&near), "{near}");
        // answers that noise hides say nothing
        assert_eq!(difference((here, &soft), (there, &soft), 1e4), None);
    }
}
