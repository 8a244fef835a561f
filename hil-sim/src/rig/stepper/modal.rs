//! One complex multiplication per mode and scan.
//!
//! Modes are stored in arrays of real and imaginary parts, slowest decay first, and each mode's
//! eight output coefficients are adjacent, so that both loops run over contiguous `f64`. Modes at
//! the end of the arrays are skipped once they have decayed.

use std::sync::Arc;

use nalgebra::DVector;
use num_complex::Complex;

use super::{Aimed, Joint, SIGNALS, ScanForces, Span};
use crate::rig::force::{phi, phi_rising};
use crate::rig::modal::Mode;

/// A mode is skipped when it changes no signal by more than this fraction of a converter step: far
/// below the rounding of any reading, and far above the denormals that would slow the loop down.
const NEGLIGIBLE_STEPS: f64 = 1e-9;

/// One number per mode: real parts, imaginary parts.
#[derive(Debug, Clone, Default)]
struct Parts {
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Parts {
    fn zeros(count: usize) -> Self {
        Self { re: vec![0.0; count], im: vec![0.0; count] }
    }

    fn add(&mut self, gain: &Self, factor: f64) {
        for (z, gain) in self.re.iter_mut().zip(&gain.re) {
            *z += gain * factor;
        }
        for (z, gain) in self.im.iter_mut().zip(&gain.im) {
            *z += gain * factor;
        }
    }
}

impl FromIterator<Complex<f64>> for Parts {
    fn from_iter<I: IntoIterator<Item = Complex<f64>>>(values: I) -> Self {
        let (re, im) = values.into_iter().map(|value| (value.re, value.im)).unzip();
        Self { re, im }
    }
}

/// Effect of a time span on the modes.
#[derive(Debug, Clone)]
struct Pace {
    /// e^{λh}.
    turn: Parts,
    /// Gain from a constant 1 N of the shaker.
    shaker: Parts,
    /// Gain from a force between the specimens that falls from 1 N to zero, and from one that rises
    /// from zero to 1 N.
    falling: Parts,
    rising: Parts,
}

impl Pace {
    fn new(modes: &[Mode], shaker: &DVector<f64>, joint: Option<&Joint>, h: f64) -> Self {
        let gains = |column: &DVector<f64>, shape: &dyn Fn(Complex<f64>) -> Complex<f64>| -> Parts {
            modes.iter().map(|mode| project(mode, column) * shape(mode.lambda * h) * h).collect()
        };
        let of_joint = |shape: &dyn Fn(Complex<f64>) -> Complex<f64>| {
            joint.map_or_else(Parts::default, |joint| gains(&joint.column, shape))
        };
        Self {
            turn: modes.iter().map(|mode| (mode.lambda * h).exp()).collect(),
            shaker: gains(shaker, &phi),
            falling: of_joint(&|x| phi(x) - phi_rising(x)),
            rising: of_joint(&phi_rising),
        }
    }
}

fn project(mode: &Mode, column: &DVector<f64>) -> Complex<f64> {
    mode.left.iter().zip(column.iter()).map(|(left, b)| left * b).sum()
}

/// Steps z' = λ z + b f exactly.
#[derive(Debug, Clone)]
pub struct ModalStepper {
    modes: Arc<Vec<Mode>>,
    scan: Pace,
    /// A step of a scan in which an element slips; as long as the scan without a joint that can
    /// slip.
    step: Pace,
    z: Parts,
    rows_re: Vec<[f64; SIGNALS]>,
    rows_im: Vec<[f64; SIGNALS]>,
    hammer: Vec<Complex<f64>>,
    /// Output row of the joint's y: Σ re · re + im · im.
    joint: Parts,
    /// Output rows of the fixed vibrometers.
    fixed: Vec<Parts>,
    negligible: Vec<f64>,
    active: usize,
    /// Saved `z` and `active`.
    kept: (Parts, usize),
}

impl ModalStepper {
    /// At rest, with the scan period `period_s`.
    pub fn new(modes: &Arc<Vec<Mode>>, aimed: &Aimed, period_s: f64) -> Self {
        let count = modes.len();
        let joint = aimed.joint.as_ref();
        let pace = |h| Pace::new(modes, &aimed.shaker, joint, h);
        let scan = pace(period_s);
        let read = |mode: &Mode, row: &DVector<f64>| -> Complex<f64> {
            row.iter().zip(mode.right.iter()).map(|(r, v)| v * (r * mode.weight)).sum()
        };
        let mut stepper = Self {
            step: joint.map_or_else(|| scan.clone(), |joint| pace(joint.step_s)),
            scan,
            z: Parts::zeros(count),
            rows_re: Vec::with_capacity(count),
            rows_im: Vec::with_capacity(count),
            hammer: modes.iter().map(|mode| project(mode, &aimed.hammer)).collect(),
            joint: modes
                .iter()
                .map(|mode| joint.map_or(Complex::ZERO, |joint| read(mode, &joint.row).conj()))
                .collect(),
            fixed: aimed
                .fixed
                .rows
                .iter()
                .map(|row| modes.iter().map(|mode| read(mode, row).conj()).collect())
                .collect(),
            negligible: Vec::with_capacity(count),
            active: 0,
            kept: (Parts::zeros(count), 0),
            modes: Arc::clone(modes),
        };
        for mode in modes.iter() {
            let seen = aimed.rows.each_ref().map(|row| read(mode, row));
            stepper.rows_re.push(seen.map(|c| c.re));
            stepper.rows_im.push(seen.map(|c| -c.im));
            let fixed = &aimed.fixed;
            let of_fixed =
                fixed.rows.iter().zip(&fixed.steps).map(|(row, step)| read(mode, row).norm() / step);
            let steps = seen.iter().zip(aimed.steps).map(|(c, step)| c.norm() / step);
            let steps = steps.chain(of_fixed).fold(0.0, f64::max);
            // A mode that affects no signal may be skipped at any amplitude; the lower bound
            // prevents 0/0.
            stepper.negligible.push((NEGLIGIBLE_STEPS / steps.max(1e-30)).powi(2));
        }
        stepper
    }

    /// Advances one scan period, or one of its steps.
    #[inline]
    pub fn advance(&mut self, span: Span, forces: &ScanForces<'_>) {
        let pace = match span {
            Span::Scan => &self.scan,
            Span::Step => &self.step,
        };
        let count = self.active;
        let (z_re, z_im) = (&mut self.z.re[..count], &mut self.z.im[..count]);
        let (turn_re, turn_im) = (&pace.turn.re[..count], &pace.turn.im[..count]);
        for k in 0..count {
            let re = z_re[k] * turn_re[k] - z_im[k] * turn_im[k];
            z_im[k] = z_re[k] * turn_im[k] + z_im[k] * turn_re[k];
            z_re[k] = re;
        }
        let mut pushed = false;
        if forces.shaker_n != 0.0 {
            pushed = true;
            self.z.add(&pace.shaker, forces.shaker_n);
        }
        for segment in forces.hammer {
            if segment.overlap(forces.from_s, forces.to_s).is_none() {
                continue;
            }
            pushed = true;
            for (k, (mode, input)) in self.modes.iter().zip(&self.hammer).enumerate() {
                let gain = input * segment.gained(mode.lambda, forces.from_s, forces.to_s);
                self.z.re[k] += gain.re;
                self.z.im[k] += gain.im;
            }
        }
        if pushed {
            self.active = self.modes.len();
        } else if let Some(last) = count.checked_sub(1) {
            let size = self.z.re[last] * self.z.re[last] + self.z.im[last] * self.z.im[last];
            if size < self.negligible[last] {
                (self.z.re[last], self.z.im[last]) = (0.0, 0.0);
                self.active = last;
            }
        }
    }

    /// Adds the effect of a force between the specimens over the span just passed, during which it
    /// changed linearly from `from_n` to `to_n` (N).
    #[inline]
    pub fn push(&mut self, span: Span, from_n: f64, to_n: f64) {
        let pace = match span {
            Span::Scan => &self.scan,
            Span::Step => &self.step,
        };
        self.active = self.modes.len();
        if from_n != 0.0 {
            self.z.add(&pace.falling, from_n);
        }
        if to_n != 0.0 {
            self.z.add(&pace.rising, to_n);
        }
    }

    /// Current y of the joint (m).
    #[inline]
    pub fn joint(&self) -> f64 {
        read_parts(&self.joint, &self.z, self.active)
    }

    /// Gain of y over a step from a force that rises from zero to 1 N (m/N).
    pub fn receptance(&self) -> f64 {
        read_parts(&self.joint, &self.step.rising, self.modes.len())
    }

    /// Saves the state.
    #[inline]
    pub fn keep(&mut self) {
        let (kept, active) = &mut self.kept;
        kept.re.copy_from_slice(&self.z.re);
        kept.im.copy_from_slice(&self.z.im);
        *active = self.active;
    }

    /// Restores the saved state.
    #[inline]
    pub fn go_back(&mut self) {
        std::mem::swap(&mut self.z, &mut self.kept.0);
        self.active = self.kept.1;
    }

    /// The current signals.
    #[inline]
    pub fn signals(&self) -> [f64; SIGNALS] {
        let count = self.active;
        let (rows_re, rows_im) = (&self.rows_re[..count], &self.rows_im[..count]);
        let (z_re, z_im) = (&self.z.re[..count], &self.z.im[..count]);
        // Two sums at a time: a single sum would wait for its own last addition.
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

    /// The current signals of the fixed vibrometers.
    pub fn fixed(&self, into: &mut [f64]) {
        for (signal, row) in into.iter_mut().zip(&self.fixed) {
            *signal = read_parts(row, &self.z, self.active);
        }
    }

    /// The state x (2n).
    pub fn state(&self) -> DVector<f64> {
        let order = self.modes.first().map_or(0, |mode| mode.right.len());
        let mut x = DVector::zeros(order);
        for (k, mode) in self.modes.iter().enumerate() {
            let z = Complex::new(self.z.re[k], self.z.im[k]) * mode.weight;
            x += mode.right.map(|v| (v * z).re);
        }
        x
    }

    /// As [`super::Stepper::set_state`].
    pub fn set_state(&mut self, x: &DVector<f64>) {
        self.z = self.modes.iter().map(|mode| project(mode, x)).collect();
        self.active = self.modes.len();
    }
}

fn read_parts(row: &Parts, z: &Parts, count: usize) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for k in 0..count {
        re += row.re[k] * z.re[k];
        im += row.im[k] * z.im[k];
    }
    re + im
}
