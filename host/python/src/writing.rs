//! Writing: a new campaign file, and hits and levels from arrays, judged and stored by the same
//! functions as the command's import.

use crate::interruptible::Stopped;
use crate::{in_the_process_that_loaded_this, interruptible, raised};
use jointrig::campaign::cut::import::{self as cutting, Cut, Places, Stored, Terms};
use jointrig::campaign::cut::marker::Marker;
use jointrig::campaign::cut::recording::LongRecording;
use jointrig::campaign::cut::{CutError, Only};
use jointrig::campaign::import::assign::{Calibrations, assigned};
use jointrig::campaign::import::channel_file::{ChannelFile, FileChannel};
use jointrig::campaign::import::{
    self, Added, AddedLevel, CellName, Hit, ImportError, NewLevelRecord, Origin,
};
use jointrig::campaign::plan::level::{Level, Moment};
use jointrig::campaign::plan::{Plan, configuration_name};
use jointrig::campaign::store::Store;
use jointrig::campaign::verdict::Judgement;
use jointrig::device::samples::{ChannelSamples, ChannelView, SampleType, Samples};
use numpy::{Element, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Debug;
use std::path::Path;

/// The arrays of hits or of a level, and what Python states about them: each dict has the channels'
/// names as its keys.
pub struct Arrays<'py> {
    pub fs_hz: f64,
    pub force_n: Option<Bound<'py, PyAny>>,
    pub channels: Bound<'py, PyDict>,
    pub units: Option<Bound<'py, PyDict>>,
    pub scale: Option<Bound<'py, PyDict>>,
    pub delay_s: Option<Bound<'py, PyDict>>,
}

/// Name of the channel that `force_n` becomes.
const HAMMER: &str = "force";

impl<'py> Arrays<'py> {
    /// The channels as those of a file, the hammer's force first; `axes` are the axes that their
    /// arrays must have.
    ///
    /// # Errors
    /// Refused: a table names an unknown channel, or arrays of another type or shape.
    pub fn read(&self, py: Python<'py>, axes: &[&str]) -> PyResult<ChannelFile> {
        let refused = |what: String| Err(raised::refused(py, &what));
        if !(1.0..=f64::from(u32::MAX)).contains(&self.fs_hz) {
            return refused(format!("fs_hz is {}: 1 Hz or more is needed", self.fs_hz));
        }
        let mut arrays: Vec<(String, Bound<'py, PyAny>)> = Vec::new();
        if let Some(force) = &self.force_n {
            arrays.push((HAMMER.into(), force.clone()));
        }
        for (name, samples) in &self.channels {
            arrays.push((name.extract()?, samples));
        }
        for (table, stated) in [("units", &self.units), ("scale", &self.scale), ("delay_s", &self.delay_s)] {
            for name in stated.iter().flat_map(PyDictMethods::keys) {
                let name: String = name.extract()?;
                if !arrays.iter().any(|(own, _)| *own == name) {
                    return refused(format!("{table} names `{name}`, which is none of the channels"));
                }
            }
        }
        let stated =
            |table: &Option<Bound<'py, PyDict>>, name: &str| -> PyResult<Option<Bound<'py, PyAny>>> {
                table.as_ref().map_or(Ok(None), |table| table.get_item(name))
            };
        let number = |table, name: &str, otherwise: f64| -> PyResult<f64> {
            stated(table, name)?.map_or(Ok(otherwise), |value| value.extract())
        };
        let numpy = py.import("numpy")?;
        let (mut channels, mut columns) = (Vec::new(), Vec::new());
        for (name, samples) in arrays {
            let samples = numpy.call_method1("ascontiguousarray", (samples,))?;
            let found: usize = samples.getattr("ndim")?.extract()?;
            if found != axes.len() {
                let wanted = axes.join(", ");
                return refused(format!("channel `{name}` has {found} axes: ({wanted}) is needed"));
            }
            let scale = number(&self.scale, &name, 1.0)?;
            if !scale.is_normal() {
                return refused(format!(
                    "channel `{name}`: a scale of {scale}: a number other than 0 is needed"
                ));
            }
            let Some(hits) = hits(&numpy.call_method1("atleast_2d", (samples,))?, scale) else {
                return refused(format!(
                    "channel `{name}`: int16, int32, float32 or float64 with the axes (hit, sample) are needed"
                ));
            };
            let bits = match hits.first().map(|own| own.view().of()) {
                Some(SampleType::I16) => 16,
                Some(SampleType::I32) => 32,
                _ => 0,
            };
            let unit = match stated(&self.units, &name)? {
                Some(unit) => Some(unit.extract()?),
                None => (name == HAMMER && self.force_n.is_some()).then(|| "N".to_owned()),
            };
            channels.push(FileChannel {
                unit,
                full_scale: (bits > 0).then(|| scale * f64::from(1_u32 << (bits - 1))),
                bits,
                delay_s: number(&self.delay_s, &name, 0.0)?,
                name,
            });
            columns.push(hits.into_iter());
        }
        let count = columns.first().map_or(0, ExactSizeIterator::len);
        if count == 0 {
            return refused(format!("there is no hit: channels need the axes ({})", axes.join(", ")));
        }
        if let Some(other) = columns.iter().position(|own| own.len() != count) {
            let (name, hits) = (&channels[other].name, columns[other].len());
            return refused(format!(
                "channel `{name}` has {hits} hits, and `{}` has {count}",
                channels[0].name
            ));
        }
        let mut all = Vec::new();
        for hit in 0..count {
            let own = columns.iter_mut().filter_map(Iterator::next).collect();
            let Some(samples) = Samples::new(own) else {
                return refused(format!("hit {hit}: its channels differ in length"));
            };
            all.push(samples);
        }
        Ok(ChannelFile { fs_hz: self.fs_hz, channels, hits: all })
    }
}

/// The samples of each hit: codes as they came, values times `scale`. `None` for another type or
/// shape.
fn hits(samples: &Bound<'_, PyAny>, scale: f64) -> Option<Vec<ChannelSamples>> {
    fn rows<'py, T: Element + Copy>(
        samples: &Bound<'py, PyAny>,
        of: impl Fn(Vec<T>) -> ChannelSamples,
    ) -> Option<Vec<ChannelSamples>> {
        let array = samples.extract::<PyReadonlyArray2<'py, T>>().ok()?;
        Some(array.as_array().outer_iter().map(|hit| of(hit.to_vec())).collect())
    }
    let scaled = |hit: Vec<f64>| match scale {
        1.0 => hit,
        _ => hit.into_iter().map(|value| value * scale).collect(),
    };
    let single = |hit: Vec<f32>| match scale {
        1.0 => ChannelSamples::F32(hit),
        _ => ChannelSamples::F64(scaled(hit.into_iter().map(f64::from).collect())),
    };
    rows(samples, ChannelSamples::I16)
        .or_else(|| rows(samples, ChannelSamples::I32))
        .or_else(|| rows(samples, single))
        .or_else(|| rows(samples, |hit| ChannelSamples::F64(scaled(hit))))
}

/// Identifies the arrays by their description and samples, so that a second call with the same ones
/// stores nothing.
fn origin(name: &str, described: &impl Debug, all: &[Samples]) -> Origin {
    let mut bytes: Vec<Vec<u8>> = vec![format!("{described:?}").into_bytes()];
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
pub fn add_hits(
    py: Python<'_>,
    path: &Path,
    (configuration, impact, response): (&str, &str, Option<&str>),
    (channels, calibrate): (&ChannelFile, &Calibrations),
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
    let (map, all) = assigned(&plan, &response, channels, calibrate).map_err(refused)?;
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
    (channels, calibrate): (&ChannelFile, &Calibrations),
    source: &str,
) -> PyResult<AddedLevel> {
    in_the_process_that_loaded_this(py)?;
    // a level belongs to no response location
    let (map, all) =
        assigned(&plan(py, path)?, "", channels, calibrate).map_err(|what| raised::refused(py, &what))?;
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

/// How Python states the places.
const TERMS: Terms = Terms {
    order: "order=\"plan\"",
    marker: "marker=\"CHANNEL:STEP\"",
    table: "table=, the text of a CSV file",
    place: "configuration=, impact= and response=",
};

/// What Python states about a continuous recording.
pub struct Recorded {
    /// Configuration, impact and response, as far as they are named.
    pub only: [Option<String>; 3],
    pub order: Option<String>,
    pub marker: Option<String>,
    /// Text of the table of places.
    pub table: Option<String>,
    pub source: String,
    pub replace: bool,
    pub dry_run: bool,
}

impl Recorded {
    /// The hits and their places; a Ctrl-C ends the search.
    fn found(
        &self,
        stopped: &Stopped,
        plan: &Plan,
        marker: Option<&Marker>,
        channels: ChannelFile,
        calibrate: &Calibrations,
    ) -> Result<(LongRecording, Cut), CutError> {
        let [configuration, impact, response] = self.only.each_ref().map(Option::as_deref);
        let places = Places {
            only: Only { configuration, impact, response },
            in_order: self.order.is_some(),
            table: self.table.as_deref().map(|text| ("table", text)),
            marker,
            terms: &TERMS,
        };
        cutting::stated_places(plan, &places)?;
        let recording = LongRecording::in_memory(&self.source, plan, channels, calibrate)?;
        let cut = cutting::cut(&recording, plan, &places, &mut |_, _| stopped.end_here_if_so())?;
        Ok((recording, cut))
    }
}

/// Place, number, verdict and sentence of a stored hit.
pub type CutVerdict = (String, u32, &'static str, String);

/// Cuts a continuous recording; returns what was found, the counts of stored hits, and the verdict
/// of each.
pub fn cut(
    py: Python<'_>,
    path: &Path,
    by: Recorded,
    channels: ChannelFile,
    calibrate: Calibrations,
) -> PyResult<(Vec<String>, Stored, Vec<CutVerdict>)> {
    in_the_process_that_loaded_this(py)?;
    let plan = plan(py, path)?;
    if let Some(order) = by.order.as_deref().filter(|order| *order != "plan") {
        return Err(raised::refused(py, &format!("order is `{order}`: \"plan\" is the only one")));
    }
    let marker: Option<Marker> = by
        .marker
        .as_deref()
        .map(|text| text.parse().map_err(|what: String| raised::refused(py, &format!("marker: {what}"))))
        .transpose()?;
    let failed = |error: CutError| match error {
        CutError::Store(error) => raised::file(py, path, &error),
        CutError::Import(error) => failed(py, path, &error),
        other => raised::refused(py, &other.to_string()),
    };
    let Recorded { replace, dry_run, .. } = by;
    let (origin, plan, found) = interruptible::run(py, move |stopped| {
        let origin = origin(&by.source, &(channels.fs_hz, &channels.channels), &channels.hits);
        let found = by.found(stopped, &plan, marker.as_ref(), channels, &calibrate);
        (origin, plan, found)
    })?;
    let (recording, cut) = found.map_err(failed)?;
    let mut verdicts = Vec::new();
    if dry_run {
        return Ok((cut.report, Stored::default(), verdicts));
    }
    let stored = py.detach(|| -> Result<_, CutError> {
        let mut store = Store::open(path)?;
        let mut tell = |place: &str, hit: u32, verdict: &Judgement| {
            verdicts.push((place.to_owned(), hit, verdict.kind.name(), verdict.sentence.clone()));
        };
        let into = (&mut store, &origin);
        let stored = cutting::store(&recording, (&cut, &plan), into, replace, &mut tell, &mut |_| {})?;
        store.close()?;
        Ok(stored)
    });
    Ok((cut.report, stored.map_err(failed)?, verdicts))
}

/// Sensitivities in the form of the command's `--calibrate`.
pub fn calibrations(py: Python<'_>, text: &str) -> PyResult<Calibrations> {
    text.parse().map_err(|what: String| raised::refused(py, &what))
}

fn plan(py: Python<'_>, path: &Path) -> PyResult<Plan> {
    py.detach(|| Store::open_read_only(path)?.plan()).map_err(|error| raised::file(py, path, &error))
}
