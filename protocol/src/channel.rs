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

/// One channel of the scan. A value in SI units is `code / 32768 × range_v × units_per_volt`, or
/// for a wide code `code / 2^(bits-1) × range_v × units_per_volt`; the sign of the scale is the
/// polarity.
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
    /// Bits of the converter that carry information: up to 18 are sent as codes of 16 bits
    /// (rounded), more than 18 as wide codes ([`Channel::is_wide`]).
    pub bits: u8,
}

/// Most bits of a code that is sent as 16 bits.
pub const NARROW_BITS: u8 = 18;

/// Most bits of a wide code. The lower word of a code then has at most 14 bits, so that it never
/// looks like a 16-bit code at either end of its range.
pub const WIDE_BITS: u8 = 30;

/// 16-bit words in one scan of these channels: one per channel, and one more per wide channel.
#[must_use]
pub fn words_per_scan(channels: &[Channel]) -> usize {
    channels.len() + channels.iter().filter(|channel| channel.is_wide()).count()
}

/// The two words of a wide code of `bits` bits: the upper 16 bits, and the remaining ones.
#[must_use]
pub fn split_code(code: i32, bits: u8) -> [i16; 2] {
    let low = bits.clamp(NARROW_BITS, WIDE_BITS) - 16;
    [(code >> low) as i16, (code & ((1 << low) - 1)) as i16]
}

/// The wide code of `bits` bits that [`split_code`] turned into these words.
#[must_use]
pub fn joined_code([upper, lower]: [i16; 2], bits: u8) -> i32 {
    let low = bits.clamp(NARROW_BITS, WIDE_BITS) - 16;
    (i32::from(upper) << low) | (i32::from(lower) & ((1 << low) - 1))
}

impl Channel {
    /// Whether its codes have more bits than fit one 16-bit word of a scan.
    #[must_use]
    pub const fn is_wide(&self) -> bool {
        self.bits > NARROW_BITS
    }

    /// SI units per code of 16 bits.
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_wide_code_survives_its_two_words(code in any::<i32>(), bits in 19_u8..=WIDE_BITS) {
            let code = code >> (32 - bits);
            let words = split_code(code, bits);
            prop_assert_eq!(joined_code(words, bits), code);
            // the upper word is the code with 16 bits, and the lower one never looks clipped
            prop_assert_eq!(i32::from(words[0]), code >> (bits - 16));
            prop_assert!((0..1 << 14).contains(&words[1]));
        }
    }
}
