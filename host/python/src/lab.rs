//! A campaign file.

use std::path::PathBuf;

use jointrig::analyse::{AnalyseError, CampaignFile, KnownContact, Wanted};
use jointrig::campaign::plan::structure;
use jointrig::campaign::run::status;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::error::StoreError;
use jointrig::report;
use pyo3::prelude::*;

use crate::frf::Frf;
use crate::record::Record;
use crate::{in_the_process_that_loaded_this, raised, values};

/// Lines of FRFs, Hz, as the command exports them.
const BAND_HZ: (f64, f64) = (10.0, 1000.0);

/// A campaign file, read only; it may be measured meanwhile. Holds a path and no connection, so that it can be pickled.
#[pyclass(module = "jointrig._native", frozen)]
pub struct Lab {
    path: PathBuf,
}

#[pymethods]
impl Lab {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        py.detach(|| Store::open_read_only(&path).map(drop)).map_err(|error| raised::file(py, &error))?;
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
        let (kept, wanted) = self.read(py, status::counts)?;
        Ok(format!("Lab({:?}): {kept} of {wanted} good hits", self.path.display().to_string()))
    }

    /// What `jointrig campaign status --json` says.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let found = self.read(py, |store| status::document(store).map(|found| found.to_string()))?;
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

    /// H1 of a configuration's good hits, or the FRFs that were imported for it.
    #[pyo3(signature = (configuration, *, band_hz=BAND_HZ))]
    fn frf(&self, py: Python<'_>, configuration: &str, band_hz: (f64, f64)) -> PyResult<Frf> {
        in_the_process_that_loaded_this(py)?;
        let Some(known) = self.read(py, Store::plan)?.configuration(configuration) else {
            return Err(raised::refused(
                py,
                &format!("there is no configuration `{configuration}`: A, B or AJB"),
            ));
        };
        let of = structure(known);
        let (measured, complaints) = self.computed(py, |store| {
            let (measured, complaints) =
                CampaignFile::open(store, KnownContact::default())?.measured(of, [band_hz.0, band_hz.1]);
            let imported =
                if measured.is_none() { store.frf(of.name())?.map(|found| found.frf) } else { None };
            Ok((measured.or(imported), complaints))
        })?;
        measured.map(Frf::of).ok_or_else(|| {
            let why = complaints.first().map_or(String::new(), |why| format!(" ({why})"));
            raised::refused(py, &format!("{configuration} has no good hit and no imported FRFs{why}"))
        })
    }

    /// `results.json` as Python's values; `progress(done, total)` is called now and then.
    #[pyo3(signature = (progress=None, *, bootstrap=0))]
    fn analyse<'py>(
        &self,
        py: Python<'py>,
        progress: Option<Py<PyAny>>,
        bootstrap: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        in_the_process_that_loaded_this(py)?;
        let wanted = Wanted { replicates: bootstrap, known: KnownContact::default() };
        let tell = |now: jointrig::analyse::Progress| {
            if let Some(progress) = &progress {
                Python::attach(|py| {
                    // whoever watches does not stop the work: what it raises is printed and not thrown
                    if let Err(error) = progress.call1(py, (now.done, now.total)) {
                        error.print(py);
                    }
                });
            }
        };
        let found = self.computed(py, |store| report::analysed(store, wanted, &tell))?;
        let text = found.to_json().map_err(|error| raised::data(py, &error.to_string()))?;
        values(py, &text)
    }

    /// Writes results.json and report.html into `folder`.
    fn report(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        in_the_process_that_loaded_this(py)?;
        let found = self.computed(py, |store| report::analysed(store, Wanted::default(), &|_| {}))?;
        py.detach(|| report::write(&found, &folder, &[]))
            .map_err(|error| raised::writing(py, &format!("{}: {error}", folder.display())))
    }
}

impl Lab {
    /// What `work` finds in the file, with the interpreter released.
    fn read<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Store) -> Result<T, StoreError> + Send,
    ) -> PyResult<T> {
        let found = py.detach(|| work(&Store::open_read_only(&self.path)?));
        found.map_err(|error| raised::file(py, &error))
    }

    /// The same of an analysis.
    fn computed<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Store) -> Result<T, AnalyseError> + Send,
    ) -> PyResult<T> {
        let found = py.detach(|| work(&Store::open_read_only(&self.path)?));
        found.map_err(|error| raised::analysis(py, &error))
    }
}
