//! From converter codes to SI units: the channel scales of a session, for trigger, quiet, limits
//! and amplitudes, and the friction force T from the load cells that ground substructure B.
//!
//! A board is built with nominal sensitivities; a laboratory may have better values. The host sends
//! these when its session begins, so that control, limits and trigger use the same scales as the
//! host. Otherwise, two vibrometers calibrated separately would leave a part of their common motion
//! in their difference.
//!
//! Three load cells share the friction force; a 3 × 3 calibration matrix converts their readings
//! (N) to forces (N), and T is the sum of the three. Since T is linear in the readings, the column
//! sums of the matrix are computed once, and each scan costs three multiplications.

use crate::sentence::out_of_bounds;
use heapless::Vec;
use jointrig_hot::codes;
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::limits::{CHANNEL_CAPACITY, SCALE_FACTOR_CAP};
use nalgebra::{Matrix3, RowVector3, Vector3};

/// SI units per code of every channel, sign included.
pub(crate) type UnitsPerCode = Vec<f32, CHANNEL_CAPACITY>;

/// The built-in scales.
pub(crate) fn as_built(channels: &[Channel]) -> UnitsPerCode {
    channels.iter().take(CHANNEL_CAPACITY).map(Channel::units_per_code_f32).collect()
}

/// The scales sent by a host, if they are acceptable.
pub(crate) fn as_told(channels: &[Channel], units_per_volt: &[f32]) -> Result<UnitsPerCode, Refusal> {
    if units_per_volt.len() != channels.len() {
        return Err(out_of_bounds("scales: one for each channel of the device, in its order"));
    }
    let most = SCALE_FACTOR_CAP as f32;
    let fits = |(channel, told): (&Channel, &f32)| {
        // NaN and zero lie in no range
        let factor = (told / channel.units_per_volt).abs();
        factor >= 1.0 / most && factor <= most
    };
    if !channels.iter().zip(units_per_volt).all(fits) {
        return Err(out_of_bounds(
            "scales: each must be a number, not zero, and within a factor of 100 of the one built in",
        ));
    }
    Ok(channels.iter().zip(units_per_volt).map(|(channel, told)| told * channel.range_v / 32_768.0).collect())
}

/// Cells that share the friction force.
pub const CELLS: usize = 3;

/// Converts codes of the load cells to T.
#[derive(Clone, Debug)]
pub struct Friction {
    /// Indices of the cells in the scan.
    places: [usize; CELLS],
    /// N per code of each cell.
    newtons_per_code: Vector3<f32>,
    /// Sums of the calibration matrix's columns.
    columns: RowVector3<f32>,
    /// N per code of each cell, calibration included.
    weights: RowVector3<f32>,
}

impl Friction {
    /// Uncalibrated (identity matrix); `None` unless exactly three channels are load cells.
    pub fn new(channels: &[Channel]) -> Option<Self> {
        let mut cells = channels.iter().enumerate().filter(|(_, channel)| channel.role == Role::LoadCell);
        let mut places = [0; CELLS];
        let mut newtons_per_code = Vector3::zeros();
        for i in 0..CELLS {
            let (place, channel) = cells.next()?;
            places[i] = place;
            newtons_per_code[i] = channel.units_per_code_f32();
        }
        if cells.next().is_some() {
            return None;
        }
        let mut friction =
            Self { places, newtons_per_code, columns: RowVector3::repeat(1.0), weights: RowVector3::zeros() };
        friction.calibrate(&Matrix3::identity());
        Some(friction)
    }

    /// Sets the calibration matrix: forces = matrix × readings.
    pub fn calibrate(&mut self, matrix: &Matrix3<f32>) {
        self.columns = RowVector3::repeat(1.0) * matrix;
        self.weigh();
    }

    /// Sets other scales; the matrix is unchanged.
    pub(crate) fn judge_by(&mut self, scales: &[f32]) {
        for (newtons_per_code, place) in self.newtons_per_code.iter_mut().zip(self.places) {
            *newtons_per_code = scales[place];
        }
        self.weigh();
    }

    fn weigh(&mut self) {
        self.weights = self.columns.component_mul(&self.newtons_per_code.transpose());
    }

    /// The mean of T over some scans of `words` 16-bit words each, N. The raw codes are summed,
    /// since T is linear in them.
    pub fn mean_of(&self, codes: &[[u8; 2]], words: usize) -> f32 {
        let sums = self.places.map(|place| codes::sum(codes, words, place) as f32);
        (self.weights * Vector3::from(sums)).x * words as f32 / codes.len() as f32
    }

    /// T of one scan, N.
    pub fn of_scan(&self, codes: &impl Fn(usize) -> i16) -> f32 {
        let [a, b, c] = self.places;
        let readings = Vector3::new(f32::from(codes(a)), f32::from(codes(b)), f32::from(codes(c)));
        (self.weights * readings).x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Name, Quantity, Role};

    fn channels() -> [Channel; 2] {
        [0.005, -0.001].map(|units_per_volt| Channel {
            name: Name::new(),
            role: Role::Auxiliary,
            quantity: Quantity::Velocity,
            units_per_volt,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        })
    }

    #[test]
    fn a_scale_may_be_another_and_turned_but_not_another_sensors() {
        let told = as_told(&channels(), &[0.00515, 0.1]).expect("3 % more, and turned, at the cap");
        assert!((told[0] - 0.00515 * 10.0 / 32_768.0).abs() < 1e-12 && told[1] > 0.0);
        for wrong in [f32::NAN, f32::INFINITY, 0.0, -0.0, 0.51, 4.9e-5] {
            let refused = as_told(&channels(), &[wrong, -0.001]);
            assert!(matches!(refused, Err(Refusal::OutOfBounds(_))), "{wrong}");
        }
        for count in [0, 1, 3] {
            assert!(as_told(&channels(), &[0.005, -0.001, 1.0][..count]).is_err(), "{count} scales");
        }
    }
}
