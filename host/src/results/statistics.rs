//! Mean, scatter, median and interval of a quantity over lines or cycles.

use serde::{Deserialize, Serialize};

/// A quantity over the lines of a band, in the unit its field's name carries.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Arithmetic mean.
    pub mean: f64,
    /// Population standard deviation over the lines.
    pub std: f64,
    /// Median: what remains when a few lines explode.
    pub median: f64,
    /// 95 % interval of the mean; null where it is not known.
    pub ci95: Option<[f64; 2]>,
}

/// A quantity over cycles (of one shaker record, or the first cycles of many impacts).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OverCycles {
    /// Arithmetic mean.
    pub mean: f64,
    /// Population standard deviation.
    pub std: f64,
    /// How many cycles.
    pub cycles: usize,
}

impl OverCycles {
    /// Of the finite values among `values`; `None` when there are none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        if finite.is_empty() {
            return None;
        }
        let n = finite.len() as f64;
        let mean = finite.iter().sum::<f64>() / n;
        let variance = finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        Some(OverCycles { mean, std: variance.sqrt(), cycles: finite.len() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_no_numbers_are_left_out() {
        let s = OverCycles::of(&[1.0, f64::NAN, 3.0, f64::INFINITY]).expect("two values");
        assert_eq!((s.mean, s.std, s.cycles), (2.0, 1.0, 2));
        assert!(OverCycles::of(&[f64::NAN]).is_none());
    }
}
