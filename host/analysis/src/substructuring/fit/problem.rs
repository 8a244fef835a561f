//! What is measured, corrected for what is believed of the geometry, and its residuals against the model.

use super::FitError;
use super::block::{Block, Line};
use super::cell::CellGeometry;
use super::chart::Chart;
use super::model::{Layout, Predicted};
use super::nuisance::Nuisances;
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::ops::Range;

type C = Complex<f64>;

/// Residuals are averaged over about this many Hz: fewer of them, whose noise is known better.
const WIDTH_HZ: f64 = 15.0;
/// Steps of the fixed point that takes an error of geometry out of a substructure's admittance. Tilts mix directions
/// whose admittances differ tenfold, so one is not enough; the error falls at least fivefold with each.
const CORRECTIONS: usize = 6;
/// Pairs of draws per line for the bias of noise.
const PAIRS: u64 = 4;
/// Fixed, so that the same data give the same figures.
const SEED: u64 = 0x6669_7421;

/// The measurement and the model's frame.
pub(super) struct Problem {
    /// A, B.
    pub(super) parts: [Block; 2],
    pub(super) ajb: Block,
    pub(super) layout: Layout,
    pub(super) s: Vec<C>,
    /// Lines of each band.
    pub(super) bands: Vec<Range<usize>>,
    /// Output and input ports that the assembly's file measures.
    pub(super) rows: Vec<usize>,
    pub(super) columns: Vec<usize>,
    pub(super) nuisances: Nuisances,
    /// See [`crate::frf::noise::shared_by_lines`].
    pub(super) shared: f64,
}

/// The admittances with the believed errors of geometry taken out, and what noise adds to the model.
pub(super) struct Corrected {
    pub(super) parts: [Vec<Line>; 2],
    pub(super) ajb: Vec<Line>,
    bias: Vec<Line>,
}

/// Residuals per band (measured ports, by columns) and their derivatives by the joint's parameters.
pub(super) struct Residuals {
    pub(super) r: Vec<DVector<C>>,
    pub(super) slopes: Vec<DMatrix<C>>,
}

impl Problem {
    pub(super) fn new(
        parts: [Block; 2],
        ajb: Block,
        layout: Layout,
        s: Vec<C>,
        nuisances: Nuisances,
        shared: f64,
    ) -> Problem {
        let measured = |t: &DMatrix<f64>| (0..t.nrows()).filter(|&r| t.row(r).amax() > 0.0).collect();
        let (rows, columns) = (measured(&ajb.t_u), measured(&ajb.t_f.transpose()));
        let span = (s[s.len() - 1].im - s[0].im) / std::f64::consts::TAU;
        let count = ((span / WIDTH_HZ).round() as usize).clamp(1, s.len());
        let bands = (0..count).map(|b| b * s.len() / count..(b + 1) * s.len() / count).collect();
        Problem { parts, ajb, layout, s, bands, rows, columns, nuisances, shared }
    }

    /// A, B and AJB, with the place of each among the nuisance parameters.
    pub(super) fn blocks(&self) -> [&Block; 3] {
        [&self.parts[0], &self.parts[1], &self.ajb]
    }

    /// Entries of a residual.
    pub(super) fn entries(&self) -> usize {
        self.rows.len() * self.columns.len()
    }

    /// The measured ports of a matrix over all ports.
    pub(super) fn measured(&self, y: &Line) -> Line {
        Line::from_fn(self.rows.len(), self.columns.len(), |r, c| y[(self.rows[r], self.columns[c])])
    }

    /// Every cell of a block (by impact, then sensor) with the believed errors `eta`, in standard deviations.
    pub(super) fn cells(&self, place: usize, eta: &[f64]) -> Vec<CellGeometry> {
        let block = self.blocks()[place];
        let mut cells = Vec::with_capacity(block.impacts.len() * block.sensors.len());
        for (i, impact) in block.impacts.iter().enumerate() {
            for (s, sensor) in block.sensors.iter().enumerate() {
                let error = self.nuisances.error(&self.nuisances.of_cell(place, block, s, i), eta);
                cells.push(block.cell(sensor, impact, &error));
            }
        }
        cells
    }

    /// How much more every cell of a block reads at the geometry `moved` than at `nominal`, when its ports move by `y` per force.
    fn effect(&self, place: usize, y: &Line, moved: &[CellGeometry], nominal: &[CellGeometry]) -> Line {
        let block = self.blocks()[place];
        let mut effect = Line::zeros(block.t_u.ncols(), block.t_f.nrows());
        let mut cells = moved.iter().zip(nominal);
        for i in 0..block.impacts.len() {
            for sensor in &block.sensors {
                let Some((moved, nominal)) = cells.next() else { continue };
                let difference = &moved.seen * (y * &moved.pushed) - &nominal.seen * (y * &nominal.pushed);
                for (axis, row) in sensor.rows.iter().enumerate() {
                    effect[(*row, i)] = difference[(axis, 0)];
                }
            }
        }
        effect
    }

    /// Takes the believed errors `eta` (in standard deviations) out of the data, and draws the model's bias.
    pub(super) fn corrected(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        eta: &[f64],
    ) -> Result<Corrected, FitError> {
        let still = eta.iter().all(|e| *e == 0.0);
        let none = vec![0.0; eta.len()];
        let moved = [0, 1, 2].map(|place| self.cells(place, eta));
        let nominal = [0, 1, 2].map(|place| self.cells(place, &none));
        let part = |place: usize| -> Vec<Line> {
            let block = &self.parts[place];
            (block.cells.par_iter())
                .map(|cells| {
                    let mut y = block.reduce(cells);
                    if !still {
                        for _ in 0..CORRECTIONS {
                            let effect = self.effect(place, &y, &moved[place], &nominal[place]);
                            y = block.reduce(&(cells - effect));
                        }
                    }
                    y
                })
                .collect()
        };
        let parts = [part(0), part(1)];
        let ajb = (0..self.s.len())
            .into_par_iter()
            .map(|l| {
                let cells = &self.ajb.cells[l];
                if still {
                    return Ok(self.ajb.reduce(cells));
                }
                let y = self.layout.assembly(&chart.at(p, self.s[l], false), [&parts[0][l], &parts[1][l]]);
                let y = y.ok_or(FitError::Singular { frequency_hz: self.frequency_hz(l) })?;
                let effect = self.effect(2, &y, &moved[2], &nominal[2]);
                Ok(self.ajb.reduce(&(cells - effect)))
            })
            .collect::<Result<Vec<Line>, FitError>>()?;
        let bias = self.bias(chart, p, &parts)?;
        Ok(Corrected { parts, ajb, bias })
    }

    pub(super) fn frequency_hz(&self, line: usize) -> f64 {
        self.s[line].im / std::f64::consts::TAU
    }

    /// A draw of the noise of Y^A and Y^B at a line; a stream of its own for every line, so the order of threads cannot matter.
    pub(super) fn noise(&self, l: usize, seed: u64) -> [Line; 2] {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed ^ ((l as u64) << 20));
        let mut normal = || -> f64 { StandardNormal.sample(&mut stream) };
        self.parts.each_ref().map(|block| {
            let noise = block.variance[l].map(|v| C::new(normal(), normal()) * v.sqrt());
            block.reduce(&noise)
        })
    }

    /// E\[model(Y + n)\] − model(Y) per line: Eq. (1) bends, so the noise of Y^A and Y^B moves its mean. Pairs ±n cancel the
    /// linear part.
    fn bias(&self, chart: &Chart, p: &DVector<f64>, parts: &[Vec<Line>; 2]) -> Result<Vec<Line>, FitError> {
        (0..self.s.len())
            .into_par_iter()
            .map(|l| {
                let singular = FitError::Singular { frequency_hz: self.frequency_hz(l) };
                let joint = chart.at(p, self.s[l], false);
                let still = self.layout.assembly(&joint, [&parts[0][l], &parts[1][l]]).ok_or(singular)?;
                let mut sum = still.map(|_| C::default());
                for pair in 0..PAIRS {
                    let draw = self.noise(l, SEED + pair);
                    let at = |sign: f64| {
                        let moved = [0, 1].map(|side| &parts[side][l] + &draw[side] * C::from(sign));
                        self.layout.assembly(&joint, [&moved[0], &moved[1]])
                    };
                    // a draw that makes G singular to rounding has probability zero, and says nothing
                    if let (Some(plus), Some(minus)) = (at(1.0), at(-1.0)) {
                        sum += ((plus + minus) * C::from(0.5) - &still) / C::from(PAIRS as f64);
                    }
                }
                Ok(sum)
            })
            .collect()
    }

    pub(super) fn predict(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        parts: [&Line; 2],
        l: usize,
        slopes: bool,
    ) -> Result<Predicted, FitError> {
        self.layout
            .predict(&chart.at(p, self.s[l], slopes), parts)
            .ok_or(FitError::Singular { frequency_hz: self.frequency_hz(l) })
    }

    /// Measured minus model, averaged over each band, and its derivatives.
    pub(super) fn residuals(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        data: &Corrected,
    ) -> Result<Residuals, FitError> {
        let m = self.entries();
        let by_band: Vec<(DVector<C>, DMatrix<C>)> = (self.bands.par_iter())
            .map(|band| {
                let mut r = DVector::zeros(m);
                let mut slopes = DMatrix::zeros(m, chart.count());
                let share = C::from(1.0 / band.len() as f64);
                for l in band.clone() {
                    let parts = [&data.parts[0][l], &data.parts[1][l]];
                    let predicted = self.predict(chart, p, parts, l, true)?;
                    let model = predicted.y + &data.bias[l];
                    let difference = self.measured(&(&data.ajb[l] - model));
                    for (sum, v) in r.iter_mut().zip(difference.iter()) {
                        *sum += v * share;
                    }
                    for (mut column, slope) in slopes.column_iter_mut().zip(&predicted.slopes) {
                        for (sum, v) in column.iter_mut().zip(self.measured(slope).iter()) {
                            *sum += v * share;
                        }
                    }
                }
                Ok((r, slopes))
            })
            .collect::<Result<_, FitError>>()?;
        let (r, slopes) = by_band.into_iter().unzip();
        Ok(Residuals { r, slopes })
    }
}
