//! Reads the examples' data: FRFs as (frequency, output, input, real, imaginary part), one value
//! per row.

use jointrig_analysis::substructuring::{Frf, MotionQuantity};
use nalgebra::{Complex, DMatrix};
use std::error::Error;
use std::path::Path;

/// The rows of a file in `examples/data`, without its header line.
pub fn rows(file: &str) -> Result<Vec<Vec<String>>, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data").join(file);
    let text = std::fs::read_to_string(path)?;
    Ok(text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect())
}

/// Mobilities measured with an exponential window of 2.3 1/s.
#[allow(dead_code, reason = "not every example reads FRFs")]
pub fn frf(file: &str) -> Result<Frf, Box<dyn Error>> {
    let rows = rows(file)?;
    let (mut frequency_hz, mut outputs, mut inputs) = (Vec::<f64>::new(), Vec::new(), Vec::new());
    for row in &rows {
        let hz = row[0].parse()?;
        if frequency_hz.last() != Some(&hz) {
            frequency_hz.push(hz);
        }
        for (names, name) in [(&mut outputs, &row[1]), (&mut inputs, &row[2])] {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
    }
    let (m, n) = (outputs.len(), inputs.len());
    let values = rows.iter().map(|row| Ok(Complex::new(row[3].parse()?, row[4].parse()?)));
    let values = values.collect::<Result<Vec<Complex<f64>>, std::num::ParseFloatError>>()?;
    let lines = values.chunks(m * n).map(|line| DMatrix::from_row_slice(m, n, line)).collect();
    let quantity = MotionQuantity::Velocity;
    Ok(Frf::new(frequency_hz, 2.3, quantity, outputs, inputs, lines)?)
}
