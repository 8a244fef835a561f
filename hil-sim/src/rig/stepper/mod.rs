//! Advances the structure by one scan: exactly while stuck, in steps while slipping.
//!
//! Stuck motion is linear, so there is no numerical integration: [`ModalStepper`] multiplies each
//! complex mode by e^{λT}; [`ExponentialStepper`] multiplies the whole state by e^{AT}, slower, for
//! structures whose modes are dependent. A contact that can slip stays linear for the steppers: the
//! difference to its sliders' force is applied as a force between the specimens ([`Slipping`]).
//!
//! While stuck, a scan is one exact step of the linear structure under a constant force between the
//! specimens that remains from earlier slip. A scan in which an element would slip is undone and
//! repeated in steps.

use super::force::ForceSegment;
use super::sensors::FixedRows;
use super::sliders::Sliders;
use nalgebra::DVector;

pub use exponential::ExponentialStepper;
pub use modal::ModalStepper;

mod exponential;
mod modal;

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

    /// Sets the state x (2n).
    pub fn set_state(&mut self, x: &DVector<f64>) {
        either!(self, stepper => stepper.set_state(x));
    }
}

/// The step's equation converges from any start while its slopes differ by less than a half.
const MOST_GAIN: f64 = 0.5;

/// The sliders, and how a scan is divided for them.
#[derive(Debug, Clone)]
pub struct Slipping {
    sliders: Sliders,
    receptance: f64,
    steps: u32,
    step_s: f64,
}

impl Slipping {
    /// At rest; `None` when the joint's step is too long for this structure.
    pub fn new(sliders: Sliders, joint: &Joint, stepper: &Stepper) -> Option<Self> {
        let receptance = stepper.receptance();
        let gain = receptance * sliders.stiffness();
        (0.0..MOST_GAIN).contains(&gain).then_some(Self {
            sliders,
            receptance,
            steps: joint.steps,
            step_s: joint.step_s,
        })
    }

    /// The sliders.
    pub fn sliders(&self) -> &Sliders {
        &self.sliders
    }

    /// Sets the normal load (N).
    pub fn load(&mut self, normal_load_n: f64) {
        self.sliders.load(normal_load_n);
    }

    /// Takes over where the elements of `before` are, in a joint that has changed since.
    pub fn continues(&mut self, before: &Self) {
        self.sliders.continues(&before.sliders);
    }

    /// Advances one scan period.
    #[inline]
    pub fn advance(&mut self, stepper: &mut Stepper, forces: &ScanForces<'_>) {
        if self.sliders.settled() {
            stepper.keep();
            stepper.advance(Span::Scan, forces);
            let push_n = self.sliders.push_n();
            if push_n != 0.0 {
                stepper.push(Span::Scan, push_n, push_n);
            }
            if self.sliders.hold(stepper.joint()) {
                return;
            }
            stepper.go_back();
        }
        self.slip(stepper, forces);
    }

    fn slip(&mut self, stepper: &mut Stepper, forces: &ScanForces<'_>) {
        let mut from_s = forces.from_s;
        let mut push_n = self.sliders.push_n();
        for step in 1..=self.steps {
            let to_s =
                if step == self.steps { forces.to_s } else { forces.from_s + f64::from(step) * self.step_s };
            stepper.advance(Span::Step, &ScanForces { from_s, to_s, ..*forces });
            stepper.push(Span::Step, push_n, 0.0);
            let next_n = self.sliders.slide(stepper.joint(), self.receptance);
            stepper.push(Span::Step, 0.0, next_n);
            (from_s, push_n) = (to_s, next_n);
        }
    }
}
