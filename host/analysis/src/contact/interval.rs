//! A value with its confidence interval.

use serde::Serialize;

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub mean: f64,
    /// Its 95 % interval, lower and upper end.
    pub ci95: [f64; 2],
}
