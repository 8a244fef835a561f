//! The contact stiffness: selects the cells used, and evaluates them together.

use super::averages::CellAverage;
use super::cell::{CellName, Measurements};
use crate::contact;
use crate::contact::{Axes, BAND, ContactCell, ContactError, Input, Known, KnownMass, Stiffness, read};
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping};

/// Whether a cell is used for the estimate of the contact: arm B's interface from hits on B alone,
/// and from the assembly arm B's interface and the specimens from hits along z on A or on the part
/// behind it.
pub fn reads(geometry: &Geometry, name: &CellName) -> bool {
    let specimen = geometry.ajb.channels.iter().any(|p| p.grouping == Grouping::SpecimenA);
    if !specimen || name.configuration == Structure::A {
        return false;
    }
    let points = geometry.points(name.configuration);
    let mut own = points.channels.iter().filter(|p| p.name == name.response);
    let served = own.any(|p| contact::serves(p.grouping));
    let hit = points.impacts.iter().find(|p| p.name == name.impact);
    served
        && hit.is_some_and(|p| match name.configuration {
            Structure::B => p.grouping == Grouping::InterfaceB,
            _ => {
                matches!(p.grouping, Grouping::InterfaceA | Grouping::InternalA) && p.direction[2].abs() > 0.9
            }
        })
}

/// Identifies the contact from the averaged cells and the hits on a known mass.
///
/// # Errors
/// Why there is no result, and how to obtain one.
pub fn answer<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    known_mass: Option<KnownMass>,
) -> Result<(Stiffness, Known), ContactError> {
    let cells = cells(measurements, averages, |average| average.damped.as_ref());
    if cells.is_empty() {
        let hit = averages.iter().any(|a| a.name.configuration == Structure::Ajb && a.contact.is_some());
        return Err(if hit { ContactError::NoRotation } else { ContactError::NoCells });
    }
    read(&input(measurements, cells, known_mass))
}

/// The cells that have these spectra.
pub fn cells<'a, M: Measurements>(
    measurements: &'a M,
    averages: &'a [CellAverage],
    spectra: impl Fn(&'a CellAverage) -> Option<&'a CrossSpectra>,
) -> Vec<ContactCell<'a>> {
    let geometry = measurements.geometry();
    let cell = |average: &'a CellAverage| {
        let spectra = spectra(average)?;
        let points = geometry.points(average.name.configuration);
        let impact = points.impacts.iter().find(|p| p.name == average.name.impact)?;
        let own = || points.channels.iter().filter(|p| p.name == average.name.response);
        let point = own().next()?;
        Some(ContactCell {
            structure: average.name.configuration,
            impact: &impact.name,
            impact_m: impact.position_m,
            direction: impact.direction,
            impact_grouping: impact.grouping,
            point: &point.name,
            point_m: point.position_m,
            point_sigma_m: measurements.point_sigma_m(&point.name),
            point_grouping: point.grouping,
            axes: Axes::new(&own().map(|p| p.direction).collect::<Vec<_>>())?,
            fixed: measurements.is_fixed(&point.name),
            lasers: measurements.has_all_lasers(&point.name),
            records: &average.records,
            spectra,
            quantity: measurements.quantity(),
        })
    };
    averages.iter().filter_map(cell).collect()
}

/// Input of the contact identification.
pub fn input<'a, M: Measurements>(
    measurements: &M,
    cells: Vec<ContactCell<'a>>,
    known_mass: Option<KnownMass>,
) -> Input<'a> {
    Input {
        cells,
        contact_m: measurements.geometry().virtual_point_b_m,
        spots_m: measurements.spots_m(),
        specimens: measurements.specimens(),
        parallel_path: measurements.known_contact().parallel_path,
        priors: measurements.contact_priors(),
        known_mass,
        band_hz: BAND,
    }
}
