//! Compares hammer and vibrometers on the known mass.

use super::averages::Asked;
use super::cell::{MassCell, Measurements};
use super::cells_stage::average;
use super::missing::Missing;
use crate::contact::{KnownMass, mass_ratio};
use crate::spectra::MotionQuantity;

/// The ratios of the sensors to the hammer from the hits on the known mass; `None` if the plan has
/// none, or before the first hit.
///
/// # Errors
/// The hits cannot be read, or do not match.
pub fn compared<M: Measurements>(measurements: &M) -> Result<Option<KnownMass>, Missing> {
    let Some(MassCell { name, mass_kg, sigma, axis, lasers }) = measurements.known_mass() else {
        return Ok(None);
    };
    let Some(average) = average(measurements, &name, Asked { contact: lasers, damped: false })? else {
        return Ok(None);
    };
    let spot =
        |output: usize| mass_ratio(average.contact.as_ref()?, output, MotionQuantity::Velocity, mass_kg);
    let point = (axis < average.spectra.outputs())
        .then(|| mass_ratio(&average.spectra, axis, measurements.quantity(), mass_kg));
    Ok(Some(KnownMass { sigma, spots: [spot(0), spot(1)], point: point.flatten(), axis }))
}
