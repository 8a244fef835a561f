//! A matrix of FRFs as arrays.

use std::path::PathBuf;

use jointrig::exchange::write_frf;
use numpy::{Complex64, IntoPyArray, PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::raised;

/// A matrix of FRFs with its noise.
#[pyclass(module = "jointrig._native", frozen)]
pub struct Frf {
    frf: jointrig::frf::Frf,
    frequency_hz: Vec<f64>,
}

impl Frf {
    pub fn of(frf: jointrig::frf::Frf) -> Self {
        Self { frequency_hz: frf.frequency_hz().to_vec(), frf }
    }

    fn shape(&self) -> [usize; 3] {
        [self.frf.lines().len(), self.frf.outputs().len(), self.frf.inputs().len()]
    }

    /// Values of all lines in C order: nalgebra keeps columns together.
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

#[pymethods]
impl Frf {
    /// (line,) float64, Hz.
    #[getter]
    fn frequency_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.frequency_hz.clone().into_pyarray(py)
    }

    /// (line, output, input) complex128 in SI per N, on s = sigma + i 2 pi f.
    #[getter]
    fn frf<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
        let y = self.frf.lines();
        self.in_order(|l, o, i| Complex64::new(y[l][(o, i)].re, y[l][(o, i)].im))
            .into_pyarray(py)
            .reshape(self.shape())
    }

    /// (line, output, input) float64, or None where it is not known.
    #[getter]
    fn coherence<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let all = self.frf.coherence();
        all.map(|all| self.in_order(|l, o, i| all[l][(o, i)]).into_pyarray(py).reshape(self.shape()))
            .transpose()
    }

    /// (line, output, input) float64, of the real part (the imaginary part has as much), or None where it is not known.
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let all = self.frf.variance();
        all.map(|all| self.in_order(|l, o, i| all[l][(o, i)]).into_pyarray(py).reshape(self.shape()))
            .transpose()
    }

    /// Names of the responses.
    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.frf.outputs().to_vec()
    }

    /// Names of the impacts.
    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.frf.inputs().to_vec()
    }

    /// `receptance`, `mobility` or `accelerance`.
    #[getter]
    fn quantity(&self) -> &'static str {
        self.frf.quantity().frf_name()
    }

    /// The exponential window's damping, which is part of s, 1/s.
    #[getter]
    fn sigma_per_s(&self) -> f64 {
        self.frf.sigma_per_s()
    }

    /// Writes an npz that `identify` and `import` take.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| write_frf(&path, &self.frf, &[]))
            .map_err(|error| raised::writing(py, &error.to_string()))
    }

    fn __repr__(&self) -> String {
        let [lines, outputs, inputs] = self.shape();
        format!("Frf: {} of {outputs} outputs, {inputs} inputs, {lines} lines", self.quantity())
    }
}
