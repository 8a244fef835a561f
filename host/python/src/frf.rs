//! A matrix of FRFs as arrays.

use std::path::PathBuf;

use jointrig::exchange::frf_npz::direction_extras;
use jointrig::exchange::labelled_frf::{Label, LabelledFrf};
use jointrig::exchange::{StatedUnits, read_frf_file, write_frf};
use jointrig::frf::MotionQuantity;
use jointrig::report;
use jointrig::substructuring::Configuration;
use nalgebra::DMatrix;
use numpy::ndarray::ArrayView3;
use numpy::{
    Complex64, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray3,
};
use pyo3::prelude::*;

use crate::raised;

/// A matrix of FRFs with its noise.
#[pyclass(module = "jointrig._native", frozen)]
pub struct Frf {
    matrix: jointrig::frf::Frf,
    /// Labels of outputs and inputs from its file; `None` for FRFs from arrays.
    labels: Option<(Vec<Label>, Vec<Label>)>,
    /// Hits in each average, outputs × inputs; `None` for FRFs from other sources.
    hits: Option<DMatrix<usize>>,
}

impl Frf {
    pub fn of(frf: jointrig::frf::Frf) -> Self {
        Self { matrix: frf, labels: None, hits: None }
    }

    /// The FRFs along the directions of these points, and what was reversed; a file's labels take
    /// precedence.
    ///
    /// # Errors
    /// A label and its point have different axes: both are named.
    pub fn along(&self, points: &Configuration) -> Result<(jointrig::frf::Frf, Vec<String>), String> {
        match &self.labels {
            Some(_) => self.labelled().along(points),
            None => Ok((self.matrix.clone(), Vec::new())),
        }
    }

    /// The FRFs with the labels of their file, if there was one.
    pub fn labelled(&self) -> LabelledFrf {
        let read = LabelledFrf::unlabelled(self.matrix.clone(), String::new(), Vec::new());
        match &self.labels {
            Some((outputs, inputs)) => {
                LabelledFrf { outputs: outputs.clone(), inputs: inputs.clone(), ..read }
            }
            None => read,
        }
    }

    pub fn with_hits(frf: jointrig::frf::Frf, hits: DMatrix<usize>) -> Self {
        Self { matrix: frf, labels: None, hits: Some(hits) }
    }

    pub fn matrix(&self) -> &jointrig::frf::Frf {
        &self.matrix
    }

    fn shape(&self) -> [usize; 3] {
        [self.matrix.lines().len(), self.matrix.outputs().len(), self.matrix.inputs().len()]
    }

    /// Values of all lines in C order (nalgebra stores matrices by columns).
    fn in_order<T: Copy + 'static>(&self, of: impl Fn(usize, usize, usize) -> T) -> Vec<T> {
        let [lines, outputs, inputs] = self.shape();
        let mut all = Vec::with_capacity(lines * outputs * inputs);
        for line in 0..lines {
            for output in 0..outputs {
                all.extend((0..inputs).map(|input| of(line, output, input)));
            }
        }
        all
    }
}

/// One matrix per line.
fn lines<T: nalgebra::Scalar>(values: ArrayView3<'_, T>) -> Vec<DMatrix<T>> {
    let [_, outputs, inputs] = [values.shape()[0], values.shape()[1], values.shape()[2]];
    values
        .outer_iter()
        .map(|line| DMatrix::from_row_iterator(outputs, inputs, line.iter().cloned()))
        .collect()
}

#[pymethods]
impl Frf {
    #[new]
    #[pyo3(signature = (*, frequency_hz, frf, quantity, outputs, inputs, sigma_per_s=0.0, variance=None, coherence=None))]
    #[allow(clippy::too_many_arguments, reason = "Python names each of them")]
    fn new(
        py: Python<'_>,
        frequency_hz: PyReadonlyArray1<'_, f64>,
        frf: PyReadonlyArray3<'_, Complex64>,
        quantity: &str,
        outputs: Vec<String>,
        inputs: Vec<String>,
        sigma_per_s: f64,
        variance: Option<PyReadonlyArray3<'_, f64>>,
        coherence: Option<PyReadonlyArray3<'_, f64>>,
    ) -> PyResult<Self> {
        let refused = |sentence: &str| raised::refused(py, sentence);
        let Some(quantity) = MotionQuantity::from_frf_name(quantity) else {
            return Err(refused(&format!(
                "quantity is `{quantity}`: receptance, mobility or accelerance is needed"
            )));
        };
        let frequency_hz = frequency_hz.as_array().to_vec();
        let values = lines(frf.as_array().map(|v| nalgebra::Complex::new(v.re, v.im)).view());
        let made = jointrig::frf::Frf::new(frequency_hz, sigma_per_s, quantity, outputs, inputs, values)
            .and_then(|frf| match &variance {
                Some(own) => frf.with_variance(lines(own.as_array())),
                None => Ok(frf),
            })
            .and_then(|frf| match &coherence {
                Some(own) => frf.with_coherence(lines(own.as_array())),
                None => Ok(frf),
            });
        let whole = made.and_then(|frf| frf.check_variance().map(|()| frf));
        whole.map(Self::of).map_err(|error| refused(&error.to_string()))
    }

    /// The FRFs of an npz or a universal file, and what was left out of it.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<(Self, Vec<String>)> {
        let read = py.detach(|| read_frf_file(&path, &StatedUnits::default()));
        let read = read.map_err(|error| raised::reading(py, &path, &error.to_string()))?;
        Ok((Self { matrix: read.frf, labels: Some((read.outputs, read.inputs)), hits: None }, read.notes))
    }

    /// (line,) float64, Hz.
    #[getter]
    fn frequency_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.matrix.frequency_hz().to_vec().into_pyarray(py)
    }

    /// (line, output, input) complex128 in SI per N, on s = sigma + i 2 pi f.
    #[getter]
    fn frf<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
        let y = self.matrix.lines();
        self.in_order(|l, o, i| Complex64::new(y[l][(o, i)].re, y[l][(o, i)].im))
            .into_pyarray(py)
            .reshape(self.shape())
    }

    /// (line, output, input) float64, or None if it is not known.
    #[getter]
    fn coherence<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let all = self.matrix.coherence();
        all.map(|all| self.in_order(|l, o, i| all[l][(o, i)]).into_pyarray(py).reshape(self.shape()))
            .transpose()
    }

    /// (line, output, input) float64, of the real part (that of the imaginary part is equal), or
    /// None if it is not known.
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let all = self.matrix.variance();
        all.map(|all| self.in_order(|l, o, i| all[l][(o, i)]).into_pyarray(py).reshape(self.shape()))
            .transpose()
    }

    /// Number of hits in the average of each FRF, `(output, input)`; `None` for FRFs from a file or
    /// from arrays.
    #[getter]
    fn hits<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<i64>>>> {
        let Some(hits) = &self.hits else { return Ok(None) };
        let in_order: Vec<i64> =
            hits.transpose().iter().map(|count| i64::try_from(*count).unwrap_or(i64::MAX)).collect();
        in_order.into_pyarray(py).reshape([hits.nrows(), hits.ncols()]).map(Some)
    }

    /// Names of the responses.
    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.matrix.outputs().to_vec()
    }

    /// Names of the impacts.
    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.matrix.inputs().to_vec()
    }

    /// `receptance`, `mobility` or `accelerance`.
    #[getter]
    fn quantity(&self) -> &'static str {
        self.matrix.quantity().frf_name()
    }

    /// The exponential window's damping, which is part of s, 1/s.
    #[getter]
    fn sigma_per_s(&self) -> f64 {
        self.matrix.sigma_per_s()
    }

    /// The same as receptances, m/N: divided by s once or twice.
    fn to_receptance(&self, py: Python<'_>) -> PyResult<Self> {
        let converted =
            self.matrix.to_receptance().map_err(|error| raised::refused(py, &error.to_string()))?;
        Ok(Self { matrix: converted, labels: self.labels.clone(), hits: self.hits.clone() })
    }

    /// The lines from `low_hz` to `high_hz`, ends included.
    fn band(&self, low_hz: f64, high_hz: f64) -> Self {
        let (labels, hits) = (self.labels.clone(), self.hits.clone());
        Self { matrix: self.matrix.band(low_hz, high_hz), labels, hits }
    }

    /// The rows and columns with these names, in this order.
    fn select(&self, py: Python<'_>, outputs: Vec<String>, inputs: Vec<String>) -> PyResult<Self> {
        let chosen =
            self.matrix.select(&outputs, &inputs).map_err(|error| raised::refused(py, &error.to_string()))?;
        let of = |wanted: &[String], names: &[String]| -> Vec<usize> {
            wanted.iter().filter_map(|name| names.iter().position(|own| own == name)).collect()
        };
        let (rows, columns) = (of(&outputs, self.matrix.outputs()), of(&inputs, self.matrix.inputs()));
        let hits = self.hits.as_ref().map(|hits| hits.select_rows(&rows).select_columns(&columns));
        let of = |all: &[Label], at: &[usize]| at.iter().map(|at| all[*at].clone()).collect::<Vec<_>>();
        let labels = self.labels.as_ref().map(|(own, others)| (of(own, &rows), of(others, &columns)));
        Ok(Self { matrix: chosen, labels, hits })
    }

    /// Writes an npz file that `identify` and `import` accept.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let directions = self.labels.as_ref().map_or_else(Vec::new, |(outputs, inputs)| {
            let along = |labels: &[Label]| labels.iter().map(|label| label.direction).collect::<Vec<_>>();
            direction_extras(&along(outputs), &along(inputs))
        });
        py.detach(|| write_frf(&path, &self.matrix, &directions))
            .map_err(|error| raised::reading(py, &path, &error.to_string()))
    }

    fn to_pyfbs<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("jointrig._others")?.call_method1("to_pyfbs", (slf,))
    }

    fn to_dataframe<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("jointrig._others")?.call_method1("to_dataframe", (slf,))
    }

    fn _repr_svg_(&self) -> Option<String> {
        report::frf_figure(&self.matrix, "FRFs").as_ref().map(report::notebook_figure)
    }

    fn __repr__(&self) -> String {
        let [lines, outputs, inputs] = self.shape();
        let hz = self.matrix.frequency_hz();
        let over = match (hz.first(), hz.last()) {
            (Some(first), Some(last)) => format!(" from {first} to {last} Hz"),
            _ => String::new(),
        };
        format!("Frf: {} of {outputs} outputs, {inputs} inputs, {lines} lines{over}", self.quantity())
    }
}
