//! State that exists only while measuring: what is done between two records, the link, the stream's
//! channels, the shaker's level. It is not stored in the campaign file and is gone when measuring
//! ends.

use serde::Serialize;

use crate::device::channels::ChannelMap;

/// The whole of this state, for a page that has just connected.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Now {
    /// What the measuring process is doing.
    pub state: Option<State>,
    /// Scans received and lost.
    pub link: Option<Link>,
    /// The channels of the stream.
    pub stream: Option<StreamInfo>,
    /// Signal levels of the channels.
    pub signals: Option<Signals>,
    /// The shaker's level.
    pub shaker: Option<Shaker>,
    /// Free space for the campaign file.
    pub disk: Option<Disk>,
    /// Which page may answer the prompts to move hammer and laser.
    pub control: Option<Control>,
}

/// What the measuring process is doing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct State {
    /// The activity.
    pub what: Doing,
    /// Start of the activity, ms since 1970.
    pub since_unix_ms: f64,
    /// Longest duration, s of device time.
    pub most_s: Option<f64>,
    /// The cell's id.
    pub cell: Option<i64>,
    /// Good hits of the cell so far.
    pub kept: u32,
    /// The number of its next attempt.
    pub attempt: u32,
}

/// Activities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Doing {
    /// A device moves hammer and laser.
    Moving,
    /// Hammer and laser must be moved manually or by another program.
    MoveByHand,
    /// Waiting for the structure to come to rest.
    Settling,
    /// Waiting for a person to strike.
    StrikeByHand,
    /// A hit's record is being received.
    Recording,
    /// The record is being assessed.
    Judging,
    /// The shaker approaches a level or holds it.
    Shaking,
    /// The channels are shown without any excitation.
    Watching,
    /// Measuring has ended.
    Ended,
}

/// Scans received and lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Link {
    /// Lost for good.
    pub lost_scans: u64,
    /// Sent again.
    pub recovered_scans: u64,
    /// Arrived when first sent.
    pub received_scans: u64,
}

/// The channels of the stream.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamInfo {
    /// Whether the rig is simulated.
    pub simulated: bool,
    /// Scans per second, Hz.
    pub rate_hz: u32,
    /// The channels in the order of the scan.
    pub channels: Vec<ChannelInfo>,
}

/// What a page needs to know of a channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelInfo {
    /// Its name.
    pub name: String,
    /// Its SI unit.
    pub unit: &'static str,
    /// SI units per code.
    pub units_per_code: f64,
}

impl StreamInfo {
    /// Description of a stream with these channels.
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

/// Signal levels, for each channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Signals {
    /// RMS about the mean since the last report, SI.
    pub rms: Vec<f64>,
    /// Largest magnitude of a code since the last report, of 32768.
    pub peak_codes: Vec<u16>,
    /// Time at which the channel last reached the end of its range, ms since 1970; `None` if it
    /// never did.
    pub overload_unix_ms: Vec<Option<f64>>,
    /// Number of stretches of the stream of which nothing arrived.
    pub holes: u64,
}

/// The shaker's level.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shaker {
    /// Number of the level, different for each; older data belong to another level.
    pub level: u64,
    /// Its description.
    pub title: String,
    /// Its (first) frequency, Hz.
    pub frequency_hz: f64,
    /// The controlled quantity: `displacement`, `force` or `drive`.
    pub held: &'static str,
    /// The set point, m, N or V.
    pub order: f64,
    /// The drive's largest amplitude, V.
    pub most_drive_v: f64,
    /// Whether it has settled.
    pub settled: bool,
    /// How it ended: whether it was recorded, and a message; `None` while it runs.
    pub over: Option<(bool, String)>,
    /// New windows: time (s of the device), amplitude of the controlled quantity (m or N; with a
    /// controlled drive the relative displacement), drive (V).
    pub windows: Vec<[f64; 3]>,
    /// The last cycle: relative displacement, µm, and force, N.
    pub turn: Option<[Vec<f64>; 2]>,
    /// Channels whose limit stops the shaker.
    pub limits: Vec<Limit>,
}

/// A limit that stops the shaker.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// The channel's name.
    pub channel: String,
    /// Its unit.
    pub unit: &'static str,
    /// The magnitude at which the shaker stops, SI.
    pub limit: f64,
    /// Largest magnitude during this level so far, SI.
    pub largest: f64,
}

impl Shaker {
    /// Merges an update of the same level: windows are appended, the rest is replaced. Another
    /// level replaces everything.
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

/// Free space for the campaign file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Disk {
    /// Free bytes.
    pub free_bytes: u64,
}

/// Which page may answer the prompts to move hammer and laser.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Control {
    /// The name of that page, which the page chose itself.
    pub page: Option<String>,
}
