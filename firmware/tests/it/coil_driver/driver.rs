//! The coil driver: how PULSE, PERMIT and two one-shots determine the MOSFET's gate.
//!
//! ```text
//! gate  = PULSE · A · PERMIT · not B      (74HCT21, then TC4427)
//! A     : rising edge of PULSE, not retriggerable, reset unless PERMIT · not B
//! B     : falling edge of PULSE, retriggerable, never reset
//! ```

use crate::coil_driver::one_shot::{Edge, OneShot, nominal_s};

/// Pulse length of one-shot A, which ends a pulse that PULSE does not end: 100 kΩ and 150 nF.
pub const A_S: f64 = nominal_s(100e3, 150e-9);
/// Pulse length of one-shot B, which blocks the next pulse: 680 kΩ and 1 µF.
pub const B_S: f64 = nominal_s(680e3, 1e-6);

/// State of a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire {
    Low,
    High,
    /// Not driven: the pin floats, or the wire is disconnected.
    Open,
}

pub const WIRES: [Wire; 3] = [Wire::Low, Wire::High, Wire::Open];

impl Wire {
    pub fn name(self) -> &'static str {
        match self {
            Wire::Low => "0",
            Wire::High => "1",
            Wire::Open => "open",
        }
    }
}

/// An input with or without a pull-down resistor.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    pub pulled_down: bool,
}

impl Input {
    /// The level; a floating input follows the noise.
    fn level(self, wire: Wire, noise: bool) -> bool {
        match wire {
            Wire::Low => false,
            Wire::High => true,
            Wire::Open => noise && !self.pulled_down,
        }
    }
}

/// External conditions.
#[derive(Clone, Copy, Debug)]
pub struct Outside {
    pub pulse: Wire,
    pub permit: Wire,
    /// The driver's own 5 V supply is present.
    pub logic_supply: bool,
    /// Level of a floating input.
    pub noise: bool,
}

impl Outside {
    pub fn new(pulse: Wire, permit: Wire) -> Self {
        Self { pulse, permit, logic_supply: true, noise: false }
    }
}

/// The coil driver.
#[derive(Clone, Copy, Debug)]
pub struct Driver {
    pub pulse: Input,
    pub permit: Input,
    pub a: OneShot,
    pub b: OneShot,
}

impl Driver {
    /// The circuit as drawn; `scale` is the tolerance factor of each one-shot.
    pub fn new(scale: [f64; 2]) -> Self {
        Self {
            pulse: Input { pulled_down: true },
            permit: Input { pulled_down: true },
            a: OneShot::new(Edge::Rising, false, A_S * scale[0]),
            b: OneShot::new(Edge::Falling, true, B_S * scale[1]),
        }
    }

    /// The gate level for these inputs and the present state of the one-shots.
    pub fn gate(&self, outside: Outside) -> bool {
        let pulse = self.pulse.level(outside.pulse, outside.noise);
        let permit = self.permit.level(outside.permit, outside.noise);
        // without its supply the TC4427 is inactive, and 10 kΩ hold the gate low
        outside.logic_supply && pulse && permit && self.a.runs() && !self.b.runs()
    }

    /// Advances the time with these levels; returns whether the gate is on at the end.
    pub fn step(&mut self, outside: Outside, seconds: f64) -> bool {
        let pulse = self.pulse.level(outside.pulse, outside.noise);
        let permit = self.permit.level(outside.permit, outside.noise);
        if outside.logic_supply {
            self.b.step(pulse, true, seconds);
            self.a.step(pulse, permit && !self.b.runs(), seconds);
        }
        self.gate(outside)
    }
}
