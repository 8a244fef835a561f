//! Identifies the static arm from hits on B alone, where the force at the contact is that of the
//! hammer.

use super::averages::CellAverage;
use super::missing::Missing;
use crate::hysteresis::static_arm::{Identified, from_known_force};
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Point};
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::vpt;
use nalgebra::Vector3;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Frequency range of the fit, Hz: above the hammer's drift, below the first mode of the arm on its
/// cells.
const FIT_HZ: [f64; 2] = [100.0, 600.0];

/// Fits mass and parallel path to the hits on B alone; `None` without a complete set of them.
///
/// Cells whose lines differ from those of the first are reported in `missing`. The hits are
/// transformed to the virtual point by the impacts' transformation, so that a hit away from the
/// contact is weighted by its lever arm.
pub fn from_hits(
    averages: &[CellAverage],
    points: &Configuration,
    virtual_point_m: [f64; 3],
    sigma_per_s: f64,
    parallel_path: Option<f64>,
    missing: &mut Vec<Missing>,
) -> Option<Identified> {
    let mut hit: Vec<(&Point, CrossSpectra)> = Vec::new();
    let mut frequency_hz: &[f64] = &[];
    for cell in averages.iter().filter(|cell| cell.name.configuration == Structure::B) {
        let Some(contact) = &cell.contact else { continue };
        if frequency_hz.is_empty() {
            frequency_hz = cell.spectra.frequency_hz();
        }
        let added = match hit.iter_mut().find(|(point, _)| point.name == cell.name.impact) {
            Some((_, sum)) => sum.add(contact).is_ok(),
            None if contact.lines() != frequency_hz.len() => false,
            None => {
                let point = points.impacts.iter().find(|point| point.name == cell.name.impact)?;
                hit.push((point, contact.clone()));
                true
            }
        };
        if !added {
            missing.push(Missing::OtherLines(cell.name.clone()));
        }
    }
    if hit.is_empty() {
        return None;
    }
    let impacts: Vec<Point> = hit.iter().map(|(point, _)| (*point).clone()).collect();
    let transformation = vpt::impacts(&impacts, Vector3::from(virtual_point_m), IdmSet::Six, None).ok()?;
    let z = IdmSet::Six.position(Dof::Z)?;
    let lines: Vec<(Complex<f64>, Complex<f64>)> = frequency_hz
        .iter()
        .enumerate()
        .filter(|(_, f)| (FIT_HZ[0]..=FIT_HZ[1]).contains(*f))
        .map(|(l, f)| {
            let per_newton = |signal: usize| -> Complex<f64> {
                hit.iter().enumerate().map(|(i, (_, sum))| sum.h1(l, signal) * transformation.t[(i, z)]).sum()
            };
            // the cells' sum, and B's acceleration from its velocity
            (per_newton(2), per_newton(1) * Complex::new(sigma_per_s, TAU * f))
        })
        .filter(|(t, a)| t.is_finite() && a.is_finite())
        .collect();
    from_known_force(&lines, parallel_path)
}
