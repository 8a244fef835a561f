//! A wear run: the device holds one amplitude while every cycle is reduced and stored.
//!
//! The shaker is ordered, limited and brought to rest as for a level; what is promised about its
//! motion is the same. The run differs in what is read:
//!
//! - From the order until the shaker rests, the stream is cut into cycles of equal length. At both
//!   ends, cycles whose amplitude is below a hundredth of the ordered one do not count; all between
//!   them do, also while the amplitude rises and falls.
//! - Once a second of the device's clock, the cycles since the last block are reduced and committed
//!   as a block ([`crate::campaign::store::wear_table`]). A cycle exists when its block is
//!   committed: what a killed process had not committed was not counted, and is not in the file.
//! - A run that is started again continues the numbers and the energy of the file. On a simulated
//!   rig the contact must be given that energy when it is opened
//!   ([`crate::device::address::Address::open_worn`]).
//! - Raw loops are kept of ten cycles in each decade, and of the first and last cycle of a run and
//!   of those around a sudden change.
//!
//! Memory does not grow: two blocks of samples are held.

use super::error::{ShakeError, Shortfall};
use super::order::Orders;
use super::{Begun, Bench, ChannelLimits, LevelOptions, Onlookers, begin, clipped, record};
use crate::campaign::plan::WearPlan;
use crate::campaign::plan::level::{Held, Level, Moment};
use crate::campaign::store::Store;
use crate::campaign::store::wear_table::{NewWearBlock, NewWearLoop, WearCycle, WearTotal};
use crate::campaign::watch::{Seen, Shaking};
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::session::Session;
use crate::hysteresis::wear::{CycleReading, each};
use jointrig_protocol::request::Shake;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Length of a block, s of the device's clock; a block has at least one cycle.
const BLOCK_S: f64 = 1.0;

/// A cycle at either end of a run counts from this fraction of the ordered amplitude on.
const MOVES: f64 = 0.01;

/// The amplitude is reached within this fraction; limits and changes are checked from then on.
const REACHED: f64 = 0.03;

/// A cycle whose stiffness or friction differs from the running mean by more than this fraction is
/// a sudden change.
const SUDDEN: f64 = 0.15;

/// Weight of a new cycle in the running mean.
const MEAN_WEIGHT: f64 = 0.02;

/// Most sudden changes in one run whose loops are kept.
const MOST_CHANGES: u32 = 100;

/// Raw loops kept of each decade of cycles.
const LOOPS_PER_DECADE: f64 = 10.0;

/// How a wear run is driven and when it ends.
#[derive(Clone, Debug)]
pub struct WearOptions {
    /// What is ordered, and the limits.
    pub run: WearPlan,
    /// The stated normal load, N; it counts if the run names no channels for it.
    pub normal_load_n: Option<f64>,
    /// The drive's largest amplitude, V; its full scale if absent.
    pub most_drive_v: Option<f64>,
    /// Limits that stop the shaker.
    pub limits: ChannelLimits,
    /// Continue even if device or rig indicate another structure than that of the file's records.
    pub new_structure: bool,
    /// Set to bring the shaker to rest and end the run.
    pub stop: Arc<AtomicBool>,
}

/// Why a run has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum WearEnd {
    /// All cycles have been made.
    Cycles,
    /// The energy has been dissipated.
    Energy,
    /// The coefficient of friction, this value over a block, has left its limits.
    Friction(f64),
    /// A cycle had this amplitude, m.
    Amplitude(f64),
    /// The specimen has this temperature, °C.
    Temperature(f64),
    /// The user ended it.
    Interrupted,
}

impl WearEnd {
    /// Its name in JSON.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Cycles => "cycles",
            Self::Energy => "energy",
            Self::Friction(_) => "friction",
            Self::Amplitude(_) => "amplitude",
            Self::Temperature(_) => "temperature",
            Self::Interrupted => "interrupted",
        }
    }
}

impl fmt::Display for WearEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cycles => f.write_str("all cycles are made"),
            Self::Energy => f.write_str("the energy is dissipated"),
            Self::Friction(mu) => write!(f, "the coefficient of friction is {mu:.3}, beyond its limits"),
            Self::Amplitude(m) => write!(f, "a cycle had an amplitude of {:.3} µm, over its limit", 1e6 * m),
            Self::Temperature(c) => write!(f, "the specimen is at {c:.1} °C, over its limit"),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct WearSummary {
    /// What was in the file before.
    pub before: WearTotal,
    /// What is in it now.
    pub after: WearTotal,
    /// Why it has ended.
    pub end: WearEnd,
    /// Cycles of this run of which samples were lost or at an end of a channel's range.
    pub unmeasured: u64,
}

/// State of a run after a block, for a display.
#[derive(Clone, Copy, Debug)]
pub struct WearState {
    /// What is in the file.
    pub total: WearTotal,
    /// Means over the block: stiffness (N/m), μN (N), amplitude (m); `None` where no cycle has one.
    pub stiffness_n_per_m: Option<f64>,
    /// μN, N.
    pub friction_n: Option<f64>,
    /// Amplitude, m.
    pub amplitude_m: Option<f64>,
}

/// Why a run cannot be started, or was stopped.
#[derive(Debug, thiserror::Error)]
pub enum WearError {
    /// As for a level.
    #[error(transparent)]
    Shake(#[from] ShakeError),
    /// The shaker cannot hold the amplitude, or was stopped.
    #[error(
        "the shaker stopped in the wear run: {why}\nall {cycles} cycles up to then are in the file; run the same command again to go on"
    )]
    Stopped {
        /// The cause, and what to do.
        why: String,
        /// Cycles in the file.
        cycles: u64,
    },
}

macro_rules! through_shake {
    ($($from:ty),+) => {
        $(impl From<$from> for WearError {
            fn from(error: $from) -> Self {
                Self::Shake(error.into())
            }
        })+
    };
}
through_shake!(crate::campaign::store::error::StoreError, crate::device::error::DeviceError);

/// Runs until a limit is reached, the user interrupts, or the shaker stops. `tell` is called after
/// each block.
///
/// # Errors
/// File or device failed, the device does not fit, or the shaker stopped; every committed block is
/// in the file.
pub fn run(
    store: &mut Store,
    session: &mut Session,
    options: &WearOptions,
    onlookers: &Onlookers,
    tell: &mut dyn FnMut(&WearState),
) -> Result<WearSummary, WearError> {
    let before = store.wear_total()?;
    let level = Level {
        frequency_hz: options.run.frequency_hz,
        end_hz: None,
        held: Held::Displacement,
        amplitude: options.run.amplitude_m,
    };
    let levels = LevelOptions {
        levels: vec![level],
        moment: Moment::After,
        seconds: 1.0,
        sweep_hz_per_s: 1.0,
        most_drive_v: options.most_drive_v,
        limits: options.limits.clone(),
        new_structure: options.new_structure,
        stop: options.stop.clone(),
    };
    if let Some(end) = over(&options.run, &before) {
        return Ok(WearSummary { before, after: before, end, unmeasured: 0 });
    }
    if options.run.temperature_c.is_some() && session.temperature_c()?.is_none() {
        return Err(unfit(
            session,
            "it measures no temperature, which the run has a limit for (wear.temperature_c)",
        ));
    }
    let Begun { plan, info, channels, session_id, epoch } = begin(store, session, &levels, onlookers)?;
    let load = NormalLoad::new(&channels, &options.run.normal_load, options.normal_load_n)
        .map_err(|what| unfit(session, &what))?;
    let load_cells = plan.load_cells(&channels);
    let bench = Bench {
        session,
        channels: &channels,
        load_cells,
        info: &info,
        options: &levels,
        onlookers,
        session_id,
        epoch,
    };
    let step = Shake::step_of(level.frequency_hz, channels.rate_hz);
    // the device's sine advances by `step` in units of 2⁻³² turn per scan
    let period = 2f64.powi(32) / f64::from(step);
    let late = channels.channels.iter().map(|channel| channel.delay_ns).max().unwrap_or(0);
    let mut run = Run {
        bench,
        store,
        options,
        level,
        load,
        period,
        after: (f64::from(late) * 1e-9 * channels.fs_hz()).ceil() as u64 + AFTER,
        begin: 0.0,
        total: before,
        counts: false,
        reached: false,
        last_energy_j: 0.0,
        unmeasured: 0,
        mean: [None; 2],
        changes: 0,
        celsius: None,
    };
    let ended = run.go(tell);
    let (total, unmeasured) = (run.total, run.unmeasured);
    let say = match &ended {
        Ok(end) => end.to_string(),
        Err(error) => error.to_string(),
    };
    onlookers.watch.saw(&Seen::LevelOver { recorded: ended.is_ok(), say: &say });
    let finished = run.bench.session.finish();
    onlookers.watch.saw(&Seen::Ended);
    let end = ended?;
    finished?;
    Ok(WearSummary { before, after: total, end, unmeasured })
}

fn unfit(session: &Session, what: &str) -> WearError {
    WearError::Shake(ShakeError::Unfit { address: session.address().into(), what: what.into() })
}

/// Whether the file has all that was wanted.
fn over(run: &WearPlan, total: &WearTotal) -> Option<WearEnd> {
    if total.cycles >= run.cycles {
        Some(WearEnd::Cycles)
    } else if run.energy_j.is_some_and(|most| total.energy_j >= most) {
        Some(WearEnd::Energy)
    } else {
        None
    }
}

/// Whether a raw loop of the cycle with this number is kept in any case: ten in each decade,
/// evenly spaced in the logarithm.
pub fn is_spaced(number: u64) -> bool {
    let nearest = (LOOPS_PER_DECADE * (number as f64).log10()).round();
    10f64.powf(nearest / LOOPS_PER_DECADE).round() as u64 == number
}

/// Where the normal load comes from.
enum NormalLoad {
    Stated(Option<f64>),
    /// Indices of its channels in the scan.
    Measured(Vec<usize>),
}

impl NormalLoad {
    fn new(channels: &ChannelMap, measured: &[String], stated_n: Option<f64>) -> Result<Self, String> {
        if measured.is_empty() {
            return Ok(Self::Stated(stated_n));
        }
        let place = |name: &String| {
            let mut all = channels.channels.iter();
            all.position(|channel| channel.name == name.as_str())
                .ok_or_else(|| format!("it has no channel `{name}` for the normal load (wear.normal_load)"))
        };
        measured.iter().map(place).collect::<Result<_, _>>().map(Self::Measured)
    }

    /// Its mean over these scans, N.
    fn over(&self, channels: &ChannelMap, samples: &Samples, scans: Range<usize>) -> Option<f64> {
        match self {
            Self::Stated(load) => *load,
            Self::Measured(places) => {
                let mean = |place: &usize| {
                    let own = samples.channel(*place).part(scans.start, scans.end);
                    Some(own.of().units(&channels.channels[*place]) * own.mean()?)
                };
                // a sensor may show pressure with either sign
                Some(places.iter().map(mean).sum::<Option<f64>>()?.abs())
            }
        }
    }
}

/// Scans that are cut before a block: interpolation needs one.
const BEFORE: u64 = 4;

/// Scans that are cut after a block beyond the channels' delays.
const AFTER: u64 = 4;

/// A run in progress.
struct Run<'a> {
    bench: Bench<'a>,
    store: &'a mut Store,
    options: &'a WearOptions,
    level: Level,
    load: NormalLoad,
    /// Scans of a cycle.
    period: f64,
    /// Scans needed after a block.
    after: u64,
    /// Where the next cycle begins, scans.
    begin: f64,
    total: WearTotal,
    /// Whether a cycle of this run counts already.
    counts: bool,
    /// Whether the ordered amplitude has been reached.
    reached: bool,
    /// Energy of the last measured cycle, J.
    last_energy_j: f64,
    unmeasured: u64,
    /// Running means of stiffness and friction.
    mean: [Option<f64>; 2],
    changes: u32,
    celsius: Option<f64>,
}

/// A part of the stream, cut into cycles.
struct Part {
    /// Scan index of the first sample.
    first_scan: u64,
    samples: Samples,
    gaps: Vec<Range<usize>>,
    cycles: Vec<WearCycle>,
}

impl Run<'_> {
    fn go(&mut self, tell: &mut dyn FnMut(&WearState)) -> Result<WearEnd, WearError> {
        let mut orders = Orders::new(self.bench.channels, self.bench.info, &self.level, self.bench.options);
        let (limits, most_drive_v) =
            (self.bench.options.limits.of(self.bench.channels), orders.most_drive_v());
        self.bench.onlookers.watch.saw(&Seen::Level {
            level: &self.level,
            limits: &limits,
            most_drive_v,
            load_cells: &self.bench.load_cells,
        });
        let begun = orders.begin(self.bench.session)?;
        self.begin = (begun + BEFORE) as f64;
        let slid = self.slide(&mut orders, begun, tell);
        // whatever has happened, the shaker comes to rest, and the cycles until then count
        let rested = self.bench.come_to_rest();
        let kept = match &slid {
            // nothing more can be read or stored
            Err(WearError::Shake(ShakeError::Device(_) | ShakeError::Store(_))) => Ok(()),
            _ => self.ramp(),
        };
        // of several errors the first one is returned
        let end = slid.map_err(|error| self.stopped(error))?;
        rested?;
        kept?;
        Ok(end)
    }

    /// The error of a run whose shaker has stopped or cannot reach the amplitude.
    fn stopped(&self, error: WearError) -> WearError {
        let why = match error {
            WearError::Shake(ShakeError::Stopped { why, .. }) => why,
            WearError::Shake(ShakeError::Short(short)) => short.to_string(),
            other => return other,
        };
        WearError::Stopped { why, cycles: self.total.cycles }
    }

    /// Block after block, until the run ends.
    fn slide(
        &mut self,
        orders: &mut Orders,
        begun: u64,
        tell: &mut dyn FnMut(&WearState),
    ) -> Result<WearEnd, WearError> {
        let of_block = (BLOCK_S * orders.rate_hz() / self.period).floor().max(1.0) as u64;
        loop {
            let left = self.options.run.cycles - self.total.cycles;
            let count = of_block.min(left).max(1);
            let end_scan = (self.begin + count as f64 * self.period).ceil() as u64 + self.after;
            match orders.go_on(self.bench.session, end_scan) {
                Err(ShakeError::Interrupted) => return Ok(WearEnd::Interrupted),
                done => done?,
            }
            let part = self.cut(count)?;
            let drive_v = f64::from(self.bench.session.status()?.drive_v);
            if self.options.run.temperature_c.is_some() {
                self.celsius = self.bench.session.temperature_c()?;
            }
            let at_s = (self.begin - begun as f64) / orders.rate_hz();
            let state = self.state(&part.cycles);
            let worst = part
                .cycles
                .iter()
                .filter_map(|cycle| cycle.reading.map(|own| own.amplitude_m))
                .fold(0.0, f64::max);
            self.commit(&part, drive_v, None)?;
            if self.reached
                && part.cycles.iter().all(|cycle| cycle.reading.is_none())
                && let Some(channel) = clipped(self.bench.channels, &part.samples, 0..part.samples.scans())
            {
                return Err(ShakeError::Short(Shortfall::Clipped { channel }).into());
            }
            let state = WearState { total: self.total, ..state };
            self.bench.onlookers.watch.saw(&Seen::Shaking(Shaking {
                at_s,
                amplitude: state.amplitude_m.unwrap_or(0.0),
                drive_v,
                settled: self.reached,
                samples: &part.samples,
            }));
            tell(&state);
            if let Some(end) = self.ends(&state, worst, &part.cycles) {
                return Ok(end);
            }
            if !self.reached && at_s > super::SETTLE_BOUND_S {
                let ratio = state.amplitude_m.unwrap_or(0.0) / self.level.amplitude;
                let (least, most) = (ratio, ratio);
                let seconds = super::SETTLE_BOUND_S;
                return Err(ShakeError::Short(Shortfall::NeverSettled { seconds, least, most }).into());
            }
        }
    }

    /// Whether a limit is reached after a block.
    fn ends(&self, state: &WearState, worst_m: f64, cycles: &[WearCycle]) -> Option<WearEnd> {
        let run = &self.options.run;
        if let Some(end) = over(run, &self.total) {
            return Some(end);
        }
        if let Some(most) = run.largest_amplitude_m
            && worst_m > most
        {
            return Some(WearEnd::Amplitude(worst_m));
        }
        if let (Some(most), Some(now)) = (run.temperature_c, self.celsius)
            && now > most
        {
            return Some(WearEnd::Temperature(now));
        }
        let loads: Vec<f64> = cycles.iter().filter_map(|cycle| cycle.normal_load_n).collect();
        let load_n = loads.iter().sum::<f64>() / loads.len() as f64;
        if let (true, Some([low, high]), Some(friction_n)) =
            (self.reached, run.friction_coefficient, state.friction_n)
            && load_n > 0.0
            && !(low..=high).contains(&(friction_n / load_n))
        {
            return Some(WearEnd::Friction(friction_n / load_n));
        }
        None
    }

    fn state(&self, cycles: &[WearCycle]) -> WearState {
        let mean = |of: fn(&CycleReading) -> Option<f64>| {
            let all: Vec<f64> =
                cycles.iter().filter_map(|cycle| cycle.reading.as_ref().and_then(of)).collect();
            (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
        };
        WearState {
            total: self.total,
            stiffness_n_per_m: mean(|own| own.stiffness_n_per_m),
            friction_n: mean(|own| own.friction_n),
            amplitude_m: mean(|own| Some(own.amplitude_m)),
        }
    }

    /// Reduces the next `count` cycles, which have arrived.
    fn cut(&mut self, count: u64) -> Result<Part, WearError> {
        let first_scan = self.begin.floor() as u64 - BEFORE;
        let end_scan = (self.begin + count as f64 * self.period).ceil() as u64 + self.after;
        let (samples, gaps) = self.bench.session.cut(first_scan..end_scan)?;
        let channels = self.bench.channels;
        let record = record(channels, &self.bench.load_cells, &samples, &self.level)
            .map_err(|why| unfit(self.bench.session, &why.to_string()))?;
        let begin = self.begin - first_scan as f64;
        let mut cycles = Vec::with_capacity(count as usize);
        let mut last_energy_j = self.last_energy_j;
        let read = each(&record, begin, self.period, count as usize, |_, reading| {
            let from = begin + cycles.len() as f64 * self.period;
            let scans = from as usize..(from + self.period).ceil() as usize;
            // the interpolation and the removal of delays reach a little further
            let reach = scans.start.saturating_sub(2)..scans.end + self.after as usize;
            let whole = gaps.iter().all(|gap| gap.end <= reach.start || gap.start >= reach.end)
                && clipped(channels, &samples, reach).is_none();
            if whole {
                last_energy_j = reading.energy_j;
            }
            cycles.push(WearCycle {
                reading: whole.then_some(reading),
                energy_j: last_energy_j,
                normal_load_n: self.load.over(channels, &samples, scans),
            });
        });
        read.map_err(|why| unfit(self.bench.session, &format!("its cycles cannot be reduced: {why}")))?;
        self.last_energy_j = last_energy_j;
        Ok(Part { first_scan, samples, gaps, cycles })
    }

    /// Commits the cycles of a part that count, and the raw loops kept of it. `last` is the index
    /// of the last cycle of the run, if it is in this part.
    fn commit(&mut self, part: &Part, drive_v: f64, last: Option<usize>) -> Result<(), WearError> {
        let moves = |cycle: &WearCycle| {
            cycle.reading.is_none_or(|own| own.amplitude_m > MOVES * self.level.amplitude)
        };
        let from =
            if self.counts { 0 } else { part.cycles.iter().position(moves).unwrap_or(part.cycles.len()) };
        let to = last.map_or(part.cycles.len(), |last| last + 1);
        let begin_scan = self.begin + from as f64 * self.period;
        let counted = part.cycles.get(from..to).unwrap_or_default();
        if !counted.is_empty() {
            let kept = self.kept(part, from, counted, last.is_some());
            let block = NewWearBlock {
                session: self.bench.session_id,
                frequency_hz: self.bench.channels.fs_hz() / self.period,
                ordered_m: self.level.amplitude,
                drive_v,
                celsius: self.celsius,
                epoch: self.bench.epoch,
                begin_scan,
                period_scans: self.period,
                before: self.total,
                cycles: counted,
            };
            self.store.insert_wear(&block, &kept)?;
            self.total = block.after();
            self.unmeasured += counted.iter().filter(|cycle| cycle.reading.is_none()).count() as u64;
            self.counts = true;
        }
        self.begin += part.cycles.len() as f64 * self.period;
        self.bench.session.forget_before(self.begin.floor() as u64 - BEFORE);
        Ok(())
    }

    /// The raw loops to keep of a part.
    fn kept(&mut self, part: &Part, from: usize, counted: &[WearCycle], ends: bool) -> Vec<NewWearLoop> {
        let mut wanted: Vec<Option<&'static str>> = vec![None; counted.len()];
        let mut changed = false;
        for (i, cycle) in counted.iter().enumerate() {
            if is_spaced(self.total.cycles + 1 + i as u64) {
                wanted[i] = Some("spaced");
            }
            if let Some(own) = &cycle.reading {
                let reached = (own.amplitude_m / self.level.amplitude - 1.0).abs() < REACHED;
                self.reached |= reached;
                if reached && !ends && self.sudden(own) && !changed && self.changes < MOST_CHANGES {
                    changed = true;
                    self.changes += 1;
                    for near in wanted.iter_mut().take(i + 2).skip(i.saturating_sub(1)) {
                        near.get_or_insert("change");
                    }
                }
            }
        }
        if !self.counts {
            wanted[0].get_or_insert("begin");
        }
        if ends && let Some(last) = wanted.last_mut() {
            last.get_or_insert("end");
        }
        let mut loops = Vec::new();
        let mut energy_before_j = self.total.energy_j;
        for (i, why) in wanted.into_iter().enumerate() {
            if let Some(why) = why {
                loops.push(self.raw_loop(
                    part,
                    from + i,
                    self.total.cycles + 1 + i as u64,
                    why,
                    energy_before_j,
                ));
            }
            energy_before_j += counted[i].energy_j;
        }
        loops
    }

    fn raw_loop(
        &self,
        part: &Part,
        place: usize,
        cycle: u64,
        why: &'static str,
        energy_before_j: f64,
    ) -> NewWearLoop {
        let begin_scan = self.begin + place as f64 * self.period;
        let from = (begin_scan.floor() as u64 - BEFORE - part.first_scan) as usize;
        let to = ((begin_scan + self.period).ceil() as u64 + self.after - part.first_scan) as usize;
        let samples = part.samples.part(from..to.min(part.samples.scans()));
        let within = |gap: &Range<usize>| {
            let (start, end) = (gap.start.max(from), gap.end.min(to));
            (start < end).then(|| start - from..end - from)
        };
        let gaps = part.gaps.iter().filter_map(within).collect();
        let first_scan = part.first_scan + from as u64;
        NewWearLoop { cycle, why, energy_before_j, first_scan, begin_scan, samples, gaps }
    }

    /// Whether a cycle differs from the running means, which then begin again from it.
    fn sudden(&mut self, own: &CycleReading) -> bool {
        let mut sudden = false;
        for (mean, value) in self.mean.iter_mut().zip([own.stiffness_n_per_m, own.friction_n]) {
            let Some(value) = value else { continue };
            match mean {
                Some(known) if (value / *known - 1.0).abs() <= SUDDEN => {
                    *known += MEAN_WEIGHT * (value - *known);
                }
                Some(known) => {
                    sudden = true;
                    *known = value;
                }
                None => *mean = Some(value),
            }
        }
        sudden
    }

    /// The cycles from the last block until the shaker rests.
    fn ramp(&mut self) -> Result<(), WearError> {
        let arrived = self.bench.session.expected()?.saturating_sub(self.after);
        let count = ((arrived as f64 - self.begin) / self.period).floor();
        if count < 1.0 {
            return Ok(());
        }
        let part = self.cut(count as u64)?;
        let moves = |cycle: &WearCycle| {
            cycle.reading.is_some_and(|own| own.amplitude_m > MOVES * self.level.amplitude)
        };
        match part.cycles.iter().rposition(moves) {
            Some(last) => self.commit(&part, 0.0, Some(last)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Channel, Quantity, Role};

    #[test]
    fn the_normal_load_is_the_sum_of_its_channels_over_a_cycle() {
        let channel = |name: &str, units_per_volt: f32| Channel {
            name: name.parse().expect("a short name"),
            role: Role::Auxiliary,
            quantity: Quantity::Force,
            units_per_volt,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        let channels = ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![channel("n_1", 40.0), channel("t", 20.0), channel("n_2", -20.0)],
        };
        // per code 400/32768 N and -200/32768 N; in the cycle (scans 1 to 4) means of 8192 codes
        let n_1 = [0, 8192 + 300, 8192 - 300, 8192, 8192, 0];
        let n_2 = [7, 8192, 8192 + 50, 8192 - 50, 8192, 7];
        let codes = [n_1, [9000; 6], n_2].concat();
        let samples = Samples::of_codes(&codes, 3);
        let of = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            NormalLoad::new(&channels, &names, Some(300.0))
        };
        let over = |load: NormalLoad| load.over(&channels, &samples, 1..5);
        assert_eq!(over(of(&["n_1"]).expect("a channel")), Some(100.0));
        // pressure counts with either sign
        assert_eq!(over(of(&["n_2"]).expect("a channel")), Some(50.0));
        assert_eq!(over(of(&["n_1", "n_2"]).expect("channels")), Some(50.0));
        assert_eq!(over(of(&[]).expect("none")), Some(300.0));
        let refused = of(&["n_3"]).err().expect("no such channel");
        assert!(refused.contains("`n_3`") && refused.contains("wear.normal_load"), "{refused}");
    }

    #[test]
    fn ten_loops_of_each_decade_are_kept() {
        let kept = |range: Range<u64>| range.filter(|number| is_spaced(*number)).count();
        assert_eq!(kept(10..100), 10);
        assert_eq!(kept(1_000..10_000), 10);
        assert_eq!(kept(100_000..1_000_000), 10);
        assert!([1, 10, 1_000, 100_000].into_iter().all(is_spaced) && !is_spaced(1_001));
    }
}
