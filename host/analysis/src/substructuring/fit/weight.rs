//! The residuals' covariance: noise of all three measurements, and what every error of geometry does to all bands at once.
//!
//! Noise of a band is circular, so its covariance is one Hermitian matrix N; that of Y^A and Y^B reaches the residual through L and
//! R. The nuisance parameters η (in standard deviations) act through G = ∂r/∂η and are integrated out: Σ = N + G Gᵀ, never formed;
//! with S = I + Gᵀ N⁻¹ G, rᵀ Σ⁻¹ r = rᵀ N⁻¹ r − (Gᵀ N⁻¹ r)ᵀ S⁻¹ (Gᵀ N⁻¹ r), and η's own estimate is S⁻¹ Gᵀ N⁻¹ r.

use super::FitError;
use super::block::Line;
use super::cell::CellGeometry;
use super::chart::Chart;
use super::noise::Whitening;
use super::problem::{Corrected, Problem};
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix, DVector};
use std::ops::Range;

type C = Complex<f64>;

/// Lines per band at which the noise that passes through L and R is evaluated: it varies slowly.
const SAMPLED: usize = 4;
/// Of the noise that the derivatives hold; another than that of the model's bias.
const NOISE_SEED: u64 = 0x6669_7422;
/// Columns of G that are multiplied at once.
const TILE: usize = 128;

/// The noise of one band, and the nuisance parameters' effect in units of it.
pub(super) struct BandWeight {
    pub(super) whitening: Whitening,
    /// 2m × nuisance parameters.
    pub(super) g: DMatrix<f64>,
    /// One draw of the noise of Y^A and Y^B as it shows in a band's mean, in units of the residual's noise: in the residual (first
    /// column) and in ∂model/∂joint.
    ///
    /// J is evaluated at noisy Y^A and Y^B, so JᵀJ is too large by δJᵀδJ and Jᵀr by δJᵀδr: the estimate and its interval are
    /// corrected by both.
    pub(super) feigned: DMatrix<f64>,
}

/// The weights of all bands, and Gᵀ N⁻¹ G (its lower triangle).
pub(super) struct Weight {
    pub(super) bands: Vec<BandWeight>,
    pub(super) information: DMatrix<f64>,
}

/// Where the model is linearised.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub(super) problem: &'a Problem,
    pub(super) chart: &'a Chart,
    pub(super) p: &'a DVector<f64>,
    /// A's, B's and the assembly's cells where their geometry is believed to be.
    pub(super) cells: &'a [Vec<CellGeometry>; 3],
    pub(super) data: &'a Corrected,
}

impl Weight {
    pub(super) fn of(point: Point<'_>) -> Result<Weight, FitError> {
        let problem = point.problem;
        let bands: Vec<BandWeight> = (problem.bands.par_iter())
            .enumerate()
            .map(|(band, lines)| point.weight(band, lines.clone()))
            .collect::<Result<_, FitError>>()?;
        let information = information(&bands, problem.nuisances.std.len());
        Ok(Weight { bands, information })
    }
}

/// The lower triangle of Σ gᵀg, tile by tile.
fn information(bands: &[BandWeight], count: usize) -> DMatrix<f64> {
    let tile = |first: usize| first..(first + TILE).min(count);
    let places: Vec<(usize, usize)> = (0..count)
        .step_by(TILE)
        .flat_map(|row| (0..=row).step_by(TILE).map(move |column| (row, column)))
        .collect();
    let turned: Vec<DMatrix<f64>> = bands.par_iter().map(|band| band.g.transpose()).collect();
    let tiles: Vec<DMatrix<f64>> = (places.par_iter())
        .map(|&(row, column)| {
            let (rows, columns) = (tile(row), tile(column));
            let mut sum = DMatrix::zeros(rows.len(), columns.len());
            for (band, turned) in bands.iter().zip(&turned) {
                let right = band.g.columns(columns.start, columns.len());
                sum.gemm(1.0, &turned.rows(rows.start, rows.len()), &right, 1.0);
            }
            sum
        })
        .collect();
    let mut information = DMatrix::zeros(count, count);
    for (at, tile) in places.into_iter().zip(tiles) {
        information.view_mut(at, tile.shape()).copy_from(&tile);
    }
    information
}

impl Point<'_> {
    fn weight(&self, band: usize, lines: Range<usize>) -> Result<BandWeight, FitError> {
        let Point { problem, data, .. } = *self;
        // variance of a band's mean: 2 for real and imaginary part together
        let averaged = 2.0 * problem.shared / lines.len() as f64;
        let mut noise = problem.own_noise[band].clone();
        let step = (lines.len() / SAMPLED).max(1);
        let sampled = lines.clone().step_by(step).count() as f64;
        for l in lines.clone().step_by(step) {
            let predicted =
                problem.predict(self.chart, self.p, [&data.parts[0][l], &data.parts[1][l]], l, false)?;
            for side in 0..2 {
                let (left, right) = problem.through(side, &predicted);
                noise.spread(&left, &right, &problem.parts[side].variance[l], averaged / sampled);
            }
        }
        let draws: Vec<[Line; 2]> = lines.clone().map(|l| problem.noise(l, NOISE_SEED)).collect();
        let moved = |sign: f64| {
            self.evaluated(&lines, |side, l| {
                &data.parts[side][l] + &draws[l - lines.start][side] * C::from(sign)
            })
        };
        let here = self.evaluated(&lines, |side, l| data.parts[side][l].clone())?;
        let (plus, minus) = (moved(1.0)?, moved(-1.0)?);
        // neighbouring lines share their noise, the draws do not
        let half = 0.5 * problem.shared.sqrt();
        // an error of geometry whose effect is known only to δG leaves δG η behind, and η has variance one
        noise.add(&((plus.effect - minus.effect) * half), 1.0);
        let whitening = noise.whitening().ok_or(FitError::NoiseSingular)?;
        let g = whitening.of(here.effect);
        let mut feigned = (plus.model - minus.model) * half;
        // what raises the model lowers the residual
        feigned.column_mut(0).neg_mut();
        let feigned = whitening.of(feigned);
        Ok(BandWeight { whitening, g, feigned })
    }
}
