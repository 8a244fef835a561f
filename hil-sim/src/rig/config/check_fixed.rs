//! Checks of the fixed vibrometers.

use super::RigConfig;
use super::values::{bad, finite, not_negative, positive};
use crate::rig::channels::{CHANNELS, channels};
use crate::rig::error::RigError;
use jointrig_protocol::limits::MAX_CHANNELS;

/// Maximum length of a channel's name, bytes, as in the protocol.
const NAME_BYTES: usize = jointrig_protocol::limits::NAME_BYTES;

pub(super) fn check_fixed(config: &RigConfig) -> Result<(), RigError> {
    let fixed = &config.sensors.fixed;
    if CHANNELS + fixed.len() > MAX_CHANNELS {
        let most = MAX_CHANNELS - CHANNELS;
        return Err(bad("sensors.fixed", &format!("are {}; a device has room for {most}", fixed.len())));
    }
    let mut taken: Vec<String> = channels(&config.sensors).map(|channel| channel.name).into();
    for (index, own) in fixed.iter().enumerate() {
        let field = |name: &str| format!("sensors.fixed[{index}].{name}");
        let name = &own.name;
        if name.is_empty() || name.len() > NAME_BYTES || !name.chars().all(|c| c.is_ascii_graphic()) {
            return Err(bad(&field("name"), &format!("must be 1 to {NAME_BYTES} letters, digits or signs")));
        }
        if taken.contains(name) {
            return Err(bad(&field("name"), &format!("`{name}` is another channel's name")));
        }
        taken.push(name.clone());
        if !config.responses.iter().any(|point| point.name == own.response) {
            return Err(bad(
                &field("response"),
                &format!("`{}` is none of the rig's responses", own.response),
            ));
        }
        finite(&field("direction"), &own.direction)?;
        if own.direction.iter().all(|part| *part == 0.0) {
            return Err(bad(&field("direction"), "must point somewhere"));
        }
        positive(&field("units_per_volt"), own.units_per_volt)?;
        not_negative(&field("floor"), own.floor)?;
        not_negative(&field("delay_s"), own.delay_s)?;
        if own.delay_s * f64::from(config.scan_rate_hz) > 1e4 {
            return Err(bad(&field("delay_s"), "is more than 10000 scans: give the delay in seconds"));
        }
        if own.polarity.abs() != 1 {
            return Err(bad(&field("polarity"), "must be 1 or -1"));
        }
    }
    Ok(())
}
