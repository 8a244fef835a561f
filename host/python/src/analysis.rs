//! Results of an analysis: the document of `results.json`, its report and its figures.

use std::path::PathBuf;

use jointrig::report;
use jointrig::report::words::brief;
use jointrig::results::Results;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::frf::Frf;
use crate::lab::Lab;
use crate::{raised, values};

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
