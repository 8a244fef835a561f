//! The device judges trigger, quiet and limits by the sensitivities that it was built with. Where a calibration says otherwise, orders are told in
//! the device's units, and what it answers is told in true ones.

use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::request::{Control, Fire, Shake, Trigger};
use jointrig_protocol::shot::Shot;

use super::channels::ChannelMap;

/// The device's value over the true one, channel by channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Units {
    /// With the sign that differs, if it does; empty while nobody calibrated anything.
    ratio: Vec<f32>,
    force: Option<usize>,
    excitation: Option<usize>,
    spots: [Option<usize>; 2],
    cells: Vec<usize>,
}

impl Units {
    /// Of a device that says `device` of its channels, which are calibrated as in `calibrated`.
    pub(super) fn new(device: &ChannelMap, calibrated: &ChannelMap) -> Self {
        let ratio = |(own, is): (&Channel, &Channel)| own.units_per_volt / is.units_per_volt;
        let place = |role| device.place(role);
        Self {
            ratio: device.channels.iter().zip(&calibrated.channels).map(ratio).collect(),
            force: place(Role::HammerForce),
            excitation: place(Role::Excitation),
            spots: [place(Role::SpecimenA), place(Role::SpecimenB)],
            cells: device.places(Role::LoadCell),
        }
    }

    fn of(&self, place: Option<usize>) -> f32 {
        place.and_then(|place| self.ratio.get(place)).copied().unwrap_or(1.0)
    }

    fn limits(&self, limits: &mut [f32]) {
        for (place, limit) in limits.iter_mut().enumerate() {
            *limit *= self.of(Some(place)).abs();
        }
    }

    pub(super) fn trigger(&self, trigger: Trigger) -> Trigger {
        Trigger { level_n: trigger.level_n * self.of(self.force), ..trigger }
    }

    pub(super) fn fire(&self, mut fire: Fire) -> Fire {
        self.limits(&mut fire.quiet_limits);
        fire
    }

    /// A displacement held is the difference of two vibrometers: with two different ratios it is told by their mean, and what it is in truth stands
    /// in the record.
    pub(super) fn shake(&self, mut shake: Shake) -> Shake {
        self.limits(&mut shake.limits);
        shake.control = match shake.control {
            Control::Drive => Control::Drive,
            Control::Force { amplitude_n } => {
                Control::Force { amplitude_n: amplitude_n * self.of(self.excitation).abs() }
            }
            Control::Displacement { amplitude_m } => {
                let [a, b] = self.spots.map(|place| self.of(place).abs());
                Control::Displacement { amplitude_m: amplitude_m * 0.5 * (a + b) }
            }
        };
        shake
    }

    /// What each of three load cells is multiplied by on the device, so that it sums true forces.
    pub(super) fn load_cells(&self, mut matrix: [f32; 9]) -> [f32; 9] {
        for row in matrix.chunks_exact_mut(3) {
            for (cell, value) in row.iter_mut().enumerate() {
                *value /= self.of(self.cells.get(cell).copied());
            }
        }
        matrix
    }

    pub(super) fn true_shot(&self, shot: Shot) -> Shot {
        Shot { peak_n: shot.peak_n / self.of(self.force), ..shot }
    }
}
