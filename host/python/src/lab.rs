//! A campaign file, and the results of its analysis: the document of `results.json`, its report and
//! its figures.

use crate::frf::Frf;
use crate::interruptible::Stopped;
use crate::record::Record;
use crate::writing::{self, Arrays, Recorded, calibrations};
use crate::{in_the_process_that_loaded_this, interruptible, raised, values};
use jointrig::analyse::{AnalyseError, CampaignFile, KnownContact, Wanted};
use jointrig::campaign::plan::level::Level;
use jointrig::campaign::plan::{configuration_named, structure};
use jointrig::campaign::run::progress;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::error::StoreError;
use jointrig::report::words::brief;
use jointrig::results::Results;
use jointrig::structure::Structure;
use jointrig::{analyse, report};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// The default band of FRF lines, Hz.
const BAND_HZ: (f64, f64) = (10.0, 1000.0);

/// A new campaign file for the plan in `plan`.
#[pyfunction]
pub fn new(py: Python<'_>, path: PathBuf, plan: PathBuf) -> PyResult<Lab> {
    let text = std::fs::read_to_string(&plan)
        .map_err(|error| raised::reading(py, &plan, &format!("{}: {error}", plan.display())))?;
    py.detach(|| Store::create(&path, &text, &plan.display().to_string())?.close())
        .map_err(|error| raised::file(py, &path, &error))?;
    Ok(Lab::at(path))
}

/// A campaign file, opened read only for each request, so that it may be measured at the same time;
/// adding hits and levels opens it for writing. Holds a path and no connection,
/// so that it can be pickled.
#[pyclass(module = "jointrig._native", frozen)]
pub struct Lab {
    path: PathBuf,
}

#[pymethods]
impl Lab {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        py.detach(|| Store::open_read_only(&path).map(drop))
            .map_err(|error| raised::file(py, &path, &error))?;
        Ok(Self { path })
    }

    /// The campaign file's path.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyAny>, (PathBuf,)) {
        (py.get_type::<Self>().into_any(), (self.path.clone(),))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (kept, wanted) = self.read(py, progress::counts)?;
        Ok(format!("Lab({:?}): {kept} of {wanted} good hits", self.path.display().to_string()))
    }

    /// The positions of hammer and vibrometer in the plan.
    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let plan = self.read(py, Store::plan)?;
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let figure = report::planned_places(&analyse::places(&plan), &name);
        Ok(figure.as_ref().map(report::notebook_figure))
    }

    /// The document of `jointrig campaign status --json`.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let found = self.read(py, |store| progress::document(store).map(|found| found.to_string()))?;
        values(py, &found)
    }

    /// The records, in the order in which they were measured.
    #[pyo3(signature = (*, configuration=None, impact=None, response=None, kept=None))]
    fn records(
        &self,
        py: Python<'_>,
        configuration: Option<&str>,
        impact: Option<&str>,
        response: Option<&str>,
        kept: Option<bool>,
    ) -> PyResult<Vec<Record>> {
        let all = self.read(py, Record::all)?;
        let asked = |own: &str, wanted: Option<&str>| wanted.is_none_or(|wanted| own == wanted);
        let of = |record: &Record| {
            asked(record.configuration(), configuration)
                && asked(record.impact(), impact)
                && asked(record.response(), response)
                && kept.is_none_or(|kept| record.kept() == kept)
        };
        Ok(all.into_iter().filter(of).collect())
    }

    /// H1 of a configuration's good hits, or the FRFs that were imported for it; lines of
    /// `band_hz`, (low, high), default 10 Hz to 1 kHz.
    #[pyo3(signature = (configuration, *, band_hz=BAND_HZ))]
    fn frf(&self, py: Python<'_>, configuration: &str, band_hz: (f64, f64)) -> PyResult<Frf> {
        in_the_process_that_loaded_this(py)?;
        let plan = self.read(py, Store::plan)?;
        let Some(known) = plan.configuration(configuration) else {
            return Err(raised::refused(
                py,
                &format!("there is no configuration `{configuration}`: A, B or AJB"),
            ));
        };
        let (measured, complaints) = self.measured(py, structure(known), band_hz)?;
        measured.ok_or_else(|| {
            let why = complaints.first().map_or(String::new(), |why| format!(" ({why})"));
            raised::refused(py, &format!("{configuration} has no good hit and no imported FRFs{why}"))
        })
    }

    /// Results of `jointrig analyse`; `progress(done, total)` is called now and then.
    #[pyo3(signature = (progress=None, *, bootstrap=0))]
    fn analyse(&self, py: Python<'_>, progress: Option<Py<PyAny>>, bootstrap: usize) -> PyResult<Analysis> {
        in_the_process_that_loaded_this(py)?;
        let wanted = Wanted { replicates: bootstrap, ..Wanted::default() };
        let found = self.computed(py, move |store, stopped| {
            let tell = |now: analyse::Progress| {
                stopped.end_here_if_so();
                if let Some(progress) = &progress {
                    Python::attach(|py| {
                        // an observer must not stop the work: its exceptions are printed and not
                        // raised
                        if let Err(error) = progress.call1(py, (now.done, now.total)) {
                            error.print(py);
                        }
                    });
                }
            };
            report::analysed(store, wanted, &tell)
        })?;
        report::must_hold_something(&found).map_err(|sentence| raised::refused(py, &sentence))?;
        Ok(Analysis::of(found, Of::Campaign(self.path.clone())))
    }

    /// Adds the hits of one cell; jointrig's stub file describes the arguments.
    #[pyo3(signature = (configuration, impact, response=None, *, fs_hz, channels, force_n=None, units=None, scale=None,
                        delay_s=None, calibrate="", trigger_index=None, source="python", replace=false))]
    #[allow(clippy::too_many_arguments, reason = "Python names each of them")]
    fn add_hits<'py>(
        &self,
        py: Python<'py>,
        configuration: &str,
        impact: &str,
        response: Option<&str>,
        fs_hz: f64,
        channels: Bound<'py, PyDict>,
        force_n: Option<Bound<'py, PyAny>>,
        units: Option<Bound<'py, PyDict>>,
        scale: Option<Bound<'py, PyDict>>,
        delay_s: Option<Bound<'py, PyDict>>,
        calibrate: &str,
        trigger_index: Option<usize>,
        source: &str,
        replace: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let arrays = Arrays { fs_hz, force_n, channels, units, scale, delay_s };
        let channels = (&arrays.read(py, &["hit", "sample"])?, &calibrations(py, calibrate)?);
        let cell = (configuration, impact, response);
        let (added, verdicts) =
            writing::add_hits(py, &self.path, cell, channels, trigger_index, source, replace)?;
        let found = PyDict::new(py);
        found.set_item("hits", added.hits)?;
        found.set_item("kept", added.kept)?;
        found.set_item("already", added.already)?;
        found.set_item("verdicts", verdicts)?;
        Ok(found)
    }

    /// Cuts a continuous recording into hits; jointrig's stub file describes the arguments.
    #[pyo3(signature = (*, fs_hz, channels, configuration=None, impact=None, response=None, order=None,
                        marker=None, table=None, units=None, scale=None, delay_s=None, calibrate="",
                        source="python", replace=false, dry_run=false))]
    #[allow(clippy::too_many_arguments, reason = "Python names each of them")]
    fn cut<'py>(
        &self,
        py: Python<'py>,
        fs_hz: f64,
        channels: Bound<'py, PyDict>,
        configuration: Option<String>,
        impact: Option<String>,
        response: Option<String>,
        order: Option<String>,
        marker: Option<String>,
        table: Option<String>,
        units: Option<Bound<'py, PyDict>>,
        scale: Option<Bound<'py, PyDict>>,
        delay_s: Option<Bound<'py, PyDict>>,
        calibrate: &str,
        source: &str,
        replace: bool,
        dry_run: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let arrays = Arrays { fs_hz, force_n: None, channels, units, scale, delay_s };
        let (channels, calibrate) = (arrays.read(py, &["sample"])?, calibrations(py, calibrate)?);
        let only = [configuration, impact, response];
        let by = Recorded { only, order, marker, table, source: source.into(), replace, dry_run };
        let (report, stored, verdicts) = writing::cut(py, &self.path, by, channels, calibrate)?;
        let found = PyDict::new(py);
        found.set_item("report", report)?;
        found.set_item("hits", stored.hits)?;
        found.set_item("kept", stored.kept)?;
        found.set_item("already", stored.already)?;
        found.set_item("verdicts", verdicts)?;
        Ok(found)
    }

    /// Adds a level of the shaker; jointrig's stub file describes the arguments.
    #[pyo3(signature = (frequency_hz, amplitude, *, fs_hz, channels, units=None, scale=None, delay_s=None, calibrate="", end_hz=None,
                        held="displacement", when="before", source="python"))]
    #[allow(clippy::too_many_arguments, reason = "Python names each of them")]
    fn add_level<'py>(
        &self,
        py: Python<'py>,
        frequency_hz: f64,
        amplitude: f64,
        fs_hz: f64,
        channels: Bound<'py, PyDict>,
        units: Option<Bound<'py, PyDict>>,
        scale: Option<Bound<'py, PyDict>>,
        delay_s: Option<Bound<'py, PyDict>>,
        calibrate: &str,
        end_hz: Option<f64>,
        held: &str,
        when: &str,
        source: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let arrays = Arrays { fs_hz, force_n: None, channels, units, scale, delay_s };
        let channels = (&arrays.read(py, &["sample"])?, &calibrations(py, calibrate)?);
        let held = held.parse().map_err(|what| raised::refused(py, &format!("held is `{held}`: {what}")))?;
        let when = when.parse().map_err(|what| raised::refused(py, &format!("when is `{when}`: {what}")))?;
        let level = Level { frequency_hz, end_hz, held, amplitude };
        let added = writing::add_level(py, &self.path, level, when, channels, source)?;
        let found = PyDict::new(py);
        found.set_item("level", added.id)?;
        found.set_item("reached", added.reached)?;
        found.set_item("already", added.already)?;
        Ok(found)
    }

    /// Writes results.json and report.html into `folder`.
    fn report(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        in_the_process_that_loaded_this(py)?;
        let found = self.computed(py, |store, stopped| {
            report::analysed(store, Wanted::default(), &|_| stopped.end_here_if_so())
        })?;
        py.detach(|| report::write(&found, &folder, &[]))
            .map_err(|error| raised::writing(py, &folder, &error))
    }
}

impl Lab {
    /// A file that was opened before.
    pub fn at(path: PathBuf) -> Self {
        Self { path }
    }

    /// The FRFs of every configuration that has any, under the plan's name for it.
    pub fn frfs(&self, py: Python<'_>) -> PyResult<Vec<(String, Frf)>> {
        in_the_process_that_loaded_this(py)?;
        let plan = self.read(py, Store::plan)?;
        let mut found = Vec::new();
        for own in ["A", "B", "AJB"].into_iter().filter_map(configuration_named) {
            if let (Some(frf), _) = self.measured(py, structure(own), BAND_HZ)? {
                found.push((plan.called(own).to_owned(), frf));
            }
        }
        Ok(found)
    }

    /// The FRFs of a configuration, from hits or imported, and the problems with hits.
    fn measured(
        &self,
        py: Python<'_>,
        of: Structure,
        band_hz: (f64, f64),
    ) -> PyResult<(Option<Frf>, Vec<String>)> {
        self.computed(py, move |store, _| {
            let (measured, complaints) =
                CampaignFile::open(store, KnownContact::default())?.measured(of, [band_hz.0, band_hz.1]);
            let found = match measured {
                Some((frf, hits)) => Some(Frf::with_hits(frf, hits)),
                None => store.frf(of.name())?.map(|found| Frf::of(found.frf)),
            };
            Ok((found, complaints))
        })
    }

    /// Reads from the file with `work`, with the interpreter released.
    fn read<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Store) -> Result<T, StoreError> + Send,
    ) -> PyResult<T> {
        let found = py.detach(|| work(&Store::open_read_only(&self.path)?));
        found.map_err(|error| raised::file(py, &self.path, &error))
    }

    /// The same for a long computation, which Ctrl-C interrupts.
    fn computed<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Store, &Stopped) -> Result<T, AnalyseError> + Send + 'static,
    ) -> PyResult<T> {
        let path = self.path.clone();
        let found = interruptible::run(py, move |stopped| work(&Store::open_read_only(&path)?, stopped))?;
        found.map_err(|error| raised::analysis(py, &self.path, &error))
    }
}

/// Results of an analysis.
#[pyclass(module = "jointrig._native", frozen)]
pub struct Analysis {
    found: Results,
    of: Of,
    spectra: PyOnceLock<Py<PyDict>>,
}

/// The source of an analysis.
pub enum Of {
    /// A campaign file.
    Campaign(PathBuf),
    /// FRFs of A, B and the assembly; empty for a loop.
    Frfs(Vec<(&'static str, Py<Frf>)>),
}

impl Analysis {
    pub fn of(found: Results, of: Of) -> Self {
        Self { found, of, spectra: PyOnceLock::new() }
    }
}

#[pymethods]
impl Analysis {
    /// The dict of `results.json`.
    #[getter]
    fn results<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.found.to_json().map_err(|error| raised::data(py, &error.to_string()))?;
        values(py, &text)
    }

    /// The FRFs used, by name of the configuration, for those that have any. For a campaign they
    /// are computed once, on first use.
    #[getter]
    fn spectra(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        let made = self.spectra.get_or_try_init(py, || {
            let all = PyDict::new(py);
            match &self.of {
                Of::Campaign(path) => {
                    for (name, frf) in Lab::at(path.clone()).frfs(py)? {
                        all.set_item(name, Bound::new(py, frf)?)?;
                    }
                }
                Of::Frfs(given) => {
                    for (name, frf) in given {
                        all.set_item(name, frf.bind(py))?;
                    }
                }
            }
            Ok::<_, PyErr>(all.unbind())
        })?;
        Ok(made.clone_ref(py))
    }

    /// Names of the figures for which there are data, in the order of the report.
    #[getter]
    fn figures(&self) -> Vec<&'static str> {
        report::all_figures(&self.found).iter().map(|figure| figure.name).collect()
    }

    /// A figure of the report as SVG text that adapts to a light or dark colour scheme.
    fn svg(&self, py: Python<'_>, figure: &str) -> PyResult<String> {
        let all = report::all_figures(&self.found);
        all.iter().find(|own| own.name == figure).map(report::notebook_figure).ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(|own| own.name).collect();
            raised::refused(py, &format!("there is no figure `{figure}`: {}", names.join(", ")))
        })
    }

    /// Writes `results.json` and `report.html` into `folder`, which is created if it does not
    /// exist.
    fn report(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        py.detach(|| report::write(&self.found, &folder, &[]))
            .map_err(|error| raised::writing(py, &folder, &error))
    }

    fn _repr_svg_(&self) -> Option<String> {
        report::all_figures(&self.found).first().map(report::notebook_figure)
    }

    fn __repr__(&self) -> String {
        let source = &self.found.source.file;
        let of = if source.is_empty() { String::new() } else { format!(" of {source}") };
        format!("Analysis{of}: {}", brief::headline(&self.found))
    }
}
