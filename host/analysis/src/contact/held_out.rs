//! Prediction of a cell that the fit has not seen: the model's test on data that it was not fitted
//! to.
//!
//! The cell's signals are given no weight, and the rest is fitted again from the present minimum.
//! The other cells of the impact then give the motion; motion and parameters give the cell's
//! signals. The variance of the difference is that of the cell's noise, of the motion, and of the
//! parameters, among them the cell's own errors of aim.

use super::Fit;
use super::block::{Block, Group, POINT};
use super::model::{Eliminated, LineModel, eliminated};
use super::solver::{Refit, refit, shifts};
use crate::C;
use crate::parallel::prelude::*;
use crate::substructuring::joint_over_bands::NORMAL_95;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// One predicted cell of the assembly, along the axis of its sensor that moves most.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// The impact's name.
    pub impact: String,
    /// The response point's name.
    pub point: String,
    /// Unit vector of the axis.
    pub direction: [f64; 3],
    /// The lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// Magnitudes of the measured receptance, m/N.
    pub measured_m_per_n: Vec<f64>,
    /// Magnitudes of the predicted receptance, m/N.
    pub predicted_m_per_n: Vec<f64>,
    /// Measured over predicted magnitude, minus 1.
    pub off: Vec<f64>,
    /// Half widths of the predicted magnitude's 95 % interval for noise, aims and places, relative
    /// to it.
    pub half_width: Vec<f64>,
    /// Rms of the complex difference over its standard deviation, over all axes and lines: about 1
    /// if the model holds.
    pub deviation: f64,
    /// Rms of the difference over the rms of the signal, over all axes and lines.
    pub part: f64,
}

/// Standard deviation over the signal above which the other cells do not determine a prediction.
const VAGUE: f64 = 0.3;

/// Predicts one cell on specimen A for each impact on the assembly, not the same point for all. A
/// cell without which the fit is not determined is left out.
pub fn held_out(fit: &Fit) -> Vec<HeldOut> {
    let assembled =
        fit.blocks.iter().enumerate().filter(|(_, block)| block.along_z.is_none() && block.counts);
    let chosen: Vec<(usize, usize)> = assembled
        .enumerate()
        .filter_map(|(n, (b, block))| {
            let own: Vec<usize> =
                (0..block.cells.len()).filter(|c| block.cells[*c].group == Group::SpecimenA).collect();
            Some((b, *own.get(n % own.len().max(1))?))
        })
        .collect();
    chosen.into_par_iter().filter_map(|(b, cell)| predicted(fit, b, cell)).collect()
}

fn predicted(fit: &Fit, b: usize, cell: usize) -> Option<HeldOut> {
    let mut blocks = fit.blocks.clone();
    for line in &mut blocks[b].lines {
        for (weight, row) in line.weight.iter_mut().zip(&fit.blocks[b].rows) {
            if row.cell == cell {
                *weight = 0.0;
            }
        }
    }
    let Refit { p, covariance, motion } =
        refit(&blocks, &fit.parameters, fit.solution.shared, &fit.solution.p).ok()?;
    let rest = &blocks[b];
    let at = &rest.parameters;
    let covariance = DMatrix::from_fn(at.len(), at.len(), |i, j| covariance[(at[i], at[j])]);

    let rows: Vec<usize> = (0..rest.rows.len())
        .filter(|r| rest.rows[*r].cell == cell && rest.rows[*r].channel >= POINT)
        .collect();
    let lines = (0..rest.lines.len())
        .map(|line| compared(rest, line, &p, shifts(rest, &motion, line).as_ref(), &rows, &covariance))
        .collect::<Option<Vec<Vec<Compared>>>>()?;
    let mean = |of: &dyn Fn(&Compared) -> f64| {
        let all = lines.iter().flatten().map(of);
        all.sum::<f64>() / (rows.len() * lines.len()).max(1) as f64
    };
    let signal = mean(&|one| one.measured.norm_sqr());
    if lines.is_empty() || mean(&|one| one.variance) > VAGUE * VAGUE * signal {
        return None;
    }
    let moves = |axis: usize| lines.iter().map(|line| line[axis].measured.norm_sqr()).sum::<f64>();
    let axis = (0..rows.len()).max_by(|a, b| moves(*a).total_cmp(&moves(*b)))?;
    let of_axis = |of: fn(&Compared) -> f64| lines.iter().map(|line| of(&line[axis])).collect();
    Some(HeldOut {
        impact: rest.impact.clone(),
        point: rest.cells[cell].name.clone(),
        direction: rest.cells[cell].axes[rest.rows[rows[axis]].channel - POINT].direction,
        frequency_hz: rest.lines.iter().map(|line| line.frequency_hz).collect(),
        measured_m_per_n: of_axis(|one| one.measured.norm()),
        predicted_m_per_n: of_axis(|one| one.predicted.norm()),
        off: of_axis(|one| one.measured.norm() / one.predicted.norm() - 1.0),
        // a magnitude has one of the two parts of a complex difference
        half_width: of_axis(|one| NORMAL_95 * (0.5 * one.variance).sqrt() / one.predicted.norm()),
        deviation: mean(&|one| one.off() / one.variance).sqrt(),
        part: (mean(&Compared::off) / signal).sqrt(),
    })
}

/// One row at one line.
struct Compared {
    measured: C,
    predicted: C,
    variance: f64,
}

impl Compared {
    fn off(&self) -> f64 {
        (self.measured - self.predicted).norm_sqr()
    }
}

/// The prediction of `rows`, which have no weight in the block, at one line.
fn compared(
    block: &Block,
    line: usize,
    p: &[f64],
    shifts: Option<&[DVector<C>; 2]>,
    rows: &[usize],
    covariance: &DMatrix<f64>,
) -> Option<Vec<Compared>> {
    let at = &block.lines[line];
    let model = LineModel::new(block, p, at.s);
    let (map, offsets) = model.map();
    let Eliminated { q, r, motion, .. } = eliminated(block, at, &map, &offsets, p, shifts)?;
    // each column: what unit noise in one combination of the weighted signals adds to the motion
    let of_noise = r.solve_upper_triangular(&DMatrix::identity(r.nrows(), r.ncols()))?;
    let derivatives = model.derivatives(&motion, shifts, &map);
    let parameters = covariance.nrows();
    // Qᴴ times the weighted derivatives: how far the motion follows the parameters
    let mut followed = DMatrix::<C>::zeros(q.ncols(), parameters);
    for (k, own) in derivatives.iter().enumerate() {
        for (i, value) in own {
            let value = value * at.weight[k];
            for n in 0..q.ncols() {
                followed[(n, *i)] += q[(k, n)].conj() * value;
            }
        }
    }
    let compared = rows.iter().map(|&row| {
        let of_motion = map.row(row) * &of_noise;
        let mut slopes = -(&of_motion * &followed);
        for (i, value) in &derivatives[row] {
            slopes[*i] += value;
        }
        let [re, im] = [slopes.map(|slope| slope.re), slopes.map(|slope| slope.im)];
        let of_parameters = (&re * covariance).dot(&re) + (&im * covariance).dot(&im);
        let mut predicted = (map.row(row) * &motion)[0] + offsets[row];
        if let (Some(shifts), Some(at)) = (shifts, block.cells[block.rows[row].cell].shift) {
            predicted += (0..2).map(|axis| (map.row(row) * &shifts[axis])[0] * p[at + axis]).sum::<C>();
        }
        Compared {
            measured: at.value[row],
            predicted,
            variance: at.sigma[row].powi(2) + of_motion.norm_squared() + of_parameters,
        }
    });
    Some(compared.collect())
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::super::tests::{QUIET, World, input, measured};

    #[test]
    fn a_cell_left_out_is_predicted_within_its_noise() {
        let cells = measured(World { noise_m_per_s: 1e-7, ..QUIET });
        let (found, _) = read(&input(&cells)).expect("all is there");
        let points: Vec<&str> = found.held_out.iter().map(|one| one.point.as_str()).collect();
        assert_eq!(points, ["4", "5", "6"], "one point for each impact");
        for one in &found.held_out {
            // some hundred independent differences: their rms scatters by some per cent
            assert!((0.8..1.25).contains(&one.deviation), "{one:?}");
            let lines = one.frequency_hz.len();
            let inside = (0..lines).filter(|line| one.off[*line].abs() < one.half_width[*line]);
            let inside = inside.count() as f64 / lines as f64;
            assert!(lines > 20 && inside > 0.87, "{inside} of {lines}");
        }
    }

    #[test]
    fn a_point_that_is_not_where_it_is_stated_is_not_predicted() {
        let cells = measured(World { noise_m_per_s: 1e-7, misplaced_m: 1e-3, ..QUIET });
        let mut input = input(&cells);
        // the point is hit once only, so that nothing else says where it is
        input.cells.retain(|cell| cell.point != "4" || cell.impact == "1");
        let (found, _) = read(&input).expect("all is there");
        let misplaced = &found.held_out[0];
        assert_eq!(misplaced.point, "4");
        assert!(misplaced.deviation > 5.0, "{misplaced:?}");
    }
}
