//! A value with its interval.

use serde::Serialize;

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub mean: f64,
    /// Its interval.
    pub ci95: [f64; 2],
}
