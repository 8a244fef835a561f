//! Corrections applied to a loop in gross slip before its figures are computed: a delay of the
//! force, a dashpot parallel to the friction.

use super::cycle::Cycle;
use super::finding::LoopFinding;
use super::law_fit::{LawFit, earlier, unexplained};

/// A shorter delay is not corrected, s: channels are never aligned better than this.
const LATE_S: f64 = 8e-6;

/// A delay below this many samples does not show in a loop of few samples and is not corrected
/// either.
const LATE_SAMPLES: f64 = 0.4;

/// A dashpot whose force stays below this fraction of the loop's force is not corrected.
const VISCOUS: f64 = 0.02;

/// Both must exceed this many of their standard deviations,
const SIGNIFICANT: f64 = 5.0;

/// and the sum of squares without them must be larger by this factor.
const BETTER: f64 = 1.5;

/// Corrections to the force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Repair {
    /// Delay of the force, in points of the cycle.
    late_points: f64,
    /// Viscous damping coefficient, N s/m.
    viscous: f64,
    /// Relative uncertainty of the correction.
    unsure: f64,
}

/// The delay found must leave less than this fraction of the sum of squares,
const EXPLAINS: f64 = 0.25;

/// be at least this fraction of the cycle (a small delay preserves the loop's shape, and is fitted
/// together with the dashpot),
const SHORTEST: f64 = 0.01;

/// and be no longer than this fraction: beyond it, the force may equally have the wrong sign.
const LONGEST: f64 = 0.25;

/// Friction alone explains a loop if it leaves at most this fraction of the force (rms). It may
/// take a delay for friction of short reach, and then leaves little.
const ALONE: f64 = 0.003;

/// Result of a search for a delay over the whole cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Delay {
    /// The loop is not delayed.
    None,
    /// This delay explains it, s (and its standard deviation).
    Found(f64, f64),
    /// It looks delayed by this much, s (and its standard deviation), but the delay does not
    /// explain it.
    NotExplained(f64, f64),
    /// A dashpot parallel to the friction explains the loop about as well as a delay of the force
    /// by this much, s (negative if the force leads, as for any dashpot that dissipates; and its
    /// standard deviation).
    OrDamped(f64, f64),
}

/// Whether a loop that bends is a friction loop whose force is shifted so far in time that its
/// figures are invalid.
pub(super) fn delay(mean: &Cycle, dt_s: f64, play_m: f64) -> Delay {
    let Some(fit) = LawFit::far(mean, dt_s, play_m) else { return Delay::None };
    let [left, without_delay, _] = fit.residuals;
    let [by_s, std_s] = fit.late_s;
    let explains = |than: f64| left <= EXPLAINS * than && unexplained(than, &mean.force_n);
    let part = |late_s: f64| late_s.abs() / (dt_s * mean.force_n.len() as f64);
    if explains(without_delay) && part(by_s) >= SHORTEST {
        return if unexplained(left, &mean.force_n) || part(by_s) > LONGEST {
            Delay::NotExplained(by_s, std_s)
        } else {
            Delay::Found(by_s, std_s)
        };
    }
    // friction and a dashpot may explain it as well
    let alone_s = fit.undamped_s;
    let squares: f64 = mean.force_n.iter().map(|t| t * t).sum();
    let alone_explains = fit.friction_alone < ALONE.powi(2) * squares || left > EXPLAINS * fit.friction_alone;
    if alone_explains || part(alone_s) < 0.5 * SHORTEST || unexplained(left, &mean.force_n) {
        Delay::None
    } else {
        Delay::OrDamped(alone_s, std_s)
    }
}

impl Repair {
    /// The correction for the averaged loop of a contact in gross slip, and the findings to report.
    /// `late_s` has already been removed from `mean`; it is included in the reported delay.
    pub fn of(mean: &Cycle, dt_s: f64, play_m: f64, late_s: f64) -> (Self, Vec<LoopFinding>) {
        let (mut repair, mut said) = (Self { late_points: late_s / dt_s, ..Self::default() }, Vec::new());
        let Some(fit) = LawFit::of(mean, dt_s, play_m) else { return (repair, said) };
        let [left, without_delay, without_dashpot] = fit.residuals;
        let [more_s, std_s] = fit.late_s;
        let needed = more_s.abs() > LATE_S.max(SIGNIFICANT * std_s).max(LATE_SAMPLES * dt_s)
            && without_delay > BETTER * left;
        if needed || late_s != 0.0 {
            let by_s = late_s + more_s;
            repair.late_points = by_s / dt_s;
            repair.unsure = std_s / by_s.abs();
            said.push(LoopFinding::LateForce { by_s, std_s, at_least: false, corrected: true });
        }
        let [viscous_n_s_per_m, std_n_s_per_m] = fit.viscous_n_s_per_m;
        let fastest = mean.velocity_m_per_s.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let force_n = viscous_n_s_per_m * fastest;
        let most = mean.force_n.iter().map(|t| t.abs()).fold(0.0, f64::max);
        if force_n > VISCOUS * most
            && viscous_n_s_per_m > SIGNIFICANT * std_n_s_per_m
            && without_dashpot > BETTER * left
        {
            repair.viscous = viscous_n_s_per_m;
            repair.unsure = repair.unsure.max(std_n_s_per_m / viscous_n_s_per_m);
            said.push(LoopFinding::Viscous { viscous_n_s_per_m, std_n_s_per_m, force_n });
        }
        (repair, said)
    }

    /// A delay of the force only, with its standard deviation.
    pub fn in_step_by(late_s: f64, std_s: f64, dt_s: f64) -> Self {
        let unsure = if late_s == 0.0 { 0.0 } else { std_s / late_s.abs() };
        Self { late_points: late_s / dt_s, unsure, ..Self::default() }
    }

    /// Whether there is anything to correct.
    pub fn is_some(&self) -> bool {
        self.late_points != 0.0 || self.viscous != 0.0
    }

    /// Whether the force is delayed.
    pub fn is_late(&self) -> bool {
        self.late_points != 0.0
    }

    /// Relative uncertainty of the correction.
    pub fn unsure(&self) -> f64 {
        self.unsure
    }

    /// The cycle with its force aligned in time.
    pub fn in_step(&self, cycle: &Cycle) -> Cycle {
        Cycle { force_n: earlier(&cycle.force_n, self.late_points), ..cycle.clone() }
    }

    /// The cycle with its friction force only.
    pub fn friction(&self, cycle: &Cycle) -> Cycle {
        let mut cycle = self.in_step(cycle);
        for (t, v) in cycle.force_n.iter_mut().zip(&cycle.velocity_m_per_s) {
            *t -= self.viscous * v;
        }
        cycle
    }
}
