//! Hysteresis: loops of the tangential force T over the relative displacement Δx, and the contact's
//! properties derived from them.
//!
//! Processing order: [`record`] (the measured signals) → [`cycles`] (a shaker record, cut by its
//! frequency, with velocity integrated to displacement over whole cycles) or [`impact`] (a decay,
//! cut by its dominant mode) → [`loops`] (slopes, area, secant, fundamental) with `stick` (the
//! stick part and the plateau) and [`shape`]; `steady` combines them for a shaker record.
//! [`analyse`](mod@analyse) is the entry point, [`loop_analysis`] its result.
//!
//! Definitions are stated only here: k_T is the least-squares slope of the stick part; k_eq that of
//! the whole loop; the peak secant and the ratio of fundamentals have their own names. T is used as
//! given: the load cells' sum is not T at the contact (the static arm's inertia adds 2.4 % at 250
//! Hz). [`static_arm`] identifies the arm's parameters and converts it to the contact's force, and
//! the corrected record is analysed in addition to the raw one. [`compliance`] treats the same
//! signals in the frequency domain, [`backbone`] several levels.

pub mod analyse;
pub mod backbone;
pub mod compliance;
pub mod cycles;
mod dominant_frequency;
pub mod first_cycle;
pub mod hammer_slip;
mod hum;
pub mod impact;
pub mod loop_analysis;
pub mod loops;
pub mod phase_split;
pub mod record;
mod repair;
pub mod shape;
pub mod static_arm;
mod steady;
mod stick;
mod timing;

pub use analyse::{analyse, analyse_both, analyse_corrected};
pub use loop_analysis::LoopFinding;
pub use loop_analysis::{Kind, LoopAnalysis};
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
    /// No two consecutive cycles are alike.
    #[error(
        "none of the {cycles} cycles has the amplitude of its neighbour ({low_m:.3e} to {high_m:.3e} m): no steady loop is in this record; record longer, or after the excitation has settled"
    )]
    NotSteady {
        /// Cycles of the record.
        cycles: usize,
        /// Smallest amplitude of Δx in a cycle, m.
        low_m: f64,
        /// Largest, m.
        high_m: f64,
    },
    /// Nothing moves.
    #[error("force or relative motion is constant: there is no loop; check the channels")]
    NoMotion,
}
#[cfg(test)]
mod faulty_loops_tests;
#[cfg(test)]
mod loop_bench;
#[cfg(test)]
mod loops_of_any_size_tests;
#[cfg(test)]
mod synthetic_tests;
