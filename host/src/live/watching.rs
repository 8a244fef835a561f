//! Follows what happens between two records, without blocking the measuring thread and without
//! unbounded memory.
//!
//! The measuring thread reports to a [`Watcher`]. Its reports go into a queue of fixed size; when
//! it is full, the newest report is dropped, and the state is correct again with the next one. The
//! cycles of a level go into a single buffer, in which new ones replace cycles that were not read.
//! A separate thread ([`Watching`]) takes them from there, reads the stream through the tap, and
//! sends both to the pages, with the shaker's current loop: the last received cycle, unprocessed.
//! It is for display only; results are computed from stored data.

use super::bus::Bus;
use super::frames::Frames;
use super::message::Message;
use super::now::{Disk, Doing, Limit, Link, Shaker, Signals, State, StreamInfo};
use crate::campaign::plan::level::Level;
use crate::campaign::run::shaking::record;
use crate::campaign::watch::{Seen, Watch};
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, ChannelView, SampleType, Samples};
use crate::device::stream::Accounts;
use crate::device::tap::{Envelope, NOTHING, View};
use crate::hysteresis::RelativeMotion;
use crate::hysteresis::cycles::closed_cycle;
use jointrig_protocol::channel::Channel;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Time between two frames: 30 frames per second.
const FRAME: Duration = Duration::from_millis(33);

/// The stream is read only every this many frames while no page shows it.
const SELDOM: u32 = 15;

/// Time between two reports of the signal levels.
const SIGNALS: Duration = Duration::from_millis(500);

/// Time between two checks of the free disk space.
const DISK: Duration = Duration::from_secs(10);

/// The thread's inputs and outputs.
pub struct Watching {
    /// Reports of the measuring thread.
    pub watch_queue: WatchQueue,
    /// The stream.
    pub view: View,
    /// Receives the messages.
    pub bus: Arc<Bus>,
    /// Receives the frames of the stream.
    pub frames: Arc<Frames>,
    /// The campaign file, whose free disk space is reported.
    pub file: Option<PathBuf>,
}

/// State collected so far.
#[derive(Default)]
struct Known {
    channels: Option<Arc<ChannelMap>>,
    level: Option<Level>,
    load_cells: Vec<(usize, f64)>,
    shaker: Option<Shaker>,
    levels: u64,
    signals: LevelSums,
    cycles: Vec<i32>,
}

impl Watching {
    /// Sends reports until `stop`.
    pub fn watch(mut self, stop: &AtomicBool) {
        let mut known = Known { cycles: room(), ..Known::default() };
        let (mut tick, mut signals, mut disk) = (0_u32, Instant::now(), None::<Instant>);
        loop {
            std::thread::sleep(FRAME);
            // reports made before `stop` was set are still sent
            let last = stop.load(Ordering::Relaxed);
            self.hear(&mut known);
            if last {
                return;
            }
            tick += 1;
            if self.frames.looked_at() || tick.is_multiple_of(SELDOM) {
                // a stream delivers a stretch every millisecond; without a stream, do not wait
                let patience = if known.channels.is_some() { FRAME } else { Duration::ZERO };
                if let Some(envelope) = self.view.next(patience) {
                    known.signals.add(envelope);
                    if self.frames.looked_at() {
                        self.frames.push(envelope, unix_ms());
                    }
                }
            }
            if signals.elapsed() >= SIGNALS {
                signals = Instant::now();
                let told = known.channels.as_ref().and_then(|channels| known.signals.told(channels));
                if let Some(told) = told {
                    self.bus.say(Message::Signals(told));
                }
            }
            if disk.is_none_or(|before| before.elapsed() >= DISK) {
                disk = Some(Instant::now());
                let free = self.file.as_deref().and_then(free_bytes);
                if let Some(free_bytes) = free {
                    self.bus.say(Message::Disk(Disk { free_bytes }));
                }
            }
        }
    }

    /// Sends the queued reports; of those that replace one another, only the last.
    fn hear(&self, known: &mut Known) {
        let (mut state, mut link) = (None, None);
        let mut shaker = false;
        for told in self.watch_queue.queue.try_iter() {
            let mut now = |what, most_s, at: Option<(i64, u32, u32)>| {
                let (cell, kept, attempt) = at.map_or((None, 0, 0), |(cell, kept, n)| (Some(cell), kept, n));
                state = Some(State { what, since_unix_ms: unix_ms(), most_s, cell, kept, attempt });
            };
            match told {
                WatchReport::Stream(channels, simulated) => {
                    self.bus.say(Message::Stream(StreamInfo::of(&channels, simulated)));
                    known.signals = LevelSums::of(channels.len());
                    known.channels = Some(channels);
                    now(Doing::Watching, None, None);
                }
                WatchReport::Moving { cell, kept, attempt, by_hand } => {
                    let what = if by_hand { Doing::MoveByHand } else { Doing::Moving };
                    now(what, None, Some((cell, kept, attempt)));
                }
                WatchReport::Settling { cell, kept, attempt, most_s, by_hand } => {
                    let what = if by_hand { Doing::StrikeByHand } else { Doing::Settling };
                    now(what, Some(most_s), Some((cell, kept, attempt)));
                }
                // the cell is that of the previous state
                WatchReport::Recording | WatchReport::Judging => {
                    let what =
                        if matches!(told, WatchReport::Judging) { Doing::Judging } else { Doing::Recording };
                    let before = state.take().or_else(|| self.bus.state());
                    state =
                        before.map(|before| State { what, since_unix_ms: unix_ms(), most_s: None, ..before });
                }
                WatchReport::Link(accounts) => {
                    link = Some(Link {
                        lost_scans: accounts.lost,
                        recovered_scans: accounts.recovered,
                        received_scans: accounts.received,
                    });
                }
                WatchReport::Level { level, limits, most_drive_v, load_cells } => {
                    known.load_cells = load_cells;
                    known.begin(level, &limits, most_drive_v);
                    now(Doing::Shaking, None, None);
                    shaker = true;
                }
                WatchReport::Window(window, settled) => {
                    if let Some(own) = &mut known.shaker {
                        own.windows.push(window);
                        own.settled = settled;
                        shaker = true;
                    }
                }
                WatchReport::LevelOver(recorded, say) => {
                    if let Some(own) = &mut known.shaker {
                        own.over = Some((recorded, say));
                        shaker = true;
                    }
                }
                WatchReport::Ended => now(Doing::Ended, None, None),
            }
        }
        if self.watch_queue.cycles(&mut known.cycles) {
            known.turn();
            shaker = true;
        }
        if shaker && let Some(own) = &mut known.shaker {
            self.bus.say(Message::Shaker(Box::new(own.clone())));
            // data that were sent are not sent again
            own.windows.clear();
            own.turn = None;
        }
        if let Some(state) = state {
            self.bus.say(Message::State(state));
        }
        if let Some(link) = link {
            self.bus.say(Message::Link(link));
        }
    }
}

impl Known {
    fn begin(&mut self, level: Level, limits: &[f64], most_drive_v: f64) {
        self.levels += 1;
        let channels = self.channels.iter().flat_map(|map| &map.channels).zip(limits);
        self.level = Some(level);
        self.shaker = Some(Shaker {
            level: self.levels,
            title: level.to_string(),
            frequency_hz: level.frequency_hz,
            held: level.held.name(),
            order: level.amplitude,
            most_drive_v,
            settled: false,
            over: None,
            windows: Vec::new(),
            turn: None,
            limits: channels
                .filter(|(_, limit)| **limit > 0.0)
                .map(|(channel, limit)| Limit {
                    channel: channel.name.as_str().into(),
                    unit: channel.quantity.unit(),
                    limit: *limit,
                    largest: 0.0,
                })
                .collect(),
        });
    }

    /// Updates loop and limits from the newest cycles.
    fn turn(&mut self) {
        let (Some(channels), Some(level), Some(shaker)) = (&self.channels, &self.level, &mut self.shaker)
        else {
            return;
        };
        shaker.turn = turn(channels, &self.load_cells, &self.cycles, level).or(shaker.turn.take());
        for limit in &mut shaker.limits {
            let Some(place) = channels.channels.iter().position(|own| own.name.as_str() == limit.channel)
            else {
                continue;
            };
            let scans = self.cycles.len() / channels.len();
            let codes = self.cycles[place * scans..][..scans].iter();
            let most = codes.map(|code| code.unsigned_abs()).max().unwrap_or(0);
            let channel = &channels.channels[place];
            let si = f64::from(most) * code_type(channel).units(channel).abs();
            limit.largest = limit.largest.max(si);
        }
    }
}

/// Signal levels since the last report.
#[derive(Default)]
struct LevelSums {
    arrived: u64,
    both: Vec<(i64, u64)>,
    peaks: Vec<u16>,
    overloads: Vec<Option<f64>>,
    holes: u64,
}

impl LevelSums {
    fn of(channels: usize) -> Self {
        Self {
            both: vec![(0, 0); channels],
            peaks: vec![0; channels],
            overloads: vec![None; channels],
            ..Self::default()
        }
    }

    fn add(&mut self, envelope: &Envelope) {
        if envelope.channels != self.both.len() {
            return;
        }
        self.arrived += envelope.arrived;
        for (channel, own) in self.both.iter_mut().enumerate() {
            let (sum, squares) = envelope.sums(channel);
            *own = (own.0 + sum, own.1 + squares);
        }
        let now = unix_ms();
        for stretch in envelope.ends().chunks_exact(envelope.channels) {
            self.holes += u64::from(stretch.iter().all(|ends| *ends == NOTHING));
            for (channel, [least, most]) in stretch.iter().enumerate() {
                if least > most {
                    continue;
                }
                let peak = least.unsigned_abs().max(most.unsigned_abs());
                self.peaks[channel] = self.peaks[channel].max(peak);
                if *least == i16::MIN || *most == i16::MAX {
                    self.overloads[channel] = Some(now);
                }
            }
        }
    }

    /// The levels to report, after which the sums are reset; `None` if nothing arrived.
    fn told(&mut self, channels: &ChannelMap) -> Option<Signals> {
        if self.arrived == 0 || channels.len() != self.both.len() {
            return None;
        }
        let n = self.arrived as f64;
        let rms = |((sum, squares), channel): (&(i64, u64), &jointrig_protocol::channel::Channel)| {
            let mean = *sum as f64 / n;
            (*squares as f64 / n - mean * mean).max(0.0).sqrt() * channel.units_per_code().abs()
        };
        let told = Signals {
            rms: self.both.iter().zip(&channels.channels).map(rms).collect(),
            peak_codes: self.peaks.clone(),
            overload_unix_ms: self.overloads.clone(),
            holes: self.holes,
        };
        self.arrived = 0;
        self.both.fill((0, 0));
        self.peaks.fill(0);
        Some(told)
    }
}

/// The current time, ms since 1970.
fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64() * 1e3)
}

/// Free bytes on the file's disk; `None` where the system does not report them.
pub(crate) fn free_bytes(file: &std::path::Path) -> Option<u64> {
    fs4::available_space(file).ok()
}

/// The type of a device's samples of this channel.
fn code_type(channel: &Channel) -> SampleType {
    if channel.is_wide() { SampleType::I32 } else { SampleType::I16 }
}

/// Most points of a loop on the screen.
const POINTS: usize = 180;

/// Relative displacement (µm) and force (N) over the last whole cycle in these codes (one
/// channel after another); `None` where a channel or a cycle is missing, or during a sweep.
pub fn turn(
    channels: &ChannelMap,
    load_cells: &[(usize, f64)],
    codes: &[i32],
    level: &Level,
) -> Option<[Vec<f64>; 2]> {
    let count = channels.len();
    let cycle = (f64::from(channels.rate_hz) / level.frequency_hz).round() as usize;
    let scans = codes.len().checked_div(count)?;
    // the alignment of the channels in time makes both ends of the record invalid
    let spare = cycle / 8;
    if level.end_hz.is_some() || cycle < 8 || scans < cycle + 2 * spare {
        return None;
    }
    let from = scans - cycle - 2 * spare;
    let last = codes.chunks_exact(scans).zip(&channels.channels).map(|(own, channel)| {
        let own = &own[from..];
        match code_type(channel) {
            SampleType::I32 => ChannelSamples::I32(own.to_vec()),
            _ => ChannelSamples::I16(own.iter().map(|code| *code as i16).collect()),
        }
    });
    let samples = Samples::new(last.collect())?;
    let record = record(channels, load_cells, &samples, level).ok()?;
    let RelativeMotion::Velocity { a_m_per_s, b_m_per_s } = &record.motion else { return None };
    let length = a_m_per_s.len().min(b_m_per_s.len()).min(record.force_n.len());
    let from = length.checked_sub(cycle + spare)?;
    let within = from..from + cycle;
    let apart = a_m_per_s[within.clone()].iter().zip(&b_m_per_s[within.clone()]);
    let velocity: Vec<f64> = apart.map(|(a, b)| a - b).collect();
    let mut x = Vec::new();
    closed_cycle(&velocity, 1.0 / record.fs_hz, &mut x);
    let force = &record.force_n[within];
    let mean = force.iter().sum::<f64>() / cycle as f64;
    let step = cycle.div_ceil(POINTS);
    // repeats the first point, which closes the loop
    let closed = |values: &[f64], of: &dyn Fn(f64) -> f64| -> Vec<f64> {
        values.iter().step_by(step).chain(values.first()).map(|value| of(*value)).collect()
    };
    Some([closed(&x, &|x| 1e6 * x), closed(force, &|force| force - mean)])
}

/// Length of the queue of reports.
const QUEUE: usize = 256;

/// Most codes kept of a level's cycles: at least a quarter of a second of sixteen channels.
const MOST_CODES: usize = 1 << 18;

/// One report.
#[derive(Clone, Debug)]
pub enum WatchReport {
    /// A stream with these channels began; the flag is true for a simulated rig.
    Stream(Arc<ChannelMap>, bool),
    /// Hammer and laser move to a cell.
    Moving {
        /// The cell.
        cell: i64,
        /// Good hits of the cell so far.
        kept: u32,
        /// The number of its next attempt.
        attempt: u32,
        /// Whether they are moved manually or by another program instead of by the device.
        by_hand: bool,
    },
    /// A shot waits for the structure to come to rest.
    Settling {
        /// The cell.
        cell: i64,
        /// Good hits of the cell so far.
        kept: u32,
        /// The number of its next attempt.
        attempt: u32,
        /// Longest wait, s of device time.
        most_s: f64,
        /// Whether a person strikes.
        by_hand: bool,
    },
    /// A record is being received.
    Recording,
    /// The record is being assessed.
    Judging,
    /// Scans received and lost.
    Link(Accounts),
    /// A level of the shaker begins.
    Level {
        /// The level.
        level: Level,
        /// Limit of each channel that stops the shaker, SI; 0 where there is none.
        limits: Vec<f64>,
        /// Largest amplitude of the drive, V.
        most_drive_v: f64,
        /// The load cells whose sum is T: index in the scan, and factor.
        load_cells: Vec<(usize, f64)>,
    },
    /// A window of the level: time (s), amplitude, drive (V), and whether the level has settled.
    Window([f64; 3], bool),
    /// The level is over: whether it was recorded, and a message.
    LevelOver(bool, String),
    /// Measuring has ended.
    Ended,
}

/// The newest cycles of a level.
#[derive(Debug, Default)]
pub struct Cycles {
    /// Codes of 16 bits or wide ones, one channel after another.
    pub codes: Vec<i32>,
    /// Whether they have not been read yet.
    pub fresh: bool,
}

/// The sending end, used by the measuring thread.
pub struct Watcher {
    queue: SyncSender<WatchReport>,
    cycles: Arc<Mutex<Cycles>>,
}

/// The receiving end.
pub struct WatchQueue {
    /// The reports.
    pub queue: Receiver<WatchReport>,
    cycles: Arc<Mutex<Cycles>>,
}

/// Creates both ends.
pub fn watcher() -> (Watcher, WatchQueue) {
    let (to, from) = sync_channel(QUEUE);
    let cycles = Arc::new(Mutex::new(Cycles { codes: room(), fresh: false }));
    (Watcher { queue: to, cycles: cycles.clone() }, WatchQueue { queue: from, cycles })
}

/// A buffer for the cycles, allocated in advance so that the measuring thread never allocates.
pub fn room() -> Vec<i32> {
    Vec::with_capacity(MOST_CODES)
}

impl WatchQueue {
    /// Swaps the newest cycles with `own` if they have not been read yet; `own` should come from
    /// [`room`].
    pub fn cycles(&self, own: &mut Vec<i32>) -> bool {
        let mut cycles = self.cycles.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = std::mem::take(&mut cycles.fresh);
        if fresh {
            std::mem::swap(own, &mut cycles.codes);
        }
        fresh
    }
}

impl Watcher {
    fn tell(&self, told: WatchReport) {
        // if the queue is full, a later report updates the page
        let _ = self.queue.try_send(told);
    }

    fn keep(&self, samples: &Samples) {
        let mut cycles = match self.cycles.try_lock() {
            Ok(cycles) => cycles,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        cycles.codes.clear();
        // the buffer never grows: of a longer window the last scans are kept
        let kept = samples.scans().min(MOST_CODES / samples.channels().max(1));
        for place in 0..samples.channels() {
            match samples.channel(place) {
                ChannelView::I16(own) => {
                    cycles.codes.extend(own[own.len() - kept..].iter().copied().map(i32::from));
                }
                ChannelView::I32(own) => cycles.codes.extend_from_slice(&own[own.len() - kept..]),
                // a device delivers codes only
                ChannelView::F32(_) | ChannelView::F64(_) => {}
            }
        }
        cycles.fresh = true;
    }
}

impl Watch for Watcher {
    fn saw(&self, seen: &Seen<'_>) {
        match *seen {
            Seen::Stream { channels, simulated } => {
                self.tell(WatchReport::Stream(Arc::new(channels.clone()), simulated));
            }
            Seen::Moving { row, standing, by_hand, .. } => self.tell(WatchReport::Moving {
                cell: row.id,
                kept: standing.kept,
                attempt: standing.attempts,
                by_hand,
            }),
            Seen::Settling { row, standing, most_s, by_hand } => self.tell(WatchReport::Settling {
                cell: row.id,
                kept: standing.kept,
                attempt: standing.attempts,
                most_s,
                by_hand,
            }),
            Seen::Recording => self.tell(WatchReport::Recording),
            Seen::Judging => self.tell(WatchReport::Judging),
            Seen::Link(accounts) => self.tell(WatchReport::Link(accounts)),
            Seen::Level { level, limits, most_drive_v, load_cells } => {
                let (limits, load_cells) = (limits.to_vec(), load_cells.to_vec());
                self.tell(WatchReport::Level { level: *level, limits, most_drive_v, load_cells });
            }
            Seen::Shaking(shaking) => {
                self.keep(shaking.samples);
                self.tell(WatchReport::Window(
                    [shaking.at_s, shaking.amplitude, shaking.drive_v],
                    shaking.settled,
                ));
            }
            Seen::LevelOver { recorded, say } => self.tell(WatchReport::LevelOver(recorded, say.into())),
            Seen::Ended => self.tell(WatchReport::Ended),
            // the campaign file contains the rest
            Seen::Begun { .. } | Seen::Moved | Seen::Judged { .. } | Seen::Remark(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::level::Held;
    use jointrig_protocol::channel::{Channel, Quantity, Role};
    use std::f64::consts::TAU;

    #[test]
    fn an_ellipse_comes_out_with_its_axes() {
        let channel = |role, quantity, units_per_volt| Channel {
            name: "c".parse().expect("short"),
            role,
            quantity,
            units_per_volt,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        let channels = ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel(Role::SpecimenA, Quantity::Velocity, 1e-3),
                channel(Role::SpecimenB, Quantity::Velocity, 1e-3),
                channel(Role::LoadCell, Quantity::Force, 10.0),
            ],
        };
        // x_A − x_B = 2 µm sin ωt, F = 30 N sin ωt + 5 N cos ωt plus a constant 3 N
        let level = Level { frequency_hz: 100.0, end_hz: None, held: Held::Displacement, amplitude: 2e-6 };
        let omega = TAU * 100.0;
        let code =
            |place: usize, value: f64| (value / channels.channels[place].units_per_code()).round() as i32;
        let codes = |scans: i32| -> Vec<i32> {
            let of = |place: usize| {
                (0..scans).map(move |scan| {
                    let (sin, cos) = (omega * f64::from(scan) / 51_200.0).sin_cos();
                    [1.5e-6 * omega * cos, -0.5e-6 * omega * cos, 3.0 + 30.0 * sin + 5.0 * cos][place]
                })
            };
            (0..3).flat_map(|place| of(place).map(move |value| code(place, value))).collect()
        };
        let (few, codes) = (codes(512), codes(5_120));
        let [x, force] = turn(&channels, &[(2, 1.0)], &codes, &level).expect("whole cycles");
        assert_eq!(x.len(), force.len());
        let most = |all: &[f64]| all.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!((most(&x) - 2.0).abs() < 0.02, "{}", most(&x));
        assert!((most(&force) - 30_f64.hypot(5.0)).abs() < 0.1, "{}", most(&force));
        // at the largest x the force is the elastic part, at zero x the dissipative one
        let middle = x.iter().zip(&force).min_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).expect("points");
        assert!((middle.1.abs() - 5.0).abs() < 1.5, "{middle:?}");
        assert_eq!(turn(&channels, &[(2, 1.0)], &few, &level), None, "not a cycle and its ends");
        assert_eq!(turn(&channels, &[(2, 1.0)], &codes, &Level { end_hz: Some(200.0), ..level }), None);
    }
}
