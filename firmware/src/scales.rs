//! The scales used in a session for trigger, quiet, limits and amplitudes.
//!
//! A board is built with nominal sensitivities; a laboratory may have better values. The host sends
//! these when its session begins, so that control, limits and trigger use the same scales as the
//! host. Otherwise, two vibrometers calibrated separately would leave a part of their common motion
//! in their difference.

use heapless::Vec;
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::channel::Channel;
use jointrig_protocol::limits::{MAX_CHANNELS, SCALE_FACTOR_CAP};

use crate::sentence::out_of_bounds;

/// SI units per code of every channel, sign included.
pub(crate) type UnitsPerCode = Vec<f32, MAX_CHANNELS>;

/// The built-in scales.
pub(crate) fn as_built(channels: &[Channel]) -> UnitsPerCode {
    channels.iter().take(MAX_CHANNELS).map(Channel::units_per_code_f32).collect()
}

/// The scales sent by a host, if they are acceptable.
pub(crate) fn as_told(channels: &[Channel], units_per_volt: &[f32]) -> Result<UnitsPerCode, Refusal> {
    if units_per_volt.len() != channels.len() {
        return Err(out_of_bounds("scales: one for each channel of the device, in its order"));
    }
    let most = SCALE_FACTOR_CAP as f32;
    let fits = |(channel, told): (&Channel, &f32)| {
        // NaN and zero lie in no range
        let factor = (told / channel.units_per_volt).abs();
        factor >= 1.0 / most && factor <= most
    };
    if !channels.iter().zip(units_per_volt).all(fits) {
        return Err(out_of_bounds(
            "scales: each must be a number, not zero, and within a factor of 100 of the one built in",
        ));
    }
    Ok(channels.iter().zip(units_per_volt).map(|(channel, told)| told * channel.range_v / 32_768.0).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Name, Quantity, Role};

    fn channels() -> [Channel; 2] {
        [0.005, -0.001].map(|units_per_volt| Channel {
            name: Name::new(),
            role: Role::Auxiliary,
            quantity: Quantity::Velocity,
            units_per_volt,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        })
    }

    #[test]
    fn a_scale_may_be_another_and_turned_but_not_another_sensors() {
        let told = as_told(&channels(), &[0.00515, 0.1]).expect("3 % more, and turned, at the cap");
        assert!((told[0] - 0.00515 * 10.0 / 32_768.0).abs() < 1e-12 && told[1] > 0.0);
        for wrong in [f32::NAN, f32::INFINITY, 0.0, -0.0, 0.51, 4.9e-5] {
            let refused = as_told(&channels(), &[wrong, -0.001]);
            assert!(matches!(refused, Err(Refusal::OutOfBounds(_))), "{wrong}");
        }
        for count in [0, 1, 3] {
            assert!(as_told(&channels(), &[0.005, -0.001, 1.0][..count]).is_err(), "{count} scales");
        }
    }
}
