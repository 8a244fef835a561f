//! Spectra of single hits, for the bootstrap: only the assembly's interface cells, only the main
//! band.

use super::cell::{Cell, CellName};
use crate::results::MAIN_BAND;
use crate::spectra::{FrfSettings, ImpactRecords, MotionQuantity, SpectraError, Windowing, estimate};
use crate::structure::Structure;
use crate::substructuring::averaged::CellHits;
use crate::substructuring::geometry::{Configuration, Grouping, Point};
use num_complex::Complex;

/// The spectra of every hit of a cell of the assembly's interface; `None` for another cell, or for
/// a single hit.
///
/// # Errors
/// Hits that cannot be transformed.
pub fn of(
    name: &CellName,
    points: &Configuration,
    cell: &Cell,
    sigma_per_s: f64,
    quantity: MotionQuantity,
) -> Result<Option<CellHits>, SpectraError> {
    let interface = |p: &&Point| matches!(p.grouping, Grouping::InterfaceA | Grouping::InterfaceB);
    let channels: Vec<&Point> =
        points.channels.iter().filter(interface).filter(|p| p.name == name.response).collect();
    // records hold a location's channels in the order used here
    let all = cell.hits.iter().all(|hit| hit.response.len() == channels.len());
    let there = points.impacts.iter().filter(interface).any(|p| p.name == name.impact);
    if name.configuration != Structure::Ajb || channels.is_empty() || !all || !there || cell.hits.len() < 2 {
        return Ok(None);
    }
    let (mut auto, mut cross) = (Vec::<Vec<f64>>::new(), Vec::<Vec<Vec<Complex<f64>>>>::new());
    for hit in &cell.hits {
        let one = ImpactRecords {
            fs_hz: cell.fs_hz,
            force_n: vec![hit.force_n.clone()],
            response: vec![hit.response.clone()],
            quantity,
        };
        let settings = FrfSettings {
            windowing: Windowing { sigma_per_s, ..Windowing::default() },
            delay_s: hit.response_delay_s.clone(),
            band_hz: Some([MAIN_BAND.low_hz, MAIN_BAND.high_hz]),
            ..FrfSettings::default()
        };
        let y = estimate(&one, &[true], &settings)?;
        auto.resize(y.lines(), Vec::new());
        cross.resize(y.lines(), vec![Vec::new(); channels.len()]);
        for l in 0..y.lines() {
            auto[l].push(y.force(l));
            for (axis, of_channel) in cross[l].iter_mut().enumerate() {
                of_channel.push(y.cross(l, axis));
            }
        }
    }
    Ok(Some(CellHits {
        input: name.impact.clone(),
        outputs: channels.iter().map(|c| c.description.clone()).collect(),
        auto,
        cross,
    }))
}
