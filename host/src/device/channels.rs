//! The channel map: what each channel of a scan measures, and how a sample converts to SI.

use super::samples::{ChannelView, SampleType};
use jointrig_protocol::channel::{Axis, Channel, Role};

/// Every channel of a scan, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelMap {
    /// The map's id in the protocol.
    pub id: u8,
    /// Scans per second, Hz; the nearest integer where `exact_hz` is set.
    pub rate_hz: u32,
    /// The rate where it is not an integer, Hz; imported records may have any rate.
    pub exact_hz: Option<f64>,
    /// The channels in scan order.
    pub channels: Vec<Channel>,
}

impl ChannelMap {
    /// Scans per second, Hz.
    pub fn fs_hz(&self) -> f64 {
        self.exact_hz.unwrap_or(f64::from(self.rate_hz))
    }

    /// Number of channels per scan.
    pub fn len(&self) -> usize {
        self.channels.len()
    }

    /// Whether there is no channel at all.
    pub fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }

    /// Index of the first channel with this role.
    pub fn place(&self, role: Role) -> Option<usize> {
        self.channels.iter().position(|channel| channel.role == role)
    }

    /// Indices of the channels with this role, in order.
    pub fn places(&self, role: Role) -> Vec<usize> {
        (0..self.len()).filter(|place| self.channels[*place].role == role).collect()
    }

    /// Indices of the response channels: the vibrometer's x, y and z, or as many of them in this
    /// order as an imported record has; `None` without the first.
    pub fn responses(&self) -> Option<Vec<usize>> {
        let at = |axis| self.place(Role::Response(axis));
        let there: Vec<usize> = [Axis::X, Axis::Y, Axis::Z].into_iter().map_while(at).collect();
        (!there.is_empty()).then_some(there)
    }

    /// Index of the channel of that name.
    pub fn named(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|channel| channel.name == name)
    }

    /// SI units per sample of this type in the channel at `place`; `None` outside the map.
    pub fn units(&self, place: usize, of: SampleType) -> Option<f64> {
        self.channels.get(place).map(|channel| of.units(channel))
    }

    /// The samples of the channel at `place` in SI units
    /// ([`jointrig_protocol::channel::Quantity::unit`]); empty for an index outside the map.
    pub fn to_si(&self, place: usize, samples: ChannelView<'_>) -> Vec<f64> {
        let mut si = Vec::new();
        self.si_into(place, samples, &mut si);
        si
    }

    /// As [`ChannelMap::to_si`]; `si` is emptied first, and its memory reused.
    pub fn si_into(&self, place: usize, samples: ChannelView<'_>, si: &mut Vec<f64>) {
        si.clear();
        if let Some(units) = self.units(place, samples.of()) {
            samples.scaled(units, si);
        }
    }

    /// SI value of a device's full scale of the channel at `place`, always positive; `None` outside
    /// the map.
    pub fn full_scale(&self, place: usize) -> Option<f64> {
        Some((self.channels.get(place)?.units_per_code() * 32_768.0).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::Quantity;

    fn channel(name: &str, role: Role, units_per_volt: f32) -> Channel {
        Channel {
            name: name.parse().expect("short"),
            role,
            quantity: Quantity::Velocity,
            units_per_volt,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        }
    }

    #[test]
    fn codes_become_si_units_with_the_polarity_of_the_scale() {
        let map = ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel("a", Role::HammerForce, 44.64),
                channel("b", Role::SpecimenA, -0.001),
                channel("c", Role::LoadCell, 1.0),
                channel("d", Role::LoadCell, 1.0),
            ],
        };
        assert_eq!(map.places(Role::LoadCell), [2, 3]);
        assert_eq!(map.place(Role::SpecimenB), None);
        assert_eq!(map.responses(), None);
        let value = map.to_si(1, ChannelView::I16(&[16_384]))[0];
        assert!((value + 0.005).abs() < 1e-9, "{value}");
        assert!((map.full_scale(1).expect("there") - 0.01).abs() < 1e-9);
        assert!(map.to_si(9, ChannelView::I16(&[1])).is_empty());
    }
}
