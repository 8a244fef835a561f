//! What a loop in gross slip is put right by before its figures are read: a delay of the force, a dashpot beside the friction.

use super::cycle::Cycle;
use super::finding::LoopFinding;
use super::law_fit::{LawFit, earlier, unexplained};

/// A delay below this is left alone, s: channels are never in step to better.
const LATE_S: f64 = 8e-6;

/// Nor does a loop of few samples show a small part of one between them.
const LATE_SAMPLES: f64 = 0.4;

/// A dashpot whose force stays below this part of the loop's is left alone.
const VISCOUS: f64 = 0.02;

/// Either must be so many of its standard deviations,
const SIGNIFICANT: f64 = 5.0;

/// and leave so many times the squares when it is not allowed for.
const BETTER: f64 = 1.5;

/// What is taken out of the force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Repair {
    /// By which it comes too late, in points of the cycle.
    late_points: f64,
    /// N s/m.
    viscous: f64,
    /// What is not known of it, over it.
    unsure: f64,
}

/// The delay found must leave less than this part of the squares,
const EXPLAINS: f64 = 0.25;

/// be at least this part of the cycle (a small one leaves the loop's shape, and is looked for with the dashpot),
const SHORTEST: f64 = 0.01;

/// and be no longer than this part: beyond it, the force's sign may as well be wrong.
const LONGEST: f64 = 0.25;

/// Friction alone that leaves this part of the force (rms) or less explains a loop. It may take a delay for friction of short reach,
/// and then leaves little.
const ALONE: f64 = 0.003;

/// What a search for a delay over the whole cycle said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Delay {
    /// The loop needs none.
    None,
    /// So much explains it, s (and its standard deviation).
    Found(f64, f64),
    /// It looks late by so much, s (and its standard deviation), but that does not explain it.
    NotExplained(f64, f64),
    /// A dashpot beside the friction explains it about as well as a force that is late by so much, s (early if negative, as for any
    /// dashpot that takes energy; and its standard deviation).
    OrDamped(f64, f64),
}

/// Whether a loop that bends is a friction loop whose force is out of step by so much that its figures are lost.
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
    /// What the averaged loop of a contact in gross slip asks for, and what is to be said of it. `late_s` was taken out of `mean`
    /// already; it is part of the delay that is said.
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

    /// A delay of the force alone, with its standard deviation.
    pub fn in_step_by(late_s: f64, std_s: f64, dt_s: f64) -> Self {
        let unsure = if late_s == 0.0 { 0.0 } else { std_s / late_s.abs() };
        Self { late_points: late_s / dt_s, unsure, ..Self::default() }
    }

    /// Whether there is anything to do.
    pub fn is_some(&self) -> bool {
        self.late_points != 0.0 || self.viscous != 0.0
    }

    /// Whether the force is late.
    pub fn is_late(&self) -> bool {
        self.late_points != 0.0
    }

    /// What is not known of it, over it.
    pub fn unsure(&self) -> f64 {
        self.unsure
    }

    /// The cycle with its force in step.
    pub fn in_step(&self, cycle: &Cycle) -> Cycle {
        Cycle { force_n: earlier(&cycle.force_n, self.late_points), ..cycle.clone() }
    }

    /// The cycle with its friction alone.
    pub fn friction(&self, cycle: &Cycle) -> Cycle {
        let mut cycle = self.in_step(cycle);
        for (t, v) in cycle.force_n.iter_mut().zip(&cycle.velocity_m_per_s) {
            *t -= self.viscous * v;
        }
        cycle
    }
}
