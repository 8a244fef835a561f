//! The assembly's interface cells over a band: receptances, their noise, and their reduction to two
//! virtual points.

use super::layout::Layout;
use super::{AveragedError, Line};
use crate::band::Band;
use crate::frf::Frf;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping};
use crate::substructuring::idm::IdmSet;
use crate::substructuring::interface_data::{Found, Measured};
use nalgebra::{Complex, DMatrix};

/// The assembly's FRFs reduced to its two virtual points, with the data needed to relate an error
/// to its cell.
pub(super) struct Assembly {
    pub(super) frequency_hz: Vec<f64>,
    pub(super) s: Vec<Complex<f64>>,
    /// Interface cells (channels of A then B × impacts on A then B), receptance, m/N.
    pub(super) cells: Vec<Line>,
    /// Variance of the cells' real parts; none where it is not known.
    pub(super) variance: Option<Vec<DMatrix<f64>>>,
    pub(super) layout: Layout,
    /// Names of the cells' rows and columns.
    pub(super) outputs: Vec<String>,
    pub(super) inputs: Vec<String>,
}

impl Assembly {
    pub(super) fn of(
        ajb: &Frf,
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
    ) -> Result<Assembly, AveragedError> {
        let in_band: Vec<usize> = (0..ajb.frequency_hz().len())
            .filter(|&l| ajb.frequency_hz()[l] > 0.0 && band.contains(ajb.frequency_hz()[l]))
            .collect();
        if in_band.is_empty() {
            return Err(AveragedError::EmptyBand { low_hz: band.low_hz, high_hz: band.high_hz });
        }
        let file = Measured { file: Structure::Ajb, frf: ajb, points: &geometry.ajb };
        let a = file.virtual_point(Grouping::InterfaceA, geometry, idms)?;
        let b = file.virtual_point(Grouping::InterfaceB, geometry, idms)?;
        let (rows, columns) = (joined(&a.rows, &b.rows), joined(&a.columns, &b.columns));
        let cut = ajb.band(band.low_hz.max(f64::MIN_POSITIVE), band.high_hz);
        let cells = Measured { frf: &cut, ..file }.block(&rows, &columns)?;
        let order = ajb.quantity().order_of_s();
        let s: Vec<Complex<f64>> = in_band.iter().map(|&l| ajb.s(l)).collect();
        let cells = cells.iter().zip(&s).map(|(y, s)| y * s.powi(-order)).collect();
        let variance = ajb
            .receptance_variance(&in_band, &rows.at, &columns.at)
            // if the variance of one cell is unknown, the whole is unknown: an interval of part of
            // the errors would be useless
            .filter(|v| v.iter().all(|line| line.iter().all(|v| v.is_finite())));
        let frequency_hz = in_band.iter().map(|&l| ajb.frequency_hz()[l]).collect();
        let layout = Layout::new(&a, &b, &rows, &columns, geometry, idms);
        Ok(Assembly { frequency_hz, s, cells, variance, layout, outputs: rows.names, inputs: columns.names })
    }

    /// Mean spacing of the lines, Hz.
    pub(super) fn step_hz(&self) -> f64 {
        let n = self.frequency_hz.len();
        if n < 2 { f64::INFINITY } else { (self.frequency_hz[n - 1] - self.frequency_hz[0]) / (n - 1) as f64 }
    }
}

fn joined(first: &Found, second: &Found) -> Found {
    let both = |a: &[String], b: &[String]| a.iter().chain(b).cloned().collect();
    Found {
        names: both(&first.names, &second.names),
        points: first.points.iter().chain(&second.points).cloned().collect(),
        at: first.at.iter().chain(&second.at).copied().collect(),
    }
}
