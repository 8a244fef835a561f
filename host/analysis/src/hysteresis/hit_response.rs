//! The response to one hit per newton, line by line: the basis for comparing hits of different
//! force.

use crate::transforms::forward;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Range of lines used, Hz: below it, the motion is truncated at the ends of the records; above it,
/// little of it passes the contact.
pub const LINES_HZ: [f64; 2] = [60.0, 700.0];

/// Length of record used, s: slip shows in the first cycles, and noise accumulates after them.
const LENGTH_S: f64 = 0.3;

/// Time kept before the pulse's peak, s.
const LEAD_S: f64 = 2e-3;

/// Decay rate of the exponential window, 1/s: what remains at the truncated end is small, and the
/// same fraction for every hit.
const SIGMA_PER_S: f64 = 8.0;

/// T, v_A and v_B.
pub const SIGNALS: usize = 3;

/// The contact's signals after one hit.
#[derive(Debug, Clone, Copy)]
pub struct HitSignals<'a> {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// The hammer's force, N.
    pub hammer_n: &'a [f64],
    /// T (N), v_A and v_B (m/s), of the same length.
    pub contact: [&'a [f64]; SIGNALS],
    /// Delay of each signal relative to the hammer's force, s.
    pub delay_s: [f64; SIGNALS],
}

/// One hit's response per unit of its own force.
#[derive(Debug, Clone, PartialEq)]
pub struct HitResponse {
    /// The hammer's impulse, N s.
    pub impulse_n_s: f64,
    /// The hammer's largest force, N.
    pub peak_n: f64,
    /// The largest |T|, N.
    pub peak_tangential_n: f64,
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// T (N/N), v_A and v_B (m/s/N) at s = σ + iω.
    pub per_newton: [Vec<Complex<f64>>; SIGNALS],
}

impl HitResponse {
    /// From one hit; `None` without a pulse, or if the signals differ in length.
    pub fn of(signals: &HitSignals<'_>) -> Option<Self> {
        let HitSignals { fs_hz, hammer_n, contact, delay_s } = *signals;
        if contact.iter().any(|x| x.len() != hammer_n.len()) || !(fs_hz.is_finite() && fs_hz > 0.0) {
            return None;
        }
        let peak = (0..hammer_n.len()).max_by(|&a, &b| hammer_n[a].abs().total_cmp(&hammer_n[b].abs()))?;
        // the truncation is at the same distance after the pulse in every hit, so it removes the
        // same fraction of each
        let from = peak.saturating_sub((LEAD_S * fs_hz).round() as usize);
        let length = ((LENGTH_S * fs_hz) as usize).min(hammer_n.len() - from);
        let size = ((LENGTH_S * fs_hz) as usize).next_power_of_two();
        let fft = forward(size);
        let window: Vec<f64> = (0..length).map(|i| (-SIGMA_PER_S * i as f64 / fs_hz).exp()).collect();
        let step_hz = fs_hz / size as f64;
        let lines = (LINES_HZ[0] / step_hz).ceil() as usize..=(LINES_HZ[1] / step_hz).floor() as usize;
        if *lines.end() >= size / 2 {
            return None;
        }
        let spectrum = |x: &[f64]| -> Option<Vec<Complex<f64>>> {
            let own = &x[from..from + length];
            // a sensor's offset does not scale with the force, so if it remained it would look like
            // slip
            let rest = mean(&x[x.len() - x.len() / 4..]);
            let mut windowed = vec![0.0; size];
            windowed.iter_mut().zip(own).zip(&window).for_each(|((to, x), w)| *to = (x - rest) * w);
            let mut out = fft.make_output_vec();
            fft.process(&mut windowed, &mut out).ok()?;
            Some(out)
        };
        let force = spectrum(hammer_n)?;
        let impulse_n_s = force[0].norm() / fs_hz;
        if impulse_n_s.is_nan() || impulse_n_s <= 0.0 {
            return None;
        }
        let mut per_newton: [Vec<Complex<f64>>; SIGNALS] = Default::default();
        for ((to, x), late) in per_newton.iter_mut().zip(contact).zip(delay_s) {
            let moved = spectrum(x)?;
            to.extend(lines.clone().map(|l| {
                let s = Complex::new(SIGMA_PER_S, TAU * step_hz * l as f64);
                moved[l] / force[l] * (s * late).exp()
            }));
        }
        let largest = |x: &[f64]| x.iter().map(|v| v.abs()).fold(0.0, f64::max);
        Some(Self {
            impulse_n_s,
            peak_n: hammer_n[peak].abs(),
            peak_tangential_n: largest(contact[0]),
            first_hz: step_hz * *lines.start() as f64,
            step_hz,
            per_newton,
        })
    }
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}
