//! The ten channels: their names, what they measure, and their indices.

use super::config;

/// Number of channels of the rig, without additional fixed sensors.
pub const CHANNELS: usize = 10;
/// Index of the hammer's force.
pub const FORCE: usize = 0;
/// Index of the structure's first signal; the others follow in the order of
/// [`super::stepper::SIGNALS`].
pub const FIRST_SIGNAL: usize = 1;
/// Indices of the 3-D vibrometer.
pub const VIBROMETER: [usize; 3] = [1, 2, 3];
/// Indices of the load cells.
pub const LOAD_CELLS: [usize; 3] = [6, 7, 8];
/// Index of the shaker's force.
pub const EXCITATION: usize = 9;

/// Whether `errors.gain` applies to the channel: it does to load cells and vibrometers, not to the
/// two excitation forces.
pub fn is_gauged(at: usize) -> bool {
    at != FORCE && at != EXCITATION
}

/// The quantity that a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measured {
    /// Force (N).
    Force,
    /// Velocity (m/s).
    Velocity,
    /// Acceleration (m/s²).
    Acceleration,
}

impl Measured {
    /// Its SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s²",
        }
    }
}

/// One channel of the rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Its name: `force`, `vib_x` … `excitation`, or the rig's name of a fixed sensor.
    pub name: String,
    /// What it measures.
    pub quantity: Measured,
    /// `N`, `m/s` or `m/s²`.
    pub unit: &'static str,
    /// Units per volt.
    pub units_per_volt: f64,
    /// Converter range, ± this (V).
    pub range_v: f64,
    /// Bits of the converter.
    pub bits: u8,
    /// Delay of the signal (s).
    pub delay_s: f64,
    /// 1, or −1 for a reversed sensor.
    pub polarity: i8,
    /// The axis it measures along (x, y, z); `None` for the hammer, which measures along the
    /// impact.
    pub axis: Option<usize>,
}

impl Channel {
    /// Value of one converter step, in the channel's unit.
    pub fn step(&self) -> f64 {
        self.units_per_volt * self.range_v / f64::from(1_u32 << (self.bits - 1))
    }
}

/// The ten channels in order.
pub fn channels(sensors: &config::Sensors) -> [Channel; CHANNELS] {
    let channel = |name: &str, quantity, units_per_volt, delay_s, polarity, axis| Channel {
        name: name.to_owned(),
        quantity,
        unit: quantity.unit(),
        units_per_volt,
        range_v: sensors.range_v,
        bits: sensors.bits,
        delay_s,
        polarity,
        axis,
    };
    let vibrometer = |name, axis: usize| {
        let it = &sensors.vibrometer;
        channel(name, Measured::Velocity, it.units_per_volt, it.delay_s[axis], it.polarity[axis], Some(axis))
    };
    let spot = |name, it: &config::SpotVibrometer| {
        channel(name, Measured::Velocity, it.units_per_volt, it.delay_s, it.polarity, Some(2))
    };
    let cell = |name, index: usize| {
        let it = &sensors.load_cells;
        channel(name, Measured::Force, it.units_per_volt, it.delay_s[index], it.polarity[index], Some(2))
    };
    let (force, excitation) = (&sensors.force, &sensors.excitation);
    [
        channel("force", Measured::Force, force.units_per_volt, force.delay_s, force.polarity, None),
        vibrometer("vib_x", 0),
        vibrometer("vib_y", 1),
        vibrometer("vib_z", 2),
        spot("ldv_a", &sensors.ldv_a),
        spot("ldv_b", &sensors.ldv_b),
        cell("lc_1", 0),
        cell("lc_2", 1),
        cell("lc_3", 2),
        channel(
            "excitation",
            Measured::Force,
            excitation.units_per_volt,
            excitation.delay_s,
            excitation.polarity,
            Some(2),
        ),
    ]
}
