//! FRF matrices in npz: `frequency` (line) Hz, `frf` (line, output, input), `quantity`, `outputs`, `inputs`, and optionally
//! `sigma`, the damping of the exponential window in 1/s (absent means 0).

use super::npz::{Array, NpzError, NpzFile};
use super::npz_output::NpzOutput;
use crate::substructuring::frf::{FrfMatrix, Quantity};
use crate::substructuring::noise::FrfNoise;
use nalgebra::DMatrix;
use num_complex::Complex;
use std::path::Path;

/// Further arrays that go into an FRF file by their own names, each (line, output) or (line, output, input).
#[derive(Debug, Clone, PartialEq)]
pub enum Extra {
    /// Real, e.g. `coherence`, `variance`.
    Real(String, Array<f64>),
    /// Complex, e.g. `h2`, `hv`.
    Complex(String, Array<Complex<f64>>),
}

/// Reads an FRF file. Values may be NaN; whoever uses a cell checks it.
///
/// # Errors
/// [`NpzError`] naming the array that is missing or does not fit.
pub fn read_frf(path: &Path) -> Result<FrfMatrix, NpzError> {
    let mut file = NpzFile::open(path)?;
    let frequency_hz = file.real("frequency", "the frequency of each line, Hz")?.values;
    let outputs = file.text("outputs", "the names of the outputs")?.values;
    let inputs = file.text("inputs", "the names of the inputs")?.values;
    let word = file.word("quantity", "receptance, mobility or accelerance")?;
    let quantity = Quantity::from_name(&word).ok_or_else(|| {
        file.unexpected("quantity", &format!("is `{word}`"), "receptance, mobility or accelerance")
    })?;
    let sigma_per_s =
        if file.has("sigma") { file.number("sigma", "the exponential window's damping, 1/s")? } else { 0.0 };
    let expected = format!(
        "shape (line, output, input) = ({}, {}, {}), complex",
        frequency_hz.len(),
        outputs.len(),
        inputs.len()
    );
    let frf = file.complex("frf", &expected)?;
    let (rows, columns) = (outputs.len(), inputs.len());
    if frf.shape != [frequency_hz.len(), rows, columns] {
        return Err(file.unexpected("frf", &format!("has shape {:?}", frf.shape), &expected));
    }
    // chunks of zero length are not allowed; an FRF without rows or columns has empty matrices
    let lines = if rows * columns == 0 {
        vec![DMatrix::zeros(rows, columns); frequency_hz.len()]
    } else {
        frf.values.chunks(rows * columns).map(|line| DMatrix::from_row_slice(rows, columns, line)).collect()
    };
    let matrix = FrfMatrix { frequency_hz, sigma_per_s, quantity, outputs, inputs, lines };
    matrix.check().map_err(|e| file.content(e.to_string()))?;
    Ok(matrix)
}

/// The array `variance` (line, output, input) of an FRF file, where it has one: of the real part of each value.
///
/// # Errors
/// [`NpzError`] naming what does not fit.
pub fn read_frf_noise(path: &Path, frf: &FrfMatrix) -> Result<Option<FrfNoise>, NpzError> {
    let mut file = NpzFile::open(path)?;
    if !file.has("variance") {
        return Ok(None);
    }
    let (lines, rows, columns) = (frf.lines.len(), frf.outputs.len(), frf.inputs.len());
    let expected = format!("the variance of each value's real part, shape ({lines}, {rows}, {columns})");
    let array = file.real("variance", &expected)?;
    // FRFs of a single impact have no axis of inputs
    let fits = array.shape == [lines, rows, columns] || (columns == 1 && array.shape == [lines, rows]);
    if !fits || rows * columns == 0 {
        return Err(file.unexpected("variance", &format!("has shape {:?}", array.shape), &expected));
    }
    let variance = array
        .values
        .chunks(rows * columns)
        .map(|line| DMatrix::from_row_slice(rows, columns, line))
        .collect();
    Ok(Some(FrfNoise { variance }))
}

/// Writes an FRF file, with further arrays beside it.
///
/// # Errors
/// [`NpzError::Write`], or [`NpzError::Content`] when the matrix contradicts itself.
pub fn write_frf(path: &Path, frf: &FrfMatrix, extras: &[Extra]) -> Result<(), NpzError> {
    frf.check().map_err(|e| NpzError::Content { path: path.into(), reason: e.to_string() })?;
    let mut out = NpzOutput::create(path)?;
    out.real("frequency", &[frf.frequency_hz.len()], &frf.frequency_hz)?;
    let values: Vec<Complex<f64>> =
        frf.lines.iter().flat_map(|y| y.transpose().iter().copied().collect::<Vec<_>>()).collect();
    out.complex("frf", &[frf.lines.len(), frf.outputs.len(), frf.inputs.len()], &values)?;
    out.text("quantity", &[], &[frf.quantity.name().into()])?;
    out.text("outputs", &[frf.outputs.len()], &frf.outputs)?;
    out.text("inputs", &[frf.inputs.len()], &frf.inputs)?;
    out.real("sigma", &[], &[frf.sigma_per_s])?;
    for extra in extras {
        match extra {
            Extra::Real(name, array) => out.real(name, &array.shape, &array.values)?,
            Extra::Complex(name, array) => out.complex(name, &array.shape, &array.values)?,
        }
    }
    out.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_frf_file_comes_back_with_its_extras() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        let frf = FrfMatrix {
            frequency_hz: vec![10.0, 20.0],
            sigma_per_s: 2.3,
            quantity: Quantity::Mobility,
            outputs: vec!["A1:x".into(), "A1:y".into(), "A1:z".into()],
            inputs: vec!["AZ1".into(), "AZ2".into()],
            lines: (0..2)
                .map(|l| DMatrix::from_fn(3, 2, |r, c| Complex::new(l as f64, (10 * r + c) as f64)))
                .collect(),
        };
        let coherence = Array { shape: vec![2, 3], values: vec![1.0; 6] };
        write_frf(&path, &frf, &[Extra::Real("coherence".into(), coherence)]).expect("written");
        assert_eq!(read_frf(&path).expect("read"), frf);
        assert!(NpzFile::open(&path).expect("open").has("coherence"));
    }

    #[test]
    fn a_wrong_shape_names_the_array() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        let mut out = NpzOutput::create(&path).expect("writable");
        out.real("frequency", &[2], &[1.0, 2.0]).expect("written");
        out.text("outputs", &[1], &["a".into()]).expect("written");
        out.text("inputs", &[1], &["f".into()]).expect("written");
        out.text("quantity", &[], &["mobility".into()]).expect("written");
        out.complex("frf", &[1, 1, 1], &[Complex::new(0.0, 0.0)]).expect("written");
        out.finish().expect("closed");
        let text = read_frf(&path).expect_err("one line of two").to_string();
        assert!(text.contains("`frf`") && text.contains("(2, 1, 1)"), "{text}");
    }
}
