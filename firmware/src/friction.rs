//! The friction force T from the load cells that ground substructure B.
//!
//! Three cells share the force; a 3 × 3 calibration matrix converts their readings (N) to forces
//! (N), and T is the sum of the three. Since T is linear in the readings, the column sums of the
//! matrix are computed once, and each scan costs three multiplications.

use jointrig_hot::codes;
use jointrig_protocol::channel::{Channel, Role};
use nalgebra::{Matrix3, RowVector3, Vector3};

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

    /// The mean of T over some scans with `channels` channels each, N. The raw codes are summed,
    /// since T is linear in them.
    pub fn mean_of(&self, codes: &[[u8; 2]], channels: usize) -> f32 {
        let sums = self.places.map(|place| codes::sum(codes, channels, place) as f32);
        (self.weights * Vector3::from(sums)).x * channels as f32 / codes.len() as f32
    }

    /// T of one scan, N.
    pub fn of_scan(&self, codes: &impl Fn(usize) -> i16) -> f32 {
        let [a, b, c] = self.places;
        let readings = Vector3::new(f32::from(codes(a)), f32::from(codes(b)), f32::from(codes(c)));
        (self.weights * readings).x
    }
}
