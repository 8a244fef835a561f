//! Writing: a new campaign file, and hits and levels from arrays, judged and stored by the same
//! functions as the command's import.

use crate::lab::Lab;
use crate::{in_the_process_that_loaded_this, raised};
use jointrig::campaign::import::roles::role_of;
use jointrig::campaign::import::{
    self, Added, AddedLevel, CellName, Hit, ImportError, NewLevelRecord, Origin,
};
use jointrig::campaign::plan::level::{Level, Moment};
use jointrig::campaign::plan::{Plan, configuration_name};
use jointrig::campaign::store::Store;
use jointrig::campaign::verdict::Judgement;
use jointrig::device::channels::ChannelMap;
use jointrig::device::samples::{ChannelSamples, ChannelView, Samples};
use jointrig::exchange::units::{Dimension, Unit};
use jointrig_protocol::channel::{Channel, Quantity, Role};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};

/// A new campaign file for the plan in `plan`.
#[pyfunction]
pub fn new(py: Python<'_>, path: PathBuf, plan: PathBuf) -> PyResult<Lab> {
    let text = std::fs::read_to_string(&plan)
        .map_err(|error| raised::reading(py, &plan, &format!("{}: {error}", plan.display())))?;
    py.detach(|| Store::create(&path, &text, &plan.display().to_string())?.close())
        .map_err(|error| raised::file(py, &path, &error))?;
    Ok(Lab::at(path))
}

/// One channel of hits or of a level, as Python describes it.
pub struct Given<'py> {
    name: String,
    unit: String,
    /// Units per sample.
    scale: f64,
    delay_s: f64,
    /// (hit, sample), of one of four types.
    samples: Bound<'py, PyAny>,
}

/// What Python states about the channels: each dict has the channels' names as its keys.
pub struct Stated<'py> {
    pub force_n: Option<Bound<'py, PyAny>>,
    pub channels: Bound<'py, PyDict>,
    pub units: Option<Bound<'py, PyDict>>,
    pub scale: Option<Bound<'py, PyDict>>,
    pub delay_s: Option<Bound<'py, PyDict>>,
}

impl<'py> Stated<'py> {
    /// The channels, the hammer's force first; `axes` are the axes that their arrays must have.
    ///
    /// # Errors
    /// Refused: a channel without a unit, a unit of an unknown channel, or arrays of another shape.
    pub fn given(&self, py: Python<'py>, axes: &[&str]) -> PyResult<Vec<Given<'py>>> {
        let refused = |what: String| raised::refused(py, &what);
        let mut arrays: Vec<(String, Bound<'py, PyAny>)> = Vec::new();
        if let Some(force) = &self.force_n {
            arrays.push((HAMMER.into(), force.clone()));
        }
        for (name, samples) in &self.channels {
            arrays.push((name.extract()?, samples));
        }
        let tables = [("units", &self.units), ("scale", &self.scale), ("delay_s", &self.delay_s)].into_iter();
        for (table, stated) in tables.filter_map(|(table, stated)| Some((table, stated.as_ref()?))) {
            for name in stated.keys() {
                let name: String = name.extract()?;
                if !arrays.iter().any(|(own, _)| *own == name) {
                    return Err(refused(format!("{table} names `{name}`, which is none of the channels")));
                }
            }
        }
        let stated =
            |table: &Option<Bound<'py, PyDict>>, name: &str| -> PyResult<Option<Bound<'py, PyAny>>> {
                table.as_ref().map_or(Ok(None), |table| table.get_item(name))
            };
        let numpy = py.import("numpy")?;
        let mut all = Vec::new();
        for (name, samples) in arrays {
            let unit = match stated(&self.units, &name)? {
                Some(unit) => unit.extract()?,
                None if name == HAMMER && self.force_n.is_some() => "N".to_owned(),
                None => {
                    return Err(refused(format!(
                        "channel `{name}` has no unit: units={{{name:?}: \"m/s\"}}, or N, g, V …"
                    )));
                }
            };
            let number = |table, otherwise: f64| -> PyResult<f64> {
                stated(table, &name)?.map_or(Ok(otherwise), |value| value.extract())
            };
            let samples = numpy.call_method1("ascontiguousarray", (samples,))?;
            let found: usize = samples.getattr("ndim")?.extract()?;
            if found != axes.len() {
                let wanted = axes.join(", ");
                return Err(refused(format!("channel `{name}` has {found} axes: ({wanted}) is needed")));
            }
            all.push(Given {
                unit,
                scale: number(&self.scale, 1.0)?,
                delay_s: number(&self.delay_s, 0.0)?,
                samples: numpy.call_method1("atleast_2d", (samples,))?,
                name,
            });
        }
        Ok(all)
    }
}

/// Name of the channel that `force_n` becomes.
const HAMMER: &str = "force";

/// A channel with its samples, hit by hit.
struct Described {
    channel: Channel,
    hits: Vec<ChannelSamples>,
}

impl Given<'_> {
    /// The channel, with the role that its name has in the plan at this response location.
    fn described(&self, plan: &Plan, response: &str) -> Result<Described, String> {
        let name = &self.name;
        let wanted = [
            (Dimension::FORCE, Quantity::Force),
            (Dimension::VELOCITY, Quantity::Velocity),
            (Dimension::ACCELERATION, Quantity::Acceleration),
            (Dimension::DISPLACEMENT, Quantity::Displacement),
            (Dimension::VOLTAGE, Quantity::Voltage),
        ];
        let unit = Unit::parse(&self.unit, &wanted.map(|(dimension, _)| dimension))
            .map_err(|error| format!("channel `{name}`: unit `{}`: {error}", self.unit))?;
        let (_, quantity) = *wanted
            .iter()
            .find(|(dimension, _)| *dimension == unit.dimension)
            .ok_or_else(|| format!("channel `{name}`: unit `{}` is of no use here", self.unit))?;
        let factor = unit.factor * self.scale;
        let hits = self.hits(factor).ok_or_else(|| {
            format!(
                "channel `{name}`: int16, int32, float32 or float64 with the axes (hit, sample) are needed"
            )
        })?;
        // codes keep their type: half their range is the full scale of a converter of 1 V
        let (bits, per_volt) = match hits.first().map(ChannelSamples::view) {
            Some(ChannelView::I16(_)) => (16, factor * 32_768.0),
            Some(ChannelView::I32(_)) => (32, factor * 2_147_483_648.0),
            _ => (0, 1.0),
        };
        if !(per_volt as f32).is_normal() {
            return Err(format!(
                "channel `{name}`: a sample would be {factor} in SI units: state another scale"
            ));
        }
        // checked by the function that adds the hits
        let late_ns = (1e9 * self.delay_s).round();
        if !(0.0..=f64::from(u32::MAX)).contains(&late_ns) {
            return Err(format!("channel `{name}`: a delay of {} s: 0 to 4 s are possible", self.delay_s));
        }
        let role = role_of(plan, response, name, quantity).unwrap_or(Role::Auxiliary);
        let channel = Channel {
            name: name.parse().map_err(|_| format!("channel `{name}`: 24 bytes at most"))?,
            role,
            quantity,
            units_per_volt: per_volt as f32,
            range_v: if bits == 0 { 0.0 } else { 1.0 },
            delay_ns: late_ns as u32,
            bits,
        };
        Ok(Described { channel, hits })
    }

    /// The samples of each hit; floating-point ones in SI units, which keep their type if they are
    /// in SI units already. `None` for another type or shape.
    fn hits(&self, factor: f64) -> Option<Vec<ChannelSamples>> {
        if let Ok(codes) = self.samples.extract::<PyReadonlyArray2<'_, i16>>() {
            let rows = codes.as_array();
            return Some(rows.outer_iter().map(|hit| ChannelSamples::I16(hit.to_vec())).collect());
        }
        if let Ok(codes) = self.samples.extract::<PyReadonlyArray2<'_, i32>>() {
            let rows = codes.as_array();
            return Some(rows.outer_iter().map(|hit| ChannelSamples::I32(hit.to_vec())).collect());
        }
        if let Ok(values) = self.samples.extract::<PyReadonlyArray2<'_, f32>>() {
            let rows = values.as_array();
            let of = |hit: &[f32]| match factor {
                1.0 => ChannelSamples::F32(hit.to_vec()),
                _ => ChannelSamples::F64(hit.iter().map(|value| f64::from(*value) * factor).collect()),
            };
            return Some(rows.outer_iter().map(|hit| of(&hit.to_vec())).collect());
        }
        let values = self.samples.extract::<PyReadonlyArray2<'_, f64>>().ok()?;
        let rows = values.as_array();
        Some(
            rows.outer_iter()
                .map(|hit| ChannelSamples::F64(hit.iter().map(|value| value * factor).collect()))
                .collect(),
        )
    }
}

/// The channel map and the samples of each hit.
fn together(
    plan: &Plan,
    response: &str,
    fs_hz: f64,
    given: &[Given<'_>],
) -> Result<(ChannelMap, Vec<Samples>), String> {
    let rounded = fs_hz.round();
    if !(1.0..=f64::from(u32::MAX)).contains(&rounded) {
        return Err(format!("fs_hz is {fs_hz}: 1 Hz or more is needed"));
    }
    let mut map = ChannelMap {
        id: 0,
        rate_hz: rounded as u32,
        exact_hz: (rounded != fs_hz).then_some(fs_hz),
        channels: Vec::new(),
    };
    let mut columns = Vec::new();
    for one in given {
        let Described { channel, hits } = one.described(plan, response)?;
        map.channels.push(channel);
        columns.push(hits.into_iter());
    }
    let count = columns.first().map_or(0, ExactSizeIterator::len);
    if let Some(other) = columns.iter().position(|own| own.len() != count) {
        let (name, hits) = (&given[other].name, columns[other].len());
        return Err(format!("channel `{name}` has {hits} hits, and `{}` has {count}", given[0].name));
    }
    let mut all = Vec::new();
    for hit in 0..count {
        let own = columns.iter_mut().filter_map(Iterator::next).collect();
        all.push(Samples::new(own).ok_or_else(|| format!("hit {hit}: its channels differ in length"))?);
    }
    Ok((map, all))
}

/// Identifies the arrays, so that a second call with the same ones stores nothing.
fn origin(name: &str, map: &ChannelMap, all: &[Samples]) -> Origin {
    let mut bytes: Vec<Vec<u8>> = vec![format!("{map:?}").into_bytes()];
    for view in all.iter().flat_map(Samples::each) {
        bytes.push(match view {
            ChannelView::I16(own) => own.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ChannelView::I32(own) => own.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ChannelView::F32(own) => own.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ChannelView::F64(own) => own.iter().flat_map(|v| v.to_le_bytes()).collect(),
        });
    }
    Origin::of_content(name, bytes.iter().map(Vec::as_slice))
}

/// The response location that hits of this configuration and impact belong to if none is named:
/// the first one if all have fixed sensors, which measure every hit.
fn only_response(plan: &Plan, configuration: &str, impact: &str) -> Result<String, String> {
    let own = plan.configuration(configuration).map_or(configuration, |own| configuration_name(own));
    let cells = plan.cells();
    let there: Vec<&str> = (cells.iter())
        .filter(|cell| configuration_name(cell.configuration) == own && cell.impact == impact)
        .map(|cell| cell.response.as_str())
        .collect();
    let fixed = there.iter().all(|name| plan.own_channels(name).is_some());
    match there.as_slice() {
        [] => Err(format!("the plan has no impact `{impact}` in configuration `{configuration}`")),
        [only] => Ok((*only).to_owned()),
        [first, ..] if fixed => Ok((*first).to_owned()),
        all => Err(format!(
            "several locations were measured from `{impact}`: response= one of {}",
            all.join(", ")
        )),
    }
}

/// An error of the import, as Python raises it.
fn failed(py: Python<'_>, path: &Path, error: &ImportError) -> PyErr {
    match error {
        ImportError::Store(error) => raised::file(py, path, error),
        other => raised::refused(py, &other.to_string()),
    }
}

/// Adds the hits of one cell (configuration, impact, response); returns their counts, and verdict
/// and sentence of each.
#[allow(clippy::too_many_arguments, reason = "Python names each of them")]
pub fn add_hits(
    py: Python<'_>,
    path: &Path,
    (configuration, impact, response): (&str, &str, Option<&str>),
    fs_hz: f64,
    channels: &[Given<'_>],
    trigger_index: Option<usize>,
    source: &str,
    replace: bool,
) -> PyResult<(Added, Vec<(&'static str, String)>)> {
    in_the_process_that_loaded_this(py)?;
    let plan = plan(py, path)?;
    let refused = |what: String| raised::refused(py, &what);
    let response = match response {
        Some(response) => response.to_owned(),
        None => only_response(&plan, configuration, impact).map_err(refused)?,
    };
    let (map, all) = together(&plan, &response, fs_hz, channels).map_err(refused)?;
    if all.is_empty() {
        return Err(refused("there is no hit: channels need the axes (hit, sample)".into()));
    }
    let mut verdicts = Vec::new();
    let added = py.detach(|| {
        let origin = origin(source, &map, &all);
        let of = |(number, samples)| Hit { trigger_index, ..Hit::new(number, samples) };
        let hits = (0..).zip(all).map(of).collect();
        let mut store = Store::open(path)?;
        let cell = CellName { configuration, impact, response: &response };
        let mut tell = |_, verdict: &Judgement| {
            verdicts.push((verdict.kind.name(), verdict.sentence.clone()));
        };
        let added = import::add_hits(&mut store, &origin, &cell, &map, hits, replace, &mut tell)?;
        store.log(&format!("imported {} hits from {source} by Python", added.hits))?;
        store.close()?;
        Ok(added)
    });
    let added = added.map_err(|error: ImportError| failed(py, path, &error))?;
    Ok((added, verdicts))
}

/// Adds a level of the shaker.
pub fn add_level(
    py: Python<'_>,
    path: &Path,
    level: Level,
    moment: Moment,
    fs_hz: f64,
    channels: &[Given<'_>],
    source: &str,
) -> PyResult<AddedLevel> {
    in_the_process_that_loaded_this(py)?;
    // a level belongs to no response location
    let (map, all) =
        together(&plan(py, path)?, "", fs_hz, channels).map_err(|what| raised::refused(py, &what))?;
    let Some(samples) = all.into_iter().next() else {
        return Err(raised::refused(py, "there is no sample: channels need the axis (sample)"));
    };
    let added = py.detach(|| {
        let origin = origin(source, &map, std::slice::from_ref(&samples));
        let mut store = Store::open(path)?;
        let new = NewLevelRecord { moment, level, samples, first_scan: 0, gaps: Vec::new() };
        let added = import::add_level(&mut store, &origin, &map, new)?;
        store.log(&format!("imported the level {level} from {source} by Python"))?;
        store.close()?;
        Ok(added)
    });
    added.map_err(|error: ImportError| failed(py, path, &error))
}

fn plan(py: Python<'_>, path: &Path) -> PyResult<Plan> {
    py.detach(|| Store::open_read_only(path)?.plan()).map_err(|error| raised::file(py, path, &error))
}
