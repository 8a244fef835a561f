//! The cells that belong to no FRF matrix: on the known mass, and with the joint open.

use super::averages::{Asked, CellAverage, CellSums, LINES_HZ};
use super::cell::{CellName, MassCell, Measurements, OpenAndClosed};
use super::missing::Missing;
use crate::contact::{HitsOnA, KnownMass, SecondPath, mass_ratio};
use crate::spectra::MotionQuantity;

/// The ratios of the sensors to the hammer from the hits on the known mass; `None` if the plan has
/// none, or before the first hit.
///
/// # Errors
/// The hits cannot be read, or do not match.
pub fn known_mass<M: Measurements>(measurements: &M) -> Result<Option<KnownMass>, Missing> {
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

/// The part of the force between the arms that passes beside the contact; `None` if the plan has no
/// cell with the joint open, or before the first hit of it or of the cell that it is compared with.
///
/// # Errors
/// The hits cannot be read, do not match, or lack a signal.
pub fn second_path<M: Measurements>(measurements: &M) -> Result<Option<SecondPath>, Missing> {
    let Some(OpenAndClosed { open, closed, axes }) = measurements.open_joint() else { return Ok(None) };
    let of = |name: &CellName| average(measurements, name, Asked { contact: false, damped: true });
    let (Some(seen_open), Some(seen_closed)) = (of(&open)?, of(&closed)?) else { return Ok(None) };
    let quantity = measurements.quantity();
    let path = hits_on_a(&seen_open, axes[0], quantity)
        .zip(hits_on_a(&seen_closed, axes[1], quantity))
        .and_then(|(open, closed)| SecondPath::of(&open, &closed));
    let told = "the load cells or the vibrometer next to the contact on B are missing".to_owned();
    path.map(Some).ok_or(Missing::Records { cell: open, told })
}

/// `None` unless both vibrometers next to the contact and the load cells were measured.
fn hits_on_a(average: &CellAverage, axis: usize, quantity: MotionQuantity) -> Option<HitsOnA<'_>> {
    let spectra = average.damped.as_ref()?;
    (spectra.outputs() == average.spectra.outputs() + 3).then_some(HitsOnA { spectra, axis, quantity })
}

/// The average of one cell; `None` before its first hit.
///
/// # Errors
/// The hits cannot be read, or do not match.
fn average<M: Measurements>(
    measurements: &M,
    name: &CellName,
    asked: Asked,
) -> Result<Option<CellAverage>, Missing> {
    let records = |told: String| Missing::Records { cell: name.clone(), told };
    let mut sums = CellSums::new(name.clone(), measurements.sigma_per_s(), asked, LINES_HZ);
    let (mut hits, mut unfit) = (0, None);
    let read = measurements.each_hit(name, asked.contact || asked.damped, &mut |hit, fs_hz| {
        if unfit.is_none() {
            unfit = sums.add(hit, fs_hz).err();
            hits += 1;
        }
    });
    read.map_err(|error| records(error.to_string()))?;
    if hits == 0 {
        return Ok(None);
    }
    unfit.map_or_else(|| sums.finish(), Err).map(Some).map_err(|error| records(error.to_string()))
}
