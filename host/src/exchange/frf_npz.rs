//! FRFs in npz: `frequency` (line) Hz, `frf` (line, output, input), `quantity`, `outputs`, `inputs`, and optionally `sigma`, the
//! damping of the exponential window in 1/s (absent means 0), `variance` of the real part of each value and `coherence`, both shaped like
//! `frf`.

use super::npz::{Array, NpzFile};
use super::npz_error::NpzError;
use super::npz_output::NpzOutput;
use crate::frf::{Frf, MotionQuantity};
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

/// Bytes of memory of a line's matrix beside its values.
const LINE: u64 = 64;

/// Reads an FRF file, with the variance where it has one. Values may be NaN; whoever uses a cell checks it. A coherence of another
/// shape than the FRFs' is no ordinary one, and is passed over.
///
/// # Errors
/// [`NpzError`] naming the array that is missing or does not fit.
pub fn read_frf(path: &Path) -> Result<Frf, NpzError> {
    let mut file = NpzFile::open(path)?;
    let frequency_hz = file.real("frequency", "the frequency of each line, Hz")?.values;
    let outputs = file.text("outputs", "the names of the outputs")?.values;
    let inputs = file.text("inputs", "the names of the inputs")?.values;
    let word = file.word("quantity", "receptance, mobility or accelerance")?;
    let quantity = MotionQuantity::from_frf_name(&word).ok_or_else(|| {
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
    file.charge("frf", frequency_hz.len(), LINE + 16 * (rows * columns) as u64, &expected)?;
    // chunks of zero length are not allowed; an FRF without rows or columns has empty matrices
    let lines = if rows * columns == 0 {
        vec![DMatrix::zeros(rows, columns); frequency_hz.len()]
    } else {
        frf.values.chunks(rows * columns).map(|line| DMatrix::from_row_slice(rows, columns, line)).collect()
    };
    let mut whole = Frf::new(frequency_hz, sigma_per_s, quantity, outputs, inputs, lines)
        .map_err(|e| file.content(e.to_string()))?;
    if file.has("variance") {
        let (lines, rows, columns) = shape(&whole);
        let expected = format!("the variance of each value's real part, shape ({lines}, {rows}, {columns})");
        let array = file.real("variance", &expected)?;
        if !fits(&array, &whole) {
            return Err(file.unexpected("variance", &format!("has shape {:?}", array.shape), &expected));
        }
        file.charge("variance", lines, LINE + 8 * (rows * columns) as u64, &expected)?;
        whole =
            whole.with_variance(by_line(&array, rows, columns)).map_err(|e| file.content(e.to_string()))?;
        whole.check_variance().map_err(|e| file.content(e.to_string()))?;
    }
    if file.has("coherence")
        && let Ok(array) = file.real("coherence", "the coherence of each value")
        && fits(&array, &whole)
    {
        let expected = "the coherence of each value";
        file.charge("coherence", array.values.len() / (rows * columns), LINE, expected)?;
        let coherence = by_line(&array, rows, columns);
        whole = whole.with_coherence(coherence).map_err(|e| file.content(e.to_string()))?;
    }
    Ok(whole)
}

fn shape(frf: &Frf) -> (usize, usize, usize) {
    (frf.lines().len(), frf.outputs().len(), frf.inputs().len())
}

/// Whether there is one number for each value; FRFs of a single impact have no axis of inputs.
fn fits(array: &Array<f64>, frf: &Frf) -> bool {
    let (lines, rows, columns) = shape(frf);
    let alike = array.shape == [lines, rows, columns] || (columns == 1 && array.shape == [lines, rows]);
    alike && rows * columns > 0
}

fn by_line(array: &Array<f64>, rows: usize, columns: usize) -> Vec<DMatrix<f64>> {
    array.values.chunks(rows * columns).map(|line| DMatrix::from_row_slice(rows, columns, line)).collect()
}

/// Writes an FRF file with the coherence and variance that are known, and further arrays beside it.
///
/// # Errors
/// [`NpzError::Write`].
pub fn write_frf(path: &Path, frf: &Frf, extras: &[Extra]) -> Result<(), NpzError> {
    // every bit of an FRF's numbers is in use: two of three files would grow
    let mut out = NpzOutput::create(path)?.unpacked();
    out.real("frequency", &[frf.frequency_hz().len()], frf.frequency_hz())?;
    let (lines, rows, columns) = shape(frf);
    out.complex("frf", &[lines, rows, columns], in_c_order(frf.lines()))?;
    out.text("quantity", &[], &[frf.quantity().frf_name().into()])?;
    out.text("outputs", &[frf.outputs().len()], frf.outputs())?;
    out.text("inputs", &[frf.inputs().len()], frf.inputs())?;
    out.real("sigma", &[], [frf.sigma_per_s()])?;
    for (name, known) in [("coherence", frf.coherence()), ("variance", frf.variance())] {
        if let Some(known) = known {
            out.real(name, &[lines, rows, columns], in_c_order(known))?;
        }
    }
    for extra in extras {
        match extra {
            Extra::Real(name, array) => out.real(name, &array.shape, &array.values)?,
            Extra::Complex(name, array) => out.complex(name, &array.shape, &array.values)?,
        }
    }
    out.finish()
}

/// (line, output, input) in C order: row after row of matrices that hold column after column.
fn in_c_order<T: nalgebra::Scalar>(lines: &[DMatrix<T>]) -> impl Iterator<Item = &T> {
    lines.iter().flat_map(|y| {
        let rows = y.nrows();
        (0..rows).flat_map(move |row| y.as_slice().iter().skip(row).step_by(rows))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_frf_file_comes_back_with_its_extras() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        let frf = Frf::new(
            vec![10.0, 20.0],
            2.3,
            MotionQuantity::Velocity,
            vec!["A1:x".into(), "A1:y".into(), "A1:z".into()],
            vec!["AZ1".into(), "AZ2".into()],
            (0..2)
                .map(|l| DMatrix::from_fn(3, 2, |r, c| Complex::new(l as f64, (10 * r + c) as f64)))
                .collect(),
        )
        .expect("all agree");
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
        out.real("frequency", &[2], [1.0, 2.0]).expect("written");
        out.text("outputs", &[1], &["a".into()]).expect("written");
        out.text("inputs", &[1], &["f".into()]).expect("written");
        out.text("quantity", &[], &["mobility".into()]).expect("written");
        out.complex("frf", &[1, 1, 1], [Complex::new(0.0, 0.0)]).expect("written");
        out.finish().expect("closed");
        let text = read_frf(&path).expect_err("one line of two").to_string();
        assert!(text.contains("`frf`") && text.contains("(2, 1, 1)"), "{text}");
    }
}
