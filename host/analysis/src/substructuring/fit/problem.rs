//! The measured data, corrected for the estimated errors of geometry, and its residuals against the
//! model.
//!
//! Effect of errors of geometry on the admittances that a block's cells reduce to.
//!
//! A cell's value is (response of its sensor) · Y · (port forces of its hit), linear in the ports'
//! admittance Y, and so is the reduction of all cells: one real matrix acting on the entries of Y,
//! the same for every line.

use super::FitError;
use super::block::{AIMS, CellGeometry, Nuisances, ReceptanceBlock};
use super::chart::{At, Chart};
use super::model::{Layout, Predicted, Slopes, Wanted};
use super::noise::{ByImpact, Noise, Pushes};
use crate::parallel::prelude::*;
use crate::{C, Line};
use nalgebra::{Complex, DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::ops::Range;

/// Approximate width over which residuals are averaged, Hz: fewer residuals, whose noise is known
/// more accurately.
const WIDTH_HZ: f64 = 15.0;
/// Steps of the fixed-point iteration that removes an error of geometry from a substructure's
/// admittance. Tilts mix directions whose admittances differ tenfold, so one step is not enough;
/// each reduces the error at least fivefold.
const CORRECTIONS: usize = 6;
/// Pairs of draws per line for the bias of noise.
const PAIRS: u64 = 4;
/// Fixed seed, so that the same data give the same values.
const SEED: u64 = 0x6669_7421;

/// The measurement, and the layout of the model.
pub(super) struct Problem {
    /// A, B.
    pub(super) parts: [ReceptanceBlock; 2],
    pub(super) ajb: ReceptanceBlock,
    pub(super) layout: Layout,
    pub(super) s: Vec<C>,
    /// Lines of each band.
    pub(super) bands: Vec<Range<usize>>,
    /// Output and input ports that the assembly's file contains.
    pub(super) rows: Vec<usize>,
    pub(super) columns: Vec<usize>,
    pub(super) nuisances: Nuisances,
    /// Noise of the assembly itself in each band's mean, which does not depend on the parameters.
    pub(super) own_noise: Vec<Noise>,
    /// T_u and T_f of the measured ports.
    pub(super) reductions: (Line, Line),
    pub(super) pushes: Pushes,
    /// See [`crate::frf::noise::shared_by_lines`].
    pub(super) shared: f64,
}

/// The admittances without the estimated errors of geometry, and the bias of the model due to
/// noise.
pub(super) struct Corrected {
    pub(super) parts: [Vec<Line>; 2],
    pub(super) ajb: Vec<Line>,
    bias: Vec<Line>,
}

impl Problem {
    pub(super) fn new(
        parts: [ReceptanceBlock; 2],
        ajb: ReceptanceBlock,
        layout: Layout,
        s: Vec<C>,
        nuisances: Nuisances,
        shared: f64,
    ) -> Problem {
        let measured =
            |t: &DMatrix<f64>| -> Vec<usize> { (0..t.nrows()).filter(|&r| t.row(r).amax() > 0.0).collect() };
        let (rows, columns) = (measured(&ajb.t_u), measured(&ajb.t_f.transpose()));
        let span = (s[s.len() - 1].im - s[0].im) / std::f64::consts::TAU;
        let count = ((span / WIDTH_HZ).round() as usize).clamp(1, s.len());
        let bands: Vec<Range<usize>> =
            (0..count).map(|b| b * s.len() / count..(b + 1) * s.len() / count).collect();
        let t_f = ajb.t_f.select_columns(&columns);
        let reductions = (ajb.t_u.select_rows(&rows).map(C::from), t_f.map(C::from));
        let pushes = Pushes::of(&t_f);
        let own_noise = (bands.par_iter())
            .map(|band| {
                let mut noise = Noise::none(rows.len(), columns.len());
                let share = 1.0 / band.len() as f64;
                let variance = (band.clone().map(|l| &ajb.variance[l]))
                    .fold(ajb.variance[band.start].map(|_| 0.0), |sum, v| sum + v * share);
                let own =
                    ByImpact::of_cells(&reductions.0, reductions.1.clone(), &variance, 2.0 * shared * share);
                noise.add_by_impact(&[own]);
                noise
            })
            .collect();
        Problem {
            parts,
            ajb,
            layout,
            s,
            bands,
            rows,
            columns,
            nuisances,
            own_noise,
            reductions,
            pushes,
            shared,
        }
    }

    /// A, B and AJB, in the order of the nuisance parameters' blocks.
    pub(super) fn blocks(&self) -> [&ReceptanceBlock; 3] {
        [&self.parts[0], &self.parts[1], &self.ajb]
    }

    /// Number of entries of a residual.
    pub(super) fn entries(&self) -> usize {
        self.rows.len() * self.columns.len()
    }

    /// All cells of a block (by impact, then sensor) with the estimated errors `eta`, in standard
    /// deviations.
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

    /// Removes the estimated errors `eta` (in standard deviations) from the data, and computes the
    /// model's bias from random draws.
    pub(super) fn corrected(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        eta: &[f64],
    ) -> Result<Corrected, FitError> {
        let reduced = |block: &ReceptanceBlock| -> Vec<Line> {
            block.cells.par_iter().map(|cells| block.reduce(cells)).collect()
        };
        let mut parts = self.parts.each_ref().map(reduced);
        let mut ajb = reduced(&self.ajb);
        if eta.iter().any(|e| *e != 0.0) {
            let none = vec![0.0; eta.len()];
            let shift = |place: usize| {
                Shift::of(self.blocks()[place], &self.cells(place, eta), &self.cells(place, &none))
            };
            for (place, part) in parts.iter_mut().enumerate() {
                let (measured, shift) = (part.clone(), shift(place));
                for _ in 0..CORRECTIONS {
                    *part = (measured.iter().zip(shift.added_to(part))).map(|(y, more)| y - more).collect();
                }
            }
            let model: Vec<Vec<Line>> = (self.bands.par_iter())
                .map(|band| self.model(chart, p, &parts, band.clone()))
                .collect::<Result<_, FitError>>()?;
            let model = model.concat();
            ajb.iter_mut().zip(shift(2).added_to(&model)).for_each(|(y, more)| *y -= more);
        }
        let bias = self.bias(chart, p, &parts)?;
        Ok(Corrected { parts, ajb, bias })
    }

    /// Index of the nuisance parameter for aim `k` at the assembly's cells of an impact, sensor by
    /// sensor.
    pub(super) fn assembly_aim(&self, impact: usize, k: usize) -> usize {
        let (sensor, own) = (k / AIMS, k % AIMS);
        self.nuisances.of_assembly() + AIMS * (sensor * self.ajb.impacts.len() + impact) + own
    }

    pub(super) fn frequency_hz(&self, line: usize) -> f64 {
        self.s[line].im / std::f64::consts::TAU
    }

    /// A draw of the noise of Y^A and Y^B at a line; every line has a separate random stream, so
    /// that the order of threads does not matter.
    pub(super) fn noise(&self, l: usize, seed: u64) -> [Line; 2] {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed ^ ((l as u64) << 20));
        let mut normal = || -> f64 { StandardNormal.sample(&mut stream) };
        self.parts.each_ref().map(|block| {
            let noise = block.variance[l].map(|v| C::new(normal(), normal()) * v.sqrt());
            block.reduce(&noise)
        })
    }

    /// E\[model(Y + n)\] − model(Y) per line: Eq. (1) is nonlinear, so the noise of Y^A and Y^B
    /// changes its mean. Pairs ±n cancel the linear part.
    fn bias(&self, chart: &Chart, p: &DVector<f64>, parts: &[Vec<Line>; 2]) -> Result<Vec<Line>, FitError> {
        let by_band: Vec<Vec<Line>> = (self.bands.par_iter())
            .map(|band| {
                let still = self.model(chart, p, parts, band.clone())?;
                let joint = self.joint(chart, p, band.clone(), false);
                let mut sums: Vec<Line> = still.iter().map(|y| y.map(|_| C::default())).collect();
                for pair in 0..PAIRS {
                    let draws: Vec<[Line; 2]> = band.clone().map(|l| self.noise(l, SEED + pair)).collect();
                    let at = |sign: f64| {
                        let moved = [0, 1].map(|side| -> Vec<Line> {
                            let own = parts[side][band.clone()].iter().zip(&draws);
                            own.map(|(y, draw)| y + &draw[side] * C::from(sign)).collect()
                        });
                        let wanted = Wanted { y: true, ..Wanted::default() };
                        self.layout.predict(&joint, moved.each_ref().map(Vec::as_slice), wanted)
                    };
                    for ((sum, still), both) in
                        sums.iter_mut().zip(&still).zip(at(1.0).into_iter().zip(at(-1.0)))
                    {
                        // a draw that makes G singular to rounding has probability zero and is
                        // skipped
                        if let (Some(plus), Some(minus)) = both {
                            *sum += ((plus.y + minus.y) * C::from(0.5) - still) / C::from(PAIRS as f64);
                        }
                    }
                }
                Ok(sums)
            })
            .collect::<Result<_, FitError>>()?;
        Ok(by_band.concat())
    }

    /// The joint at some lines.
    fn joint(&self, chart: &Chart, p: &DVector<f64>, lines: Range<usize>, slopes: bool) -> Vec<At> {
        lines.map(|l| chart.at(p, self.s[l], slopes)).collect()
    }

    /// The assembly's admittance at some lines, by Eq. (1).
    fn model(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        parts: &[Vec<Line>; 2],
        lines: Range<usize>,
    ) -> Result<Vec<Line>, FitError> {
        let own = parts.each_ref().map(|part| &part[lines.clone()]);
        let wanted = Wanted { y: true, ..Wanted::default() };
        Ok(self.predict(chart, p, own, lines, wanted)?.into_iter().map(|line| line.y).collect())
    }

    /// The model at some lines, with Y^A and Y^B equal to `parts`.
    pub(super) fn predict(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        parts: [&[Line]; 2],
        lines: Range<usize>,
        wanted: Wanted,
    ) -> Result<Vec<Predicted>, FitError> {
        let joint = self.joint(chart, p, lines.clone(), wanted.slopes);
        (self.layout.predict(&joint, parts, wanted).into_iter().zip(lines))
            .map(|(line, l)| line.ok_or(FitError::Singular { frequency_hz: self.frequency_hz(l) }))
            .collect()
    }

    /// Measured minus model, averaged over a band: real parts on top of imaginary parts.
    pub(super) fn residual(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        data: &Corrected,
        band: Range<usize>,
    ) -> Result<DMatrix<f64>, FitError> {
        let mut sum = DMatrix::zeros(2 * self.entries(), 1);
        let share = 1.0 / band.len() as f64;
        let model = self.model(chart, p, &data.parts, band.clone())?;
        for (l, model) in band.zip(model) {
            let difference = &data.ajb[l] - model - &data.bias[l];
            self.add_measured(sum.as_mut_slice(), &difference, share);
        }
        Ok(sum)
    }

    /// The model's derivatives by the joint, averaged over a band: a column for each parameter.
    pub(super) fn slopes(
        &self,
        chart: &Chart,
        p: &DVector<f64>,
        data: &Corrected,
        band: Range<usize>,
    ) -> Result<DMatrix<f64>, FitError> {
        let mut sums = DMatrix::zeros(2 * self.entries(), chart.count());
        let share = 1.0 / band.len() as f64;
        let parts = data.parts.each_ref().map(|part| &part[band.clone()]);
        let wanted = Wanted { slopes: true, ..Wanted::default() };
        let lines = self.predict(chart, p, parts, band, wanted)?;
        let slopes: Vec<Slopes> = lines.into_iter().map(|line| line.slopes).collect();
        self.put_slopes(sums.as_mut_slice(), &slopes, share);
        Ok(sums)
    }

    /// Writes the derivatives of lines, summed and times `share`, to consecutive columns.
    ///
    /// Each is a column times a row, so their sum over lines is one matrix product.
    pub(super) fn put_slopes(&self, sums: &mut [f64], lines: &[Slopes], share: f64) {
        let (rows, columns) = (self.rows.len(), self.columns.len());
        let height = (2 * rows * columns).max(1);
        let parameters = (sums.len() / height).max(1);
        let dyads = lines.first().map_or(0, |slopes| slopes.moved.ncols() / parameters);
        let count = lines.len() * dyads;
        for (parameter, sum) in sums.chunks_exact_mut(height).enumerate() {
            let mut moved = DMatrix::<f64>::zeros(rows, 2 * count);
            let mut by = DMatrix::<f64>::zeros(2 * count, 2 * columns);
            let own = parameter * dyads..(parameter + 1) * dyads;
            let all = lines.iter().flat_map(|slopes| own.clone().map(move |dyad| (slopes, dyad)));
            for (j, (slopes, dyad)) in all.enumerate() {
                for (r, port) in self.rows.iter().enumerate() {
                    let v = slopes.moved[(*port, dyad)];
                    moved[(r, j)] = v.re;
                    moved[(r, count + j)] = v.im;
                }
                for (c, port) in self.columns.iter().enumerate() {
                    let v = slopes.by[(*port, dyad)] * share;
                    by[(j, c)] = v.re;
                    by[(count + j, c)] = -v.im;
                    by[(j, columns + c)] = v.im;
                    by[(count + j, columns + c)] = v.re;
                }
            }
            sum.copy_from_slice((moved * by).as_slice());
        }
    }

    /// Adds the measured ports of `y` times `share` to a column of real parts on top of imaginary
    /// parts.
    pub(super) fn add_measured(&self, column: &mut [f64], y: &Line, share: f64) {
        let (re, im) = column.split_at_mut(self.entries());
        let places = self.columns.iter().flat_map(|c| self.rows.iter().map(move |r| (*r, *c)));
        for ((re, im), at) in re.iter_mut().zip(im).zip(places) {
            *re += y[at].re * share;
            *im += y[at].im * share;
        }
    }
}

/// That matrix, acting on Y's entries in column-major order.
pub(super) struct Shift {
    matrix: DMatrix<f64>,
    shape: (usize, usize),
}

impl Shift {
    /// Difference of the reduction of `block` between cells at `moved` and cells at `nominal`.
    pub(super) fn of(block: &ReceptanceBlock, moved: &[CellGeometry], nominal: &[CellGeometry]) -> Shift {
        let (rows, columns) = (block.rows.count, block.columns.count);
        let mut matrix = DMatrix::zeros(rows * columns, rows * columns);
        for (cells, sign) in [(moved, 1.0), (nominal, -1.0)] {
            let mut cells = cells.iter();
            for i in 0..block.impacts.len() {
                for sensor in &block.sensors {
                    let Some(cell) = cells.next() else { continue };
                    let shown = block.t_u.select_columns(&sensor.rows) * &cell.seen;
                    for (q, push) in cell.pushed.iter().enumerate().filter(|(_, push)| **push != 0.0) {
                        for c in 0..columns {
                            let factor = sign * push * block.t_f[(i, c)];
                            if factor != 0.0 {
                                let mut at = matrix.view_mut((c * rows, q * rows), (rows, rows));
                                at += &shown * factor;
                            }
                        }
                    }
                }
            }
        }
        Shift { matrix, shape: (rows, columns) }
    }

    /// The change of each of `lines`.
    pub(super) fn added_to(&self, lines: &[Line]) -> Vec<Line> {
        let (rows, columns) = self.shape;
        let count = lines.len();
        // real parts of all lines, then imaginary parts
        let mut stacked = DMatrix::zeros(rows * columns, 2 * count);
        for (l, y) in lines.iter().enumerate() {
            for (at, v) in y.iter().enumerate() {
                stacked[(at, l)] = v.re;
                stacked[(at, count + l)] = v.im;
            }
        }
        let added = &self.matrix * stacked;
        (0..count)
            .map(|l| {
                let parts = added.column(l).into_iter().zip(added.column(count + l));
                Line::from_iterator(rows, columns, parts.map(|(re, im)| Complex::new(*re, *im)))
            })
            .collect()
    }
}
