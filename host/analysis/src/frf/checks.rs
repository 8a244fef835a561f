//! Checks of the values in an FRF matrix.

use super::error::FrfError;
use super::matrix::Frf;

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

#[cfg(test)]
mod tests {
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
