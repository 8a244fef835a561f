//! Channels of a response: those of the vibrometer, which moves from point to point, or those of a
//! fixed sensor.

use std::collections::HashSet;

use super::{Cell, Plan, ResponsePoint, configuration_name};
use crate::device::channels::ChannelMap;

impl Plan {
    /// The response point with that name.
    pub fn response(&self, name: &str) -> Option<&ResponsePoint> {
        self.geometry.response.iter().map(toml::Spanned::get_ref).find(|point| point.name == name)
    }

    /// Total number of good hits wanted: a hit that fills a row of cells counts once.
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

    /// Names of the channels of the fixed sensor at this response point; `None` if the vibrometer
    /// measures it.
    pub fn own_channels(&self, response: &str) -> Option<&[String]> {
        self.response(response)?.channels.as_deref()
    }

    /// The point of the fixed sensor with this channel, and the channel's measurement direction;
    /// `None` for the vibrometer's channels.
    pub fn sensor_on(&self, channel: &str) -> Option<(&ResponsePoint, [f64; 3])> {
        self.geometry.response.iter().map(toml::Spanned::get_ref).find_map(|point| {
            let place = point.channels.as_ref()?.iter().position(|name| name == channel)?;
            point.axes().get(place).map(|(_, direction)| (point, *direction))
        })
    }

    /// Indices in `map` of the channels of the fixed sensor at this response point, in the order of
    /// its axes; `None` if there is no such sensor or one of its channels is missing.
    pub fn own_places(&self, response: &str, map: &ChannelMap) -> Option<Vec<usize>> {
        self.own_channels(response)?.iter().map(|name| map.named(name)).collect()
    }

    /// Indices in `map` of the channels that measure this response point in a record of its own
    /// cell: those of its fixed sensor, or the vibrometer's. An imported record holds only the
    /// point's signals, with arbitrary names.
    pub fn response_places(&self, response: &str, map: &ChannelMap) -> Option<Vec<usize>> {
        self.own_places(response, map).or_else(|| map.responses())
    }
}
