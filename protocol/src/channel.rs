//! Description of a scan's channel, sufficient to convert its codes to SI units.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::limits::NAME_BYTES;

/// A short name.
pub type Name = String<NAME_BYTES>;

/// The physical quantity of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Quantity {
    /// Force, N.
    Force,
    /// Velocity, m/s.
    Velocity,
    /// Displacement, m.
    Displacement,
    /// Acceleration, m/s².
    Acceleration,
    /// Voltage that represents no other quantity, V.
    Voltage,
}

impl Quantity {
    /// Symbol of the SI unit.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Velocity => "m/s",
            Self::Displacement => "m",
            Self::Acceleration => "m/s^2",
            Self::Voltage => "V",
        }
    }
}

/// Purpose of a channel: firmware and host find their inputs by role, never by name or position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Role {
    /// The hammer's force sensor.
    HammerForce,
    /// The scanning vibrometer at the aimed response point, along x, y, z.
    Response(Axis),
    /// Single-point vibrometer on the specimen of substructure A, along z.
    SpecimenA,
    /// Single-point vibrometer on the specimen of substructure B, along z.
    SpecimenB,
    /// One of the load cells that ground substructure B, along z.
    LoadCell,
    /// The excitation force between shaker and moving mass.
    Excitation,
    /// Anything else that is recorded.
    Auxiliary,
}

/// An axis of the rig: x lateral, y vertical (normal load), z sliding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Axis {
    /// Lateral.
    X,
    /// Vertical, the direction of the normal load.
    Y,
    /// Horizontal, the sliding direction.
    Z,
}

/// One channel of the scan. A value in SI units is `code / 32768 × range_v × units_per_volt`; the
/// sign of the scale is the polarity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Channel {
    /// Name, unique in the channel map.
    pub name: Name,
    /// Purpose of the channel.
    pub role: Role,
    /// Measured quantity; it determines the unit ([`Quantity::unit`]).
    pub quantity: Quantity,
    /// SI units per volt at the converter, sign included.
    pub units_per_volt: f32,
    /// Full scale of the converter, ± V.
    pub range_v: f32,
    /// Delay of the sample relative to the physical quantity, ns (decoder and converter).
    pub delay_ns: u32,
    /// Bits of the converter that carry information (16, or 18 rounded to 16).
    pub bits: u8,
}

impl Channel {
    /// SI units per code.
    #[must_use]
    pub fn units_per_code(&self) -> f64 {
        f64::from(self.units_per_volt) * f64::from(self.range_v) / 32_768.0
    }

    /// SI units per code in single precision, for a controller without double precision: equal to
    /// [`Channel::units_per_code`] with a single rounding, because the division by 32 768 only
    /// changes the exponent.
    #[must_use]
    pub fn units_per_code_f32(&self) -> f32 {
        self.units_per_volt * self.range_v / 32_768.0
    }
}
