//! How quiet the structure must be before the next hit, relative to its motion after the last one.

use std::f64::consts::PI;

use jointrig_protocol::channel::Quantity;

use super::shot::QuietLimits;
use crate::campaign::plan::Settle;
use crate::device::channels::ChannelMap;
use crate::device::recording::Recording;

/// Start of the window in which the motion right after a hit is evaluated (s after the trigger),
/// when the pulse is over …
const FROM_S: f64 = 0.002;
/// … and its length, s: `PERIODS` periods of the slowest mode of interest.
const FOR_S: f64 = 0.075;
const PERIODS: f64 = 2.0;

/// Limits for the first hit of a cell: without an earlier hit, any motion is allowed.
pub fn unknown(channels: &ChannelMap) -> QuietLimits {
    vec![0.0; channels.len()]
}

/// Limits after `recording`: for each velocity or acceleration channel a fraction of its rms right
/// after the hit, but at least the floor; `allowance` (1 or more) loosens them. Other channels are
/// not limited. For an acceleration, the velocity floor is converted at the frequency of the
/// slowest mode of interest.
pub fn after(recording: &Recording, channels: &ChannelMap, settle: &Settle, allowance: f64) -> QuietLimits {
    let rate = f64::from(channels.rate_hz);
    let from = recording.trigger_index + (FROM_S * rate) as usize;
    let to = from + (FOR_S * rate) as usize;
    channels
        .channels
        .iter()
        .enumerate()
        .map(|(place, channel)| {
            let floor = match channel.quantity {
                Quantity::Velocity => settle.quiet_floor_m_per_s,
                Quantity::Acceleration => settle.quiet_floor_m_per_s * 2.0 * PI * PERIODS / FOR_S,
                Quantity::Displacement | Quantity::Force | Quantity::Voltage => return 0.0,
            };
            let codes = recording.channel(place);
            let window = codes.get(from.min(codes.len())..to.min(codes.len())).unwrap_or(&[]);
            let power: f64 = window.iter().map(|code| f64::from(*code).powi(2)).sum();
            let rms = (power / window.len().max(1) as f64).sqrt() * channel.units_per_code().abs();
            (allowance * (settle.quiet_relative * rms).max(floor)) as f32
        })
        .collect()
}
