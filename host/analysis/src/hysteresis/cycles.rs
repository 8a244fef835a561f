//! Cutting a steady record into its cycles.
//!
//! A minute of a record has thousands of cycles, and all of them as vectors would be several times the record. So they are cut
//! when they are wanted, on all cores, and what is needed of all of them is summed up on the way.

use super::HysteresisError;
use super::correction::Correction;
use super::cycle::Cycle;
use super::integration::closed_cycle;
use super::loops::energy;
use super::record::{HysteresisRecord, RelativeMotion};
use super::sums::{dot, mean};
use super::timing::Timing;
use crate::parallel::prelude::*;
use crate::vectors::wide;
use std::ops::Range;

/// Fewer samples than this make no loop.
const FEWEST_SAMPLES: usize = 16;

/// Cycles that are summed one after the other; fixed, so that rounding does not depend on the number of cores.
const BLOCK: usize = 64;

/// All whole cycles of a steady record, each resampled to the same number of points: a period need not be a whole number of samples.
pub(super) struct Steady<'a> {
    record: &'a HysteresisRecord,
    correction: Option<&'a Correction>,
    timing: Timing,
    points: usize,
    cycles: usize,
}

/// What all cycles give together.
pub(super) struct Summed {
    /// The average cycle, point by point.
    pub mean: Cycle,
    /// Least-squares slope of each cycle, N/m.
    pub slopes: Vec<f64>,
    /// Loop area of each cycle, J.
    pub energies: Vec<f64>,
    /// How the cycles scatter about their average.
    pub scatter: Scatter,
}

/// Mean products of what single cycles differ by from their average, per point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scatter {
    /// Number of cycles.
    pub cycles: usize,
    products: Products,
}

impl Scatter {
    /// Mean square of T − k Δx − c Δẋ about that of the average cycle, N².
    pub fn variance(&self, k: f64, c: f64) -> f64 {
        let [tt, xx, vv, xt, vt, xv] = self.products;
        (tt + k * k * xx + c * c * vv - 2.0 * (k * xt + c * vt - k * c * xv)).max(0.0)
    }
}

/// TT, xx, vv, xT, vT, xv.
type Products = [f64; 6];

fn products(cycle: &Cycle) -> Products {
    let [x, v, t] = cycle.signals();
    [dot(t, t), dot(x, x), dot(v, v), dot(x, t), dot(v, t), dot(x, v)]
}

/// One block of cycles, summed.
struct Sums {
    cycle: Cycle,
    products: Products,
    slopes: Vec<f64>,
    energies: Vec<f64>,
}

/// Memory of whoever cuts one cycle after the other.
#[derive(Default)]
struct Scratch {
    cycle: Cycle,
    motion: Vec<f64>,
    force: Vec<f64>,
}

impl<'a> Steady<'a> {
    /// The cycles of this timing in a record that [`HysteresisRecord::check`] found good, with the force at the contact if a
    /// correction is given.
    ///
    /// # Errors
    /// When there is no whole cycle, or too few samples in one.
    pub fn new(
        record: &'a HysteresisRecord,
        correction: Option<&'a Correction>,
        timing: Timing,
    ) -> Result<Self, HysteresisError> {
        let samples = record.force_n.len();
        let time_s = samples as f64 / record.fs_hz;
        let frequency_hz = timing.at(0.5 * time_s);
        let points = (record.fs_hz / frequency_hz).round() as usize;
        // a hair of tolerance: 20 cycles exactly must not count as 19
        let cycles = (timing.cycles(time_s) + 1e-6).floor() as usize;
        if cycles == 0 || points < FEWEST_SAMPLES {
            return Err(HysteresisError::NoCycle { frequency_hz, samples, points });
        }
        Ok(Self { record, correction, timing, points, cycles })
    }

    /// Time between the points of the average cycle, s.
    pub fn dt_s(&self) -> f64 {
        self.timing.begin_s(self.cycles as f64) / (self.cycles * self.points) as f64
    }

    /// `look` at every cycle, in order.
    pub fn each<T: Send>(&self, look: impl Fn(&Cycle) -> T + Sync) -> Vec<T> {
        let blocks: Vec<Vec<T>> = self.blocks(|cycles| {
            let mut scratch = Scratch::default();
            cycles.map(|cycle| look(self.cut(cycle, &mut scratch))).collect()
        });
        blocks.into_iter().flatten().collect()
    }

    /// What all of them give together.
    pub fn summed(&self) -> Summed {
        let blocks = self.blocks(|cycles| self.sum(cycles));
        let mut mean = Cycle::zeros(self.points);
        let (mut all, mut slopes, mut energies) = ([0.0; 6], Vec::new(), Vec::new());
        for block in blocks {
            add(&mut mean, &block.cycle);
            all.iter_mut().zip(block.products).for_each(|(sum, own)| *sum += own);
            slopes.extend(block.slopes);
            energies.extend(block.energies);
        }
        let n = self.cycles as f64;
        for x in mean.signals_mut() {
            for value in x {
                *value /= n;
            }
        }
        let of_mean = products(&mean);
        let points = self.points as f64;
        let apart = std::array::from_fn(|i| (all[i] / n - of_mean[i]) / points);
        Summed { mean, slopes, energies, scatter: Scatter { cycles: self.cycles, products: apart } }
    }

    fn blocks<T: Send>(&self, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
        let block = |b: usize| work(b * BLOCK..((b + 1) * BLOCK).min(self.cycles));
        (0..self.cycles.div_ceil(BLOCK)).into_par_iter().map(block).collect()
    }

    fn sum(&self, cycles: Range<usize>) -> Sums {
        let mut scratch = Scratch::default();
        let cycle = Cycle::zeros(self.points);
        let mut sums = Sums { cycle, products: [0.0; 6], slopes: Vec::new(), energies: Vec::new() };
        for cycle in cycles {
            let cycle = self.cut(cycle, &mut scratch);
            let own = products(cycle);
            let [_, xx, _, xt, _, _] = own;
            // both have no mean
            sums.slopes.push(xt / xx);
            sums.energies.push(energy(cycle));
            sums.products.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            add(&mut sums.cycle, cycle);
        }
        sums
    }

    /// Cycle number `cycle`.
    fn cut<'s>(&self, cycle: usize, scratch: &'s mut Scratch) -> &'s Cycle {
        let Scratch { cycle: cut, motion, force } = scratch;
        let [begin_s, end_s] = [0.0, 1.0].map(|more| self.timing.begin_s(cycle as f64 + more));
        let (begin, period) = (begin_s * self.record.fs_hz, (end_s - begin_s) * self.record.fs_hz);
        let dt_s = (end_s - begin_s) / self.points as f64;
        // a cubic takes one sample before and two after
        let first = begin.floor() as isize - 1;
        let end = (begin + period).floor() as isize + 3;
        self.record.relative_motion(first..end, motion);
        match self.correction {
            None => self.record.force(first..end, force),
            Some(correction) => correction.force(self.record, first..end, force),
        }
        let from = begin - first as f64;
        let step = period / self.points as f64;
        resample([motion, force], from, step, self.points, [&mut cut.velocity_m_per_s, &mut cut.force_n]);
        centre(&mut cut.velocity_m_per_s);
        centre(&mut cut.force_n);
        match self.record.motion {
            RelativeMotion::Velocity { .. } => {
                closed_cycle(&cut.velocity_m_per_s, dt_s, &mut cut.displacement_m);
            }
            RelativeMotion::Displacement { .. } => {
                std::mem::swap(&mut cut.velocity_m_per_s, &mut cut.displacement_m);
                let (x, n) = (&cut.displacement_m, self.points);
                cut.velocity_m_per_s.clear();
                let slope = |j: usize| (x[(j + 1) % n] - x[(j + n - 1) % n]) / (2.0 * dt_s);
                cut.velocity_m_per_s.extend((0..n).map(slope));
            }
        }
        cut
    }
}

fn add(sum: &mut Cycle, cycle: &Cycle) {
    for (sum, x) in sum.signals_mut().into_iter().zip(cycle.signals()) {
        sum.iter_mut().zip(x).for_each(|(sum, value)| *sum += value);
    }
}

fn centre(x: &mut [f64]) {
    let mean = mean(x);
    for v in x {
        *v -= mean;
    }
}

/// Both signals at `points` places from sample `from` on, `step` samples apart, by cubic (Catmull–Rom) interpolation.
///
/// A step is one sample but for a fraction, so that the place between two samples is the same but for a slow drift: only where
/// that passes a sample, runs of equal whole steps end.
fn resample(signals: [&[f64]; 2], from: f64, step: f64, points: usize, to: [&mut Vec<f64>; 2]) {
    let drift = step - 1.0;
    let [to_a, to_b] = to;
    for to in [&mut *to_a, &mut *to_b] {
        to.clear();
        to.resize(points, 0.0);
    }
    let mut done = 0;
    while done < points {
        let at = from + done as f64 * step;
        let i = at as usize;
        let t = at - i as f64;
        let run = if drift > 0.0 { (1.0 - t) / drift } else { t / -drift };
        // the first point may lie on a sample and drift down from it
        let run = (run.min(points as f64) as usize).clamp(1, points - done);
        for (x, to) in signals.into_iter().zip([&mut *to_a, &mut *to_b]) {
            cubic(&x[i - 1..i + run + 2], t, drift, &mut to[done..done + run]);
        }
        done += run;
    }
}

/// Values between the second and third of each four samples in a row, at t, t + `drift`, …
fn cubic(x: &[f64], t: f64, drift: f64, to: &mut [f64]) {
    let n = to.len();
    let [p0, p1, p2, p3] = [0, 1, 2, 3].map(|i| &x[i..][..n]);
    wide(|| {
        for j in 0..n {
            let (p0, p1, p2, p3) = (p0[j], p1[j], p2[j], p3[j]);
            let t = t + f64::from(j as u32) * drift;
            to[j] = p1
                + 0.5
                    * t
                    * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic goes through a parabola exactly, wherever runs end.
    #[test]
    fn a_parabola_comes_back_at_any_step() {
        let parabola = |at: f64| 3.0 - 2.0 * at + 0.25 * at * at;
        let x: Vec<f64> = (0..64).map(|i| parabola(f64::from(i))).collect();
        for (from, step) in [(1.0, 1.0), (1.3, 1.0), (1.0, 0.98), (1.02, 0.97), (1.99, 1.03), (1.5, 1.01)] {
            let (mut a, mut b) = (Vec::new(), Vec::new());
            resample([&x, &x], from, step, 58, [&mut a, &mut b]);
            for (j, (a, b)) in a.iter().zip(&b).enumerate() {
                let expected = parabola(from + j as f64 * step);
                assert!((a - expected).abs() < 1e-9 && a == b, "{from} {step} {j}: {a} for {expected}");
            }
        }
    }
}
