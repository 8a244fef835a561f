//! How levels are measured, and the limits that stop the shaker.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use jointrig_protocol::channel::Role;

use crate::campaign::plan::level::{Level, Moment};
use crate::campaign::run::edits::Edits;
use crate::campaign::watch::Watchers;
use crate::device::channels::ChannelMap;

/// Fraction of full scale at which load cells and excitation stop the shaker. The vibrometers do
/// not stop it: they briefly exceed their range when a contact slips, and the device controls the
/// quantity that they measure.
const OF_FULL_SCALE: f64 = 0.95;

/// How levels are measured.
#[derive(Clone, Debug)]
pub struct Options {
    /// The levels, in order.
    pub levels: Vec<Level>,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// Shortest record, s; it is extended to whole cycles, at least twenty.
    pub seconds: f64,
    /// Rate of a sweep, Hz/s.
    pub sweep_hz_per_s: f64,
    /// The drive's largest amplitude, V; its full scale if absent.
    pub most_drive_v: Option<f64>,
    /// Limits that stop the shaker.
    pub limits: Limits,
    /// Continue even if device or rig indicate another structure than that of the file's records.
    pub new_structure: bool,
    /// Set to bring the shaker to rest and end the run.
    pub stop: Arc<AtomicBool>,
}

/// Observers and editors; none by default.
#[derive(Clone, Debug, Default)]
pub struct Onlookers {
    /// The observers.
    pub watch: Watchers,
    /// Changes to the file that persons request during the run; carried out between two levels.
    pub edits: Option<Edits>,
}

/// Limits by channel name, SI units; they apply throughout a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits(pub Vec<(String, f64)>);

impl Limits {
    /// The limit of each channel, in the order of the scan; 0 for no limit.
    pub fn of(&self, channels: &ChannelMap) -> Vec<f64> {
        (0..channels.len())
            .map(|place| {
                let channel = &channels.channels[place];
                let own = self.0.iter().find(|(name, _)| name == channel.name.as_str());
                match channel.role {
                    _ if own.is_some() => own.map_or(0.0, |(_, limit)| *limit),
                    Role::LoadCell | Role::Excitation => {
                        OF_FULL_SCALE * channels.full_scale(place).unwrap_or(0.0)
                    }
                    _ => 0.0,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Channel, Quantity};

    #[test]
    fn forces_are_limited_and_a_users_limit_counts_more() {
        let channel = |name: &str, role| Channel {
            name: name.parse().expect("short"),
            role,
            quantity: Quantity::Velocity,
            units_per_volt: -1e-3,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        let channels = ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel("hammer", Role::HammerForce),
                channel("LDV_A", Role::SpecimenA),
                channel("LC1", Role::LoadCell),
            ],
        };
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-8);
        assert!(near(&Limits::default().of(&channels), &[0.0, 0.0, 9.5e-3]));
        let own = Limits(vec![("LDV_A".into(), 2e-3), ("hammer".into(), 1.0)]);
        assert!(near(&own.of(&channels), &[1.0, 2e-3, 9.5e-3]));
    }
}
