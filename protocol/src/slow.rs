//! Slowly changing values that are not part of the scans: the specimen's temperature, and the bias
//! of sensors fed with a constant current.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most inputs of a board that feed a sensor with a constant current (IEPE).
pub const MAX_SUPPLIES: usize = 2;

/// Bias below which a supply is considered shorted, V: the amplifier of an IEPE sensor is biased at
/// 8 to 14 V, and never below 5 V (typical values of such sensors, not checked against each
/// sensor's manual).
pub const SHORT_BELOW_V: f32 = 3.0;

/// Bias above which a 24 V supply is considered open, V: without a load current it is at 22 V or
/// more, and a sensor at the end of its range swings to 19 V (14 V of bias and 5 V of signal).
pub const OPEN_ABOVE_V: f32 = 20.0;

/// Last measured slow values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Slow {
    /// Temperature at the specimen, °C; `None` without a sensor.
    pub temperature_c: Option<f32>,
    /// Every constant-current supply of the board.
    pub supplies: Vec<Supply, MAX_SUPPLIES>,
}

/// A constant-current supply and the state of its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Supply {
    /// The channel that it feeds: its index in the scan.
    pub channel: u8,
    /// Mean voltage at its socket, V.
    pub bias_v: f32,
}

impl Supply {
    /// The fault that the bias indicates, if any.
    #[must_use]
    pub fn fault(&self) -> Option<SupplyFault> {
        if self.bias_v > OPEN_ABOVE_V {
            Some(SupplyFault::Open)
        } else if self.bias_v >= SHORT_BELOW_V {
            None
        } else {
            // NaN also counts as a missing sensor
            Some(SupplyFault::Short)
        }
    }
}

/// Fault of a sensor that a supply detects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SupplyFault {
    /// No current flows: the cable is open, or nothing is connected.
    Open,
    /// There is no voltage: the cable or the sensor is shorted.
    Short,
}

impl core::fmt::Display for SupplyFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Open => "its cable is open, or no sensor is plugged in",
            Self::Short => "its cable or sensor is shorted",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_tells_a_sensor_from_a_fault() {
        let fault = |bias_v| Supply { channel: 0, bias_v }.fault();
        for bias_v in [7.0, 11.0, 14.0, 19.0] {
            assert_eq!(fault(bias_v), None, "{bias_v} V");
        }
        assert_eq!(fault(22.3), Some(SupplyFault::Open));
        for bias_v in [0.0, 0.4, -1.0, f32::NAN] {
            assert_eq!(fault(bias_v), Some(SupplyFault::Short), "{bias_v} V");
        }
    }
}
