//! One half of a 74HCT4538.
//!
//! Nexperia, 74HC4538; 74HCT4538, Rev. 4 (2016): nB is the rising-edge trigger, nA the falling-edge
//! one, a LOW at nCD ends the pulse and inhibits triggering (section 1, "Functional description"),
//! and the pulse lasts 0.7 R C. Unlike a 74HC123, it is not triggered by the end of a reset.

/// Tolerance of the pulse length relative to 0.7 R C. The data sheet's output pulse of 0.7 ms (10
/// kΩ, 0.1 µF) is taken as ± 14 % over temperature; resistors have 1 %, film capacitors 5 %.
pub const TOLERANCE: f64 = 0.14 + 0.01 + 0.05;

/// Nominal length of a pulse, s.
pub const fn nominal_s(ohm: f64, farad: f64) -> f64 {
    0.7 * ohm * farad
}

/// The edge of its trigger that starts it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    Rising,
    Falling,
}

/// A one-shot with its resistor and capacitor.
#[derive(Clone, Copy, Debug)]
pub struct OneShot {
    edge: Edge,
    retriggerable: bool,
    width_s: f64,
    trigger: bool,
    left_s: f64,
}

impl OneShot {
    /// At rest, with its trigger low.
    pub fn new(edge: Edge, retriggerable: bool, width_s: f64) -> Self {
        Self { edge, retriggerable, width_s, trigger: false, left_s: 0.0 }
    }

    /// The state at power-up, which is undefined.
    pub fn woken(mut self, running: bool, trigger: bool) -> Self {
        self.left_s = if running { self.width_s } else { 0.0 };
        self.trigger = trigger;
        self
    }

    /// Q.
    pub fn runs(&self) -> bool {
        self.left_s > 0.0
    }

    /// Whether its trigger would start it now if it were not reset.
    fn triggered(&self, level: bool) -> bool {
        let edge = match self.edge {
            Edge::Rising => level && !self.trigger,
            Edge::Falling => !level && self.trigger,
        };
        edge && (self.retriggerable || !self.runs())
    }

    /// Sets the levels at trigger and nCD, and advances the time.
    pub fn step(&mut self, trigger: bool, not_reset: bool, seconds: f64) {
        self.left_s = (self.left_s - seconds).max(0.0);
        if self.triggered(trigger) {
            self.left_s = self.width_s;
        }
        if !not_reset {
            self.left_s = 0.0;
        }
        self.trigger = trigger;
    }
}
