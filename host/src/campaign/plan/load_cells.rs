//! The load cells' measurement of the force along the sliding direction.

use jointrig_protocol::channel::Role;

use super::Plan;
use super::structure::{dot, unit};
use crate::device::channels::ChannelMap;

/// A load cell is left out if the cosine between its direction and the sliding direction is below
/// this.
const FEELS: f64 = 1e-3;

impl Plan {
    /// The load cells that measure along the sliding direction: index in the map, and the factor of
    /// its reading in their sum. A cell's direction is that of the plan's sensor of the same name
    /// (`LC1` is the channel `lc_1`), or the sliding direction if the plan has none.
    pub fn load_cells(&self, map: &ChannelMap) -> Vec<(usize, f64)> {
        let places = map.places(Role::LoadCell).into_iter();
        places
            .map(|place| (place, self.sliding_part(&map.channels[place].name)))
            .filter(|(_, part)| part.abs() > FEELS)
            .collect()
    }

    /// Cosine between the measurement direction of this channel's sensor and the sliding direction;
    /// 1 for a channel that the plan does not name.
    fn sliding_part(&self, channel: &str) -> f64 {
        let named = |name: &str| letters(name).eq(letters(channel));
        let mut sensors = self.geometry.sensor.iter().map(toml::Spanned::get_ref);
        let own = sensors.find(|sensor| named(&sensor.name));
        own.map_or(1.0, |sensor| dot(unit(sensor.direction), unit(self.sliding())))
    }
}

/// Letters and digits of a name, in lower case.
fn letters(name: &str) -> impl Iterator<Item = char> {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::CONTACT;
    use jointrig_protocol::channel::{Channel, Quantity};

    fn map() -> ChannelMap {
        let channel = |name: &str| Channel {
            name: name.parse().expect("a short name"),
            role: Role::LoadCell,
            quantity: Quantity::Force,
            units_per_volt: 1.0,
            range_v: 10.0,
            bits: 16,
            delay_ns: 0,
        };
        let channels = ["lc_1", "lc_2", "lc_3", "lc_4"].map(channel).to_vec();
        ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels }
    }

    #[test]
    fn each_cell_adds_what_it_feels_along_the_sliding_direction() {
        let plan = |old: &str, new: &str| {
            assert!(CONTACT.contains(old), "{old}");
            Plan::parse(&CONTACT.replace(old, new), "plan.toml").expect("a plan")
        };
        let cells = plan("LC1", "LC1").load_cells(&map());
        // the fourth is not in the plan
        assert_eq!(cells, [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)]);
        let lc1 = "{ name = \"LC1\", position_m = [-0.035, -0.015, -0.15], direction = [0, 0, 1] }";
        let turned = plan(lc1, &lc1.replace("[0, 0, 1]", "[0, 0, -1]"));
        assert_eq!(turned.load_cells(&map())[0], (0, -1.0));
        let inclined = plan(lc1, &lc1.replace("[0, 0, 1]", "[0, 0.6, 0.8]"));
        assert!((inclined.load_cells(&map())[0].1 - 0.8).abs() < 1e-12);
        let across = plan(lc1, &lc1.replace("[0, 0, 1]", "[0, 1, 0]"));
        assert_eq!(across.load_cells(&map()).iter().map(|cell| cell.0).collect::<Vec<_>>(), [1, 2, 3]);
    }
}
