//! Errors of FRFs.

use super::quantity::MotionQuantity;

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
    #[error("the exponential window's damping is {0} 1/s: a finite number that is not negative is needed")]
    Damping(f64),
    /// A name occurs twice among the outputs or the inputs.
    #[error("the name `{name}` stands twice among the {side}: rename one of them")]
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
    /// A variance is below zero.
    #[error(
        "the variance of the FRF from `{input}` to `{output}` is {variance} at {frequency_hz} Hz: a variance is zero or more, NaN where it is not known"
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
        "the coherence of the FRF from `{input}` to `{output}` is {coherence} at {frequency_hz} Hz: a coherence is from 0 to 1, NaN where it is not known; estimate it again or leave it out"
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
    #[error("line {line} is at s = 0: a {} has no receptance there; cut the line out", quantity.frf_name())]
    DivisionByZero {
        /// Index of the line.
        line: usize,
        /// What is stored.
        quantity: MotionQuantity,
    },
}
