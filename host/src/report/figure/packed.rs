//! Numbers of curves as compact text: `f32:` and base64 of 32-bit floats, little endian.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::{Serialize, Serializer};

/// The values of a curve; NaN where unknown.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Packed(pub Vec<f32>);

impl Packed {
    /// From any sequence of numbers.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        Packed(values.into_iter().map(|v| v as f32).collect())
    }

    /// The range of the finite values.
    pub fn range(&self) -> Option<[f64; 2]> {
        let finite = || self.0.iter().copied().filter(|v| v.is_finite());
        let low = finite().reduce(f32::min)?;
        Some([low.into(), finite().fold(low, f32::max).into()])
    }
}

impl Serialize for Packed {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = self.0.iter().flat_map(|v| v.to_le_bytes()).collect();
        to.serialize_str(&format!("f32:{}", BASE64_STANDARD.encode(bytes)))
    }
}

/// A number with six significant digits, as used in csv files and readouts; empty if it is not
/// finite.
pub fn six_digits(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e9).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_digits_survive_thirty_two_bits() {
        for value in [1.234_56e-9, 26.889_5, 999_999.0, -0.000_123_456] {
            assert_eq!(six_digits(f64::from(value as f32)), six_digits(value));
        }
        assert_eq!(six_digits(f64::NAN), "");
        assert_eq!(six_digits(1.234_567e-8), "1.23457e-8");
        assert_eq!(serde_json::to_string(&Packed::of([1.0])).expect("text"), "\"f32:AACAPw==\"");
    }
}
