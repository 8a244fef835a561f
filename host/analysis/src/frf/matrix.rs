//! FRF matrices: one complex matrix per frequency line, with the names of its rows and columns.

use super::quantity::Quantity;
use nalgebra::{Complex, DMatrix};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Why an FRF matrix cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrfError {
    /// Axis, names and matrices disagree in number.
    #[error(
        "line {line}: the FRF matrix is {rows} × {columns}, but there are {outputs} output and {inputs} input names"
    )]
    Shape {
        /// Index of the line.
        line: usize,
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
        /// Output names given.
        outputs: usize,
        /// Input names given.
        inputs: usize,
    },
    /// There are not as many matrices as frequencies.
    #[error("{frequencies} frequencies but {matrices} FRF matrices: one matrix per line is needed")]
    LineCount {
        /// Frequencies given.
        frequencies: usize,
        /// Matrices given.
        matrices: usize,
    },
    /// The frequency axis is not finite, non-negative and rising.
    #[error("the frequency axis must be finite, not negative and rising: line {line} is {frequency_hz} Hz")]
    Axis {
        /// First line that is wrong.
        line: usize,
        /// Its frequency, Hz.
        frequency_hz: f64,
    },
    /// The damping of the exponential window is not a finite number.
    #[error("the exponential window's damping is {0} 1/s: a finite number that is not negative is needed")]
    Damping(f64),
    /// One name stands twice among the outputs or the inputs.
    #[error("the name `{name}` stands twice among the {side}: rename one of them")]
    RepeatedName {
        /// `outputs` or `inputs`.
        side: &'static str,
        /// The name.
        name: String,
    },
    /// A row or column was asked for that is not there.
    #[error("there is no `{name}` among the {side} ({available}): check the geometry against the FRF file")]
    MissingName {
        /// `outputs` or `inputs`.
        side: &'static str,
        /// The name.
        name: String,
        /// The names that are there.
        available: String,
    },
    /// A value is NaN or infinite.
    #[error(
        "the FRF from `{input}` to `{output}` is not a number at {frequency_hz} Hz: repeat that cell or cut the line out"
    )]
    NotFinite {
        /// The row's name.
        output: String,
        /// The column's name.
        input: String,
        /// The line, Hz.
        frequency_hz: f64,
    },
    /// A line at s = 0 cannot be divided by s.
    #[error("line {line} is at s = 0: a {quantity} has no receptance there; cut the line out")]
    DivisionByZero {
        /// Index of the line.
        line: usize,
        /// What is stored.
        quantity: Quantity,
    },
}

/// FRFs of one configuration on the line s = σ + i2πf.
///
/// `lines[l][(o, i)]` is the response at `outputs[o]`, along that channel's direction, per newton at
/// `inputs[i]`, in that impact's direction, sign included. SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfMatrix {
    /// Frequency of each line, Hz, rising.
    pub frequency_hz: Vec<f64>,
    /// Damping σ of the exponential window the records were weighted with, 1/s; 0 without a window.
    pub sigma_per_s: f64,
    /// What the values are.
    pub quantity: Quantity,
    /// Names of the rows.
    pub outputs: Vec<String>,
    /// Names of the columns.
    pub inputs: Vec<String>,
    /// One matrix (output × input) per line.
    pub lines: Vec<DMatrix<Complex<f64>>>,
}

impl FrfMatrix {
    /// Checks shapes, axis and names. Values may still be NaN: see [`FrfMatrix::check_finite`].
    ///
    /// # Errors
    /// The first disagreement found.
    pub fn check(&self) -> Result<(), FrfError> {
        if self.frequency_hz.len() != self.lines.len() {
            return Err(FrfError::LineCount {
                frequencies: self.frequency_hz.len(),
                matrices: self.lines.len(),
            });
        }
        let mut last = -1.0;
        for (line, &f) in self.frequency_hz.iter().enumerate() {
            if !f.is_finite() || f < 0.0 || f <= last {
                return Err(FrfError::Axis { line, frequency_hz: f });
            }
            last = f;
        }
        if !self.sigma_per_s.is_finite() || self.sigma_per_s < 0.0 {
            return Err(FrfError::Damping(self.sigma_per_s));
        }
        for (line, y) in self.lines.iter().enumerate() {
            if y.shape() != (self.outputs.len(), self.inputs.len()) {
                return Err(FrfError::Shape {
                    line,
                    rows: y.nrows(),
                    columns: y.ncols(),
                    outputs: self.outputs.len(),
                    inputs: self.inputs.len(),
                });
            }
        }
        places(&self.outputs, "outputs")?;
        places(&self.inputs, "inputs")?;
        Ok(())
    }

    /// Refuses NaN and infinite values, naming the first.
    ///
    /// # Errors
    /// [`FrfError::NotFinite`].
    pub fn check_finite(&self) -> Result<(), FrfError> {
        for (y, &frequency_hz) in self.lines.iter().zip(&self.frequency_hz) {
            for (column, input) in self.inputs.iter().enumerate() {
                for (row, output) in self.outputs.iter().enumerate() {
                    let value = y[(row, column)];
                    if !(value.re.is_finite() && value.im.is_finite()) {
                        return Err(FrfError::NotFinite {
                            output: output.clone(),
                            input: input.clone(),
                            frequency_hz,
                        });
                    }
                }
            }
        }
        Ok(())
    }

    /// The Laplace variable s = σ + i2πf of a line, 1/s.
    pub fn s(&self, line: usize) -> Complex<f64> {
        Complex::new(self.sigma_per_s, TAU * self.frequency_hz[line])
    }

    /// The same FRFs as receptances (m/N): divided by s once or twice. Under an exponential window it is
    /// s that differentiation multiplies by, not iω; dividing by iω would shift the phase by atan(σ/ω).
    ///
    /// # Errors
    /// [`FrfError::DivisionByZero`] for a mobility or accelerance at s = 0.
    pub fn to_receptance(&self) -> Result<FrfMatrix, FrfError> {
        let order = self.quantity.order_of_s();
        let mut lines = Vec::with_capacity(self.lines.len());
        for (line, y) in self.lines.iter().enumerate() {
            let s = self.s(line);
            if order > 0 && s.norm() == 0.0 {
                return Err(FrfError::DivisionByZero { line, quantity: self.quantity });
            }
            lines.push(y * s.powi(-order));
        }
        Ok(FrfMatrix { quantity: Quantity::Receptance, lines, ..self.without_lines() })
    }

    /// The rows and columns with these names, in this order.
    ///
    /// # Errors
    /// [`FrfError::MissingName`] or [`FrfError::RepeatedName`].
    pub fn select(&self, outputs: &[String], inputs: &[String]) -> Result<FrfMatrix, FrfError> {
        let rows = find(&self.outputs, outputs, "outputs")?;
        let columns = find(&self.inputs, inputs, "inputs")?;
        let lines = self.lines.iter().map(|y| block(y, &rows, &columns)).collect();
        Ok(FrfMatrix { outputs: outputs.to_vec(), inputs: inputs.to_vec(), lines, ..self.without_lines() })
    }

    /// The lines with `low_hz` ≤ f ≤ `high_hz`, ends included.
    #[must_use]
    pub fn band(&self, low_hz: f64, high_hz: f64) -> FrfMatrix {
        let kept: Vec<usize> = (0..self.frequency_hz.len())
            .filter(|&l| (low_hz..=high_hz).contains(&self.frequency_hz[l]))
            .collect();
        FrfMatrix {
            frequency_hz: kept.iter().map(|&l| self.frequency_hz[l]).collect(),
            lines: kept.iter().map(|&l| self.lines[l].clone()).collect(),
            ..self.without_lines()
        }
    }

    fn without_lines(&self) -> FrfMatrix {
        FrfMatrix {
            frequency_hz: self.frequency_hz.clone(),
            sigma_per_s: self.sigma_per_s,
            quantity: self.quantity,
            outputs: self.outputs.clone(),
            inputs: self.inputs.clone(),
            lines: Vec::new(),
        }
    }
}

/// The sub-matrix of the given rows and columns, in the given order.
pub(crate) fn block(y: &DMatrix<Complex<f64>>, rows: &[usize], columns: &[usize]) -> DMatrix<Complex<f64>> {
    let mut block = DMatrix::zeros(rows.len(), columns.len());
    for (to, &c) in block.as_mut_slice().chunks_exact_mut(rows.len().max(1)).zip(columns) {
        let from = &y.as_slice()[c * y.nrows()..][..y.nrows()];
        to.iter_mut().zip(rows).for_each(|(to, &r)| *to = from[r]);
    }
    block
}

fn places<'a>(names: &'a [String], side: &'static str) -> Result<HashMap<&'a str, usize>, FrfError> {
    let mut at = HashMap::new();
    for (i, name) in names.iter().enumerate() {
        if at.insert(name.as_str(), i).is_some() {
            return Err(FrfError::RepeatedName { side, name: name.clone() });
        }
    }
    Ok(at)
}

fn find(names: &[String], wanted: &[String], side: &'static str) -> Result<Vec<usize>, FrfError> {
    let at = places(names, side)?;
    wanted
        .iter()
        .map(|name| {
            at.get(name.as_str()).copied().ok_or_else(|| FrfError::MissingName {
                side,
                name: name.clone(),
                available: names.join(", "),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(quantity: Quantity) -> FrfMatrix {
        let frequency_hz = vec![100.0, 200.0, 300.0];
        let lines = (0..3)
            .map(|l| DMatrix::from_fn(2, 2, |r, c| Complex::new(l as f64 + r as f64, c as f64 - 0.5)))
            .collect();
        FrfMatrix {
            frequency_hz,
            sigma_per_s: 2.3,
            quantity,
            outputs: vec!["a".into(), "b".into()],
            inputs: vec!["f".into(), "g".into()],
            lines,
        }
    }

    #[test]
    fn receptance_divides_by_s_not_by_i_omega() {
        let y = small(Quantity::Accelerance).to_receptance().expect("no line at zero");
        let s = Complex::new(2.3, TAU * 200.0);
        let back = y.lines[1][(1, 0)] * s * s;
        // rounding only
        assert!((back - Complex::new(2.0, -0.5)).norm() < 1e-14);
        assert_eq!(y.quantity, Quantity::Receptance);
    }

    #[test]
    fn bands_include_both_ends() {
        assert_eq!(small(Quantity::Mobility).band(100.0, 200.0).frequency_hz, vec![100.0, 200.0]);
    }

    #[test]
    fn selection_is_by_name_and_keeps_the_order_asked_for() {
        let y = small(Quantity::Mobility);
        let z = y.select(&["b".into(), "a".into()], &["g".into()]).expect("all there");
        assert_eq!(z.lines[0][(0, 0)], y.lines[0][(1, 1)]);
        let error = y.select(&["c".into()], &[]).expect_err("no such row");
        assert!(error.to_string().contains("`c`"));
    }

    #[test]
    fn a_nan_is_named_by_cell_and_line() {
        let mut y = small(Quantity::Mobility);
        y.lines[2][(0, 1)].im = f64::NAN;
        let text = y.check_finite().expect_err("a NaN").to_string();
        assert!(text.contains("`g`") && text.contains("`a`") && text.contains("300"));
    }

    #[test]
    fn repeated_names_and_falling_axes_are_refused() {
        let mut y = small(Quantity::Mobility);
        y.outputs[1] = "a".into();
        assert!(matches!(y.check(), Err(FrfError::RepeatedName { .. })));
        let mut y = small(Quantity::Mobility);
        y.frequency_hz[1] = 100.0;
        assert!(matches!(y.check(), Err(FrfError::Axis { line: 1, .. })));
    }
}
