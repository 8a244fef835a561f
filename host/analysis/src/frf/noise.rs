//! Noise of measured FRFs: the variance used for each cell and line, and the correlation between
//! neighbouring lines.

use super::{Frf, block};
use crate::parallel::prelude::*;
use nalgebra::DMatrix;

/// Variances are averaged over this many Hz on either side, because a variance from a handful of
/// hits scatters by its own size.
pub const SMOOTH_HZ: f64 = 10.0;

impl Frf {
    /// The same FRFs with one standard deviation of the real and of the imaginary part in all cells
    /// of a line: this fraction of their rms.
    #[must_use]
    pub fn with_relative_noise(mut self, fraction: f64) -> Frf {
        let variance = (self.lines().iter())
            .map(|y| {
                let (sum, count) = (y.iter().filter(|v| v.re.is_finite() && v.im.is_finite()))
                    .fold((0.0, 0usize), |(sum, count), v| (sum + v.norm_sqr(), count + 1));
                y.map(|_| fraction * fraction * sum / count as f64)
            })
            .collect();
        self.variance = Some(variance);
        self
    }

    /// The variance of all cells, each averaged over the lines within ± [`SMOOTH_HZ`]; NaN where it
    /// is unknown.
    pub(crate) fn smooth_variance(&self) -> Vec<DMatrix<f64>> {
        match self.variance() {
            Some(variance) => smoothed(variance, self.frequency_hz()),
            None => self.lines().iter().map(|y| y.map(|_| f64::NAN)).collect(),
        }
    }

    /// The variance of these cells' receptances at these lines, divided by |s|² or |s|⁴ as the FRF
    /// itself is by s or s², and averaged over the lines within ± [`SMOOTH_HZ`]; `None` if it is
    /// unknown.
    pub(crate) fn receptance_variance(
        &self,
        lines: &[usize],
        rows: &[usize],
        columns: &[usize],
    ) -> Option<Vec<DMatrix<f64>>> {
        let order = self.quantity().order_of_s();
        let variance = self.variance()?;
        let scaled = |&l: &usize| block(&variance[l], rows, columns) * self.s(l).norm_sqr().powi(-order);
        let frequency_hz: Vec<f64> = lines.iter().map(|&l| self.frequency_hz()[l]).collect();
        Some(smoothed(&lines.iter().map(scaled).collect::<Vec<_>>(), &frequency_hz))
    }
}

/// Averages every cell over the lines within ± [`SMOOTH_HZ`]; unknown values are left out.
///
/// A variance from a handful of hits scatters by as much as its own size, so weights based on it
/// would favour lines whose noise looks small by chance. The noise floor itself is smooth.
fn smoothed(known: &[DMatrix<f64>], frequency_hz: &[f64]) -> Vec<DMatrix<f64>> {
    let Some(first) = known.first() else { return Vec::new() };
    let (rows, columns) = first.shape();
    let windows: Vec<(usize, usize)> = frequency_hz
        .iter()
        .map(|at| {
            let from = frequency_hz.partition_point(|f| *f < at - SMOOTH_HZ);
            (from, frequency_hz.partition_point(|f| *f <= at + SMOOTH_HZ))
        })
        .collect();
    let by_row = |row: usize, column: usize| -> Vec<f64> {
        // cumulative sums: the sum over a window is the difference of two of them
        let (mut sum, mut count) = (0.0, 0usize);
        let mut sums = Vec::with_capacity(known.len() + 1);
        sums.push((sum, count));
        for v in known {
            let value = v[(row, column)];
            if value.is_finite() {
                (sum, count) = (sum + value, count + 1);
            }
            sums.push((sum, count));
        }
        let mean = |&(from, to): &(usize, usize)| match sums[to].1 - sums[from].1 {
            0 => f64::NAN,
            count => ((sums[to].0 - sums[from].0) / count as f64).max(0.0),
        };
        windows.iter().map(mean).collect()
    };
    let by_column: Vec<Vec<Vec<f64>>> = (0..columns)
        .into_par_iter()
        .map(|column| (0..rows).map(|row| by_row(row, column)).collect())
        .collect();
    let line = |l: usize| DMatrix::from_fn(rows, columns, |row, column| by_column[column][row][l]);
    (0..known.len()).into_par_iter().map(line).collect()
}

/// Factor by which the variance of a sum over many lines exceeds that of independent lines.
///
/// White noise multiplied by e^(−σt) has the correlation 2σ/(2σ − i2πΔf) between lines Δf apart;
/// summed over all distances this is x coth x with x = σ/Δf. Without a window the lines of a record
/// are independent, and the factor is 1.
pub fn shared_by_lines(sigma_per_s: f64, step_hz: f64) -> f64 {
    let x = sigma_per_s / step_hz;
    if x > 1e-6 && x.is_finite() { x / x.tanh() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::MotionQuantity;
    use super::*;

    /// Correlation (real part) of the noise of two lines `distance_hz` apart.
    fn line_correlation(sigma_per_s: f64, distance_hz: f64) -> f64 {
        let (decay, turn) = (2.0 * sigma_per_s, std::f64::consts::TAU * distance_hz);
        decay * decay / (decay * decay + turn * turn)
    }

    #[test]
    fn lines_of_a_window_share_their_noise() {
        let (sigma, step) = (2.3, 0.5);
        let sum: f64 = (-40_000..=40_000).map(|k| line_correlation(sigma, f64::from(k) * step)).sum();
        // the tail of the sum beyond 40 000 lines is 1/(π² 40 000) of it
        assert!((shared_by_lines(sigma, step) / sum - 1.0).abs() < 1e-4);
        assert_eq!(shared_by_lines(0.0, step), 1.0);
    }

    #[test]
    fn smoothing_averages_what_is_known() {
        let known = [1.0, f64::NAN, 5.0, 9.0].map(|v| DMatrix::from_element(1, 1, v));
        let smooth = smoothed(&known, &[10.0, 20.0, 30.0, 40.0]);
        let values: Vec<f64> = smooth.iter().map(|v| v[(0, 0)]).collect();
        assert_eq!(values, [1.0, 3.0, 7.0, 7.0]);
    }

    #[test]
    fn a_variance_of_another_shape_is_refused() {
        let (outputs, inputs) = (vec!["a".into()], vec!["f".into()]);
        let lines = vec![DMatrix::zeros(1, 1)];
        let frf =
            Frf::new(vec![100.0], 0.0, MotionQuantity::Velocity, outputs, inputs, lines).expect("all agree");
        let refused = |variance| frf.clone().with_variance(variance).expect_err("another shape").to_string();
        assert!(refused(vec![DMatrix::zeros(1, 2)]).contains("1 × 2"));
        assert!(refused(vec![]).contains("0 lines"));
        let known = frf.with_variance(vec![DMatrix::from_element(1, 1, 4.0)]).expect("alike");
        let omega = std::f64::consts::TAU * 100.0;
        let wanted = 4.0 / (omega * omega);
        let receptance = known.to_receptance().expect("above 0 Hz");
        assert!((receptance.variance().expect("carried along")[0][(0, 0)] - wanted).abs() < 1e-15);
        let smooth = known.receptance_variance(&[0], &[0], &[0]).expect("known");
        assert!((smooth[0][(0, 0)] - wanted).abs() < 1e-15);
    }
}
