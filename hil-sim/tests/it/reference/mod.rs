//! Exact FRFs of an independent implementation, stored in `tests/data`.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use std::path::Path;

use nalgebra::DMatrix;
use num_complex::Complex;

/// One file: FRF matrices (outputs, inputs) at a few frequency lines.
pub struct Reference {
    pub outputs: Vec<String>,
    pub inputs: Vec<String>,
    pub lines: Vec<(f64, DMatrix<Complex<f64>>)>,
}

/// Reads `tests/data/<name>.csv`: a header `f_hz,output,<input>:re,<input>:im,…`, then one row per
/// frequency line and output.
pub fn load(name: &str) -> Reference {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(format!("{name}.csv"));
    let text = std::fs::read_to_string(&path).unwrap();
    let mut rows = text.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let inputs: Vec<String> =
        header[2..].iter().step_by(2).map(|column| column.strip_suffix(":re").unwrap().to_owned()).collect();
    let mut reference = Reference { outputs: Vec::new(), inputs, lines: Vec::new() };
    let mut blocks: Vec<(f64, Vec<Complex<f64>>)> = Vec::new();
    for row in rows {
        let f_hz: f64 = row[0].parse().unwrap();
        if blocks.last().is_none_or(|(f, _)| *f != f_hz) {
            blocks.push((f_hz, Vec::new()));
        }
        if blocks.len() == 1 {
            reference.outputs.push(row[1].to_owned());
        }
        let values: Vec<f64> = row[2..].iter().map(|value| value.parse().unwrap()).collect();
        let block = &mut blocks.last_mut().unwrap().1;
        block.extend(values.chunks(2).map(|pair| Complex::new(pair[0], pair[1])));
    }
    let (outputs, inputs) = (reference.outputs.len(), reference.inputs.len());
    reference.lines = blocks
        .into_iter()
        .map(|(f_hz, values)| (f_hz, DMatrix::from_row_slice(outputs, inputs, &values)))
        .collect();
    reference
}
