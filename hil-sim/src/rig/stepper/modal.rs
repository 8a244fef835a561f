//! One complex multiplication per mode and scan.
//!
//! Modes lie in arrays of real and imaginary parts, slowest decay first, and each mode's eight output coefficients lie
//! together, so that both loops run over contiguous `f64`. The tail of the arrays is left out once it has died away.

use std::sync::Arc;

use nalgebra::DVector;
use num_complex::Complex;

use super::{Aimed, SIGNALS, ScanForces};
use crate::rig::force::phi;
use crate::rig::modal::Mode;

/// A mode is left out when it moves no signal by more than this part of a converter step: far below rounding of anything
/// that is ever read, and far above the denormals that would slow the loop down.
const NEGLIGIBLE_STEPS: f64 = 1e-9;

/// Steps z' = λ z + b f exactly.
#[derive(Debug, Clone)]
pub struct ModalStepper {
    modes: Arc<Vec<Mode>>,
    turn_re: Vec<f64>,
    turn_im: Vec<f64>,
    z_re: Vec<f64>,
    z_im: Vec<f64>,
    rows_re: Vec<[f64; SIGNALS]>,
    rows_im: Vec<[f64; SIGNALS]>,
    hammer: Vec<Complex<f64>>,
    shaker_re: Vec<f64>,
    shaker_im: Vec<f64>,
    negligible: Vec<f64>,
    active: usize,
}

impl ModalStepper {
    /// At rest, with the scan period `period_s`.
    pub fn new(modes: &Arc<Vec<Mode>>, aimed: &Aimed, period_s: f64) -> Self {
        let count = modes.len();
        let project = |mode: &Mode, column: &DVector<f64>| -> Complex<f64> {
            mode.left.iter().zip(column.iter()).map(|(left, b)| left * b).sum()
        };
        let mut stepper = Self {
            modes: Arc::clone(modes),
            turn_re: Vec::with_capacity(count),
            turn_im: Vec::with_capacity(count),
            z_re: vec![0.0; count],
            z_im: vec![0.0; count],
            rows_re: Vec::with_capacity(count),
            rows_im: Vec::with_capacity(count),
            hammer: Vec::with_capacity(count),
            shaker_re: Vec::with_capacity(count),
            shaker_im: Vec::with_capacity(count),
            negligible: Vec::with_capacity(count),
            active: 0,
        };
        for mode in modes.iter() {
            let turn = (mode.lambda * period_s).exp();
            stepper.turn_re.push(turn.re);
            stepper.turn_im.push(turn.im);
            let seen = aimed.rows.each_ref().map(|row| -> Complex<f64> {
                row.iter().zip(mode.right.iter()).map(|(r, v)| v * (r * mode.weight)).sum()
            });
            stepper.rows_re.push(seen.map(|c| c.re));
            stepper.rows_im.push(seen.map(|c| -c.im));
            stepper.hammer.push(project(mode, &aimed.hammer));
            let held = project(mode, &aimed.shaker) * phi(mode.lambda * period_s) * period_s;
            stepper.shaker_re.push(held.re);
            stepper.shaker_im.push(held.im);
            let steps = seen.iter().zip(aimed.steps).map(|(c, step)| c.norm() / step).fold(0.0, f64::max);
            // A mode that no signal sees may go at any size; the floor keeps 0/0 away.
            stepper.negligible.push((NEGLIGIBLE_STEPS / steps.max(1e-30)).powi(2));
        }
        stepper
    }

    /// Advances one scan period.
    #[inline]
    pub fn advance(&mut self, forces: &ScanForces<'_>) {
        let count = self.active;
        let (z_re, z_im) = (&mut self.z_re[..count], &mut self.z_im[..count]);
        let (turn_re, turn_im) = (&self.turn_re[..count], &self.turn_im[..count]);
        for k in 0..count {
            let re = z_re[k] * turn_re[k] - z_im[k] * turn_im[k];
            z_im[k] = z_re[k] * turn_im[k] + z_im[k] * turn_re[k];
            z_re[k] = re;
        }
        let mut pushed = false;
        if forces.shaker_n != 0.0 {
            pushed = true;
            for (z, gain) in self.z_re.iter_mut().zip(&self.shaker_re) {
                *z += gain * forces.shaker_n;
            }
            for (z, gain) in self.z_im.iter_mut().zip(&self.shaker_im) {
                *z += gain * forces.shaker_n;
            }
        }
        for segment in forces.hammer {
            if segment.overlap(forces.from_s, forces.to_s).is_none() {
                continue;
            }
            pushed = true;
            for (k, (mode, input)) in self.modes.iter().zip(&self.hammer).enumerate() {
                let gain = input * segment.gained(mode.lambda, forces.from_s, forces.to_s);
                self.z_re[k] += gain.re;
                self.z_im[k] += gain.im;
            }
        }
        if pushed {
            self.active = self.modes.len();
        } else if let Some(last) = count.checked_sub(1) {
            let size = self.z_re[last] * self.z_re[last] + self.z_im[last] * self.z_im[last];
            if size < self.negligible[last] {
                (self.z_re[last], self.z_im[last]) = (0.0, 0.0);
                self.active = last;
            }
        }
    }

    /// The signals now.
    #[inline]
    pub fn signals(&self) -> [f64; SIGNALS] {
        let count = self.active;
        let (rows_re, rows_im) = (&self.rows_re[..count], &self.rows_im[..count]);
        let (z_re, z_im) = (&self.z_re[..count], &self.z_im[..count]);
        // Two sums at a time: one alone waits for its own last addition.
        let (mut even, mut odd) = ([0.0; SIGNALS], [0.0; SIGNALS]);
        let paired = count & !1;
        for k in (0..paired).step_by(2) {
            for signal in 0..SIGNALS {
                even[signal] += rows_re[k][signal] * z_re[k] + rows_im[k][signal] * z_im[k];
                odd[signal] += rows_re[k + 1][signal] * z_re[k + 1] + rows_im[k + 1][signal] * z_im[k + 1];
            }
        }
        if paired < count {
            for signal in 0..SIGNALS {
                even[signal] +=
                    rows_re[paired][signal] * z_re[paired] + rows_im[paired][signal] * z_im[paired];
            }
        }
        std::array::from_fn(|signal| even[signal] + odd[signal])
    }

    /// The state x (2n).
    pub fn state(&self) -> DVector<f64> {
        let order = self.modes.first().map_or(0, |mode| mode.right.len());
        let mut x = DVector::zeros(order);
        for (k, mode) in self.modes.iter().enumerate() {
            let z = Complex::new(self.z_re[k], self.z_im[k]) * mode.weight;
            x += mode.right.map(|v| (v * z).re);
        }
        x
    }
}
