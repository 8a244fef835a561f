//! The residuals' covariance: noise of all three measurements, and the effect of every error of
//! geometry, common to all bands.
//!
//! Noise of a band is circular, so its covariance is one Hermitian matrix N; that of Y^A and Y^B
//! reaches the residual through L and R. The nuisance parameters η (in standard deviations) act
//! through G = ∂r/∂η and are integrated out: Σ = N + G Gᵀ, which is never formed; with S = I + Gᵀ
//! N⁻¹ G, rᵀ Σ⁻¹ r = rᵀ N⁻¹ r − (Gᵀ N⁻¹ r)ᵀ S⁻¹ (Gᵀ N⁻¹ r), and the estimate of η is S⁻¹ Gᵀ N⁻¹ r.

use super::FitError;
use super::assembly_aims::{AssemblyAims, Met, OfImpact};
use super::block::Line;
use super::cell::{CellGeometry, factors};
use super::chart::Chart;
use super::factor::rows as own_rows;
use super::model::Wanted;
use super::narrow::crossed;
use super::noise::{ByImpact, Whitening};
use super::problem::{Corrected, Problem};
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix, DVector};
use std::ops::Range;

type C = Complex<f64>;

/// Lines per band at which the noise that passes through L and R is evaluated: it varies slowly.
const SAMPLED: usize = 4;
/// Seed for the noise in the derivatives; different from that of the model's bias.
const NOISE_SEED: u64 = 0x6669_7422;
/// Columns of G that are multiplied in one product.
const TILE: usize = 128;

/// The noise of one band, and the effect of the nuisance parameters in units of it.
pub(super) struct BandWeight {
    pub(super) whitening: Whitening,
    pub(super) g: Whitened,
    /// Effect of one draw of the noise of Y^A and Y^B on a band's mean, in units of the residual's
    /// noise: on the residual (first column) and on ∂model/∂joint.
    ///
    /// J is evaluated at noisy Y^A and Y^B, so JᵀJ is too large by δJᵀδJ and Jᵀr by δJᵀδr: the
    /// estimate and its interval are corrected for both.
    pub(super) feigned: DMatrix<f64>,
}

/// G, the effect of the nuisance parameters.
pub(super) struct Whitened {
    /// In units of the noise: 2m × the number of parameters before the assembly's aims.
    pub(super) written: DMatrix<f64>,
    /// The assembly's aims, not whitened.
    pub(super) aims: AssemblyAims,
}

/// The weights of all bands, and Gᵀ N⁻¹ G (its lower triangle).
pub(super) struct Weight {
    pub(super) bands: Vec<BandWeight>,
    pub(super) information: DMatrix<f64>,
}

/// The point at which the model is linearised.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub(super) problem: &'a Problem,
    pub(super) chart: &'a Chart,
    pub(super) p: &'a DVector<f64>,
    /// A's, B's and the assembly's cells at their currently estimated geometry.
    pub(super) cells: &'a [Vec<CellGeometry>; 3],
    pub(super) data: &'a Corrected,
}

impl Weight {
    pub(super) fn of(point: Point<'_>) -> Result<Weight, FitError> {
        let problem = point.problem;
        let factors = [0, 1].map(|place: usize| factors(&point.cells[place]));
        let (bands, met): (Vec<BandWeight>, Vec<Met>) = (problem.bands.par_iter())
            .enumerate()
            .map(|(band, lines)| {
                let weight = point.weight(band, lines.clone(), &factors)?;
                let met = Met::of(&weight.whitening, &problem.pushes, &weight.g.written, &weight.g.aims);
                Ok((weight, met))
            })
            .collect::<Result<Vec<_>, FitError>>()?
            .into_iter()
            .unzip();
        let mut information = DMatrix::zeros(problem.nuisances.std.len(), problem.nuisances.std.len());
        put_written(&bands, &mut information);
        put_aims(problem, &bands, &met, &mut information);
        Ok(Weight { bands, information })
    }
}

/// The lower triangle of Σ gᵀg for the explicitly stored columns, tile by tile.
fn put_written(bands: &[BandWeight], information: &mut DMatrix<f64>) {
    let count = bands.first().map_or(0, |band| band.g.written.ncols());
    let tile = |first: usize| first..(first + TILE).min(count);
    let places: Vec<(usize, usize)> = (0..count)
        .step_by(TILE)
        .flat_map(|row| (0..=row).step_by(TILE).map(move |column| (row, column)))
        .collect();
    let turned: Vec<DMatrix<f64>> = bands.par_iter().map(|band| band.g.written.transpose()).collect();
    let tiles: Vec<DMatrix<f64>> = (places.par_iter())
        .map(|&(row, column)| {
            let (rows, columns) = (tile(row), tile(column));
            let mut sum = DMatrix::zeros(rows.len(), columns.len());
            for (band, turned) in bands.iter().zip(&turned) {
                let right = band.g.written.columns(columns.start, columns.len());
                // copied to a separate matrix: products of views with few rows read past their end
                sum.gemm(1.0, &own_rows(turned, rows.start, rows.len()), &right, 1.0);
            }
            sum
        })
        .collect();
    for (at, tile) in places.into_iter().zip(tiles) {
        information.view_mut(at, tile.shape()).copy_from(&tile);
    }
}

/// The rows of the lower triangle that belong to the assembly's aims.
fn put_aims(problem: &Problem, bands: &[BandWeight], met: &[Met], information: &mut DMatrix<f64>) {
    let block = &problem.ajb;
    let sums: Vec<Option<OfImpact>> = (0..block.impacts.len())
        .into_par_iter()
        .map(|i| OfImpact::sum(i, bands.iter().map(|band| &band.g.aims).zip(met)))
        .collect();
    let first = problem.nuisances.of_assembly();
    for (i, sum) in sums.into_iter().enumerate() {
        let Some(sum) = sum else { continue };
        let place = |impact: usize, k: usize| problem.assembly_aim(impact, k);
        for (k, column) in sum.written.column_iter().enumerate() {
            (0..first).zip(column.iter()).for_each(|(j, v)| information[(place(i, k), j)] = *v);
        }
        for (later, tile) in sum.later.iter().enumerate() {
            for k in 0..tile.ncols() {
                for other in 0..tile.nrows() {
                    let (one, two) = (place(i, k), place(i + later, other));
                    information[(one.max(two), one.min(two))] = tile[(other, k)];
                }
            }
        }
    }
}

impl Point<'_> {
    /// The weight of one band; `factors` are those of A's and B's cells.
    fn weight(
        &self,
        band: usize,
        lines: Range<usize>,
        factors: &[DMatrix<f64>; 2],
    ) -> Result<BandWeight, FitError> {
        let Point { problem, data, .. } = *self;
        // variance of a band's mean: 2 for real and imaginary part together
        let averaged = 2.0 * problem.shared / lines.len() as f64;
        let step = (lines.len() / SAMPLED).max(1);
        let sampled = lines.clone().step_by(step).count() as f64;
        let mut parts = Vec::new();
        for l in lines.clone().step_by(step) {
            let wanted = Wanted { gains: true, ..Wanted::default() };
            let own = data.parts.each_ref().map(|part| &part[l..=l]);
            for predicted in problem.predict(self.chart, self.p, own, l..l + 1, wanted)? {
                for side in 0..2 {
                    let (left, right) = problem.through(side, &predicted);
                    let variance = &problem.parts[side].variance[l];
                    parts.push(ByImpact::of_cells(&left, right, variance, averaged / sampled));
                }
            }
        }
        let draws: Vec<[Line; 2]> = lines.clone().map(|l| problem.noise(l, NOISE_SEED)).collect();
        let moved = |sign: f64| {
            self.evaluated(&lines, true, factors, |side, l| {
                &data.parts[side][l] + &draws[l - lines.start][side] * C::from(sign)
            })
        };
        let here = self.evaluated(&lines, false, factors, |side, l| data.parts[side][l].clone())?.effect;
        let (plus, minus) = (moved(1.0)?, moved(-1.0)?);
        // neighbouring lines share their noise, but the draws are independent
        let half = 0.5 * problem.shared.sqrt();
        // if the effect of an error of geometry is uncertain by δG, δG η remains in the residual,
        // with η of unit variance
        parts.push(plus.effect.aims.apart(&minus.effect.aims, half).covariance(&problem.pushes));
        let mut noise = problem.own_noise[band].clone();
        noise.add_by_impact(&parts);
        noise.add(&((plus.effect.written - minus.effect.written) * half));
        let whitening = noise.whitening().ok_or(FitError::NoiseSingular)?;
        let g = Whitened { written: whitening.of(here.written), aims: here.aims };
        let mut feigned = (plus.model - minus.model) * half;
        // what increases the model decreases the residual
        feigned.column_mut(0).neg_mut();
        let feigned = whitening.of(feigned);
        Ok(BandWeight { whitening, g, feigned })
    }
}

impl Whitened {
    /// G η in units of the noise.
    pub(super) fn times(&self, problem: &Problem, whitening: &Whitening, eta: &[f64]) -> DMatrix<f64> {
        let (written, _) = eta.split_at(problem.nuisances.of_assembly());
        let aims = self.aims.times(&problem.pushes, |i, k| eta[problem.assembly_aim(i, k)]);
        whitening.of(aims) + &self.written * DMatrix::from_column_slice(written.len(), 1, written)
    }

    /// Gᵀ N⁻¹ times the columns, which are given in units of the noise.
    pub(super) fn pulled(
        &self,
        problem: &Problem,
        whitening: &Whitening,
        columns: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut pulled = DMatrix::zeros(problem.nuisances.std.len(), columns.ncols());
        pulled.rows_mut(0, self.written.ncols()).copy_from(&crossed(&self.written, columns));
        let aims = self.aims.pulled(&problem.pushes, &whitening.back(columns.clone()));
        for (i, own) in aims.iter().enumerate() {
            for k in 0..self.aims.by_impact[i].ncols() {
                pulled.row_mut(problem.assembly_aim(i, k)).copy_from(&own.row(k));
            }
        }
        pulled
    }
}
