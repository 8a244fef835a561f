//! A continuous recording: its channels, and any part of its samples as they came.
//!
//! An npz file is read where its arrays lie in the file, in pieces; its length is bounded by the
//! disk only. Forms (numpy.savez, not savez_compressed):
//!
//! | array | shape | content |
//! |---|---|---|
//! | `fs` | () | scans per second, Hz |
//! | `names`, `units` | (channel) | each channel's name and unit |
//! | `signals` | (channel, sample) or (sample, channel) | int16, int32, float32 or float64 |
//! | or one array per channel, with its name | (sample) | the same |
//! | `full_scale` (for integers) | (channel) or () | value of the largest code, in its unit |
//! | `bits` (for int32) | (channel) or () | of the converter; 32 without it |
//! | `delay_s` (if known) | (channel) | delay of each channel, s |

use std::ops::Range;
use std::path::Path;

use jointrig_protocol::channel::{Channel, Quantity, Role};

use super::CutError;
use crate::campaign::import::assign::{measured_in, volts};
use crate::campaign::import::roles::role_of;
use crate::campaign::plan::Plan;
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, ChannelView, SampleType, Samples};
use crate::exchange::NpzError;
use crate::exchange::npz::NpzFile;
use crate::exchange::npz_long::LongArray;

/// Most elements of an array in which channels alternate that are read at once.
const PIECE: usize = 1 << 20;
/// Most channels of a recording.
const MOST_CHANNELS: usize = 1024;

/// Where the samples of a channel are.
struct Signal {
    /// Index of the array.
    array: usize,
    /// Element of its first sample.
    first: u64,
    /// Elements from one sample to the next.
    step: u64,
}

/// The source of the samples.
enum Source {
    File { arrays: Vec<LongArray>, signals: Vec<Signal> },
    Memory(Samples),
}

/// A continuous recording.
pub struct LongRecording {
    name: String,
    map: ChannelMap,
    scans: u64,
    types: Vec<SampleType>,
    unused: Vec<String>,
    source: Source,
}

impl LongRecording {
    /// A recording in memory, whose channels are described by `map`.
    ///
    /// # Errors
    /// The map does not describe the samples.
    pub fn in_memory(name: &str, map: ChannelMap, samples: Samples) -> Result<Self, CutError> {
        if map.len() != samples.channels() {
            return Err(CutError::unfit(
                name,
                format!("{} channels are described, and there are {}", map.len(), samples.channels()),
            ));
        }
        let (scans, types) = (samples.scans() as u64, samples.types());
        Ok(Self { name: name.into(), map, scans, types, unused: Vec::new(), source: Source::Memory(samples) })
    }

    /// Opens an npz file.
    ///
    /// # Errors
    /// It is damaged, has other arrays than those above, or a unit is unknown.
    pub fn open_npz(path: &Path, plan: &Plan) -> Result<Self, CutError> {
        let mut npz = NpzFile::open(path)?;
        let fs_hz = npz.number("fs", "scans per second, Hz")?;
        if !(1.0..=f64::from(u32::MAX)).contains(&fs_hz) {
            return Err(npz.content(format!("`fs` is {fs_hz} Hz: 1 Hz or more is needed")).into());
        }
        let names = npz.text("names", "the channels' names")?.values;
        let units = npz.text("units", "each channel's unit, e.g. N, mm/s, g")?.values;
        if names.is_empty() || names.len() > MOST_CHANNELS || units.len() != names.len() {
            return Err(npz
                .content(format!(
                    "there are {} names and {} units: give one of each for every channel",
                    names.len(),
                    units.len()
                ))
                .into());
        }
        let (arrays, signals, scans) = arrays(&mut npz, &names)?;
        let mut of_channels = |array: &str, expected: &str| -> Result<Option<Vec<f64>>, NpzError> {
            if !npz.has(array) {
                return Ok(None);
            }
            let mut values = npz.real(array, expected)?.values;
            if values.len() == 1 {
                values.resize(names.len(), values[0]);
            }
            if values.len() != names.len() || values.iter().any(|v| !v.is_finite()) {
                return Err(npz.content(format!("`{array}` must have one number for each channel")));
            }
            Ok(Some(values))
        };
        let full_scales = of_channels("full_scale", "the value of the largest code, in the channel's unit")?;
        let bits = of_channels("bits", "bits of each channel's converter")?;
        let delays = of_channels("delay_s", "delay of each channel, s")?;
        let types: Vec<SampleType> = signals.iter().map(|signal| type_of(&arrays[signal.array])).collect();
        let (mut channels, mut unused) = (Vec::with_capacity(names.len()), Vec::new());
        for (place, (name, unit)) in names.iter().zip(&units).enumerate() {
            let wrong = |what: String| npz.content(format!("channel `{name}`: {what}"));
            let (quantity, factor) = quantity_of(unit).map_err(wrong)?;
            let range = full_scales.as_ref().map_or(0.0, |all| all[place]);
            if types[place].is_code() && range <= 0.0 {
                return Err(wrong(
                    "its samples are integers, and their scale is not known: add an array `full_scale` with the value \
                     of the largest code (2^15 or 2^31), in the channel's unit"
                        .into(),
                )
                .into());
            }
            let own_bits = bits.as_ref().map_or(types[place].bytes() as f64 * 8.0, |all| all[place]);
            let delay_s = delays.as_ref().map_or(0.0, |all| all[place]);
            if !(0.0..1.0).contains(&delay_s) || !(1.0..=32.0).contains(&own_bits) {
                return Err(wrong("`delay_s` must be 0 to 1 s, and `bits` 1 to 32".into()).into());
            }
            let is_code = types[place].is_code();
            let role = role_of(plan, "", name, quantity);
            if role.is_none() {
                unused.push(name.clone());
            }
            channels.push(Channel {
                name: name.as_str().try_into().map_err(|_| wrong("the name is too long".into()))?,
                role: role.unwrap_or(Role::Auxiliary),
                quantity,
                units_per_volt: factor as f32,
                range_v: if is_code { range as f32 } else { 0.0 },
                delay_ns: (1e9 * delay_s).round() as u32,
                bits: if is_code { own_bits as u8 } else { 0 },
            });
        }
        let rate_hz = fs_hz.round();
        let exact_hz = (rate_hz != fs_hz).then_some(fs_hz);
        let map = ChannelMap { id: 0, rate_hz: rate_hz as u32, exact_hz, channels };
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, map, scans, types, unused, source: Source::File { arrays, signals } })
    }

    /// Its name, for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Channels whose names neither the plan nor the usual names know: they are stored, and no
    /// analysis uses them.
    pub fn unused(&self) -> &[String] {
        &self.unused
    }

    /// The channels.
    pub fn map(&self) -> &ChannelMap {
        &self.map
    }

    /// Number of scans.
    pub fn scans(&self) -> u64 {
        self.scans
    }

    /// The sample type of each channel.
    pub fn types(&self) -> &[SampleType] {
        &self.types
    }

    /// Its length, s.
    pub fn length_s(&self) -> f64 {
        self.scans as f64 / self.map.fs_hz()
    }

    /// The samples of these channels in this range of scans, each of the type in which it came.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn part(&self, channels: &[usize], range: Range<u64>) -> Result<Samples, CutError> {
        let range = range.start.min(self.scans)..range.end.min(self.scans);
        let count = range.end.saturating_sub(range.start) as usize;
        let samples = match &self.source {
            Source::Memory(all) => {
                let part = |place: &usize| {
                    let view = all.channel(*place).part(range.start as usize, range.end as usize);
                    let mut own = ChannelSamples::empty(view.of());
                    append(&mut own, view);
                    own
                };
                channels.iter().map(part).collect()
            }
            Source::File { arrays, signals } => {
                let mut samples: Vec<ChannelSamples> =
                    channels.iter().map(|place| ChannelSamples::empty(self.types[*place])).collect();
                let mut bytes = Vec::new();
                for (own, place) in samples.iter_mut().zip(channels) {
                    let signal = &signals[*place];
                    let array = &arrays[signal.array];
                    let most = (PIECE / signal.step as usize).max(1);
                    let mut done = 0;
                    while done < count {
                        let now = most.min(count - done);
                        let from = signal.first + (range.start + done as u64) * signal.step;
                        let elements = (now - 1) * signal.step as usize + 1;
                        array.read(from, elements, &mut bytes)?;
                        decode(own, &bytes, signal.step as usize, array.big);
                        done += now;
                    }
                }
                samples
            }
        };
        // all channels have the range's length
        Samples::new(samples).ok_or_else(|| CutError::unfit(&self.name, "its channels differ in length"))
    }

    /// The samples of one channel in SI units.
    ///
    /// # Errors
    /// The file cannot be read, or a value is not a number.
    pub fn si(&self, channel: usize, range: Range<u64>) -> Result<Vec<f64>, CutError> {
        let samples = self.part(&[channel], range.clone())?;
        let view = samples.channel(0);
        if let Some(at) = view.not_finite() {
            let what = format!(
                "channel `{}` at {:.4} s is not a number: replace missing samples, or cut the recording there",
                self.map.channels[channel].name,
                (range.start + at as u64) as f64 / self.map.fs_hz()
            );
            return Err(CutError::unfit(&self.name, what));
        }
        Ok(self.map.to_si(channel, view))
    }
}

/// The arrays of an npz file, where each channel lies in them, and the number of scans.
fn arrays(npz: &mut NpzFile, names: &[String]) -> Result<(Vec<LongArray>, Vec<Signal>, u64), CutError> {
    const SIGNALS: &str = "signals";
    if !npz.has(SIGNALS) {
        let mut all = Vec::new();
        for name in names {
            let expected = "the samples of this channel, (sample); or one array `signals` (channel, sample)";
            all.push(LongArray::open(npz, name, expected)?);
        }
        let lengths: Vec<usize> = all.iter().map(|array| array.shape.iter().product()).collect();
        if all.iter().any(|array| array.shape.len() != 1) || lengths.windows(2).any(|two| two[0] != two[1]) {
            return Err(npz.content("the channels' arrays must have one axis, and the same length").into());
        }
        let signals = (0..all.len()).map(|array| Signal { array, first: 0, step: 1 }).collect();
        return Ok((all, signals, lengths.first().map_or(0, |length| *length as u64)));
    }
    let array = LongArray::open(npz, SIGNALS, "the samples, (channel, sample) or (sample, channel)")?;
    // the form of `export`, with a first axis of one hit
    let shape = match array.shape.as_slice() {
        [1, rest @ ..] if rest.len() == 2 => rest,
        shape => shape,
    };
    let channels = names.len();
    let (scans, by_channel) = match shape {
        [first, second] if *first == channels && *second >= channels => (*second, true),
        [first, second] if *second == channels => (*first, false),
        _ => {
            return Err(npz
                .content(format!(
                    "`signals` has the shape {:?}, and there are {channels} names: it must be (channel, sample) or (sample, channel)",
                    array.shape
                ))
                .into());
        }
    };
    // in Fortran order the first index runs fastest
    let one_after_another = by_channel != array.fortran;
    let signal = |channel: usize| {
        if one_after_another {
            Signal { array: 0, first: (channel * scans) as u64, step: 1 }
        } else {
            Signal { array: 0, first: channel as u64, step: channels as u64 }
        }
    };
    let signals = (0..channels).map(signal).collect();
    Ok((vec![array], signals, scans as u64))
}

fn type_of(array: &LongArray) -> SampleType {
    match (array.float, array.width) {
        (false, 2) => SampleType::I16,
        (false, _) => SampleType::I32,
        (true, 4) => SampleType::F32,
        (true, _) => SampleType::F64,
    }
}

/// Appends every `step`-th element.
fn decode(own: &mut ChannelSamples, bytes: &[u8], step: usize, big: bool) {
    macro_rules! each {
        ($samples:ident, $of:ty) => {
            $samples.extend(
                bytes
                    .as_chunks()
                    .0
                    .iter()
                    .step_by(step)
                    .map(|word| if big { <$of>::from_be_bytes(*word) } else { <$of>::from_le_bytes(*word) }),
            )
        };
    }
    match own {
        ChannelSamples::I16(samples) => each!(samples, i16),
        ChannelSamples::I32(samples) => each!(samples, i32),
        ChannelSamples::F32(samples) => each!(samples, f32),
        ChannelSamples::F64(samples) => each!(samples, f64),
    }
}

/// Appends samples of the same type.
fn append(own: &mut ChannelSamples, more: ChannelView<'_>) {
    match (own, more) {
        (ChannelSamples::I16(own), ChannelView::I16(more)) => own.extend_from_slice(more),
        (ChannelSamples::I32(own), ChannelView::I32(more)) => own.extend_from_slice(more),
        (ChannelSamples::F32(own), ChannelView::F32(more)) => own.extend_from_slice(more),
        (ChannelSamples::F64(own), ChannelView::F64(more)) => own.extend_from_slice(more),
        _ => {}
    }
}

/// The quantity of a unit, and its factor to SI.
fn quantity_of(label: &str) -> Result<(Quantity, f64), String> {
    match volts(label) {
        Some(factor) => Ok((Quantity::Voltage, factor)),
        None => measured_in(label).map_err(|what| {
            format!("its unit `{label}`: {what}; write N, m/s, mm/s, m/s^2, g, m, µm or another unit of force or motion")
        }),
    }
}
