//! Frequency response functions: one complex matrix per frequency line, with the names of its rows
//! and columns, the quantity of its values and, if known, its noise; checks of the values, and the
//! errors.

use nalgebra::{Complex, ComplexField, DMatrix, DMatrixViewMut};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::f64::consts::TAU;

pub mod common_lines;
pub mod noise;

/// FRFs of one configuration on the line s = σ + i2πf, with variance and coherence where known. SI
/// units.
///
/// `lines()[l][(o, i)]` is the response at `outputs()[o]`, along that channel's direction, per
/// newton at `inputs()[i]`, in that impact's direction, sign included. Shapes, axis and names are
/// always consistent. A value that was not measured is NaN: see [`Frf::check_finite`].
#[derive(Debug, Clone, PartialEq)]
pub struct Frf {
    frequency_hz: Vec<f64>,
    sigma_per_s: f64,
    quantity: MotionQuantity,
    outputs: Vec<String>,
    inputs: Vec<String>,
    lines: Vec<DMatrix<Complex<f64>>>,
    pub(super) variance: Option<Vec<DMatrix<f64>>>,
    pub(super) coherence: Option<Vec<DMatrix<f64>>>,
}

impl Frf {
    /// FRFs at `frequency_hz`, rising, measured with an exponential window of the damping
    /// `sigma_per_s` (0 without a window): one matrix (output × input) per line, with unique names
    /// of the outputs and of the inputs. Their noise is unknown.
    ///
    /// # Errors
    /// The first inconsistency found.
    pub fn new(
        frequency_hz: Vec<f64>,
        sigma_per_s: f64,
        quantity: MotionQuantity,
        outputs: Vec<String>,
        inputs: Vec<String>,
        lines: Vec<DMatrix<Complex<f64>>>,
    ) -> Result<Frf, FrfError> {
        if frequency_hz.len() != lines.len() {
            return Err(FrfError::LineCount { frequencies: frequency_hz.len(), matrices: lines.len() });
        }
        let mut last = -1.0;
        for (line, &f) in frequency_hz.iter().enumerate() {
            if !f.is_finite() || f < 0.0 || f <= last {
                return Err(FrfError::Axis { line, frequency_hz: f });
            }
            last = f;
        }
        if !sigma_per_s.is_finite() || sigma_per_s < 0.0 {
            return Err(FrfError::Damping(sigma_per_s));
        }
        for (line, y) in lines.iter().enumerate() {
            if y.shape() != (outputs.len(), inputs.len()) {
                return Err(FrfError::Shape {
                    line,
                    rows: y.nrows(),
                    columns: y.ncols(),
                    outputs: outputs.len(),
                    inputs: inputs.len(),
                });
            }
        }
        places(&outputs, "outputs")?;
        places(&inputs, "inputs")?;
        Ok(Frf {
            frequency_hz,
            sigma_per_s,
            quantity,
            outputs,
            inputs,
            lines,
            variance: None,
            coherence: None,
        })
    }

    /// Adds this variance (output × input per line) of the real part of each value, which equals
    /// that of its imaginary part (the complex variance is twice that), in the square of the FRF's
    /// unit; NaN where it is unknown (a single hit).
    ///
    /// The noise of different cells is assumed independent. This holds for the sensors' noise
    /// floor; the force cell's noise, which is common to the three axes of one hit, is far below
    /// it.
    ///
    /// # Errors
    /// [`FrfError::Beside`].
    pub fn with_variance(self, variance: Vec<DMatrix<f64>>) -> Result<Frf, FrfError> {
        self.beside("variance", &variance)?;
        Ok(Frf { variance: Some(variance), ..self })
    }

    /// Adds this coherence (output × input per line); NaN where it is unknown (a single hit).
    ///
    /// # Errors
    /// [`FrfError::Beside`].
    pub fn with_coherence(self, coherence: Vec<DMatrix<f64>>) -> Result<Frf, FrfError> {
        self.beside("coherence", &coherence)?;
        Ok(Frf { coherence: Some(coherence), ..self })
    }

    /// Removes all noise information: variance and coherence.
    #[must_use]
    pub fn without_noise(self) -> Frf {
        Frf { variance: None, coherence: None, ..self }
    }

    /// Other values with the same axis, quantity and names; their noise is unknown.
    ///
    /// # Errors
    /// [`FrfError::LineCount`] or [`FrfError::Shape`].
    pub fn with_values(&self, lines: Vec<DMatrix<Complex<f64>>>) -> Result<Frf, FrfError> {
        let (outputs, inputs) = (self.outputs.clone(), self.inputs.clone());
        Frf::new(self.frequency_hz.clone(), self.sigma_per_s, self.quantity, outputs, inputs, lines)
    }

    /// The same FRFs with other, unique names.
    ///
    /// # Errors
    /// [`FrfError::Shape`] for a different number of names, [`FrfError::RepeatedName`].
    pub fn renamed(self, outputs: Vec<String>, inputs: Vec<String>) -> Result<Frf, FrfError> {
        if (outputs.len(), inputs.len()) != (self.outputs.len(), self.inputs.len()) {
            let (rows, columns) = (self.outputs.len(), self.inputs.len());
            let (outputs, inputs) = (outputs.len(), inputs.len());
            return Err(FrfError::Shape { line: 0, rows, columns, outputs, inputs });
        }
        places(&outputs, "outputs")?;
        places(&inputs, "inputs")?;
        Ok(Frf { outputs, inputs, ..self })
    }

    /// Changes every line's values in place with `change`, which receives the line's index.
    #[must_use]
    pub fn map_lines(mut self, mut change: impl FnMut(usize, DMatrixViewMut<'_, Complex<f64>>)) -> Frf {
        for (line, y) in self.lines.iter_mut().enumerate() {
            change(line, y.as_view_mut());
        }
        self
    }

    fn beside(&self, what: &'static str, found: &[DMatrix<f64>]) -> Result<(), FrfError> {
        let (rows, columns) = (self.outputs.len(), self.inputs.len());
        let bad = found.iter().find(|v| v.shape() != (rows, columns));
        if found.len() == self.lines.len() && bad.is_none() {
            return Ok(());
        }
        let (found_rows, found_columns) = bad.or(found.first()).map_or((0, 0), nalgebra::Matrix::shape);
        let (found_lines, lines) = (found.len(), self.lines.len());
        Err(FrfError::Beside { what, found_lines, found_rows, found_columns, lines, rows, columns })
    }

    /// Frequency of each line, Hz, rising.
    pub fn frequency_hz(&self) -> &[f64] {
        &self.frequency_hz
    }

    /// Damping σ of the exponential window the records were weighted with, 1/s; 0 without a window.
    pub fn sigma_per_s(&self) -> f64 {
        self.sigma_per_s
    }

    /// The quantity of the values.
    pub fn quantity(&self) -> MotionQuantity {
        self.quantity
    }

    /// Names of the rows.
    pub fn outputs(&self) -> &[String] {
        &self.outputs
    }

    /// Names of the columns.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// One matrix (output × input) per line.
    pub fn lines(&self) -> &[DMatrix<Complex<f64>>] {
        &self.lines
    }

    /// Variance of the real part of each value, if known: see [`Frf::with_variance`].
    pub fn variance(&self) -> Option<&[DMatrix<f64>]> {
        self.variance.as_deref()
    }

    /// Coherence (output × input per line), if known; NaN where a cell has a single hit.
    pub fn coherence(&self) -> Option<&[DMatrix<f64>]> {
        self.coherence.as_deref()
    }

    /// The Laplace variable s = σ + i2πf of a line, 1/s.
    pub fn s(&self, line: usize) -> Complex<f64> {
        Complex::new(self.sigma_per_s, TAU * self.frequency_hz[line])
    }

    /// The same FRFs as receptances (m/N): divided by s once or twice, the variance by |s|² or
    /// |s|⁴. With an exponential window, differentiation multiplies by s, not iω; dividing by iω
    /// would shift the phase by atan(σ/ω).
    ///
    /// # Errors
    /// [`FrfError::DivisionByZero`] for a mobility or accelerance at s = 0.
    pub fn to_receptance(&self) -> Result<Frf, FrfError> {
        let order = self.quantity.order_of_s();
        let mut lines = Vec::with_capacity(self.lines.len());
        for (line, y) in self.lines.iter().enumerate() {
            let s = self.s(line);
            if order > 0 && s.norm() == 0.0 {
                return Err(FrfError::DivisionByZero { line, quantity: self.quantity });
            }
            // ComplexField::powi would round differently
            lines.push(y * Complex::powi(&s, -order));
        }
        let scaled = |(line, v): (usize, &DMatrix<f64>)| v * self.s(line).norm_sqr().powi(-order);
        Ok(Frf {
            frequency_hz: self.frequency_hz.clone(),
            sigma_per_s: self.sigma_per_s,
            quantity: MotionQuantity::Displacement,
            outputs: self.outputs.clone(),
            inputs: self.inputs.clone(),
            lines,
            variance: self.variance.as_ref().map(|all| all.iter().enumerate().map(scaled).collect()),
            coherence: self.coherence.clone(),
        })
    }

    /// The rows and columns with these names, in this order.
    ///
    /// # Errors
    /// [`FrfError::MissingName`] or [`FrfError::RepeatedName`].
    pub fn select(&self, outputs: &[String], inputs: &[String]) -> Result<Frf, FrfError> {
        places(outputs, "outputs")?;
        places(inputs, "inputs")?;
        let rows = find(&self.outputs, outputs, "outputs")?;
        let columns = find(&self.inputs, inputs, "inputs")?;
        let noise = |all: &Vec<DMatrix<f64>>| all.iter().map(|v| block(v, &rows, &columns)).collect();
        Ok(Frf {
            frequency_hz: self.frequency_hz.clone(),
            sigma_per_s: self.sigma_per_s,
            quantity: self.quantity,
            outputs: outputs.to_vec(),
            inputs: inputs.to_vec(),
            lines: self.lines.iter().map(|y| block(y, &rows, &columns)).collect(),
            variance: self.variance.as_ref().map(noise),
            coherence: self.coherence.as_ref().map(noise),
        })
    }

    /// The lines with `low_hz` ≤ f ≤ `high_hz`, ends included.
    #[must_use]
    pub fn band(&self, low_hz: f64, high_hz: f64) -> Frf {
        let inside = |l: &usize| (low_hz..=high_hz).contains(&self.frequency_hz[*l]);
        self.at(&(0..self.lines.len()).filter(inside).collect::<Vec<_>>())
    }

    /// As [`Frf::band`], but takes ownership, so it copies only when lines are dropped.
    #[must_use]
    pub fn into_band(self, low_hz: f64, high_hz: f64) -> Frf {
        let whole = self.frequency_hz.iter().all(|f| (low_hz..=high_hz).contains(f));
        if whole { self } else { self.band(low_hz, high_hz) }
    }

    /// The lines with these rising indices.
    pub(crate) fn at(&self, lines: &[usize]) -> Frf {
        let noise = |all: &Vec<DMatrix<f64>>| lines.iter().map(|&l| all[l].clone()).collect();
        Frf {
            frequency_hz: lines.iter().map(|&l| self.frequency_hz[l]).collect(),
            sigma_per_s: self.sigma_per_s,
            quantity: self.quantity,
            outputs: self.outputs.clone(),
            inputs: self.inputs.clone(),
            lines: lines.iter().map(|&l| self.lines[l].clone()).collect(),
            variance: self.variance.as_ref().map(noise),
            coherence: self.coherence.as_ref().map(noise),
        }
    }
}

/// The sub-matrix of the given rows and columns, in the given order.
pub(crate) fn block<T: ComplexField + Copy>(y: &DMatrix<T>, rows: &[usize], columns: &[usize]) -> DMatrix<T> {
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

impl Frf {
    /// Refuses NaN and infinite values, naming the first.
    ///
    /// # Errors
    /// [`FrfError::NotFinite`].
    pub fn check_finite(&self) -> Result<(), FrfError> {
        for (y, &frequency_hz) in self.lines().iter().zip(self.frequency_hz()) {
            for (column, input) in self.inputs().iter().enumerate() {
                for (row, output) in self.outputs().iter().enumerate() {
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

    /// Refuses a variance below zero, naming the first.
    ///
    /// # Errors
    /// [`FrfError::NegativeVariance`].
    pub fn check_variance(&self) -> Result<(), FrfError> {
        for (own, &frequency_hz) in self.variance().into_iter().flatten().zip(self.frequency_hz()) {
            let Some(at) = own.iter().position(|variance| *variance < 0.0) else { continue };
            // nalgebra stores columns contiguously
            let (row, column) = (at % own.nrows(), at / own.nrows());
            let (output, input) = (self.outputs()[row].clone(), self.inputs()[column].clone());
            return Err(FrfError::NegativeVariance { output, input, frequency_hz, variance: own[at] });
        }
        Ok(())
    }

    /// Refuses a coherence outside 0 to 1, naming the first place. A value outside by at most
    /// [`COHERENCE_ROUNDING`] is attributed to rounding and set to the end of the range; the second
    /// return value is the number of such corrections.
    ///
    /// # Errors
    /// [`FrfError::Coherence`].
    pub fn with_coherence_in_range(mut self) -> Result<(Frf, usize), FrfError> {
        let Some(mut all) = self.coherence.take() else { return Ok((self, 0)) };
        let mut rounded = 0;
        for (own, &frequency_hz) in all.iter_mut().zip(self.frequency_hz()) {
            let rows = own.nrows();
            for (at, coherence) in own.iter_mut().enumerate() {
                let clipped = coherence.clamp(0.0, 1.0);
                let beyond = (*coherence - clipped).abs();
                // NaN (unknown) is neither above nor below
                if beyond > COHERENCE_ROUNDING {
                    // nalgebra stores columns contiguously
                    let (output, input) =
                        (self.outputs()[at % rows].clone(), self.inputs()[at / rows].clone());
                    return Err(FrfError::Coherence { output, input, frequency_hz, coherence: *coherence });
                }
                if beyond > 0.0 {
                    *coherence = clipped;
                    rounded += 1;
                }
            }
        }
        self.coherence = Some(all);
        Ok((self, rounded))
    }
}

/// Excess of a coherence beyond 0 to 1 that is attributed to rounding: sums in single precision and
/// five printed digits give less.
pub const COHERENCE_ROUNDING: f64 = 1e-5;

/// Reasons why FRFs cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrfError {
    /// The sizes of axis, names and matrices do not match.
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
    /// The number of matrices differs from that of frequencies.
    #[error("{frequencies} frequencies but {matrices} FRF matrices: one matrix per line is needed")]
    LineCount {
        /// Frequencies given.
        frequencies: usize,
        /// Matrices given.
        matrices: usize,
    },
    /// Variance or coherence have a different number of lines, rows or columns than the FRF.
    #[error(
        "the {what} has {found_lines} lines of {found_rows} × {found_columns}, the FRF {lines} lines of {rows} × {columns}"
    )]
    Beside {
        /// `variance` or `coherence`.
        what: &'static str,
        /// Its lines.
        found_lines: usize,
        /// Rows of its first line, or of the first that differs.
        found_rows: usize,
        /// Columns of that line.
        found_columns: usize,
        /// Lines of the FRF.
        lines: usize,
        /// Rows of the FRF.
        rows: usize,
        /// Columns of the FRF.
        columns: usize,
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
    #[error("the exponential window's damping is {0} 1/s: it must be finite and not negative")]
    Damping(f64),
    /// A name occurs twice among the outputs or the inputs.
    #[error("the name `{name}` occurs twice among the {side}: rename one of them")]
    RepeatedName {
        /// `outputs` or `inputs`.
        side: &'static str,
        /// The name.
        name: String,
    },
    /// A requested row or column does not exist.
    #[error("there is no `{name}` among the {side} ({available}): check the geometry against the FRF file")]
    MissingName {
        /// `outputs` or `inputs`.
        side: &'static str,
        /// The name.
        name: String,
        /// The available names.
        available: String,
    },
    /// A value is NaN or infinite.
    #[error(
        "the FRF from `{input}` to `{output}` is not a number at {frequency_hz} Hz: measure that cell again or remove the line"
    )]
    NotFinite {
        /// The row's name.
        output: String,
        /// The column's name.
        input: String,
        /// The line, Hz.
        frequency_hz: f64,
    },
    /// A variance is below zero.
    #[error(
        "the variance of the FRF from `{input}` to `{output}` is {variance} at {frequency_hz} Hz: a variance must be zero or more, or NaN if it is not known"
    )]
    NegativeVariance {
        /// The row's name.
        output: String,
        /// The column's name.
        input: String,
        /// The line, Hz.
        frequency_hz: f64,
        /// The value given.
        variance: f64,
    },
    /// A coherence is not between 0 and 1.
    #[error(
        "the coherence of the FRF from `{input}` to `{output}` is {coherence} at {frequency_hz} Hz: a coherence must lie between 0 and 1, or be NaN \
         if it is not known; estimate it again or leave it out"
    )]
    Coherence {
        /// The row's name.
        output: String,
        /// The column's name.
        input: String,
        /// The line, Hz.
        frequency_hz: f64,
        /// The value given.
        coherence: f64,
    },
    /// A line at s = 0 cannot be divided by s.
    #[error("line {line} is at s = 0: a {} has no receptance there; remove the line", quantity.frf_name())]
    DivisionByZero {
        /// Index of the line.
        line: usize,
        /// What is stored.
        quantity: MotionQuantity,
    },
}

/// The quantity of a response: the numerator of an FRF, per newton of the hammer's force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionQuantity {
    /// m; per force a receptance, m/N.
    Displacement,
    /// m/s; per force a mobility, m/(s N).
    Velocity,
    /// m/s²; per force an accelerance, m/(s² N).
    Acceleration,
}

impl MotionQuantity {
    /// All quantities, each the time derivative of the one before.
    const ALL: [MotionQuantity; 3] =
        [MotionQuantity::Displacement, MotionQuantity::Velocity, MotionQuantity::Acceleration];

    /// The name used in record files.
    pub fn name(self) -> &'static str {
        match self {
            MotionQuantity::Displacement => "displacement",
            MotionQuantity::Velocity => "velocity",
            MotionQuantity::Acceleration => "acceleration",
        }
    }

    /// The quantity called `name`, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name.trim().to_lowercase())
    }

    /// Name of the FRF of such a response, also used in files.
    pub fn frf_name(self) -> &'static str {
        match self {
            MotionQuantity::Displacement => "receptance",
            MotionQuantity::Velocity => "mobility",
            MotionQuantity::Acceleration => "accelerance",
        }
    }

    /// The quantity whose FRFs are called `name`, if there is one.
    pub fn from_frf_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.frf_name() == name.trim().to_lowercase())
    }

    /// Power of s by which the displacement is multiplied: 0, 1 or 2.
    pub fn order_of_s(self) -> i32 {
        self as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(quantity: MotionQuantity) -> Frf {
        let frequency_hz = vec![100.0, 200.0, 300.0];
        let lines = (0..3)
            .map(|l| DMatrix::from_fn(2, 2, |r, c| Complex::new(l as f64 + r as f64, c as f64 - 0.5)))
            .collect();
        Frf::new(
            frequency_hz,
            2.3,
            quantity,
            vec!["a".into(), "b".into()],
            vec!["f".into(), "g".into()],
            lines,
        )
        .expect("all agree")
    }

    #[test]
    fn receptance_divides_by_s_not_by_i_omega() {
        let y = small(MotionQuantity::Acceleration).to_receptance().expect("no line at zero");
        let s = Complex::new(2.3, TAU * 200.0);
        let back = y.lines[1][(1, 0)] * s * s;
        // rounding only
        assert!((back - Complex::new(2.0, -0.5)).norm() < 1e-14);
        assert_eq!(y.quantity, MotionQuantity::Displacement);
    }

    #[test]
    fn bands_include_both_ends() {
        let all = small(MotionQuantity::Velocity);
        assert_eq!(all.band(100.0, 200.0).frequency_hz, vec![100.0, 200.0]);
        for (low_hz, high_hz) in [(100.0, 200.0), (0.0, f64::INFINITY), (1e6, 2e6)] {
            assert_eq!(all.clone().into_band(low_hz, high_hz), all.band(low_hz, high_hz));
        }
    }

    #[test]
    fn selection_is_by_name_and_keeps_the_order_asked_for() {
        let y = small(MotionQuantity::Velocity);
        let z = y.select(&["b".into(), "a".into()], &["g".into()]).expect("all there");
        assert_eq!(z.lines[0][(0, 0)], y.lines[0][(1, 1)]);
        let error = y.select(&["c".into()], &[]).expect_err("no such row");
        assert!(error.to_string().contains("`c`"));
        let names = |names: [&str; 2]| names.map(String::from).to_vec();
        let renamed = y.clone().renamed(names(["p", "q"]), names(["u", "v"])).expect("two and two");
        assert_eq!((renamed.lines(), renamed.outputs()[1].as_str()), (y.lines(), "q"));
        assert!(y.clone().renamed(names(["p", "p"]), names(["u", "v"])).is_err());
        assert!(y.renamed(names(["p", "q"]), vec!["u".into()]).is_err());
    }

    #[test]
    fn a_nan_is_named_by_cell_and_line() {
        let y = small(MotionQuantity::Velocity).map_lines(|line, mut y| {
            if line == 2 {
                y[(0, 1)].im = f64::NAN;
            }
        });
        let text = y.check_finite().expect_err("a NaN").to_string();
        assert!(text.contains("`g`") && text.contains("`a`") && text.contains("300"));
    }

    #[test]
    fn a_negative_variance_is_named_by_cell_and_line_and_an_unknown_one_is_none() {
        let with = |value| {
            let mut variance = vec![DMatrix::from_element(2, 2, 1.0); 3];
            variance[1][(1, 0)] = value;
            small(MotionQuantity::Velocity)
                .with_variance(variance)
                .expect("one for each value")
                .check_variance()
        };
        let text = with(-0.5).expect_err("negative").to_string();
        assert!(
            text.contains("`f`") && text.contains("`b`") && text.contains("200 Hz") && text.contains("-0.5"),
            "{text}"
        );
        assert!(with(0.0).is_ok() && with(f64::NAN).is_ok());
    }

    #[test]
    fn repeated_names_and_falling_axes_are_refused() {
        let of = |frequency_hz: [f64; 3], outputs: [&str; 2]| {
            let Frf { sigma_per_s, quantity, inputs, lines, .. } = small(MotionQuantity::Velocity);
            let outputs = outputs.map(String::from).to_vec();
            Frf::new(frequency_hz.to_vec(), sigma_per_s, quantity, outputs, inputs, lines)
        };
        assert!(of([100.0, 200.0, 300.0], ["a", "b"]).is_ok());
        assert!(matches!(of([100.0, 200.0, 300.0], ["a", "a"]), Err(FrfError::RepeatedName { .. })));
        assert!(matches!(of([100.0, 100.0, 300.0], ["a", "b"]), Err(FrfError::Axis { line: 1, .. })));
    }
}

#[cfg(test)]
mod checks_tests {
    use super::*;
    use crate::frf::MotionQuantity;
    use nalgebra::{Complex, DMatrix};

    fn with(coherence: f64) -> Frf {
        let line = || DMatrix::from_element(2, 1, Complex::new(1.0, 0.0));
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let frf = Frf::new(
            vec![0.0, 50.0],
            0.0,
            MotionQuantity::Velocity,
            names(&["A1:x", "A1:y"]),
            names(&["AZ1"]),
            vec![line(), line()],
        );
        let mut all = vec![DMatrix::from_element(2, 1, 0.5); 2];
        all[1][(1, 0)] = coherence;
        frf.and_then(|frf| frf.with_coherence(all)).expect("all agree")
    }

    #[test]
    fn a_coherence_outside_zero_to_one_is_named_and_a_rounded_one_is_clipped() {
        for wrong in [1.246, 1.001, -0.01, f64::INFINITY] {
            let text = with(wrong).with_coherence_in_range().expect_err("no coherence").to_string();
            for part in ["coherence", "`AZ1`", "`A1:y`", "50 Hz", &wrong.to_string()] {
                assert!(text.contains(part), "{text} lacks {part}");
            }
        }
        for (rounded, clipped) in [(1.000_001, 1.0), (-1e-7, 0.0)] {
            let (frf, count) = with(rounded).with_coherence_in_range().expect("rounding");
            assert_eq!((frf.coherence().expect("kept")[1][(1, 0)], count), (clipped, 1));
        }
        assert_eq!(with(1.0).with_coherence_in_range().expect("in range").1, 0);
        let (unknown, count) = with(f64::NAN).with_coherence_in_range().expect("not known");
        assert!(unknown.coherence().expect("kept")[1][(1, 0)].is_nan() && count == 0);
    }
}
