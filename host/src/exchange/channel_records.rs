//! Exports the channels of a cell's hits other than force and response (specimens, load cells,
//! excitation), in the same order of hits as the file of force and response.

use super::frf_uff::{FrfUffError, write_uff};
use super::npz::NpzOutput;
use super::tables_output::{TableError, write_rows_of};
use super::uff::{
    Abscissa, Axis, ByteOrder, DataSet, Dof, Encoding, Function, Header, Units, Values, kind, quantity,
};
use super::{NpzError, uff};
use jointrig_protocol::channel::Quantity;
use std::path::Path;

/// Longest name of an entity in a universal file, characters.
const ENTITY: usize = 10;

/// The channels of a cell's hits other than force and response.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelRecords {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Each channel's name.
    pub names: Vec<String>,
    /// The quantity of each channel, in SI.
    pub quantities: Vec<Quantity>,
    /// Delay of each channel, s: (hit, channel).
    pub delay_s: Vec<Vec<f64>>,
    /// Record id of each hit.
    pub records: Vec<i64>,
    /// The measured signals: (hit, channel, sample).
    pub signals: Vec<Vec<Vec<f64>>>,
}

impl ChannelRecords {
    fn samples(&self) -> usize {
        self.signals.first().and_then(|hit| hit.first()).map_or(0, Vec::len)
    }
}

/// Writes npz: `fs` (Hz), `record` (hit), `names` (channel), `units` (channel), `delay_s` (hit,
/// channel), `signals` (hit, channel, sample) in SI.
///
/// # Errors
/// [`NpzError::Write`]; [`NpzError::Content`] when hits differ in length.
pub fn write_npz(path: &Path, all: &ChannelRecords) -> Result<(), NpzError> {
    let (hits, channels, samples) = (all.signals.len(), all.names.len(), all.samples());
    if all.signals.iter().flatten().any(|signal| signal.len() != samples) {
        return Err(NpzError::Content { path: path.into(), reason: "hits differ in length".into() });
    }
    let mut out = NpzOutput::create(path)?;
    out.real("fs", &[], [all.fs_hz])?;
    out.real("record", &[hits], all.records.iter().map(|id| *id as f64))?;
    out.text("names", &[channels], &all.names)?;
    out.text("units", &[channels], &all.quantities.iter().map(|q| q.unit().to_owned()).collect::<Vec<_>>())?;
    out.real("delay_s", &[hits, channels], all.delay_s.iter().flatten())?;
    out.real("signals", &[hits, channels, samples], all.signals.iter().flatten().flatten())?;
    out.finish()
}

/// Writes a universal file of time responses, one hit after another: the entity is the channel's
/// name; the identification holds the record and the channel's delay.
///
/// # Errors
/// The data does not fit the format, or the file cannot be written.
pub fn write_uff_file(path: &Path, all: &ChannelRecords) -> Result<(), FrfUffError> {
    let header = Header { program: "jointrig".into(), ..Header::default() };
    let mut sets = vec![DataSet::Header(header), DataSet::Units(Units::si())];
    let places: Vec<f64> = (0..all.samples()).map(|i| i as f64 / all.fs_hz).collect();
    for (hit, (record, signals)) in all.records.iter().zip(&all.signals).enumerate() {
        for (node, (channel, signal)) in (1..).zip(signals.iter().enumerate()) {
            let name = &all.names[channel];
            let mut function = Function::new(
                kind::TIME,
                Abscissa::of(&places[..signal.len()]),
                Values::Real(signal.clone()),
            );
            function.id[0] = format!("record {record}, {name}");
            function.id[1] = format!("late by {:e} s", all.delay_s[hit][channel]);
            function.version = *record;
            let entity = name.chars().take(ENTITY).collect();
            function.response = Dof { entity, node, direction: 0 };
            let (of, unit) = (kind_of(all.quantities[channel]), all.quantities[channel].unit());
            let axis = |quantity, unit: &str| Axis { quantity, unit: unit.into(), ..Axis::default() };
            function.axes = [axis(quantity::TIME, "s"), axis(of, unit), Axis::default(), Axis::default()];
            function.encoding = Encoding::Binary(ByteOrder::Little);
            sets.push(function.into());
        }
    }
    write_uff(path, &sets)
}

fn kind_of(measured: Quantity) -> i64 {
    match measured {
        Quantity::Force => uff::quantity::FORCE,
        Quantity::Velocity => uff::quantity::VELOCITY,
        Quantity::Displacement => uff::quantity::DISPLACEMENT,
        Quantity::Acceleration => uff::quantity::ACCELERATION,
        Quantity::Voltage => 0,
    }
}

/// Writes comma-separated text: `record`, `time_s`, and a column `NAME (UNIT)` for each channel,
/// one hit after another.
///
/// # Errors
/// [`TableError`].
pub fn write_csv(path: &Path, all: &ChannelRecords) -> Result<(), TableError> {
    let units = all.names.iter().zip(&all.quantities).map(|(name, of)| format!("{name} ({})", of.unit()));
    let heading: Vec<String> = ["record", "time_s"].map(String::from).into_iter().chain(units).collect();
    let rows = all.records.iter().zip(&all.signals).flat_map(|(record, signals)| {
        let samples = signals.first().map_or(0, Vec::len);
        (0..samples).map(move |i| {
            let head = [record.to_string(), (i as f64 / all.fs_hz).to_string()];
            let values =
                signals.iter().map(|signal| signal.get(i).map_or(String::new(), ToString::to_string));
            head.into_iter().chain(values).collect::<Vec<String>>()
        })
    });
    write_rows_of(path, std::iter::once(heading).chain(rows))
}
