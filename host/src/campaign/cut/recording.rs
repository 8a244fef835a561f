//! A continuous recording: its channels, and any part of its samples as they came.
//!
//! Names, units and sensitivities have the rules of files of single hits
//! ([`assign`](crate::campaign::import::assign)). Text and universal files are in memory once, with
//! all their values. A WAV file is read where its samples lie, and so is an npz file, whose length
//! is bounded by the disk only. Its forms (numpy.savez, not savez_compressed):
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
use std::sync::{Mutex, PoisonError};

use super::CutError;
use crate::campaign::import::assign::{AssignedRecording, Calibrations, assigned_recording};
use crate::campaign::import::channel_file::{ChannelFile, FileChannel, WavFile, ending, read_channel_file};
use crate::campaign::plan::Plan;
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, ChannelView, SampleType, Samples};
use crate::exchange::NpzError;
use crate::exchange::frf_file::is_npz;
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

/// The source of the samples, with all channels of the file.
enum Source {
    File { arrays: Vec<LongArray>, signals: Vec<Signal> },
    Wav(Mutex<WavFile>),
    Memory(Samples),
}

/// The description of a recording's channels, and the types of all channels of its file.
struct Described {
    own: AssignedRecording,
    types: Vec<SampleType>,
}

impl Described {
    fn of(
        name: &str,
        plan: &Plan,
        fs_hz: f64,
        (channels, types): (&[FileChannel], &[SampleType]),
        stated: &Calibrations,
    ) -> Result<Self, CutError> {
        let own = assigned_recording(plan, fs_hz, (channels, types), stated)
            .map_err(|what| CutError::unfit(name, what))?;
        Ok(Self { own, types: types.to_vec() })
    }

    fn recording(self, name: &str, scans: u64, source: Source) -> LongRecording {
        let AssignedRecording { map, places, unknown } = self.own;
        let types = places.iter().map(|place| self.types[*place]).collect();
        LongRecording { name: name.into(), map, scans, types, places, unused: unknown, source }
    }
}

/// A continuous recording.
pub struct LongRecording {
    name: String,
    map: ChannelMap,
    scans: u64,
    types: Vec<SampleType>,
    /// Place of each channel in the file.
    places: Vec<usize>,
    unused: Vec<String>,
    source: Source,
}

impl LongRecording {
    /// A recording in memory: its channels as in a file, each with all its samples.
    ///
    /// # Errors
    /// As [`assigned_recording`], or the channels differ in length.
    pub fn in_memory(
        name: &str,
        plan: &Plan,
        file: ChannelFile,
        stated: &Calibrations,
    ) -> Result<Self, CutError> {
        let ChannelFile { fs_hz, channels, hits } = file;
        let count = hits.len();
        let (Some(samples), true) = (hits.into_iter().next(), count == 1) else {
            return Err(CutError::unfit(
                name,
                format!("it has {count} separate hits and no continuous recording: import it without --cut"),
            ));
        };
        let (types, scans) = (samples.types(), samples.scans() as u64);
        let of = Described::of(name, plan, fs_hz, (&channels, &types), stated)?;
        Ok(of.recording(name, scans, Source::Memory(samples)))
    }

    /// Opens a file: npz, WAV, comma-separated text, or a universal file.
    ///
    /// # Errors
    /// It cannot be read, has another form, or its channels cannot be described.
    pub fn open(path: &Path, plan: &Plan, stated: &Calibrations) -> Result<Self, CutError> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        match ending(path).as_str() {
            "wav" => {
                let wav = WavFile::open(path)?;
                let types = vec![wav.of; wav.channels.len()];
                let of = Described::of(&name, plan, wav.fs_hz, (&wav.channels, &types), stated)?;
                let scans = wav.scans;
                Ok(of.recording(&name, scans, Source::Wav(Mutex::new(wav))))
            }
            "csv" | "txt" | "uff" | "unv" | "uf" => {
                Self::in_memory(&name, plan, read_channel_file(path)?, stated)
            }
            _ if is_npz(path)? => Self::open_npz(path, plan, stated),
            _ => Err(CutError::unfit(
                &name,
                "a continuous recording is read from .npz (numpy.savez, uncompressed), .wav, .csv or .uff; Python's lab.cut(…) takes \
                 arrays of any other format (docs/recipes.md)",
            )),
        }
    }

    /// Opens an npz file.
    ///
    /// # Errors
    /// It is damaged, has other arrays than those above, or a unit is unknown.
    fn open_npz(path: &Path, plan: &Plan, stated: &Calibrations) -> Result<Self, CutError> {
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
        let mut channels = Vec::with_capacity(names.len());
        for (place, (name, unit)) in names.iter().zip(&units).enumerate() {
            let wrong = |what: String| npz.content(format!("channel `{name}`: {what}"));
            let range = full_scales.as_ref().map_or(0.0, |all| all[place]);
            let is_code = types[place].is_code();
            if is_code && range <= 0.0 {
                return Err(wrong(
                    "its samples are integers, and their scale is not known: add an array `full_scale` with the value \
                     of the largest code (2^15 or 2^31), in the channel's unit"
                        .into(),
                )
                .into());
            }
            let own_bits = bits.as_ref().map_or(types[place].bytes() as f64 * 8.0, |all| all[place]);
            if !(1.0..=32.0).contains(&own_bits) {
                return Err(wrong("`bits` must be 1 to 32".into()).into());
            }
            channels.push(FileChannel {
                full_scale: is_code.then_some(range),
                bits: if is_code { own_bits as u8 } else { 0 },
                delay_s: delays.as_ref().map_or(0.0, |all| all[place]),
                ..FileChannel::new(name, Some(unit))
            });
        }
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let of = Described::of(&name, plan, fs_hz, (&channels, &types), stated)?;
        Ok(of.recording(&name, scans, Source::File { arrays, signals }))
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
                    let view =
                        all.channel(self.places[*place]).part(range.start as usize, range.end as usize);
                    let mut own = ChannelSamples::empty(view.of());
                    append(&mut own, view);
                    own
                };
                channels.iter().map(part).collect()
            }
            Source::Wav(wav) => {
                let own: Vec<usize> = channels.iter().map(|place| self.places[*place]).collect();
                // a panic of another thread leaves nothing that the next seek would not set
                let mut wav = wav.lock().unwrap_or_else(PoisonError::into_inner);
                wav.part(&own, range)?
            }
            Source::File { arrays, signals } => {
                let mut samples: Vec<ChannelSamples> =
                    channels.iter().map(|place| ChannelSamples::empty(self.types[*place])).collect();
                let mut bytes = Vec::new();
                for (own, place) in samples.iter_mut().zip(channels) {
                    let signal = &signals[self.places[*place]];
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
