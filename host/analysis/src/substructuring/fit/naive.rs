//! The weights computed naively from the formulas, line by line and cell by cell: the reference for
//! the fast ones.

use super::block::CellGeometry;
use super::chart::Chart;
use super::problem::{Corrected, Problem};
use super::weight::{Point, Weight};
use super::*;
use crate::substructuring::exact_rig_tests::rig;
use crate::{C, Line};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Lines per band and seed of `weight`: the draws must be the same.
const SAMPLED: usize = 4;
const NOISE_SEED: u64 = 0x6669_7422;

/// The transformations from the cells of A or B to the residual: L T_u and T_f R.
fn through(problem: &Problem, side: usize, predicted: &model::Predicted) -> (Line, Line) {
    let block = &problem.parts[side];
    let left = problem.layout.left(predicted, side).select_rows(&problem.rows);
    let right = problem.layout.right(predicted, side).select_columns(&problem.columns);
    (left * block.t_u.map(C::from), block.t_f.map(C::from) * right)
}

/// The model at a line with Y^A and Y^B equal to `y`.
fn predicted(point: &Point<'_>, l: usize, [a, b]: [Line; 2]) -> model::Predicted {
    let all = model::Wanted { y: true, gains: true, slopes: false };
    let found = point.problem.predict(point.chart, point.p, [&[a], &[b]], l..l + 1, all);
    found.expect("regular").remove(0)
}

/// Adds ∂(left · cells · right)/∂η (unscaled) of a block with the ports' admittance `y`.
fn add_effect(point: &Point<'_>, place: usize, y: &Line, way: (&Line, &Line, f64), effect: &mut Line) {
    let problem = point.problem;
    let block = problem.blocks()[place];
    let complex = |m: &DMatrix<f64>| m.map(C::from);
    for (i, cells) in point.cells[place].chunks(block.sensors.len()).enumerate() {
        for (s, (cell, sensor)) in cells.iter().zip(&block.sensors).enumerate() {
            let at = problem.nuisances.of_cell(place, block, s, i);
            let motion = y * complex(&cell.pushed);
            let by_impact = complex(&cell.seen) * (y * complex(&cell.slopes));
            let mut add = |j: usize, axes: &[C]| {
                for (axis, row) in sensor.rows.iter().enumerate() {
                    let dyad = way.0.column(*row) * way.1.row(i) * (axes[axis] * way.2);
                    let mut to = effect.column_mut(j);
                    to += DVector::from_column_slice(dyad.as_slice());
                }
            };
            for k in 0..3 {
                let axes = complex(&cell.turned[k]) * &motion;
                add(at.aim + k, axes.as_slice());
                if let Some(own) = at.sensor {
                    add(own + k, axes.as_slice());
                }
            }
            for k in 0..4 {
                let axes = by_impact.column(k).clone_owned();
                if k < 2 {
                    add(at.aim + 3 + k, axes.as_slice());
                }
                if let Some(own) = at.impact {
                    add(own + k, axes.as_slice());
                }
            }
        }
    }
}

/// ∂r/∂η of a band's mean, η in standard deviations.
fn effect(point: &Point<'_>, lines: &Range<usize>, part: impl Fn(usize, usize) -> Line) -> Line {
    let problem = point.problem;
    let mut effect = Line::zeros(problem.entries(), problem.nuisances.std.len());
    let (rows, columns) = problem.layout.shape();
    let mut mean = Line::zeros(rows, columns);
    let share = 1.0 / lines.len() as f64;
    for l in lines.clone() {
        let y = [part(0, l), part(1, l)];
        let predicted = predicted(point, l, y.clone());
        mean += &predicted.y * C::from(share);
        for (side, y) in y.iter().enumerate() {
            let (left, right) = through(problem, side, &predicted);
            add_effect(point, side, y, (&left, &right, -share), &mut effect);
        }
    }
    let (t_u, t_f) = &problem.reductions;
    add_effect(point, 2, &mean, (t_u, t_f, 1.0), &mut effect);
    for (j, std) in problem.nuisances.std.iter().enumerate() {
        effect.column_mut(j).scale_mut(*std);
    }
    effect
}

/// Adds scale · Σ v_oi x xᴴ, x = (column o of left) ⊗ (row i of right), column-major.
fn spread(noise: &mut Line, left: &Line, right: &Line, variance: &DMatrix<f64>, scale: f64) {
    for i in 0..variance.ncols() {
        for o in 0..variance.nrows() {
            let dyad = left.column(o) * right.row(i);
            let x = DVector::from_column_slice(dyad.as_slice());
            *noise += &x * x.adjoint() * C::from(variance[(o, i)] * scale);
        }
    }
}

/// Gᵀ N⁻¹ G of all bands.
fn information(point: &Point<'_>) -> DMatrix<f64> {
    let problem = point.problem;
    let count = problem.nuisances.std.len();
    let mut sum = DMatrix::zeros(count, count);
    for lines in &problem.bands {
        let averaged = 2.0 * problem.shared / lines.len() as f64;
        let mut noise = Line::zeros(problem.entries(), problem.entries());
        let (t_u, t_f) = &problem.reductions;
        for l in lines.clone() {
            spread(&mut noise, t_u, t_f, &problem.ajb.variance[l], averaged / lines.len() as f64);
        }
        let step = (lines.len() / SAMPLED).max(1);
        let sampled = lines.clone().step_by(step).count() as f64;
        let part = |side: usize, l: usize| point.data.parts[side][l].clone();
        for l in lines.clone().step_by(step) {
            let y = [part(0, l), part(1, l)];
            let predicted = predicted(point, l, y);
            for side in 0..2 {
                let (left, right) = through(problem, side, &predicted);
                spread(&mut noise, &left, &right, &problem.parts[side].variance[l], averaged / sampled);
            }
        }
        let moved = |sign: f64| {
            effect(point, lines, |side, l| {
                part(side, l) + &problem.noise(l, NOISE_SEED)[side] * C::from(sign)
            })
        };
        let unsure = (moved(1.0) - moved(-1.0)) * C::from(0.5 * problem.shared.sqrt());
        noise += &unsure * unsure.adjoint();
        let g = effect(point, lines, part);
        // real and imaginary part have half the variance each
        let weighed = noise.cholesky().expect("positive").solve(&g) * C::from(2.0);
        sum += (g.adjoint() * weighed).map(|v| v.re);
    }
    sum
}

struct Case {
    problem: Problem,
    chart: Chart,
    p: DVector<f64>,
    eta: Vec<f64>,
}

impl Case {
    /// The exact rig with this stated noise, away from nominal geometry.
    fn new() -> Case {
        let (frf, geometry) = rig();
        let [a, b, ajb] = frf.map(|frf| frf.with_relative_noise(1e-3));
        let band = Band { low_hz: 300.0, high_hz: 400.0 };
        let problem =
            problem(&a, &b, &ajb, &geometry, IdmSet::Six, band, &Options::default()).expect("exact data");
        let chart = solver::chart(&problem);
        let p = DVector::from_fn(12, |i, _| if i < 6 { [0.9, 0.8, 0.9, 0.1, 0.05, 0.1][i] } else { 0.2 });
        let eta = (0..problem.nuisances.std.len()).map(|i| (i as f64).sin()).collect();
        Case { problem, chart, p, eta }
    }

    fn corrected(&self) -> Corrected {
        self.problem.corrected(&self.chart, &self.p, &self.eta).expect("regular")
    }

    fn point<'a>(&'a self, data: &'a Corrected, cells: &'a [Vec<CellGeometry>; 3]) -> Point<'a> {
        Point { problem: &self.problem, chart: &self.chart, p: &self.p, cells, data }
    }

    fn cells(&self) -> [Vec<CellGeometry>; 3] {
        [0, 1, 2].map(|place| self.problem.cells(place, &self.eta))
    }
}

#[test]
fn the_fast_weights_are_the_naive_ones() {
    let case = Case::new();
    let (data, cells) = (case.corrected(), case.cells());
    let point = case.point(&data, &cells);
    let fast = Weight::of(point).expect("regular").information;
    let naive = information(&point);
    let largest = naive.amax();
    for r in 0..naive.nrows() {
        for c in 0..=r {
            // rounding, through a covariance with a condition number of about 1e6
            assert!((fast[(r, c)] - naive[(r, c)]).abs() < 1e-9 * largest, "{r} {c}");
        }
    }
}

#[test]
fn geometry_taken_out_of_the_data_is_what_moved_cells_read() {
    let case = Case::new();
    let (moved, problem) = (case.cells(), &case.problem);
    let none = vec![0.0; case.eta.len()];
    let data = case.corrected();
    for place in 0..2 {
        let (block, nominal) = (&problem.parts[place], problem.cells(place, &none));
        for l in [0, problem.s.len() - 1] {
            // cells for these port admittances, as moved sensors and hits measure them
            let y = &data.parts[place][l];
            let mut more = Line::zeros(block.t_u.ncols(), block.t_f.nrows());
            let at = |cell: &CellGeometry| cell.seen.map(C::from) * (y * cell.pushed.map(C::from));
            for (k, (moved, nominal)) in moved[place].iter().zip(&nominal).enumerate() {
                let (i, s) = (k / block.sensors.len(), k % block.sensors.len());
                for (axis, row) in block.sensors[s].rows.iter().enumerate() {
                    more[(*row, i)] = (at(moved) - at(nominal))[(axis, 0)];
                }
            }
            let measured = block.reduce(&block.cells[l]);
            // remainder of the fixed point after six steps, each of which removes four fifths or
            // more
            assert!((y + block.reduce(&more) - &measured).norm() < 1e-3 * measured.norm(), "{place} {l}");
        }
    }
}

#[test]
#[ignore = "prints how much faster the fast weights are"]
fn speed_of_the_weights() {
    let case = Case::new();
    let (data, cells) = (case.corrected(), case.cells());
    let point = case.point(&data, &cells);
    let time = |work: &dyn Fn()| {
        let start = std::time::Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    let naive = time(&|| drop(information(&point)));
    let fast = time(&|| drop(Weight::of(point)));
    println!("naive {naive:.3} s, fast {fast:.3} s: {:.1} times faster", naive / fast);
}
