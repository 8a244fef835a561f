//! One firing of the hammer.

use std::collections::HashMap;
use std::path::PathBuf;

use jointrig::campaign::plan::{Cell, configuration_name};
use jointrig::campaign::store::Store;
use jointrig::campaign::store::error::StoreError;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::device::channels::ChannelMap;
use jointrig::device::samples::{ChannelView, SampleType, Samples};
use numpy::{Element, IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;

use crate::raised;

/// One firing of the hammer: the measured data and their evaluation.
#[pyclass(module = "jointrig._native", frozen)]
pub struct Record {
    path: PathBuf,
    row: RecordRow,
    cell: Cell,
}

impl Record {
    /// All readable records, in the order in which they were measured.
    pub fn all(store: &Store) -> Result<Vec<Self>, StoreError> {
        let cells: HashMap<i64, Cell> = store.cells()?.into_iter().map(|row| (row.id, row.cell)).collect();
        let path = store.path().to_owned();
        let of = |row: RecordRow| {
            let cell = cells.get(&row.cell)?.clone();
            Some(Self { path: path.clone(), row, cell })
        };
        Ok(store.records()?.into_iter().flatten().filter_map(of).collect())
    }

    fn map(&self, py: Python<'_>, store: &Store) -> PyResult<ChannelMap> {
        store.channels(self.row.session).map_err(|error| raised::file(py, &self.path, &error))
    }

    fn read(&self, py: Python<'_>) -> PyResult<Samples> {
        let read = py.detach(|| Store::open_read_only(&self.path)?.samples(&self.row));
        read.map_err(|error: StoreError| raised::file(py, &self.path, &error))
    }

    /// The file, its channels, and the index of one of them.
    fn channel(&self, py: Python<'_>, name: &str) -> PyResult<(Store, ChannelMap, usize)> {
        let store =
            Store::open_read_only(&self.path).map_err(|error| raised::file(py, &self.path, &error))?;
        let map = self.map(py, &store)?;
        let place = map.channels.iter().position(|channel| channel.name == name);
        if let Some(place) = place {
            return Ok((store, map, place));
        }
        let known: Vec<&str> = map.channels.iter().map(|channel| channel.name.as_str()).collect();
        let sentence = format!("record {} has no channel `{name}`: {}", self.row.id, known.join(", "));
        Err(raised::refused(py, &sentence))
    }
}

/// The smallest type that holds every value of all channels exactly.
fn common(samples: &Samples) -> SampleType {
    let types = samples.types();
    let only = |some: &[SampleType]| types.iter().all(|of| some.contains(of));
    if only(&[SampleType::I16]) {
        SampleType::I16
    } else if only(&[SampleType::I16, SampleType::I32]) {
        SampleType::I32
    } else if only(&[SampleType::I16, SampleType::F32]) {
        SampleType::F32
    } else {
        SampleType::F64
    }
}

/// All channels in one array, each converted by `of`.
fn together<'py, T: Element>(
    py: Python<'py>,
    samples: &Samples,
    shape: [usize; 2],
    of: impl Fn(ChannelView<'_>) -> Vec<T>,
) -> PyResult<Bound<'py, PyAny>> {
    let all: Vec<T> = samples.each().flat_map(of).collect();
    Ok(all.into_pyarray(py).reshape(shape)?.into_any())
}

#[pymethods]
impl Record {
    /// Its number in the file.
    #[getter]
    fn id(&self) -> i64 {
        self.row.id
    }

    /// `A`, `B` or `AJB`.
    #[getter]
    pub fn configuration(&self) -> &'static str {
        configuration_name(self.cell.configuration)
    }

    /// Name of the impact point.
    #[getter]
    pub fn impact(&self) -> &str {
        &self.cell.impact
    }

    /// Name of the response location.
    #[getter]
    pub fn response(&self) -> &str {
        &self.cell.response
    }

    /// Number of the attempt at its cell, from 0.
    #[getter]
    fn attempt(&self) -> u32 {
        self.row.attempt
    }

    /// The verdict at the time of measurement.
    #[getter]
    fn verdict(&self) -> &'static str {
        self.row.verdict.name()
    }

    /// The verdict that counts: the user's, if there is one.
    #[getter]
    fn standing(&self) -> &'static str {
        self.row.standing().name()
    }

    /// Whether the analysis uses it.
    #[getter]
    pub fn kept(&self) -> bool {
        self.row.kept()
    }

    /// The measured value on which the verdict is based.
    #[getter]
    fn measure(&self) -> f64 {
        self.row.measure
    }

    /// The limit with which it was compared.
    #[getter]
    fn limit(&self) -> f64 {
        self.row.limit
    }

    /// Measure and limit in words.
    #[getter]
    fn sentence(&self) -> &str {
        &self.row.sentence
    }

    /// Time of the trigger, RFC 3339, UTC.
    #[getter]
    fn utc(&self) -> &str {
        &self.row.utc
    }

    /// Peak of the band-limited force, N.
    #[getter]
    fn peak_n(&self) -> f64 {
        self.row.peak_n
    }

    /// Index of the trigger among the samples.
    #[getter]
    fn trigger_index(&self) -> usize {
        self.row.trigger_index
    }

    /// Sampling rate, Hz.
    #[getter]
    fn fs_hz(&self, py: Python<'_>) -> PyResult<f64> {
        let store =
            Store::open_read_only(&self.path).map_err(|error| raised::file(py, &self.path, &error))?;
        Ok(self.map(py, &store)?.fs_hz())
    }

    /// Names of the channels, in the order of `codes`.
    #[getter]
    fn channels(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let store =
            Store::open_read_only(&self.path).map_err(|error| raised::file(py, &self.path, &error))?;
        Ok(self.map(py, &store)?.channels.iter().map(|channel| channel.name.to_string()).collect())
    }

    /// (channel, sample): the samples as they came, int16 from a device. Channels of several types
    /// are in the smallest type that holds every value exactly.
    #[getter]
    fn codes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let samples = self.read(py)?;
        let shape = [self.row.channels, self.row.scans];
        Ok(match common(&samples) {
            SampleType::I16 => together(py, &samples, shape, |of| match of {
                ChannelView::I16(own) => own.to_vec(),
                _ => Vec::new(),
            })?,
            SampleType::I32 => together(py, &samples, shape, |of| match of {
                ChannelView::I16(own) => own.iter().map(|code| i32::from(*code)).collect(),
                ChannelView::I32(own) => own.to_vec(),
                _ => Vec::new(),
            })?,
            SampleType::F32 => together(py, &samples, shape, |of| match of {
                ChannelView::I16(own) => own.iter().map(|code| f32::from(*code)).collect(),
                ChannelView::F32(own) => own.to_vec(),
                _ => Vec::new(),
            })?,
            SampleType::F64 => together(py, &samples, shape, |of| {
                let mut own = Vec::new();
                of.scaled(1.0, &mut own);
                own
            })?,
        })
    }

    /// (sample,): one channel by its name, as it came: int16, int32, float32 or float64. Times
    /// [`Record::scale`] it is in SI.
    fn samples<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyAny>> {
        let (_, _, place) = self.channel(py, channel)?;
        Ok(match self.read(py)?.channel(place) {
            ChannelView::I16(own) => own.to_vec().into_pyarray(py).into_any(),
            ChannelView::I32(own) => own.to_vec().into_pyarray(py).into_any(),
            ChannelView::F32(own) => own.to_vec().into_pyarray(py).into_any(),
            ChannelView::F64(own) => own.to_vec().into_pyarray(py).into_any(),
        })
    }

    /// SI units per sample of a channel as it came.
    fn scale(&self, py: Python<'_>, channel: &str) -> PyResult<f64> {
        let (_, map, place) = self.channel(py, channel)?;
        Ok(self.row.sample_types.channel(place).units(&map.channels[place]))
    }

    /// (sample,) float64 in SI: one channel by its name, as measured; [`Record::delay_s`] is its
    /// delay.
    fn signal<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (store, map, place) = self.channel(py, channel)?;
        let read = py.detach(move || Ok(map.to_si(place, store.samples(&self.row)?.channel(place))));
        let signal = read.map_err(|error: StoreError| raised::file(py, &self.path, &error))?;
        Ok(signal.into_pyarray(py))
    }

    /// Delay of a channel, s.
    fn delay_s(&self, py: Python<'_>, channel: &str) -> PyResult<f64> {
        let (_, map, place) = self.channel(py, channel)?;
        Ok(f64::from(map.channels[place].delay_ns) * 1e-9)
    }

    /// The SI unit of a channel.
    fn unit(&self, py: Python<'_>, channel: &str) -> PyResult<&'static str> {
        let (_, map, place) = self.channel(py, channel)?;
        Ok(map.channels[place].quantity.unit())
    }

    fn __repr__(&self) -> String {
        let (id, of) = (self.row.id, self.configuration());
        let (impact, response) = (&self.cell.impact, &self.cell.response);
        format!("Record {id}, {of} {impact} to {response}: {} ({})", self.standing(), self.row.sentence)
    }
}
