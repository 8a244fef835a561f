//! What the masses of fixed sensors change in k_T.
//!
//! k_T is the contact's force over its deformation. The force comes from arm B's side: a sensor on
//! specimen A changes how A moves, but not k_T. A sensor on side B belongs to arm B, whose inertia
//! the hits on B alone determine: it changes nothing if it stays in place for the assembly. If it
//! was mounted in one of the two only, the force lacks its inertia or has too much of it, by
//! m ω² z_B.

use crate::analyse::averages::CellAverage;
use crate::analyse::cell::{Measurements, SensorMass};
use crate::contact::BAND;
use crate::structure::Structure;
use crate::substructuring::geometry::Grouping;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Relative change of the force beyond which the masses matter: a tenth of a good interval.
const MATTERS: f64 = 3e-3;

/// The masses, and their effect.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorMasses {
    /// Total mass on A's side, kg.
    pub on_a_kg: f64,
    /// Total mass on B's side, kg.
    pub on_b_kg: f64,
    /// Sensors on B's side that are measured on B alone or in the assembly, but not in both.
    pub in_one: Vec<String>,
    /// By how much the force at the contact, and k_T, would be off if these were mounted only where
    /// they are measured: largest value in the band, relative; `None` if the motion of B is not
    /// measured.
    pub change: Option<f64>,
}

impl SensorMasses {
    /// `None` if the plan states no masses, or no hits on B alone are compared with the assembly.
    pub fn of<M: Measurements>(measurements: &M, averages: &[CellAverage]) -> Option<Self> {
        let masses = measurements.sensor_masses();
        let has = |structure| averages.iter().any(|cell| cell.name.configuration == structure);
        if masses.is_empty() || !has(Structure::B) || !has(Structure::Ajb) {
            return None;
        }
        let on_b = |own: &&SensorMass| {
            matches!(own.grouping, Grouping::InterfaceB | Grouping::InternalB | Grouping::SpecimenB)
        };
        let seen = |own: &SensorMass, structure| {
            averages.iter().any(|c| c.name.configuration == structure && c.name.response == own.point)
        };
        let in_one = |own: &&SensorMass| seen(own, Structure::B) != seen(own, Structure::Ajb);
        let sum = |all: &mut dyn Iterator<Item = &SensorMass>| all.fold(0.0, |sum, own| sum + own.mass_kg);
        let off_kg = sum(&mut masses.iter().filter(on_b).filter(in_one));
        Some(SensorMasses {
            on_a_kg: sum(&mut masses.iter().filter(|own| !on_b(own))),
            on_b_kg: sum(&mut masses.iter().filter(on_b)),
            in_one: masses.iter().filter(on_b).filter(in_one).map(|own| own.point.clone()).collect(),
            change: inertia_per_kg(measurements, averages).map(|per_kg| off_kg * per_kg),
        })
    }

    /// Whether the masses leave k_T as it is; `None` if that is not known.
    pub fn ok(&self) -> Option<bool> {
        if self.in_one.is_empty() { Some(true) } else { self.change.map(|change| change < MATTERS) }
    }
}

/// Largest |ω² z_B / T| over the band, 1/kg: the median over the cells of the assembly with a
/// sensor along z on arm B.
fn inertia_per_kg<M: Measurements>(measurements: &M, averages: &[CellAverage]) -> Option<f64> {
    let (points, order) = (&measurements.geometry().ajb, measurements.quantity().order_of_s());
    let of_cell = |cell: &CellAverage| {
        let spectra = cell.damped.as_ref().filter(|_| cell.name.configuration == Structure::Ajb)?;
        let own = points.channels.iter().filter(|p| p.name == cell.name.response).enumerate();
        let (z, _) = own
            .filter(|(_, p)| p.grouping == Grouping::InterfaceB)
            .find(|(_, p)| p.direction[2].abs() > 0.9)?;
        let t = spectra.outputs().checked_sub(1)?;
        let inside = (0..spectra.lines()).filter(|l| BAND.contains(spectra.frequency_hz()[*l]));
        let ratio = |l: usize| {
            let omega = TAU * spectra.frequency_hz()[l];
            let moved: Complex<f64> = spectra.h1(l, z) / spectra.s(l).powi(order);
            omega * omega * (moved / spectra.h1(l, t)).norm()
        };
        inside.map(ratio).filter(|ratio| ratio.is_finite()).reduce(f64::max)
    };
    let mut all: Vec<f64> = averages.iter().filter_map(of_cell).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}
