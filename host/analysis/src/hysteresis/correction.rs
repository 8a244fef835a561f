//! From the load cells' sum to the force at the contact.
//!
//! The static arm B lies between contact and load cells. The force of the contact on B is balanced
//! by the load cells, by anything parallel to them (a lower push rod), and by B's inertia:
//!
//! F = (1 + ρ) T + m ẍ_B
//!
//! with T the cells' sum, ρ the stiffness parallel to the cells over theirs, and m B's *effective*
//! mass at the contact. This is not the arm's mass: the arm also rotates about its supports, so
//! that only part of it moves with the contact. On a rig of 1.56 kg over 150 N/µm, T reads 2.4 %
//! too high at 250 Hz and 14 % at 500 Hz.

use super::record::{HysteresisRecord, RelativeMotion, within};
use serde::Serialize;
use std::ops::Range;

/// The parameters that correct the raw force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Correction {
    /// m, kg.
    pub effective_mass_kg: f64,
    /// ρ, dimensionless.
    pub parallel_path: f64,
}

impl Correction {
    /// The same record with the force at the contact instead of the load cells' sum.
    #[must_use]
    pub fn applied(&self, record: &HysteresisRecord) -> HysteresisRecord {
        let mut force_n = Vec::with_capacity(record.force_n.len());
        self.force(record, 0..record.force_n.len().cast_signed(), &mut force_n);
        HysteresisRecord { force_n, ..record.clone() }
    }

    /// Writes the force at the contact over a range of samples to `to`; beyond the ends of the
    /// record its end values are repeated.
    pub(super) fn force(&self, record: &HysteresisRecord, range: Range<isize>, to: &mut Vec<f64>) {
        let (t, fs_hz) = (&record.force_n, record.fs_hz);
        let corrected = |t: &f64, acceleration: f64| {
            (1.0 + self.parallel_path) * t + self.effective_mass_kg * acceleration
        };
        within(range, t.len(), to, |inside, to| match &record.motion {
            RelativeMotion::Velocity { b_m_per_s: v, .. } => {
                let inner = inside.start.max(1)..inside.end.min(v.len() - 1);
                let ends = |i: usize| corrected(&t[i], rate(v, i, fs_hz));
                to.extend((inside.start..inner.start).map(ends));
                let around = v[inner.start - 1..].iter().zip(&v[inner.start + 1..]);
                to.extend(
                    t[inner.clone()]
                        .iter()
                        .zip(around)
                        .map(|(t, (before, after))| corrected(t, (after - before) * (0.5 * fs_hz))),
                );
                to.extend((inner.end..inside.end).map(ends));
            }
            RelativeMotion::Displacement { b_m: x, .. } => to.extend(inside.map(|i| {
                let (from, until) = around(i, x.len());
                let [before, after] = [from, until].map(|i| rate(x, i, fs_hz));
                corrected(&t[i], (after - before) * fs_hz / (until - from) as f64)
            })),
        });
    }
}

/// The neighbours of sample `i` of `len` (two or more); at an end, the sample itself replaces the
/// missing one.
fn around(i: usize, len: usize) -> (usize, usize) {
    (i.saturating_sub(1), (i + 1).min(len - 1))
}

/// Rate of change of `x` per second at one sample: the central difference, one-sided at the ends.
pub(super) fn rate(x: &[f64], i: usize, fs_hz: f64) -> f64 {
    let (from, to) = around(i, x.len());
    (x[to] - x[from]) * fs_hz / (to - from) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// An arm of mass m on load cells of stiffness k and a rod of ρ k: the corrected force equals
    /// that of the contact at every frequency.
    #[test]
    fn the_contacts_force_comes_back() {
        let (mass, k, path, contact) = (1.56, 150e6, 0.0133, 180e6);
        for frequency_hz in [100.0, 250.0, 500.0] {
            let w = TAU * frequency_hz;
            let stiffness = k * (1.0 + path) - mass * w * w;
            let n = (20.0 * 51_200.0 / frequency_hz) as usize;
            let wave = |amplitude: f64| -> Vec<f64> {
                (0..n).map(|i| amplitude * (w * i as f64 / 51_200.0).cos()).collect()
            };
            // 20 N at the contact
            let (x_b, x_a) = (20.0 / stiffness, 20.0 / stiffness + 20.0 / contact);
            let record = HysteresisRecord {
                fs_hz: 51_200.0,
                motion: RelativeMotion::Displacement { a_m: wave(x_a), b_m: wave(x_b) },
                force_n: wave(k * x_b),
                excitation_hz: Some(frequency_hz),
                normal_load_n: None,
            };
            let correction = Correction { effective_mass_kg: mass, parallel_path: path };
            let k_t = |record: &HysteresisRecord| {
                super::super::analyse(record).expect("a loop").k_t_n_per_m.expect("stuck").mean
            };
            let (raw, corrected) = (k_t(&record), k_t(&correction.applied(&record)));
            assert!((corrected / contact - 1.0).abs() < 1e-3, "{frequency_hz}: {corrected}");
            // the error without the correction
            assert!((raw / contact - k / stiffness).abs() < 1e-3, "{frequency_hz}: {raw}");
        }
    }
}
