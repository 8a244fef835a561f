//! Advancing the stuck structure by one scan, exactly.
//!
//! Stuck motion is linear, so nothing is integrated numerically: [`ModalStepper`] turns each complex mode by e^{λT};
//! [`ExponentialStepper`] multiplies the whole state by e^{AT}, slower, for structures whose modes are dependent.

mod exponential;
mod modal;

pub use exponential::ExponentialStepper;
pub use modal::ModalStepper;

use nalgebra::DVector;

use super::force::ForceSegment;

/// Signals of the structure: vibrometer x, y, z, the two spots (m/s), the three load cells (N).
pub const SIGNALS: usize = 8;

/// What is measured and pushed, in state coordinates (2n).
#[derive(Debug, Clone)]
pub struct Aimed {
    /// Row of each signal; zero where the configuration lacks the body.
    pub rows: [DVector<f64>; SIGNALS],
    /// Column of the hammer's force.
    pub hammer: DVector<f64>,
    /// Column of the shaker's force.
    pub shaker: DVector<f64>,
    /// Size of one converter step of each signal, in its own unit.
    pub steps: [f64; SIGNALS],
}

/// One scan's forces.
#[derive(Debug, Clone, Copy)]
pub struct ScanForces<'a> {
    /// Start of the scan on the segments' clock (s).
    pub from_s: f64,
    /// Its end (s).
    pub to_s: f64,
    /// Hammer forces, in any order.
    pub hammer: &'a [ForceSegment],
    /// The shaker's force (N), held over the scan.
    pub shaker_n: f64,
}

/// Either stepper.
#[derive(Debug, Clone)]
pub enum Stepper {
    /// By complex modes.
    Modal(ModalStepper),
    /// By matrix exponential.
    Exponential(ExponentialStepper),
}

impl Stepper {
    /// Advances one scan period.
    #[inline]
    pub fn advance(&mut self, forces: &ScanForces<'_>) {
        match self {
            Self::Modal(stepper) => stepper.advance(forces),
            Self::Exponential(stepper) => stepper.advance(forces),
        }
    }

    /// The signals now.
    #[inline]
    pub fn signals(&self) -> [f64; SIGNALS] {
        match self {
            Self::Modal(stepper) => stepper.signals(),
            Self::Exponential(stepper) => stepper.signals(),
        }
    }

    /// The state x (2n).
    pub fn state(&self) -> DVector<f64> {
        match self {
            Self::Modal(stepper) => stepper.state(),
            Self::Exponential(stepper) => stepper.state(),
        }
    }
}
