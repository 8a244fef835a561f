//! What every error of geometry does to a band's residual, at one set of Y^A and Y^B.

use super::FitError;
use super::block::{Block, Line};
use super::cell::CellGeometry;
use super::model::Predicted;
use super::problem::Problem;
use super::weight::Point;
use crate::substructuring::product::product;
use nalgebra::{Complex, DMatrix};
use std::ops::{AddAssign, Range};

type C = Complex<f64>;

/// Nuisance parameters of a cell's own aim: three of the sensor, two of the impact.
const AIMS: usize = 5;

/// A band's means at one set of Y^A and Y^B: real parts of the measured entries above imaginary ones.
pub(super) struct Evaluated {
    /// The model, then its derivatives by the joint.
    pub(super) model: DMatrix<f64>,
    /// ∂r/∂η, η in standard deviations: one column for each nuisance parameter.
    pub(super) effect: DMatrix<f64>,
}

/// From a block's cells to the residual: left · cells · right. The cells read what the ports' admittance y makes them.
struct Way {
    y: Line,
    left: Line,
    right: Line,
}

impl Point<'_> {
    pub(super) fn evaluated(
        &self,
        lines: &Range<usize>,
        part: impl Fn(usize, usize) -> Line,
    ) -> Result<Evaluated, FitError> {
        let Point { problem, chart, .. } = *self;
        let m = problem.entries();
        let share = 1.0 / lines.len() as f64;
        let mut model = DMatrix::zeros(2 * m, 1 + chart.count());
        let mut effect = DMatrix::zeros(2 * m, problem.nuisances.std.len());
        let (rows, columns) = problem.layout.shape();
        let mut mean = Line::zeros(rows, columns);
        let mut ways: [Vec<Way>; 2] = [vec![], vec![]];
        for l in lines.clone() {
            let y = [part(0, l), part(1, l)];
            let predicted = problem.predict(chart, self.p, [&y[0], &y[1]], l, true)?;
            mean += &predicted.y * C::from(share);
            for (d, slope) in predicted.slopes.iter().enumerate() {
                problem.add_measured(model.column_mut(1 + d).as_mut_slice(), slope, share);
            }
            for (side, y) in y.into_iter().enumerate() {
                let (left, right) = problem.through(side, &predicted);
                ways[side].push(Way { y, left, right });
            }
        }
        problem.add_measured(model.column_mut(0).as_mut_slice(), &mean, 1.0);
        for (side, ways) in ways.iter().enumerate() {
            // Y^A and Y^B stand on the model's side of the residual: minus
            self.aims(side, ways, -share, &mut effect);
        }
        let (left, right) = problem.reductions.clone();
        self.aims(2, &[Way { y: mean, left, right }], 1.0, &mut effect);
        self.positions(&mut effect);
        for (j, std) in problem.nuisances.std.iter().enumerate() {
            effect.column_mut(j).scale_mut(*std);
        }
        Ok(Evaluated { model, effect })
    }

    /// Adds ∂(left · cells · right)/∂η (unscaled) of a block, summed over `ways` and times `share`: of the aims, and of the tilts,
    /// which are no aims.
    ///
    /// An impact's cells have one row of `right`, so the sum over lines is a product of matrices: what the cells show through
    /// `left`, by what comes of the impact through `right`.
    fn aims(&self, place: usize, ways: &[Way], share: f64, effect: &mut DMatrix<f64>) {
        let problem = self.problem;
        let block: &Block = problem.blocks()[place];
        let sensors = block.sensors.len();
        let (rows, columns, lines) = (problem.rows.len(), problem.columns.len(), ways.len());
        for (i, cells) in self.cells[place].chunks_exact(sensors.max(1)).enumerate() {
            // per cell its five aims, then both tilts of all cells together
            let count = AIMS * sensors + 2;
            let height = rows * count;
            let mut shown = DMatrix::<f64>::zeros(height, 2 * lines);
            let mut come = DMatrix::zeros(2 * lines, 2 * columns);
            for (l, way) in ways.iter().enumerate() {
                for c in 0..columns {
                    let v = way.right[(i, c)] * share;
                    come[(l, c)] = v.re;
                    come[(lines + l, c)] = -v.im;
                    come[(l, columns + c)] = v.im;
                    come[(lines + l, columns + c)] = v.re;
                }
                for (s, (cell, sensor)) in cells.iter().zip(&block.sensors).enumerate() {
                    let effects = of_cell(cell, &way.y);
                    for (k, axes) in effects.column_iter().enumerate() {
                        let at = rows * if k < AIMS { AIMS * s + k } else { AIMS * sensors + k - AIMS };
                        let (re, im) = shown.as_mut_slice().split_at_mut(height * lines);
                        let re = &mut re[height * l + at..][..rows];
                        let im = &mut im[height * l + at..][..rows];
                        for (v, row) in axes.iter().zip(&sensor.rows) {
                            let left = &way.left.as_slice()[row * rows..][..rows];
                            for ((re, im), left) in re.iter_mut().zip(im.iter_mut()).zip(left) {
                                *re += left.re * v.re - left.im * v.im;
                                *im += left.re * v.im + left.im * v.re;
                            }
                        }
                    }
                }
            }
            // real parts in the first columns, imaginary ones in the others
            let seen: DMatrix<f64> = shown * come;
            let mut add = |j: usize, parameter: usize| {
                let mut to = effect.column_mut(j);
                for (at, to) in to.as_mut_slice().chunks_exact_mut(rows).enumerate() {
                    let own = &seen.as_slice()[at * height + parameter * rows..][..rows];
                    to.iter_mut().zip(own).for_each(|(to, v)| *to += v);
                }
            };
            for s in 0..sensors {
                let at = problem.nuisances.of_cell(place, block, s, i);
                for k in 0..AIMS {
                    add(at.aim + k, AIMS * s + k);
                }
                if let Some(own) = at.impact.filter(|_| s == 0) {
                    add(own + 2, AIMS * sensors);
                    add(own + 3, AIMS * sensors + 1);
                }
            }
        }
    }

    /// A position acts as the aims of all its cells do, each alike: their sum.
    fn positions(&self, effect: &mut DMatrix<f64>) {
        let problem = self.problem;
        for (place, block) in problem.blocks().into_iter().enumerate() {
            for i in 0..block.impacts.len() {
                for s in 0..block.sensors.len() {
                    let at = problem.nuisances.of_cell(place, block, s, i);
                    let own = [at.sensor.map(|own| (own, 0, 3)), at.impact.map(|own| (own, 3, 2))];
                    for (own, first, count) in own.into_iter().flatten() {
                        for k in 0..count {
                            let aim = effect.column(at.aim + first + k).clone_owned();
                            effect.column_mut(own + k).add_assign(&aim);
                        }
                    }
                }
            }
        }
    }
}

/// The derivatives of one cell's reading (axes × 7, where the ports' admittance is y): by three shifts of the sensor, two of the impact, and
/// two tilts.
fn of_cell(cell: &CellGeometry, y: &Line) -> Line {
    let motion = product(y, &cell.pushed);
    let by_impact = product(&cell.seen, &product(y, &cell.slopes));
    let mut effects = Line::zeros(cell.seen.nrows(), AIMS + 2);
    for (k, turned) in cell.turned.iter().enumerate() {
        effects.set_column(k, &product(turned, &motion).column(0));
    }
    effects.columns_mut(3, 4).copy_from(&by_impact);
    effects
}

impl Problem {
    /// What the cells of A or B pass through on their way to the residual: L T_u and T_f R.
    pub(super) fn through(&self, side: usize, predicted: &Predicted) -> (Line, Line) {
        let block = &self.parts[side];
        let (row, column) = self.layout.corner(side);
        let left = predicted.left.select_rows(&self.rows).columns(row, block.rows.count).clone_owned();
        let right =
            predicted.right.select_columns(&self.columns).rows(column, block.columns.count).clone_owned();
        (product(&left, &block.t_u), product(&block.t_f, &right))
    }
}
