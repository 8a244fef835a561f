//! Values measured a few times a second: the specimen's temperature, and the supplies of sensors
//! fed with a constant current.
//!
//! An actuator that needs such a sensor does not move while its cable is open or shorted. The
//! circuits are in docs/WIRING.md.

use jointrig_protocol::answer::Refusal;
use jointrig_protocol::slow::{Slow, Supply};
#[allow(unused_imports, reason = "core has no square root; where std is linked its own is taken")]
use micromath::F32Ext;

/// The resistor from the reference to the Pt1000, Ω.
const SERIES_OHM: f32 = 2_200.0;
/// Platinum, IEC 60751: R = R₀ (1 + A t + B t²) above 0 °C; off by 0.1 K at −40 °C, because a third
/// term applies below 0 °C.
const R0_OHM: f32 = 1_000.0;
/// See [`R0_OHM`], 1/K.
const A: f32 = 3.9083e-3;
/// See [`R0_OHM`], 1/K².
const B: f32 = -5.775e-7;
/// Plausible temperatures of a specimen in a laboratory; beyond them the sensor is disconnected or
/// shorted.
const BELIEVED_C: core::ops::Range<f32> = -50.0..150.0;

/// The last measured values.
#[derive(Default)]
pub(crate) struct Supplies {
    slow: Slow,
}

impl Supplies {
    /// Stores the measured values.
    pub fn take(&mut self, slow: Slow) {
        self.slow = slow;
    }

    /// The last measured values.
    pub fn latest(&self) -> &Slow {
        &self.slow
    }

    /// Whether the sensor of a channel is present, as far as its supply can detect; channels
    /// without a supply are not checked.
    pub fn is_fed(&self, channel: Option<usize>) -> Result<(), Refusal> {
        let own = |supply: &&Supply| Some(usize::from(supply.channel)) == channel;
        let Some(supply) = self.slow.supplies.iter().find(own) else { return Ok(()) };
        supply.fault().map_or(Ok(()), |fault| Err(Refusal::Supply { channel: supply.channel, fault }))
    }
}

/// Temperature of a Pt1000 to ground with a series resistor from the converter's own reference, °C.
/// `part` is the voltage at the sensor divided by the reference. `None` for values without a
/// plausible sensor.
#[must_use]
pub fn pt1000_c(part: f32) -> Option<f32> {
    if !(part > 0.0 && part < 1.0) {
        return None;
    }
    let ohm = SERIES_OHM * part / (1.0 - part);
    // t = (−A + √(A² − 4 B (1 − R/R₀))) / 2 B, rearranged to avoid cancellation
    let constant = 1.0 - ohm / R0_OHM;
    let square = A * A - 4.0 * B * constant;
    let temperature_c = -2.0 * constant / (A + root(square)?);
    BELIEVED_C.contains(&temperature_c).then_some(temperature_c)
}

/// micromath's square root is accurate to a few per cent; two Newton steps reduce the error to
/// 1e-6.
fn root(square: f32) -> Option<f32> {
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let mut root = square.sqrt();
    for _ in 0..2 {
        root = 0.5 * (root + square / root);
    }
    Some(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Voltage ratio to the reference at a resistance, Ω.
    fn part(ohm: f32) -> f32 {
        ohm / (ohm + SERIES_OHM)
    }

    #[test]
    fn the_tables_of_iec_60751_come_back() {
        for (celsius, ohm) in
            [(0.0, 1000.0), (20.0, 1077.94), (25.0, 1097.35), (50.0, 1193.97), (100.0, 1385.06)]
        {
            let told = pt1000_c(part(ohm)).expect("a sensor");
            assert!((told - celsius).abs() < 0.02, "{ohm} ohm is {told} C, not {celsius}");
        }
        assert!(
            (pt1000_c(part(842.7)).expect("a sensor") + 40.0).abs() < 0.15,
            "below zero a third term is left out"
        );
    }

    #[test]
    fn no_sensor_is_no_temperature() {
        for part in [0.0, 1e-4, 0.999, 1.0, -0.1, f32::NAN] {
            assert_eq!(pt1000_c(part), None, "{part}");
        }
    }
}
