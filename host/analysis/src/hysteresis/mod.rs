//! Hysteresis: loops of the tangential force T over the relative displacement Δx, and the contact's
//! properties derived from them.
//!
//! Processing order: [`record`] (the measured signals) → [`cycles`] (a shaker record, cut by its
//! frequency, with velocity integrated to displacement over whole cycles) or [`impact`] (a decay,
//! cut by its dominant mode) → [`loops`] (slopes, area, secant, fundamental) with `stick` (the
//! stick part and the plateau) and [`shape`]; `steady` combines them for a shaker record.
//! [`analyse`](mod@analyse) is the entry point. Its result is [`LoopAnalysis`], with the findings
//! that a reader must know before using its numbers, each with its magnitude.
//!
//! Definitions are stated only here: k_T is the least-squares slope of the stick part; k_eq that of
//! the whole loop; the peak secant and the ratio of fundamentals have their own names. T is used as
//! given: the load cells' sum is not T at the contact (the static arm's inertia adds 2.4 % at 250
//! Hz). [`static_arm`] identifies the arm's parameters and converts it to the contact's force, and
//! the corrected record is analysed in addition to the raw one. [`compliance`] treats the same
//! signals in the frequency domain, [`backbone`] several levels, [`wear`] every cycle of a run of
//! millions by itself.

use impact::DecayCycle;
use num_complex::Complex;
use serde::Serialize;

pub mod analyse;
pub mod backbone;
pub mod compliance;
pub mod contact_drift;
pub mod cycles;
mod frequency;
pub mod hammer_slip;
pub mod impact;
pub mod loops;
pub mod phase_split;
pub mod record;
mod repair;
pub mod shape;
pub mod static_arm;
mod steady;
mod stick;
pub mod wear;

pub use analyse::{analyse, analyse_both, analyse_corrected};
pub use loops::OverCycles;
pub use record::{HysteresisRecord, RelativeMotion};
pub use shape::{Shape, ShapeEvidence};
pub use static_arm::Correction;

/// Why a record gives no loop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HysteresisError {
    /// The signals differ in length.
    #[error("motion of A has {a} samples, of B {b}, the force {force}: all three need the same number")]
    Lengths {
        /// Samples of A's motion.
        a: usize,
        /// Samples of B's motion.
        b: usize,
        /// Samples of the force.
        force: usize,
    },
    /// The record is too short for any loop.
    #[error("the record has {samples} samples: at least 32 are needed, and a whole cycle")]
    TooShort {
        /// Its samples.
        samples: usize,
    },
    /// The sampling rate is not a positive number.
    #[error("the sampling rate is {0} Hz: a positive number is needed")]
    SamplingRate(f64),
    /// The excitation frequency is not a positive number.
    #[error("the excitation frequency is {0} Hz: a positive number is needed, or none for an impact")]
    Excitation(f64),
    /// A value is NaN or infinite.
    #[error("sample {sample} is not a number: cut the record before it")]
    NotFinite {
        /// Index of the first such sample.
        sample: usize,
    },
    /// There is no whole cycle, or too few samples in one.
    #[error(
        "{samples} samples hold no whole cycle of {frequency_hz:.1} Hz with at least 16 samples (one has {points}): record longer, or sample faster"
    )]
    NoCycle {
        /// The frequency, Hz.
        frequency_hz: f64,
        /// Samples of the record.
        samples: usize,
        /// Samples of one cycle.
        points: usize,
    },
    /// The stated frequency is not in the record, and force and motion show different ones.
    #[error(
        "the excitation is stated as {stated_hz:.4} Hz, but the force runs at {force_hz:.4} Hz and the relative motion at {motion_hz:.4} Hz: check the stated frequency and the channels"
    )]
    OtherFrequency {
        /// As stated, Hz.
        stated_hz: f64,
        /// The strongest frequency of the force, Hz.
        force_hz: f64,
        /// The strongest frequency of the relative motion, Hz.
        motion_hz: f64,
    },
    /// No two consecutive cycles are alike, or only some with a small part of the motion.
    #[error(
        "the main part of its motion is not steady: {cycles} cycles with amplitudes of {low_m:.3e} to {high_m:.3e} m; record longer, after the excitation has settled, and one level in a file"
    )]
    NotSteady {
        /// Cycles of the record.
        cycles: usize,
        /// Smallest amplitude of Δx in a cycle, m.
        low_m: f64,
        /// Largest, m.
        high_m: f64,
    },
    /// The cycles at the frequency that was found are not in phase.
    #[error(
        "its {cycles} cycles at {frequency_hz:.4} Hz are not in phase with one another: no steady excitation of this frequency is in this record; state the frequency, or record a steady one"
    )]
    NoSteadyPhase {
        /// Cycles that are alike in amplitude.
        cycles: usize,
        /// The strongest frequency of the force, Hz.
        frequency_hz: f64,
    },
    /// Nothing moves.
    #[error("force or relative motion is constant: there is no loop; check the channels")]
    NoMotion,
}

/// How the contact was moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Steadily, at one frequency.
    Shaker,
    /// By one hit, decaying.
    Impact,
}

/// Full result for a record's loops. The loop of a shaker record is periodic; those of an impact
/// are its first cycles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopAnalysis {
    /// How the contact was moved.
    pub kind: Kind,
    /// Excitation frequency, or the dominant mode of the decay, Hz.
    pub frequency_hz: f64,
    /// Half the swing of Δx (averaged loop; first cycle of a decay), m.
    pub amplitude_m: f64,
    /// Half the swing of T in the same loop, N.
    pub force_amplitude_n: f64,
    /// The loop's shape.
    pub shape: Shape,
    /// Evidence for the shape; `None` for a decay, where the shape follows from the drop in
    /// frequency at large amplitude.
    pub shape_evidence: Option<ShapeEvidence>,
    /// k_T: slope of the stick part, N/m. `None` for an ellipse.
    pub k_t_n_per_m: Option<OverCycles>,
    /// The fraction of the force's swing after each reversal over which k_T was fitted; only if
    /// something slips.
    pub stick_part: Option<[f64; 2]>,
    /// k_eq: least-squares slope over the whole loop, N/m.
    pub k_eq_n_per_m: OverCycles,
    /// Loop area per cycle, J. `None` for a decay, whose loops do not close.
    pub energy_j: Option<OverCycles>,
    /// Peak secant of the averaged loop, N/m.
    pub k_secant_n_per_m: Option<f64>,
    /// T₁/Δx₁ of the averaged loop, N/m (complex: real part, imaginary part).
    pub k_fundamental_n_per_m: Option<Complex<f64>>,
    /// μN from the plateau's median, N; only in gross slip.
    pub friction_limit_n: Option<f64>,
    /// 95 % interval of μN from its scatter over the cycles, N; `None` for fewer than four.
    pub friction_limit_ci95_n: Option<[f64; 2]>,
    /// μ; only if the normal load is known.
    pub friction_coefficient: Option<f64>,
    /// 95 % interval of μ for a normal load without error; `None` for fewer than four cycles.
    pub friction_coefficient_ci95: Option<[f64; 2]>,
    /// Phase by which Δx lags T at the fundamental, degrees.
    pub phase_deg: f64,
    /// Δx of the loop for plotting, m: the averaged cycle, or the first cycles of a decay.
    pub loop_displacement_m: Vec<f64>,
    /// T of the same points, N.
    pub loop_force_n: Vec<f64>,
    /// Every cycle of a decay; empty for a shaker.
    pub decay_cycles: Vec<DecayCycle>,
    /// Faults of the loop and corrections made, each with its magnitude.
    pub findings: Vec<LoopFinding>,
    /// Warnings for the reader.
    pub warnings: Vec<String>,
}

/// A fault of a loop, or a correction that was made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "finding")]
#[non_exhaustive]
pub enum LoopFinding {
    /// The force falls while the contact is pushed, and the loop dissipates no energy: the sign of
    /// the force is wrong, or A and B are swapped. No k_T is reported.
    ReversedForce {
        /// Least-squares slope over the whole loop, N/m.
        k_eq_n_per_m: f64,
        /// Loop area per cycle, J.
        energy_j: f64,
    },
    /// The force lags the motion (leads it, if negative).
    LateForce {
        /// Delay, s.
        by_s: f64,
        /// Standard deviation, s.
        std_s: f64,
        /// In a loop without a plateau only a lower bound of the delay can be found: the contact's
        /// own damping hides the rest.
        at_least: bool,
        /// Stiffness, friction and energy are those of the loop with the delay removed. If both
        /// this and `at_least` are false, the force looks shifted in time, but no delay makes it a
        /// friction loop, or damping explains it as well: neither k_T nor μN is reported.
        corrected: bool,
    },
    /// Play (backlash): after each reversal the contact moves by this distance while the force
    /// stays constant.
    Play {
        /// Size of the play, m.
        size_m: f64,
        /// Half the difference between the sizes on both strokes, m.
        std_m: f64,
    },
    /// Cycles at the beginning and the end of the record whose amplitude or force differs from that
    /// of the others were left out.
    Unsteady {
        /// Cycles left out at the beginning.
        left_out_first: usize,
        /// Cycles left out at the end.
        left_out_last: usize,
        /// Cycles used.
        used: usize,
        /// Amplitude of Δx at the fundamental in the cycles used, m.
        amplitude_m: f64,
        /// Amplitude in the left-out cycle that differs most, m.
        left_out_amplitude_m: f64,
    },
    /// A force proportional to velocity acts in addition to the friction. It is removed from k_T
    /// and μN.
    Viscous {
        /// Viscous damping coefficient, N s/m.
        viscous_n_s_per_m: f64,
        /// Standard deviation, N s/m.
        std_n_s_per_m: f64,
        /// Its largest force, N.
        force_n: f64,
    },
    /// Mains hum lies at the loop's own frequency, where averaging does not remove it.
    Hum {
        /// 50 or 60, Hz.
        mains_hz: f64,
        /// The multiple of it that coincides with the loop's frequency, Hz.
        at_hz: f64,
        /// The strongest other multiple over the fundamental of the same signal; the error of the
        /// slope may be as large.
        part: f64,
    },
    /// The plateau's force depends on position: the normal load varies while the contact slides. μN
    /// is that at the middle.
    UnevenLoad {
        /// Change of the friction limit from the middle to the end of the stroke, over that at the
        /// middle.
        change: f64,
        /// Its standard deviation.
        std: f64,
    },
    /// The excitation is not at the stated frequency, or drifts. The cycles were cut at the
    /// frequency found.
    FrequencyOff {
        /// As stated, Hz; `None` if it was found from the record.
        #[serde(skip_serializing_if = "Option::is_none")]
        stated_hz: Option<f64>,
        /// At the record's beginning, Hz.
        from_hz: f64,
        /// At its end, Hz.
        to_hz: f64,
    },
}

impl LoopFinding {
    /// Its name in `results.json`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::ReversedForce { .. } => "reversed-force",
            Self::LateForce { .. } => "late-force",
            Self::Play { .. } => "play",
            Self::Unsteady { .. } => "unsteady",
            Self::Viscous { .. } => "viscous",
            Self::Hum { .. } => "hum",
            Self::UnevenLoad { .. } => "uneven-load",
            Self::FrequencyOff { .. } => "frequency-off",
        }
    }
}

#[cfg(test)]
mod faulty_loops_tests;

#[cfg(test)]
mod loop_bench;

#[cfg(test)]
mod loops_of_any_size_tests;

#[cfg(test)]
mod synthetic_tests;
