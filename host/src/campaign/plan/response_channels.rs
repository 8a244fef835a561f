//! On which channels a response is: the vibrometer's, which goes from point to point, or those of a sensor that stays where it is.

use std::collections::HashSet;

use super::{Cell, Plan, ResponsePoint, configuration_name};
use crate::device::channels::ChannelMap;

impl Plan {
    /// The response point of that name.
    pub fn response(&self, name: &str) -> Option<&ResponsePoint> {
        self.geometry.response.iter().map(toml::Spanned::get_ref).find(|point| point.name == name)
    }

    /// Good hits wanted in all: one that fills a row of cells counts once.
    pub fn hits_wanted(&self) -> u32 {
        let mut rows = HashSet::new();
        let mut struck = |cell: &Cell| {
            let row = (configuration_name(cell.configuration), cell.impact.clone());
            self.own_channels(&cell.response).is_none() || rows.insert(row)
        };
        self.cells().iter().filter(|cell| struck(cell)).map(|cell| cell.wanted).sum()
    }

    /// Whether a configuration has this response.
    pub fn is_measured(&self, response: &str) -> bool {
        self.configuration.iter().flat_map(|block| &block.responses).any(|name| name.get_ref() == response)
    }

    /// Names of the channels of the sensor that stays at this response point; none where the vibrometer comes to it.
    pub fn own_channels(&self, response: &str) -> Option<&[String]> {
        self.response(response)?.channels.as_deref()
    }

    /// The point where the sensor with this channel stays, and what the channel feels there; none for the vibrometer's channels.
    pub fn sensor_on(&self, channel: &str) -> Option<(&ResponsePoint, [f64; 3])> {
        self.geometry.response.iter().map(toml::Spanned::get_ref).find_map(|point| {
            let place = point.channels.as_ref()?.iter().position(|name| name == channel)?;
            point.axes().get(place).map(|(_, direction)| (point, *direction))
        })
    }

    /// Places in `map` of the sensor that stays at this response point, in the order of its axes; none without one, or where a channel of
    /// it is missing.
    pub fn own_places(&self, response: &str, map: &ChannelMap) -> Option<Vec<usize>> {
        self.own_channels(response)?.iter().map(|name| map.named(name)).collect()
    }

    /// Places in `map` of what measures at this response point in a record of its own cell: its own sensor's, or the vibrometer's. A
    /// record from elsewhere holds the point's signals alone, by whatever names.
    pub fn response_places(&self, response: &str, map: &ChannelMap) -> Option<Vec<usize>> {
        self.own_places(response, map).or_else(|| map.responses())
    }
}
