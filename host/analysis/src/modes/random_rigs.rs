//! Random modal models with noise, for the tests.

use super::{Modes, Settings};
use crate::C;
use crate::band::Band;
use crate::frf::{Frf, MotionQuantity};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus as Rng;
use std::f64::consts::TAU;

/// A structure with known modes.
pub(super) struct Rig {
    pub(super) poles: Vec<C>,
    /// Output × mode and input × mode.
    pub(super) shape: DMatrix<C>,
    pub(super) participation: DMatrix<C>,
    /// Modes below and above the band.
    others: Vec<(C, DMatrix<C>)>,
    pub(super) frequency_hz: Vec<f64>,
    pub(super) sigma_per_s: f64,
    pub(super) quantity: MotionQuantity,
    /// Standard deviation of the real part of each cell's FRF, constant over the lines.
    pub(super) noise: DMatrix<f64>,
    pub(super) band: Band,
}

fn normal(rng: &mut Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A nearly real vector, as those of lightly damped structures: phases scatter by 0.05 rad.
fn vector(rng: &mut Rng, count: usize) -> DVector<C> {
    DVector::from_fn(count, |_, _| C::from_polar(normal(rng), 0.05 * normal(rng)))
}

impl Rig {
    /// 2 to 8 modes of 50 to 1000 Hz with 0.1 to 5 % of damping, every third one next to another
    /// (0.5 to 3 half-power widths apart), 3 to 12 outputs, 1 to 6 inputs, a rigid-body mode below
    /// the band and two modes above it; noise of 3e-3 to 0.3 of the median peak; with the
    /// campaign's window or without one.
    pub(super) fn random(seed: u64) -> Rig {
        let mut rng = Rng::seed_from_u64(seed);
        let modes = rng.random_range(2..=8);
        let (outputs, inputs) = (rng.random_range(3..=12), rng.random_range(1..=6));
        let sigma_per_s = if rng.random_bool(0.5) { 2.3 } else { 0.0 };
        let quantity = [MotionQuantity::Displacement, MotionQuantity::Velocity, MotionQuantity::Acceleration]
            [rng.random_range(0..3)];
        let mut poles: Vec<C> = Vec::new();
        while poles.len() < modes {
            let damping = 10f64.powf(rng.random_range(-3.0..-1.3));
            let omega = match poles.last() {
                Some(last) if rng.random_bool(1.0 / 3.0) => {
                    let width = -2.0 * last.re;
                    last.norm() + width * rng.random_range(0.5..3.0)
                }
                _ => TAU * 50.0 * 20f64.powf(rng.random_range(0.0..1.0)),
            };
            if omega < TAU * 1000.0 {
                poles.push(C::new(-damping * omega, omega * (1.0 - damping * damping).sqrt()));
            }
        }
        let residue = |rng: &mut Rng, pole: C| {
            vector(rng, outputs) * vector(rng, inputs).transpose() / (C::i() * 2.0 * pole.im)
        };
        let mut shape = DMatrix::zeros(outputs, modes);
        let mut participation = DMatrix::zeros(inputs, modes);
        for (r, pole) in poles.iter().enumerate() {
            shape.set_column(r, &vector(&mut rng, outputs));
            participation.set_column(r, &(vector(&mut rng, inputs) / (C::i() * 2.0 * pole.im)));
        }
        let mut others = Vec::new();
        for times in [1.8, 3.0] {
            let omega = TAU * 1100.0 * times * rng.random_range(1.0..1.3);
            let pole = C::new(-0.01 * omega, omega);
            others.push((pole, residue(&mut rng, pole)));
        }
        let rigid = C::new(-0.05, TAU * 2.0);
        others.push((rigid, residue(&mut rng, rigid)));
        let frequency_hz = (40..=2200).map(|k| 0.5 * f64::from(k)).collect();
        let band = Band { low_hz: 20.0, high_hz: 1100.0 };
        let noise = DMatrix::zeros(outputs, inputs);
        let mut rig =
            Rig { poles, shape, participation, others, frequency_hz, sigma_per_s, quantity, noise, band };
        let level = rig.median_peak() * 10f64.powf(rng.random_range(-2.5..-0.5));
        rig.noise = DMatrix::from_fn(outputs, inputs, |_, _| level * rng.random_range(0.5..2.0));
        rig
    }

    /// Twenty modes of 80 to 1000 Hz, 27 outputs, 24 inputs, 3600 lines, noise of 1 % of the median
    /// peak.
    pub(super) fn large() -> Rig {
        let mut rng = Rng::seed_from_u64(7);
        let (modes, outputs, inputs) = (20, 27, 24);
        let pole = |r: usize| {
            let omega = TAU * (80.0 + 46.0 * r as f64);
            C::new(-0.005 * omega, omega)
        };
        let poles: Vec<C> = (0..modes).map(pole).collect();
        let mut shape = DMatrix::zeros(outputs, modes);
        let mut participation = DMatrix::zeros(inputs, modes);
        for (r, pole) in poles.iter().enumerate() {
            shape.set_column(r, &vector(&mut rng, outputs));
            participation.set_column(r, &(vector(&mut rng, inputs) / (C::i() * 2.0 * pole.im)));
        }
        let frequency_hz: Vec<f64> = (0..3600).map(|l| 40.0 + 0.28 * f64::from(l)).collect();
        let band = Band { low_hz: 40.0, high_hz: 1100.0 };
        let (noise, quantity) = (DMatrix::zeros(outputs, inputs), MotionQuantity::Velocity);
        let others = vec![];
        let mut rig = Rig {
            poles,
            shape,
            participation,
            others,
            frequency_hz,
            sigma_per_s: 2.3,
            quantity,
            noise,
            band,
        };
        let level = 0.01 * rig.median_peak();
        rig.noise.fill(level);
        rig
    }

    /// Removes the modes outside the band.
    pub(super) fn without_others(&mut self) {
        self.others.clear();
    }

    fn median_peak(&self) -> f64 {
        let (outputs, inputs) = self.noise.shape();
        let mut peaks: Vec<f64> = (0..self.poles.len())
            .flat_map(|r| (0..outputs * inputs).map(move |cell| (r, cell)))
            .map(|(r, cell)| self.peak(r, cell / inputs, cell % inputs))
            .collect();
        peaks.sort_by(f64::total_cmp);
        peaks[peaks.len() / 2]
    }

    /// Height of one mode's own peak in one cell.
    fn peak(&self, r: usize, o: usize, i: usize) -> f64 {
        let pole = self.poles[r];
        let s = C::new(self.sigma_per_s, pole.im);
        (self.shape[(o, r)] * self.participation[(i, r)] / (s - pole)).norm()
            * s.norm().powi(self.quantity.order_of_s())
    }

    /// The height of a mode's peak over its noise, in the cell where it is largest.
    pub(super) fn peak_over_noise(&self, r: usize) -> f64 {
        let (outputs, inputs) = self.noise.shape();
        (0..outputs * inputs)
            .map(|cell| (cell / inputs, cell % inputs))
            .map(|(o, i)| self.peak(r, o, i) / self.noise[(o, i)])
            .fold(0.0, f64::max)
    }

    /// The FRFs without noise.
    pub(super) fn exact(&self) -> Frf {
        let (outputs, inputs) = self.noise.shape();
        let line = |f: &f64| {
            let s = C::new(self.sigma_per_s, TAU * f);
            let mut x = DMatrix::<C>::zeros(outputs, inputs);
            let own = (0..self.poles.len())
                .map(|r| (self.poles[r], self.shape.column(r) * self.participation.column(r).transpose()));
            for (pole, residue) in own.chain(self.others.iter().cloned()) {
                let (one, mirrored) = ((s - pole).inv(), (s - pole.conj()).inv());
                x.zip_apply(&residue, |x, a| *x += a * one + a.conj() * mirrored);
            }
            x * s.powi(self.quantity.order_of_s())
        };
        let lines = self.frequency_hz.iter().map(line).collect();
        let names = |what: &str, count: usize| (0..count).map(|k| format!("{what}{k}")).collect();
        Frf::new(
            self.frequency_hz.clone(),
            self.sigma_per_s,
            self.quantity,
            names("a", outputs),
            names("f", inputs),
            lines,
        )
        .expect("all agree")
    }

    /// The FRFs with noise and its variance. With a window the noise is white noise of the record
    /// weighted with the window.
    pub(super) fn measured(&self, seed: u64) -> Frf {
        let mut rng = Rng::seed_from_u64(seed ^ 0x5eed_0f0f);
        let exact = self.exact();
        let (lines, (outputs, inputs)) = (self.frequency_hz.len(), self.noise.shape());
        let mut noise = vec![DMatrix::<C>::zeros(outputs, inputs); lines];
        for o in 0..outputs {
            for i in 0..inputs {
                let values = self.white(&mut rng, lines);
                for (l, value) in values.into_iter().enumerate() {
                    noise[l][(o, i)] = value * self.noise[(o, i)];
                }
            }
        }
        let variance = vec![self.noise.map(|std| std * std); lines];
        exact.map_lines(|l, mut y| y += &noise[l]).with_variance(variance).expect("one for each value")
    }

    /// Noise whose real part has the variance one, on `count` lines.
    fn white(&self, rng: &mut Rng, count: usize) -> Vec<C> {
        if self.sigma_per_s == 0.0 {
            return (0..count).map(|_| C::new(normal(rng), normal(rng))).collect();
        }
        let samples = 2 * self.frequency_hz.len().next_power_of_two();
        let record = 1.0 / (self.frequency_hz[1] - self.frequency_hz[0]);
        let mut time: Vec<C> = (0..samples)
            .map(|k| {
                let t = record * k as f64 / samples as f64;
                C::new(normal(rng), normal(rng)) * (-self.sigma_per_s * t).exp()
            })
            .collect();
        let power: f64 =
            (0..samples).map(|k| (-2.0 * self.sigma_per_s * record * k as f64 / samples as f64).exp()).sum();
        rustfft::FftPlanner::new().plan_fft_forward(samples).process(&mut time);
        time[..count].iter().map(|v| v / power.sqrt()).collect()
    }

    pub(super) fn settings(&self) -> Settings {
        Settings::of(self.band)
    }
}

/// What was found of a rig.
pub(super) struct Outcome {
    /// By mode: peak over noise, and the estimate's errors in standard deviations if it was found.
    pub(super) modes: Vec<(f64, Option<[f64; 2]>)>,
    /// Modes found that the rig does not have: frequency in Hz, damping, evidence.
    pub(super) spurious: Vec<[f64; 3]>,
}

/// Assigns the modes found to those of the rig, nearest first: a mode is found if a pole is nearer
/// than the half width of its peak plus five standard deviations.
pub(super) fn compare(rig: &Rig, found: &Modes) -> Outcome {
    let mut pairs = Vec::new();
    for (r, pole) in rig.poles.iter().enumerate() {
        for (k, mode) in found.modes.iter().enumerate() {
            let std = (mode.pole_covariance[0][0] + mode.pole_covariance[1][1]).sqrt();
            let distance = (mode.pole_per_s - pole).norm();
            if distance < rig.sigma_per_s - pole.re + 5.0 * std {
                pairs.push((distance, r, k));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut of_rig = vec![None; rig.poles.len()];
    let mut of_found = vec![false; found.modes.len()];
    for (_, r, k) in pairs {
        if of_rig[r].is_none() && !of_found[k] {
            of_rig[r] = Some(k);
            of_found[k] = true;
        }
    }
    let errors = |r: usize, k: usize| {
        let (pole, mode) = (rig.poles[r], &found.modes[k]);
        let frequency = pole.norm() / TAU;
        let damping = -pole.re / pole.norm();
        [
            (mode.frequency_hz - frequency) / mode.frequency_std_hz,
            (mode.damping_ratio - damping) / mode.damping_ratio_std,
        ]
    };
    Outcome {
        modes: (0..rig.poles.len())
            .map(|r| (rig.peak_over_noise(r), of_rig[r].map(|k| errors(r, k))))
            .collect(),
        spurious: found
            .modes
            .iter()
            .zip(of_found)
            .filter(|(_, taken)| !taken)
            .map(|(mode, _)| [mode.frequency_hz, mode.damping_ratio, mode.evidence])
            .collect(),
    }
}
