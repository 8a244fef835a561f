//! Advances the structure by one scan: exactly while stuck, in steps while slipping.
//!
//! Stuck motion is linear, so there is no numerical integration: [`ModalStepper`] multiplies each
//! complex mode by e^{λT}; [`ExponentialStepper`] multiplies the whole state by e^{AT}, slower, for
//! structures whose modes are dependent. A contact that can slip stays linear for the steppers: the
//! difference to its sliders' force is applied as a force between the specimens ([`Slipping`]).

mod exponential;
mod modal;
mod slipping;

pub use exponential::ExponentialStepper;
pub use modal::ModalStepper;
pub use slipping::Slipping;

use nalgebra::DVector;

use super::fixed::FixedRows;
use super::force::ForceSegment;

/// Signals of the structure: vibrometer x, y, z, the two spots (m/s), the three load cells (N).
pub const SIGNALS: usize = 8;

/// Inputs and outputs, in state coordinates (2n).
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
    /// The joint, if it can slip.
    pub joint: Option<Joint>,
    /// Output rows of the fixed vibrometers.
    pub fixed: FixedRows,
}

/// Input and output of a joint that can slip, in state coordinates (2n).
#[derive(Debug, Clone)]
pub struct Joint {
    /// Row of y = Δ + β Δ', with Δ the displacement of specimen A minus that of B along z.
    pub row: DVector<f64>,
    /// Column of a force that pushes A along z and B in the opposite direction.
    pub column: DVector<f64>,
    /// Number of steps of a scan in which an element slips.
    pub steps: u32,
    /// Duration of one step (s).
    pub step_s: f64,
}

/// Time span of one call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Span {
    /// A scan period.
    Scan,
    /// One step of [`Joint::step_s`].
    Step,
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
    Modal(Box<ModalStepper>),
    /// By matrix exponential.
    Exponential(Box<ExponentialStepper>),
}

/// Forwards a call to the stepper in use.
macro_rules! either {
    ($stepper:expr, $it:ident => $call:expr) => {
        match $stepper {
            Self::Modal($it) => $call,
            Self::Exponential($it) => $call,
        }
    };
}

impl Stepper {
    /// Advances one span.
    #[inline]
    pub fn advance(&mut self, span: Span, forces: &ScanForces<'_>) {
        either!(self, stepper => stepper.advance(span, forces));
    }

    /// Adds the effect of a force between the specimens over the span just passed, during which it
    /// changed linearly from `from_n` to `to_n` (N).
    #[inline]
    pub fn push(&mut self, span: Span, from_n: f64, to_n: f64) {
        either!(self, stepper => stepper.push(span, from_n, to_n));
    }

    /// Current y of the joint (m); 0 without a joint that can slip.
    #[inline]
    pub fn joint(&self) -> f64 {
        either!(self, stepper => stepper.joint())
    }

    /// Gain of y over a step from a force between the specimens that rises from zero to 1 N (m/N).
    pub fn receptance(&self) -> f64 {
        either!(self, stepper => stepper.receptance())
    }

    /// Saves the state.
    #[inline]
    pub fn keep(&mut self) {
        either!(self, stepper => stepper.keep());
    }

    /// Restores the saved state.
    #[inline]
    pub fn go_back(&mut self) {
        either!(self, stepper => stepper.go_back());
    }

    /// The current signals.
    #[inline]
    pub fn signals(&self) -> [f64; SIGNALS] {
        either!(self, stepper => stepper.signals())
    }

    /// The current signals of the fixed vibrometers.
    pub fn fixed(&self, into: &mut [f64]) {
        either!(self, stepper => stepper.fixed(into));
    }

    /// The state x (2n).
    pub fn state(&self) -> DVector<f64> {
        either!(self, stepper => stepper.state())
    }
}
