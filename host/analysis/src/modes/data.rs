//! The measured values in the form that the fit needs: those of one band with their weights, free
//! of units.

use super::{ModesError, NoiseKnown, Settings};
use crate::C;
use crate::frf::{Frf, FrfError};
use nalgebra::DMatrix;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicU64, Ordering};

/// FRFs of one band and their weights.
///
/// They stay in their quantity, in which noise varies little from line to line; the model's
/// receptance is multiplied by `to_quantity`. The Laplace variable is divided by `omega_ref`, the
/// values by their root mean square, so that poles and residues are of order one. A cell is one
/// output and one input; its index is output × inputs + input, so that the cells of one output are
/// neighbours.
pub(super) struct Data {
    /// s of each line over `omega_ref`, on the line σ + iω of the exponential window.
    pub(super) s: Vec<C>,
    /// Angular frequency of the highest line, rad/s.
    pub(super) omega_ref: f64,
    /// Receptance that one stands for, m/N.
    pub(super) receptance_ref: f64,
    /// Power of s by which the values are receptances, and that power at each line.
    pub(super) order: i32,
    pub(super) to_quantity: Vec<C>,
    /// Damping of the exponential window over `omega_ref`.
    pub(super) sigma: f64,
    /// Median distance of two lines over `omega_ref`, rad/s over rad/s.
    pub(super) step: f64,
    pub(super) outputs: usize,
    pub(super) inputs: usize,
    /// One column per cell: the real parts of all lines, then the imaginary parts.
    pub(super) y: DMatrix<f64>,
    /// One column per cell: one over the variance of the real part of each line.
    pub(super) weight: DMatrix<f64>,
    /// Whether the variances are those of the noise or only relative.
    pub(super) noise: NoiseKnown,
    /// Multiplications that the fits have taken so far, roughly.
    work: AtomicU64,
}

impl Data {
    /// The values of `frf` in the band of `settings`.
    pub(super) fn new(frf: &Frf, settings: &Settings) -> Result<Data, ModesError> {
        let band = settings.band;
        let frf = frf.band(band.low_hz, band.high_hz);
        let (outputs, inputs) = (frf.outputs().len(), frf.inputs().len());
        if outputs == 0 || inputs == 0 {
            return Err(ModesError::NoCells);
        }
        let lines = frf.lines().len();
        if lines < super::MIN_LINES {
            return Err(ModesError::TooFewLines { lines, low_hz: band.low_hz, high_hz: band.high_hz });
        }
        frf.check_finite()?;
        frf.check_variance()?;
        let order = frf.quantity().order_of_s();
        if frf.s(0).norm() == 0.0 {
            // the model's inertia term is infinite there
            return Err(FrfError::DivisionByZero { line: 0, quantity: frf.quantity() }.into());
        }
        let cells = outputs * inputs;
        let omega_ref = TAU * frf.frequency_hz()[lines - 1];
        let s: Vec<C> = (0..lines).map(|l| frf.s(l) / omega_ref).collect();
        let to_quantity = s.iter().map(|s| s.powi(order)).collect();
        let sum: f64 = frf.lines().iter().flat_map(DMatrix::iter).map(C::norm_sqr).sum();
        let value_ref = (sum / (lines * cells) as f64).sqrt();
        if value_ref == 0.0 {
            return Err(ModesError::AllZero);
        }
        let receptance_ref = value_ref * omega_ref.powi(-order);
        let mut y = DMatrix::zeros(2 * lines, cells);
        for (l, line) in frf.lines().iter().enumerate() {
            for cell in 0..cells {
                let value = line[(cell / inputs, cell % inputs)] / value_ref;
                y[(l, cell)] = value.re;
                y[(lines + l, cell)] = value.im;
            }
        }
        let (weight, noise) = match frf.variance() {
            None => (DMatrix::from_element(lines, cells, 1.0), NoiseKnown::Estimated),
            Some(_) => (known_weight(&frf, value_ref)?, NoiseKnown::Given),
        };
        let mut steps: Vec<f64> = s.windows(2).map(|pair| pair[1].im - pair[0].im).collect();
        steps.sort_by(f64::total_cmp);
        let (step, sigma) = (steps[steps.len() / 2], frf.sigma_per_s() / omega_ref);
        Ok(Data {
            s,
            omega_ref,
            receptance_ref,
            order,
            to_quantity,
            sigma,
            step,
            outputs,
            inputs,
            y,
            weight,
            noise,
            work: AtomicU64::new(0),
        })
    }

    /// Counts one step of a fit with this number of columns per cell. The sum does not depend on
    /// the order in which parallel fits are counted, so that a search which it ends has the same
    /// result on every machine.
    pub(super) fn count_step(&self, columns: usize) {
        let (lines, cells) = (self.lines() as u64, self.cells() as u64);
        let columns = columns as u64;
        // inner products of the columns; residuals and gradient; elimination in every cell
        let work = columns * columns * lines + 2 * columns * lines * cells + columns.pow(3) * cells / 3;
        self.work.fetch_add(work, Ordering::Relaxed);
    }

    /// Multiplications that the fits have taken so far, roughly.
    pub(super) fn work(&self) -> u64 {
        self.work.load(Ordering::Relaxed)
    }

    pub(super) fn lines(&self) -> usize {
        self.s.len()
    }

    pub(super) fn cells(&self) -> usize {
        self.outputs * self.inputs
    }

    /// Natural frequency of a pole, Hz.
    pub(super) fn frequency_hz(&self, pole: C) -> f64 {
        pole.norm() * self.omega_ref / TAU
    }

    /// Distance of a pole from the line of measurement: the half width of its peak.
    pub(super) fn half_width(&self, pole: C) -> f64 {
        self.sigma - pole.re
    }

    /// d/(d + σ), d the [half width](Self::half_width): 1 without a window, near one half if the
    /// window's damping exceeds the pole's.
    pub(super) fn share_of_noise(&self, pole: C) -> f64 {
        let d = self.half_width(pole);
        d / (d + self.sigma)
    }

    /// The factor by which a line's variance is exceeded by that of the noise at the start of a
    /// record.
    ///
    /// White noise of a record of the length 1/Δf, weighted with e^(−σt), has at the start
    /// 2x/(1 − e^(−2x)), x = σ/Δf, times its mean power over the record. 1 without a window.
    pub(super) fn noise_at_start(&self) -> f64 {
        let x = 2.0 * TAU * self.sigma / self.step;
        if x > 1e-9 { x / -(-x).exp_m1() } else { 1.0 }
    }
}

/// One over the variance of each value, averaged over neighbouring lines as elsewhere.
fn known_weight(frf: &Frf, value_ref: f64) -> Result<DMatrix<f64>, ModesError> {
    let (outputs, inputs, lines) = (frf.outputs().len(), frf.inputs().len(), frf.lines().len());
    let smooth = frf.smooth_variance();
    let mut weight = DMatrix::zeros(lines, outputs * inputs);
    for (l, variance) in smooth.iter().enumerate() {
        for cell in 0..outputs * inputs {
            let (o, i) = (cell / inputs, cell % inputs);
            let one = value_ref * value_ref / variance[(o, i)];
            if !(one.is_finite() && one > 0.0) {
                return Err(ModesError::UnknownVariance {
                    output: frf.outputs()[o].clone(),
                    input: frf.inputs()[i].clone(),
                    frequency_hz: frf.frequency_hz()[l],
                    variance: variance[(o, i)],
                });
            }
            weight[(l, cell)] = one;
        }
    }
    Ok(weight)
}
