//! Compares hammer and vibrometers on the known mass.

use super::averages::{Asked, CellSums, LINES_HZ};
use super::cell::{MassCell, Measurements};
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
    let records = |told: String| Missing::Records { cell: name.clone(), told };
    let asked = Asked { contact: lasers, damped: false };
    let mut sums = CellSums::new(name.clone(), measurements.sigma_per_s(), asked, LINES_HZ);
    let (mut hits, mut unfit) = (0, None);
    let read = measurements.each_hit(&name, lasers, &mut |hit, fs_hz| {
        if unfit.is_none() {
            unfit = sums.add(hit, fs_hz).err();
            hits += 1;
        }
    });
    read.map_err(|error| records(error.to_string()))?;
    if hits == 0 {
        return Ok(None);
    }
    let average = unfit.map_or_else(|| sums.finish(), Err).map_err(|error| records(error.to_string()))?;
    let spot =
        |output: usize| mass_ratio(average.contact.as_ref()?, output, MotionQuantity::Velocity, mass_kg);
    let point = (axis < average.spectra.outputs())
        .then(|| mass_ratio(&average.spectra, axis, measurements.quantity(), mass_kg));
    Ok(Some(KnownMass { sigma, spots: [spot(0), spot(1)], point: point.flatten(), axis }))
}
