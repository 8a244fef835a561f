//! Simulated loops for tests: a contact's law under a sine, measured by sensors with noise, delays
//! and faults.

use super::record::in_step;
use super::{HysteresisRecord, LoopAnalysis, RelativeMotion, analyse};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// Points of one cycle at which the law is integrated.
const PLACES: usize = 8_192;

/// A contact's law over one steady cycle of x = X sin θ.
#[derive(Debug, Clone)]
pub(super) enum Law {
    /// Nothing slips.
    Linear,
    /// Elements of equal stiffness, whose limits are given relative to the mean one, with μN in
    /// total; the limit varies along the stroke by `along`.
    Sliders { limits: Vec<f64>, limit_n: f64, along: f64 },
    /// dT/dx = k (1 − T/μN sgn ẋ).
    Dahl { limit_n: f64 },
}

/// A simulated measurement.
#[derive(Debug, Clone)]
pub(super) struct Bench {
    pub fs_hz: f64,
    pub frequency_hz: f64,
    pub stiffness: f64,
    pub amplitude_m: f64,
    pub law: Law,
    /// The joint's own damping, s.
    pub beta_s: f64,
    pub viscous: f64,
    pub late_s: f64,
    /// Mains frequency, Hz, its fraction of the force's amplitude at the loop's frequency, and
    /// whether the force or the velocity has the hum.
    pub hum: Option<(f64, f64, bool)>,
    pub drift: f64,
    pub sign: f64,
    pub swapped: bool,
    pub seconds: f64,
}

impl Bench {
    fn friction(&self) -> Vec<f64> {
        let x = |i: usize| self.amplitude_m * (TAU * i as f64 / PLACES as f64).sin();
        let mut force = vec![0.0; PLACES];
        match &self.law {
            Law::Linear => (0..PLACES).for_each(|i| force[i] = self.stiffness * x(i)),
            Law::Sliders { limits, limit_n, along } => {
                let n = limits.len() as f64;
                for own in limits {
                    let mut slider = 0.0;
                    for i in 0..3 * PLACES {
                        let (k, at) = (self.stiffness / n, x(i % PLACES));
                        let limit = limit_n * own / n * (1.0 + along * at / self.amplitude_m);
                        let carried = (k * (at - slider)).clamp(-limit, limit);
                        slider = at - carried / k;
                        if i >= 2 * PLACES {
                            force[i - 2 * PLACES] += carried;
                        }
                    }
                }
            }
            Law::Dahl { limit_n } => {
                let mut t = 0.0;
                for i in 0..4 * PLACES {
                    let step = x((i + 1) % PLACES) - x(i % PLACES);
                    // exact over one step
                    let end = limit_n * step.signum();
                    t = end + (t - end) * (-self.stiffness * step.abs() / limit_n).exp();
                    if i >= 3 * PLACES {
                        force[(i + 1) % PLACES] = t;
                    }
                }
            }
        }
        force
    }

    fn record(&self, rng: &mut Xoshiro256PlusPlus) -> HysteresisRecord {
        let law = self.friction();
        let n = (self.seconds * self.fs_hz) as usize;
        let start = rng.random::<f64>();
        let rate = self.drift * self.frequency_hz / self.seconds;
        let turns = |t: f64| start + self.frequency_hz * t + 0.5 * rate * t * t;
        let omega = |t: f64| TAU * (self.frequency_hz + rate * t);
        let velocity = |t: f64| self.amplitude_m * omega(t) * (TAU * turns(t)).cos();
        let force = |t: f64| {
            let at = turns(t).rem_euclid(1.0) * PLACES as f64;
            let (i, share) = (at as usize % PLACES, at.fract());
            let friction = law[i] * (1.0 - share) + law[(i + 1) % PLACES] * share;
            let damping = if matches!(self.law, Law::Linear) { self.beta_s * self.stiffness } else { 0.0 };
            friction + (damping + self.viscous) * velocity(t)
        };
        let most = law.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let hum_phase = rng.random::<f64>();
        let hum = |t: f64, force: bool, amplitude: f64| {
            self.hum.filter(|h| h.2 == force).map_or(0.0, |(mains, part, _)| {
                let at = (self.frequency_hz / 50.0f64.max(mains.round())).round();
                // all multiples up to that of the loop and a little beyond, weaker with increasing
                // order
                (1..=8)
                    .map(f64::from)
                    .map(|m| {
                        part * amplitude * (at / m).sqrt() * (TAU * (mains * m * t + hum_phase * m)).sin()
                    })
                    .sum()
            })
        };
        // x_B follows the force through its support's compliance of 1/150 µm/N
        let late: [f64; 3] = std::array::from_fn(|_| 1e-4 * rng.random::<f64>());
        let share = 0.3;
        let fastest = self.amplitude_m * TAU * self.frequency_hz;
        let floor = 5e-8 * (0.5 * self.fs_hz).sqrt();
        let noise = |rng: &mut Xoshiro256PlusPlus| -> f64 { StandardNormal.sample(rng) };
        let (mut a, mut b, mut f) = (Vec::new(), Vec::new(), Vec::new());
        // in_step() holds the last value where a delayed signal ends, so generate samples beyond
        // the record
        for i in 0..n + 8 {
            let t = i as f64 / self.fs_hz;
            let side = |t: f64, part: f64| part * (velocity(t) + hum(t, false, fastest)) + 1e-6;
            a.push(side(t - late[0], 1.0 + share) + floor * noise(rng));
            b.push(side(t - late[1], share) + floor * noise(rng));
            let cells = 0.01 * 3f64.sqrt() * noise(rng);
            f.push(self.sign * (force(t - late[2] - self.late_s) + hum(t, true, most)) + 0.3 + cells);
        }
        let [mut a, mut b, mut force_n] = in_step([a, b, f], late, self.fs_hz);
        for signal in [&mut a, &mut b, &mut force_n] {
            signal.truncate(n);
        }
        if self.swapped {
            std::mem::swap(&mut a, &mut b);
        }
        HysteresisRecord {
            fs_hz: self.fs_hz,
            motion: RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b },
            force_n,
            excitation_hz: Some(self.frequency_hz),
            normal_load_n: None,
        }
    }

    pub fn analysed(&self, rng: &mut Xoshiro256PlusPlus) -> LoopAnalysis {
        analyse(&self.record(rng)).expect("a loop")
    }
}

/// Random value from `low` to `high`, uniform in the logarithm.
pub(super) fn between(rng: &mut Xoshiro256PlusPlus, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

pub(super) fn stuck(rng: &mut Xoshiro256PlusPlus) -> Bench {
    let fs_hz = if rng.random::<bool>() { 51_200.0 } else { 10_240.0 };
    Bench {
        fs_hz,
        frequency_hz: between(rng, 30.0, 400.0),
        stiffness: between(rng, 60e6, 600e6),
        amplitude_m: between(rng, 0.1e-6, 0.3e-6),
        law: Law::Linear,
        beta_s: between(rng, 0.5e-5, 3e-5),
        viscous: 0.0,
        late_s: 0.0,
        hum: None,
        drift: 0.0,
        sign: 1.0,
        swapped: false,
        seconds: between(rng, 0.6, 1.5),
    }
}

/// In gross slip, with one slider or many.
pub(super) fn slipping(rng: &mut Xoshiro256PlusPlus, one: bool) -> Bench {
    let limit_n = between(rng, 60.0, 300.0);
    let limits = if one { vec![1.0] } else { spread(20, 0.5 + 0.45 * rng.random::<f64>()) };
    let base = stuck(rng);
    Bench {
        amplitude_m: between(rng, 2.5, 6.0) * limit_n / base.stiffness,
        law: Law::Sliders { limits, limit_n, along: 0.0 },
        // a cycle needs at least 60 samples for the flanks to contain any
        frequency_hz: base.frequency_hz.min(base.fs_hz / 60.0),
        ..base
    }
}

pub(super) fn spread(count: usize, by: f64) -> Vec<f64> {
    (0..count).map(|i| 1.0 + by * ((2 * i + 1) as f64 / count as f64 - 1.0)).collect()
}

pub(super) fn clean(rng: &mut Xoshiro256PlusPlus) -> Bench {
    match (rng.random::<f64>() * 4.0) as u8 {
        0 | 1 => stuck(rng),
        2 => slipping(rng, true),
        _ => slipping(rng, false),
    }
}
