//! What passes beside the contact, from hits with the joint open.

use super::averages::{Asked, CellAverage};
use super::cell::{CellName, Measurements, OpenJoint};
use super::cells_stage::average;
use super::missing::Missing;
use crate::contact::{HitsOnA, SecondPath};
use crate::spectra::MotionQuantity;

/// The part of the force between the arms that passes beside the contact; `None` if the plan has no
/// cell with the joint open, or before the first hit of it or of the cell that it is compared with.
///
/// # Errors
/// The hits cannot be read, do not match, or lack a signal.
pub fn second_path<M: Measurements>(measurements: &M) -> Result<Option<SecondPath>, Missing> {
    let Some(OpenJoint { open, closed, axes }) = measurements.open_joint() else { return Ok(None) };
    let of = |name: &CellName| average(measurements, name, Asked { contact: false, damped: true });
    let (Some(seen_open), Some(seen_closed)) = (of(&open)?, of(&closed)?) else { return Ok(None) };
    let quantity = measurements.quantity();
    let path = hits(&seen_open, axes[0], quantity)
        .zip(hits(&seen_closed, axes[1], quantity))
        .and_then(|(open, closed)| SecondPath::of(&open, &closed));
    let told = "the load cells or the vibrometer next to the contact on B are missing".to_owned();
    path.map(Some).ok_or(Missing::Records { cell: open, told })
}

/// `None` unless both vibrometers next to the contact and the load cells were measured.
fn hits(average: &CellAverage, axis: usize, quantity: MotionQuantity) -> Option<HitsOnA<'_>> {
    let spectra = average.damped.as_ref()?;
    (spectra.outputs() == average.spectra.outputs() + 3).then_some(HitsOnA { spectra, axis, quantity })
}
