//! What is told while something is measured: what is going on between two records, the link, the stream's channels, the shaker's level. None of it
//! is in the campaign file, and all of it is gone when measuring ends.

use serde::Serialize;

use crate::device::channels::ChannelMap;

/// All of it, for a page that has just come.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Now {
    /// What is going on.
    pub state: Option<State>,
    /// Where the stream's scans went.
    pub link: Option<Link>,
    /// What is measured.
    pub stream: Option<StreamInfo>,
    /// How large it is.
    pub signals: Option<Signals>,
    /// The shaker's level.
    pub shaker: Option<Shaker>,
    /// Room for the campaign file.
    pub disk: Option<Disk>,
    /// Who answers for hammer and laser.
    pub control: Option<Control>,
}

/// What is going on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct State {
    /// In one word.
    pub what: Doing,
    /// Since when, ms since 1970.
    pub since_unix_ms: f64,
    /// How long it may last at most, s of the device.
    pub most_s: Option<f64>,
    /// The cell's id.
    pub cell: Option<i64>,
    /// Good hits that the cell has.
    pub kept: u32,
    /// The number of its next attempt.
    pub attempt: u32,
}

/// What may be going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Doing {
    /// A device moves hammer and laser.
    Moving,
    /// Somebody outside has to.
    MoveByHand,
    /// The structure comes to rest.
    Settling,
    /// A person is to strike.
    StrikeByHand,
    /// A hit's record comes in.
    Recording,
    /// It is looked at.
    Judging,
    /// The shaker is on its way to a level, or holds it.
    Shaking,
    /// The channels are shown, and nothing is struck.
    Watching,
    /// Nothing any more.
    Ended,
}

/// Where the stream's scans went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Link {
    /// Lost for good.
    pub lost_scans: u64,
    /// Sent again.
    pub recovered_scans: u64,
    /// Arrived at once.
    pub received_scans: u64,
}

/// What the stream consists of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamInfo {
    /// Whether the rig is simulated.
    pub simulated: bool,
    /// Scans per second, Hz.
    pub rate_hz: u32,
    /// The channels in the order of the scan.
    pub channels: Vec<ChannelInfo>,
}

/// A channel as a page needs it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelInfo {
    /// Its name.
    pub name: String,
    /// Its SI unit.
    pub unit: &'static str,
    /// SI units for each code.
    pub units_per_code: f64,
}

impl StreamInfo {
    /// Of these channels.
    pub fn of(channels: &ChannelMap, simulated: bool) -> Self {
        let channel = |channel: &jointrig_protocol::channel::Channel| ChannelInfo {
            name: channel.name.as_str().into(),
            unit: channel.quantity.unit(),
            units_per_code: channel.units_per_code(),
        };
        Self {
            simulated,
            rate_hz: channels.rate_hz,
            channels: channels.channels.iter().map(channel).collect(),
        }
    }
}

/// How large the signals are, channel by channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Signals {
    /// Rms about the mean over the last piece, SI.
    pub rms: Vec<f64>,
    /// The largest magnitude of a code over it, of 32768.
    pub peak_codes: Vec<u16>,
    /// When the channel was at the end of its range last, ms since 1970; none if it never was.
    pub overload_unix_ms: Vec<Option<f64>>,
    /// Pieces of the stream of which nothing arrived.
    pub holes: u64,
}

/// The shaker's level.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shaker {
    /// A number that each level has for itself: what came before belongs to another one.
    pub level: u64,
    /// In words.
    pub title: String,
    /// Its (first) frequency, Hz.
    pub frequency_hz: f64,
    /// What is held: `displacement`, `force` or `drive`.
    pub held: &'static str,
    /// The order, m, N or V.
    pub order: f64,
    /// The drive's largest amplitude, V.
    pub most_drive_v: f64,
    /// Whether it has settled.
    pub settled: bool,
    /// How it ended: whether it was recorded, and what is to be said; none while it is on its way.
    pub over: Option<(bool, String)>,
    /// Time (s of the device), amplitude of what is held (m or N; of a held drive, the relative displacement), drive (V): what is new.
    pub windows: Vec<[f64; 3]>,
    /// The last cycle: relative displacement, µm, and force, N.
    pub turn: Option<[Vec<f64>; 2]>,
    /// Channels that stop the shaker.
    pub limits: Vec<Limit>,
}

/// What stops the shaker.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// The channel's name.
    pub channel: String,
    /// Its unit.
    pub unit: &'static str,
    /// The magnitude that stops, SI.
    pub limit: f64,
    /// The largest magnitude of this level so far, SI.
    pub largest: f64,
}

impl Shaker {
    /// As it is after what is new: windows are added, the rest is replaced.
    pub fn take_in(&mut self, new: Shaker) {
        if new.level != self.level {
            *self = new;
            return;
        }
        let mut windows = std::mem::take(&mut self.windows);
        windows.extend_from_slice(&new.windows);
        let turn = new.turn.clone().or(self.turn.take());
        *self = Shaker { windows, turn, ..new };
    }
}

/// Room for the campaign file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Disk {
    /// Free bytes.
    pub free_bytes: u64,
}

/// Who answers for hammer and laser.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Control {
    /// The page that may answer, by the name that it gave itself.
    pub page: Option<String>,
}
