//! What a matrix of FRFs may hold.

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
            // nalgebra keeps columns together
            let (row, column) = (at % own.nrows(), at / own.nrows());
            let (output, input) = (self.outputs()[row].clone(), self.inputs()[column].clone());
            return Err(FrfError::NegativeVariance { output, input, frequency_hz, variance: own[at] });
        }
        Ok(())
    }
}
