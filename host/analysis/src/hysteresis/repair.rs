//! What a loop in gross slip is put right by before its figures are read: a delay of the force, a dashpot beside the friction.

use super::cycle::Cycle;
use super::finding::LoopFinding;
use super::law_fit::{LawFit, earlier};

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

impl Repair {
    /// What the averaged loop asks for, and what is to be said of it.
    pub fn of(mean: &Cycle, dt_s: f64) -> (Self, Vec<LoopFinding>) {
        let (mut repair, mut said) = (Self::default(), Vec::new());
        let Some(fit) = LawFit::of(mean, dt_s) else { return (repair, said) };
        let [left, without_delay, without_dashpot] = fit.residuals;
        let [by_s, std_s] = fit.late_s;
        if by_s.abs() > LATE_S.max(SIGNIFICANT * std_s).max(LATE_SAMPLES * dt_s)
            && without_delay > BETTER * left
        {
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
