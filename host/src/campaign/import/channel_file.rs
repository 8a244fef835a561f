//! Files of one or more hits with all channels, as recorders and their programs write them:
//! comma-separated text with a heading, WAV, universal files, npz. Names and units are as the file
//! states them; [`assign`](super::assign) finds what each channel is.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _};
use std::ops::Range;
use std::path::{Path, PathBuf};

use hound::{SampleFormat, WavReader};

use crate::device::samples::{ChannelSamples, SampleType, Samples};
use crate::exchange::delimiter;
use crate::exchange::exported::SignalFileError;
use crate::exchange::frf_uff::contents;
use crate::exchange::npz::NpzFile;
use crate::exchange::uff::{Abscissa, DataSet, Function, Values, kind, quantity};
use crate::untrusted_input;

/// Largest text file, bytes: its values are kept in memory.
const MOST: u64 = 2 << 30;

/// Relative resolution of times in single precision.
const SINGLE: f64 = 1.2e-7;

/// The heading of a text file lies within this many bytes.
const HEADING: usize = 1 << 16;

/// A channel as its file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct FileChannel {
    /// Its name.
    pub name: String,
    /// Its unit; `None` if the file states none.
    pub unit: Option<String>,
    /// Value of the converter's full scale in that unit, if known.
    pub full_scale: Option<f64>,
    /// Resolution of codes, bits; 0 for values.
    pub bits: u8,
    /// Its delay, s.
    pub delay_s: f64,
}

impl FileChannel {
    /// A channel of values, without delay.
    pub fn new(name: &str, unit: Option<&str>) -> Self {
        let unit = unit.map(str::trim).filter(|unit| !unit.is_empty()).map(str::to_owned);
        Self { name: name.trim().into(), unit, full_scale: None, bits: 0, delay_s: 0.0 }
    }
}

/// The hits of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelFile {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// The channels.
    pub channels: Vec<FileChannel>,
    /// The samples of each hit: the channels in this order.
    pub hits: Vec<Samples>,
}

fn wrong(path: &Path, what: impl Into<String>) -> SignalFileError {
    SignalFileError::Content { path: path.into(), what: what.into() }
}

/// Unit of a WAV file's samples: the recorder's full scale.
pub const FULL_SCALE: &str = "FS";

/// The ending of a file's name, in lower case.
pub fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Whether a file holds hits with named channels: comma-separated text, WAV, or an npz file with
/// `names` and `signals`. A universal file is one if `all_channels` says so: its labels may also
/// name force and responses only.
///
/// # Errors
/// The file cannot be read.
pub fn is_channel_file(path: &Path, all_channels: bool) -> Result<bool, SignalFileError> {
    Ok(match ending(path).as_str() {
        "csv" | "txt" | "wav" => true,
        "npz" => {
            let file = NpzFile::open(path)?;
            file.has("names") && file.has("signals")
        }
        "uff" | "unv" | "uf" => all_channels,
        _ => false,
    })
}

/// Reads a file of channels.
///
/// # Errors
/// The file cannot be read, is damaged, or states neither rate nor time.
pub fn read_channel_file(path: &Path) -> Result<ChannelFile, SignalFileError> {
    let read = match ending(path).as_str() {
        "npz" => of_npz(path)?,
        "wav" => of_wav(path)?,
        "uff" | "unv" | "uf" => of_uff(path)?,
        "csv" | "txt" => of_text(path)?,
        _ => return Err(wrong(path, "files with all channels are .npz, .csv, .wav, .uff or .unv")),
    };
    if !(1.0..=f64::from(u32::MAX)).contains(&read.fs_hz) {
        return Err(wrong(path, format!("the sampling rate is {} Hz: 1 Hz or more is needed", read.fs_hz)));
    }
    if read.hits.iter().all(|hit| hit.scans() == 0) {
        return Err(wrong(path, "it holds no samples"));
    }
    Ok(read)
}

/// Values in single precision if that holds all of them exactly, else in double precision.
fn values(own: Vec<f64>) -> ChannelSamples {
    if own.iter().all(|value| f64::from(*value as f32) == *value) {
        ChannelSamples::F32(own.iter().map(|value| *value as f32).collect())
    } else {
        ChannelSamples::F64(own)
    }
}

/// The samples of one hit; each channel has the same type in all hits of a file.
fn samples(path: &Path, hits: Vec<Vec<Vec<f64>>>) -> Result<Vec<Samples>, SignalFileError> {
    let channels = hits.first().map_or(0, Vec::len);
    let exact = |channel: usize| {
        let mut all = hits.iter().filter_map(|hit| hit.get(channel)).flatten();
        all.all(|value| f64::from(*value as f32) == *value)
    };
    let single: Vec<bool> = (0..channels).map(exact).collect();
    let one = |(number, hit): (usize, Vec<Vec<f64>>)| {
        let of = |(own, single): (Vec<f64>, &bool)| {
            if *single { values(own) } else { ChannelSamples::F64(own) }
        };
        Samples::new(hit.into_iter().zip(&single).map(of).collect())
            .filter(|samples| samples.channels() == channels)
            .ok_or_else(|| wrong(path, format!("the channels of hit {number} differ in number or length")))
    };
    hits.into_iter().enumerate().map(one).collect()
}

/// `fs`, `names` (channel), `units` (channel), `signals` (hit, channel, sample) or (channel,
/// sample); if there is `delay_s` (hit, channel) or (channel), that of the first hit.
fn of_npz(path: &Path) -> Result<ChannelFile, SignalFileError> {
    let mut file = NpzFile::open(path)?;
    let fs_hz = file.number("fs", "the sampling rate, Hz")?;
    let names = file.text("names", "the channels' names")?.values;
    let units =
        if file.has("units") { file.text("units", "each channel's unit")?.values } else { Vec::new() };
    if !units.is_empty() && units.len() != names.len() {
        let what =
            format!("there are {} names and {} units: give one unit per channel", names.len(), units.len());
        return Err(wrong(path, what));
    }
    let delays =
        if file.has("delay_s") { file.real("delay_s", "(hit, channel), s")?.values } else { Vec::new() };
    let signals = file.real("signals", "(hit, channel, sample)")?;
    let (hits, channels, scans) = match signals.shape[..] {
        [hits, channels, scans] => (hits, channels, scans),
        [channels, scans] => (1, channels, scans),
        _ => {
            let what = "`signals` must be (hit, channel, sample), or (channel, sample) for one hit";
            return Err(wrong(path, what));
        }
    };
    if channels != names.len() || channels == 0 || hits == 0 || scans == 0 {
        let what = format!(
            "`signals` has the shape {:?}, and there are {} names: it must be (hit, channel, sample)",
            signals.shape,
            names.len()
        );
        return Err(wrong(path, what));
    }
    let mut rows = signals.values.chunks(scans).map(<[f64]>::to_vec);
    let all = (0..hits).map(|_| rows.by_ref().take(channels).collect()).collect();
    let described = names.iter().enumerate().map(|(at, name)| {
        let delay_s = delays.get(at).copied().unwrap_or(0.0);
        FileChannel { delay_s, ..FileChannel::new(name, units.get(at).map(String::as_str)) }
    });
    Ok(ChannelFile { fs_hz, channels: described.collect(), hits: samples(path, all)? })
}

/// One hit; names are the channels' numbers from 1, values are parts of the recorder's full scale.
fn of_wav(path: &Path) -> Result<ChannelFile, SignalFileError> {
    let mut wav = WavFile::open(path)?;
    let all: Vec<usize> = (0..wav.channels.len()).collect();
    let read = wav.part(&all, 0..wav.scans)?;
    let hit = Samples::new(read).ok_or_else(|| wrong(path, "it ends within a scan: record it again"))?;
    Ok(ChannelFile { fs_hz: wav.fs_hz, channels: wav.channels, hits: vec![hit] })
}

/// A WAV file, whose samples are read where they lie in it.
pub struct WavFile {
    path: PathBuf,
    reader: WavReader<BufReader<File>>,
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// The channels: their numbers from 1, in parts of the recorder's full scale.
    pub channels: Vec<FileChannel>,
    /// Type of all samples.
    pub of: SampleType,
    /// Number of scans.
    pub scans: u64,
}

impl WavFile {
    /// Opens a file, and reads its last scan, so that one that was cut short is refused.
    ///
    /// # Errors
    /// It cannot be read, is cut short, or has samples of other than 16 to 32 bits.
    pub fn open(path: &Path) -> Result<Self, SignalFileError> {
        let (file, _) = untrusted_input::open(path)
            .map_err(|source| SignalFileError::Open { path: path.into(), source })?;
        let reader = WavReader::new(BufReader::new(file)).map_err(|error| not_whole(path, &error))?;
        let spec = reader.spec();
        let bits = u8::try_from(spec.bits_per_sample).unwrap_or(0);
        let (of, bits) = match (spec.sample_format, spec.bits_per_sample) {
            (SampleFormat::Float, _) => (SampleType::F32, 0),
            (SampleFormat::Int, 16) => (SampleType::I16, bits),
            (SampleFormat::Int, 17..=32) => (SampleType::I32, bits),
            (_, bits) => {
                return Err(wrong(
                    path,
                    format!("samples of {bits} bits are not read: record 16, 24 or 32 bits"),
                ));
            }
        };
        if spec.channels == 0 || reader.len() % u32::from(spec.channels) != 0 {
            return Err(wrong(path, "it ends within a scan: record it again"));
        }
        let channel = |number: u16| FileChannel {
            full_scale: Some(1.0),
            bits,
            ..FileChannel::new(&number.to_string(), Some(FULL_SCALE))
        };
        let mut own = Self {
            path: path.into(),
            fs_hz: f64::from(spec.sample_rate),
            channels: (1..=spec.channels).map(channel).collect(),
            of,
            scans: u64::from(reader.duration()),
            reader,
        };
        own.part(&[0], own.scans.saturating_sub(1)..own.scans)?;
        Ok(own)
    }

    /// The samples of these channels in a range of scans.
    ///
    /// # Errors
    /// The file cannot be read, or ends before.
    pub fn part(
        &mut self,
        channels: &[usize],
        range: Range<u64>,
    ) -> Result<Vec<ChannelSamples>, SignalFileError> {
        let failed = |path: &Path, error: hound::Error| not_whole(path, &error);
        // a WAV file has fewer than 2^32 samples
        let from = u32::try_from(range.start).unwrap_or(u32::MAX);
        self.reader.seek(from).map_err(|error| failed(&self.path, error.into()))?;
        let (count, scans) = (self.channels.len(), (range.end - range.start) as usize);
        let read = match self.of {
            SampleType::I16 => parted(&mut self.reader, count, scans, channels)
                .map(|all| all.into_iter().map(ChannelSamples::I16).collect()),
            SampleType::I32 => parted(&mut self.reader, count, scans, channels)
                .map(|all| all.into_iter().map(ChannelSamples::I32).collect()),
            SampleType::F32 | SampleType::F64 => parted(&mut self.reader, count, scans, channels)
                .map(|all| all.into_iter().map(ChannelSamples::F32).collect()),
        };
        read.map_err(|error| failed(&self.path, error))
    }
}

fn not_whole(path: &Path, error: &hound::Error) -> SignalFileError {
    wrong(path, format!("it is not a whole WAV file ({error})"))
}

/// The samples of some of `count` channels that alternate, in the next `scans` scans.
fn parted<S: hound::Sample + Copy>(
    reader: &mut WavReader<BufReader<File>>,
    count: usize,
    scans: usize,
    channels: &[usize],
) -> Result<Vec<Vec<S>>, hound::Error> {
    let mut own: Vec<Vec<S>> = channels.iter().map(|_| Vec::with_capacity(scans)).collect();
    let mut scan = Vec::with_capacity(count);
    let mut samples = reader.samples::<S>();
    for _ in 0..scans {
        scan.clear();
        for sample in samples.by_ref().take(count) {
            scan.push(sample?);
        }
        for (own, channel) in own.iter_mut().zip(channels) {
            own.push(*scan.get(*channel).ok_or(hound::Error::UnfinishedSample)?);
        }
    }
    Ok(own)
}

/// Time responses. A hit has one of each channel: the next hit begins where a channel comes again.
fn of_uff(path: &Path) -> Result<ChannelFile, SignalFileError> {
    let contents = contents(path)?;
    if let Some(fault) = contents.faults.first() {
        return Err(wrong(path, format!("{fault}")));
    }
    let mut channels: Vec<FileChannel> = Vec::new();
    let mut hits: Vec<Vec<Option<Vec<f64>>>> = Vec::new();
    let mut step = None;
    for set in contents.sets {
        let DataSet::Function(mut function) = set else { continue };
        if function.kind != kind::TIME {
            continue;
        }
        // taken, so that a long recording is in memory once
        let Values::Real(mut own) = std::mem::replace(&mut function.values, Values::Real(Vec::new())) else {
            continue;
        };
        let own_step = match &function.abscissa {
            Abscissa::Even { step, .. } => *step,
            // the header prints a step with six digits, so that long signals list their times
            Abscissa::Uneven(times) => {
                let last = times.iter().fold(0.0f64, |most, t| most.max(t.abs()));
                1.0 / rate_of(times, SINGLE * last).map_err(|what| wrong(path, what))?
            }
        };
        if step.is_some_and(|step: f64| (own_step / step - 1.0).abs() > 1e-6) {
            return Err(wrong(path, "its channels differ in sampling rate: resample them"));
        }
        step = step.or(Some(own_step));
        let name = name_of(&function).ok_or_else(|| {
            wrong(
                path,
                "a time response names neither entity nor node: write the channel's name as its entity",
            )
        })?;
        let place = channels.iter().position(|channel| channel.name == name).unwrap_or_else(|| {
            channels.push(FileChannel::new(&name, unit_of(&function).as_deref()));
            channels.len() - 1
        });
        if hits.last().is_none_or(|hit| hit.get(place).is_some_and(Option::is_some)) {
            hits.push(Vec::new());
        }
        if let Some(hit) = hits.last_mut() {
            hit.resize(hit.len().max(place + 1), None);
            // a hammer pushes whichever way its label points
            let turned = function.response.direction < 0 && function.response != function.reference;
            if turned {
                for value in &mut own {
                    *value = -*value;
                }
            }
            hit[place] = Some(own);
        }
    }
    let step = step.ok_or_else(|| wrong(path, "it holds no time response"))?;
    let whole = |(number, hit): (usize, Vec<Option<Vec<f64>>>)| {
        let whole: Option<Vec<Vec<f64>>> = hit.into_iter().collect();
        let whole = whole.filter(|hit| hit.len() == channels.len());
        whole.ok_or_else(|| wrong(path, format!("hit {number} does not have every channel of the others")))
    };
    let all = hits.into_iter().enumerate().map(whole).collect::<Result<Vec<_>, _>>()?;
    let fs_hz = 1.0 / step;
    // the step of 51 200 Hz is no decimal fraction
    let rate = fs_hz.round();
    let fs_hz = if (fs_hz / rate - 1.0).abs() < 1e-7 { rate } else { fs_hz };
    let hits = samples(path, all)?;
    Ok(ChannelFile { fs_hz, channels, hits })
}

/// The channel's name: that of an export's identification, or the entity with its direction, or
/// `force` where a force is measured at its own place.
fn name_of(function: &Function) -> Option<String> {
    if let Some((record, name)) = function.id[0].split_once(", ")
        && record.starts_with("record ")
    {
        return Some(name.to_owned());
    }
    if function.axes[1].quantity == quantity::FORCE && function.response == function.reference {
        return Some("force".into());
    }
    let dof = &function.response;
    let place = match (dof.entity.trim(), dof.node) {
        ("", 0) => return None,
        ("", node) => node.to_string(),
        (entity, _) => entity.to_owned(),
    };
    let axis = match dof.direction.abs() {
        1 => ":x",
        2 => ":y",
        3 => ":z",
        _ => "",
    };
    Some(format!("{place}{axis}"))
}

/// The unit in the label, or that of the quantity in SI where the label has none.
fn unit_of(function: &Function) -> Option<String> {
    let axis = &function.axes[1];
    let own = axis.unit.trim();
    if !own.is_empty() && !own.eq_ignore_ascii_case("none") {
        return Some(own.into());
    }
    let unit = match axis.quantity {
        quantity::FORCE => "N",
        quantity::VELOCITY => "m/s",
        quantity::ACCELERATION => "m/s^2",
        quantity::DISPLACEMENT => "m",
        _ => return None,
    };
    Some(unit.into())
}

/// Columns under a heading `NAME (UNIT)`: a column of time, one of each channel, and possibly one
/// with the number of the hit; or what jointrig exports.
fn of_text(path: &Path) -> Result<ChannelFile, SignalFileError> {
    let opened = |source| SignalFileError::Open { path: path.into(), source };
    let (file, size) = untrusted_input::open(path).map_err(opened)?;
    if size > MOST {
        let (own, most) = (untrusted_input::megabytes(size), untrusted_input::megabytes(MOST));
        return Err(wrong(
            path,
            format!("it has {own}, and text of at most {most} is read: write it as npz"),
        ));
    }
    // read as a stream, so that only the values are in memory
    let mut text = BufReader::with_capacity(HEADING, file.take(size));
    let between = delimiter(&String::from_utf8_lossy(text.fill_buf().map_err(opened)?));
    let mut reader = csv::ReaderBuilder::new().delimiter(between).trim(csv::Trim::All).from_reader(text);
    let failed = |error: csv::Error| wrong(path, format!("{error}"));
    let heading = reader.headers().map_err(failed)?.clone();
    let columns: Vec<(String, Option<String>)> = heading.iter().map(name_and_unit).collect();
    let called =
        |names: &[&str]| columns.iter().position(|(name, _)| names.contains(&name.to_lowercase().as_str()));
    let time = called(&["time", "time_s", "t", "zeit"]).ok_or_else(|| {
        wrong(path, "no column is called `time (s)`: its first line must name the columns, e.g. time (s), hammer (N), x (mm/s)")
    })?;
    let to_seconds = match (columns[time].0.as_str(), columns[time].1.as_deref()) {
        (_, Some("s")) | ("time_s", None) => 1.0,
        (_, Some("ms")) => 1e-3,
        (_, Some("us" | "µs")) => 1e-6,
        (_, unit) => {
            let what =
                format!("the column of time has the unit `{}`: s, ms or µs is needed", unit.unwrap_or(""));
            return Err(wrong(path, what));
        }
    };
    let number = called(&["hit", "record"]);
    let kept: Vec<usize> =
        (0..columns.len()).filter(|column| *column != time && Some(*column) != number).collect();
    let (mut all, mut times) = (Vec::<Vec<Vec<f64>>>::new(), Vec::<Vec<f64>>::new());
    let (mut last, mut decimals) = (String::new(), 0usize);
    for (row, line) in reader.records().zip(2..) {
        let row = row.map_err(failed)?;
        let own = number.map_or("", |column| &row[column]);
        if all.is_empty() || own != last {
            own.clone_into(&mut last);
            all.push(vec![Vec::new(); kept.len()]);
            times.push(Vec::new());
        }
        let value = |column: usize| {
            let text = &row[column];
            let plain = if between == b',' { text.to_owned() } else { text.replace(',', ".") };
            plain.parse::<f64>().map_err(|_| {
                let name = &columns[column].0;
                wrong(path, format!("line {line}, column {name}: `{text}` is not a number"))
            })
        };
        decimals = decimals.max(row[time].split(['.', ',']).nth(1).map_or(0, str::len));
        if let (Some(hit), Some(times)) = (all.last_mut(), times.last_mut()) {
            times.push(value(time)? * to_seconds);
            for (signal, column) in hit.iter_mut().zip(&kept) {
                signal.push(value(*column)?);
            }
        }
    }
    let digit_s = to_seconds * 0.1f64.powi(i32::try_from(decimals).unwrap_or(i32::MAX));
    let rates = times.iter().map(|own| rate_of(own, digit_s).map_err(|what| wrong(path, what)));
    let rates = rates.collect::<Result<Vec<f64>, _>>()?;
    let fs_hz = rates.first().copied().unwrap_or(0.0);
    if rates.iter().any(|rate| (rate / fs_hz - 1.0).abs() > 1e-5) {
        return Err(wrong(path, "its hits differ in sampling rate: split the file"));
    }
    let channels = kept.iter().map(|column| {
        let (name, unit) = &columns[*column];
        FileChannel::new(name, unit.as_deref())
    });
    Ok(ChannelFile { fs_hz, channels: channels.collect(), hits: samples(path, all)? })
}

/// `hammer (N)` or `hammer [N]` as a name and a unit.
fn name_and_unit(heading: &str) -> (String, Option<String>) {
    let parts = [('(', ')'), ('[', ']')].into_iter().find_map(|(open, close)| {
        let (name, rest) = heading.split_once(&format!(" {open}"))?;
        Some((name.trim().to_owned(), Some(rest.trim().strip_suffix(close)?.to_owned())))
    });
    parts.unwrap_or_else(|| (heading.trim().to_owned(), None))
}

/// The rate of evenly spaced times whose last digit is `digit_s`.
fn rate_of(times: &[f64], digit_s: f64) -> Result<f64, String> {
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Err("a hit has no sample".into());
    };
    let steps = times.len().saturating_sub(1) as f64;
    let length = last - first;
    if !(length > 0.0 && length.is_finite()) {
        return Err("the column of time does not increase".into());
    }
    let step = length / steps;
    // half a step tells a missing sample; written digits may be coarser
    let allowed = (0.45 * step).max(2.0 * digit_s);
    let strays =
        times.iter().zip(0u32..).position(|(t, n)| (t - first - f64::from(n) * step).abs() > allowed);
    if let Some(sample) = strays {
        return Err(format!(
            "its times are not evenly spaced (sample {sample}): samples are missing, or it must be resampled"
        ));
    }
    let rate_hz = 1.0 / step;
    // the digits leave a rate undecided by this much; if only one whole number lies within it, that
    // is meant
    let doubt = rate_hz * (2.0 * digit_s / length).max(1e-9);
    let whole = rate_hz.round();
    if doubt < 0.5 && (rate_hz - whole).abs() <= doubt {
        return Ok(whole);
    }
    if doubt > 1e-5 * rate_hz {
        return Err(format!(
            "its times have too few digits for the sampling rate ({rate_hz:.3} ± {doubt:.3} Hz): write more digits"
        ));
    }
    Ok(rate_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_names_channels_and_units() {
        assert_eq!(name_and_unit("hammer (N)"), ("hammer".into(), Some("N".into())));
        assert_eq!(name_and_unit("x [(mm/s)]"), ("x".into(), Some("(mm/s)".into())));
        assert_eq!(name_and_unit("LDV_A"), ("LDV_A".into(), None));
    }

    #[test]
    fn the_rate_is_what_the_times_can_tell() {
        let times = |rate_hz: f64, count: u32, decimals: i32| -> Vec<f64> {
            let unit = 10f64.powi(decimals);
            (0..count).map(|n| (f64::from(n) / rate_hz * unit).round() / unit).collect()
        };
        assert_eq!(rate_of(&times(51_200.0, 51_200, 6), 1e-6), Ok(51_200.0));
        let exact = rate_of(&times(17_066.67, 34_133, 12), 1e-12).expect("enough digits");
        assert!((exact / 17_066.67 - 1.0).abs() < 1e-9);
        assert!(rate_of(&times(17_066.67, 171, 3), 1e-3).is_err());
        let mut gap = times(51_200.0, 1_000, 9);
        gap.remove(500);
        assert!(rate_of(&gap, 1e-9).expect_err("a sample is missing").contains("evenly"));
    }

    #[test]
    fn text_and_wav_keep_every_value() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("hit.csv");
        let text = "time (s); hammer (N); LDV_A (mm/s)\n0,0000000000; 0,1; 1\n\
                    0,0001000000; 50,25; 2\n0,0002000000; 0; -3\n";
        std::fs::write(&path, text).expect("written");
        let read = read_channel_file(&path).expect("readable");
        assert_eq!((read.fs_hz, read.hits.len()), (10_000.0, 1));
        assert_eq!(read.channels[1].unit.as_deref(), Some("mm/s"));
        assert_eq!(read.hits[0].types(), [SampleType::F64, SampleType::F32]);
        let path = folder.path().join("hit.wav");
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 48_000,
            bits_per_sample: 24,
            sample_format: SampleFormat::Int,
        };
        let mut out = hound::WavWriter::create(&path, spec).expect("a file");
        let codes = [-8_388_608_i32, 1, 8_388_607, -2, 0, 3];
        for code in codes {
            out.write_sample(code).expect("written");
        }
        out.finalize().expect("whole");
        let read = read_channel_file(&path).expect("readable");
        assert_eq!(read.channels[0].bits, 24);
        assert_eq!(read.hits[0].channel(1), crate::device::samples::ChannelView::I32(&[1, -2, 3]));
        let whole = std::fs::read(&path).expect("there");
        std::fs::write(&path, &whole[..whole.len() - 4]).expect("written");
        assert!(read_channel_file(&path).is_err());
    }
}
