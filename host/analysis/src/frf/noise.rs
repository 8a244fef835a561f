//! Noise of measured FRFs: a variance for every cell and line, and how neighbouring lines share it.

use super::FrfMatrix;
use nalgebra::DMatrix;

/// Variances are averaged over this many Hz on either side: one from a handful of hits scatters by its own size.
pub const SMOOTH_HZ: f64 = 10.0;

/// Why a noise array cannot be used with an FRF matrix.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoiseError {
    /// Another number of lines, rows or columns than the FRF has.
    #[error(
        "the variance has {found_lines} lines of {found_rows} × {found_columns}, the FRF {lines} lines of {rows} × {columns}"
    )]
    Shape {
        /// Lines of the variance.
        found_lines: usize,
        /// Rows of its first line.
        found_rows: usize,
        /// Columns of its first line.
        found_columns: usize,
        /// Lines of the FRF.
        lines: usize,
        /// Rows of the FRF.
        rows: usize,
        /// Columns of the FRF.
        columns: usize,
    },
}

/// Variance of the real part of each FRF value, and of its imaginary part (the complex variance is twice that).
///
/// `variance[l][(o, i)]` is in the square of the FRF's own unit; NaN where it is not known (a single hit). Noise of
/// different cells counts as independent: true for the sensors' floor, while the force cell's own noise, common to
/// the three axes of one hit, is far below it.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfNoise {
    /// One matrix (output × input) per line.
    pub variance: Vec<DMatrix<f64>>,
}

impl FrfNoise {
    /// The same standard deviation of the real and of the imaginary part in all cells of a line: this fraction of their rms.
    #[must_use]
    pub fn relative(frf: &FrfMatrix, fraction: f64) -> FrfNoise {
        let variance = (frf.lines.iter())
            .map(|y| {
                let (sum, count) = (y.iter().filter(|v| v.re.is_finite() && v.im.is_finite()))
                    .fold((0.0, 0usize), |(sum, count), v| (sum + v.norm_sqr(), count + 1));
                y.map(|_| fraction * fraction * sum / count as f64)
            })
            .collect();
        FrfNoise { variance }
    }

    /// Checks that the variance belongs to this FRF.
    ///
    /// # Errors
    /// [`NoiseError::Shape`].
    pub fn check(&self, frf: &FrfMatrix) -> Result<(), NoiseError> {
        let (rows, columns) = (frf.outputs.len(), frf.inputs.len());
        let bad = self.variance.iter().find(|v| v.shape() != (rows, columns));
        if self.variance.len() == frf.lines.len() && bad.is_none() {
            return Ok(());
        }
        let (found_rows, found_columns) =
            bad.or(self.variance.first()).map_or((0, 0), nalgebra::Matrix::shape);
        Err(NoiseError::Shape {
            found_lines: self.variance.len(),
            found_rows,
            found_columns,
            lines: frf.lines.len(),
            rows,
            columns,
        })
    }

    /// The same as the variance of receptances: divided by |s|² or |s|⁴, as the FRF itself is divided by s or s².
    #[must_use]
    pub fn to_receptance(&self, frf: &FrfMatrix) -> FrfNoise {
        let order = frf.quantity.order_of_s();
        let variance =
            self.variance.iter().enumerate().map(|(l, v)| v * frf.s(l).norm_sqr().powi(-order)).collect();
        FrfNoise { variance }
    }

    /// Every cell averaged over the lines within ± `half_width_hz`; unknown values are left out.
    ///
    /// A variance from a handful of hits scatters by as much as its own size, and whoever weighs lines with it prefers
    /// the lines whose noise looks small by chance. The floor itself is smooth.
    #[must_use]
    pub fn smoothed(&self, frequency_hz: &[f64], half_width_hz: f64) -> FrfNoise {
        let Some(first) = self.variance.first() else { return self.clone() };
        let (rows, columns) = first.shape();
        let mut variance = vec![DMatrix::from_element(rows, columns, f64::NAN); self.variance.len()];
        for row in 0..rows {
            for column in 0..columns {
                // sums from the left: a window's sum is a difference of two of them
                let mut sums = vec![(0.0, 0usize)];
                for v in &self.variance {
                    let (sum, count) = sums[sums.len() - 1];
                    let value = v[(row, column)];
                    sums.push(if value.is_finite() { (sum + value, count + 1) } else { (sum, count) });
                }
                for (l, out) in variance.iter_mut().enumerate() {
                    let from = frequency_hz.partition_point(|f| *f < frequency_hz[l] - half_width_hz);
                    let to = frequency_hz.partition_point(|f| *f <= frequency_hz[l] + half_width_hz);
                    let count = sums[to].1 - sums[from].1;
                    if count > 0 {
                        out[(row, column)] = ((sums[to].0 - sums[from].0) / count as f64).max(0.0);
                    }
                }
            }
        }
        FrfNoise { variance }
    }
}

/// By how much the variance of a sum over many lines exceeds that of independent lines.
///
/// White noise under e^(−σt) has the correlation 2σ/(2σ − i2πΔf) between lines Δf apart; summed over all distances that is
/// x coth x with x = σ/Δf. Without a window the lines of a record are independent: 1.
pub fn shared_by_lines(sigma_per_s: f64, step_hz: f64) -> f64 {
    let x = sigma_per_s / step_hz;
    if x > 1e-6 && x.is_finite() { x / x.tanh() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::Quantity;
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
        // the sum's tail beyond 40 000 lines is 1/(π² 40 000) of itself
        assert!((shared_by_lines(sigma, step) / sum - 1.0).abs() < 1e-4);
        assert_eq!(shared_by_lines(0.0, step), 1.0);
    }

    #[test]
    fn smoothing_averages_what_is_known() {
        let noise = FrfNoise {
            variance: [1.0, f64::NAN, 5.0, 9.0].iter().map(|v| DMatrix::from_element(1, 1, *v)).collect(),
        };
        let smooth = noise.smoothed(&[1.0, 2.0, 3.0, 4.0], 1.0);
        let values: Vec<f64> = smooth.variance.iter().map(|v| v[(0, 0)]).collect();
        assert_eq!(values, [1.0, 3.0, 7.0, 7.0]);
    }

    #[test]
    fn a_variance_of_another_shape_is_refused() {
        let frf = FrfMatrix {
            frequency_hz: vec![100.0],
            sigma_per_s: 0.0,
            quantity: Quantity::Mobility,
            outputs: vec!["a".into()],
            inputs: vec!["f".into()],
            lines: vec![DMatrix::zeros(1, 1)],
        };
        let noise = FrfNoise { variance: vec![DMatrix::zeros(1, 2)] };
        assert!(noise.check(&frf).expect_err("two columns").to_string().contains("1 × 2"));
        let noise = FrfNoise { variance: vec![DMatrix::from_element(1, 1, 4.0)] };
        assert!(noise.check(&frf).is_ok());
        let omega = std::f64::consts::TAU * 100.0;
        assert!((noise.to_receptance(&frf).variance[0][(0, 0)] - 4.0 / (omega * omega)).abs() < 1e-15);
    }
}
