//! The forecast against closed forms, and against the same information summed from nothing.

use super::block::{Block, PlannedCell};
use super::forecast::Posterior;
use super::parameters::{COMPLIANCE, Cause};
use super::solver::{self, Certainty};
use super::tests::{Cell, QUIET, World, input, measured};
use super::*;
use crate::structure::Structure;
use nalgebra::{DMatrix, DVector};

/// A positive matrix of order n.
fn positive(n: usize, seed: usize) -> DMatrix<f64> {
    let root = DMatrix::from_fn(n, n, |r, c| ((r * 7 + c * 3 + seed) % 13) as f64 / 13.0 - 0.4);
    &root * root.transpose() + DMatrix::identity(n, n) * 0.3
}

#[test]
fn an_update_of_some_parameters_is_the_inverse_of_the_changed_matrix() {
    // units as different as those of positions and compliances
    let unit = DVector::from_iterator(9, (0..9).map(|i| 10_f64.powi(2 - 3 * i)));
    let scaled = |m: &DMatrix<f64>| solver::scaled(m, &unit.map(f64::recip));
    let curvature = scaled(&positive(9, 0));
    let noise = scaled(&(positive(9, 5) * 0.05));
    let inverse = |m: &DMatrix<f64>| {
        let own = solver::units(m);
        let whole = solver::scaled(m, &own).try_inverse().expect("regular");
        solver::scaled(&whole, &own)
    };
    let of = |curvature: &DMatrix<f64>| {
        let inverse = inverse(curvature);
        let row = DVector::from_fn(9, |i, _| if i == COMPLIANCE { 1.0 } else { 0.2 * unit[i] });
        Posterior { of_noise: &inverse * &noise * &inverse, inverse, row }
    };
    let at = [0, 2, 3, 7];
    let change = {
        let own = DVector::from_fn(4, |i, _| unit[at[i]].recip());
        solver::scaled(&positive(4, 3), &own)
    };
    let mut changed = curvature.clone();
    for (i, to) in at.iter().enumerate() {
        for (j, other) in at.iter().enumerate() {
            changed[(*to, *other)] += change[(i, j)];
        }
    }
    let (mut updated, direct) = (of(&curvature), of(&changed));
    let variance = updated.variance_after(&at, &change).expect("positive");
    assert!(updated.change(&at, &change));
    let alike = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs();
    assert!(alike(variance, direct.variance()), "{variance} {}", direct.variance());
    assert!(alike(updated.variance(), direct.variance()));
    for (own, direct) in [(&updated.inverse, &direct.inverse), (&updated.of_noise, &direct.of_noise)] {
        for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
            let size = (direct[(i, i)] * direct[(j, j)]).sqrt();
            assert!((own[(i, j)] - direct[(i, j)]).abs() < 1e-8 * size, "{i} {j}");
        }
    }
    // with a single parameter it is the closed form 1/(a + d)
    let mut one = Posterior {
        inverse: DMatrix::from_element(1, 1, 0.25),
        of_noise: DMatrix::from_element(1, 1, 0.0),
        row: DVector::from_element(1, 1.0),
    };
    assert!(one.change(&[COMPLIANCE], &DMatrix::from_element(1, 1, 12.0)));
    assert!(alike(one.variance(), 0.5 / 16.0));
}

/// Half width with the information of all lines summed again, at the same parameters.
fn summed_again(fit: &Fit, blocks: &[Block]) -> f64 {
    let (p, shared) = (&fit.solution.p, fit.solution.shared);
    let motion = solver::motions(&fit.blocks, &fit.solution.bins);
    let bins = solver::evaluate(blocks, p, Some(&motion)).expect("determined");
    let all = bins.iter().map(|bin| (bin.block, &bin.normal));
    let (mut information, _) = solver::summed(blocks, all, p.len(), shared);
    for (i, own) in fit.parameters.all().iter().enumerate().filter(|(_, own)| own.sigma.is_finite()) {
        information[(i, i)] += 0.5 / (own.sigma * own.sigma).max(f64::MIN_POSITIVE.sqrt());
    }
    let Certainty { covariance, .. } =
        solver::certainty(blocks, &bins, p, &information, shared).expect("positive");
    let (compliance, row) = of_contact(p);
    let variance = (covariance * &row).dot(&row) * fit.solution.chi_square.max(1.0);
    let part = 1.96 * variance.sqrt() / compliance;
    part / (1.0 - part * part)
}

fn grown(block: &mut Block, cell: usize, more: usize, latent: &[[f64; 2]]) {
    block.hit_again(cell, more);
    solver::reveal(block, cell, latent[cell]);
    solver::weigh(block);
}

fn noisy() -> Vec<Cell> {
    measured(World { noise_m_per_s: 2e-7, ..QUIET })
}

#[test]
fn more_hits_have_the_information_that_summing_all_lines_again_gives() {
    let cells = noisy();
    let input = input(&cells);
    let (found, forecast) = forecast(&input, &[]).expect("identified");
    let (_, fit) = fitted(&input).expect("identified");
    let latent = solver::latent(&fit.blocks, &fit.solution.bins);
    let [low, high] = found.k_t_n_per_m.ci95;
    let stated = 0.5 * (high - low) / found.k_t_n_per_m.mean;
    assert!((forecast.half_width() / stated - 1.0).abs() < 1e-6);
    let mut gains = Vec::new();
    for cell in [0, 9, 20, forecast.cells().len() - 1] {
        let own = &forecast.cells()[cell];
        let b = fit.blocks.iter().position(|block| {
            block.impact == own.impact && block.along_z.is_some() == (own.structure == Structure::B)
        });
        let b = b.expect("its block");
        let at = fit.blocks[b].cells.iter().position(|cell| cell.name == own.point).expect("its cell");
        let mut blocks = fit.blocks.clone();
        grown(&mut blocks[b], at, 6, &latent[b]);
        let (fast, naive) = (forecast.half_width_after(cell, 6), summed_again(&fit, &blocks));
        let (by_fast, by_naive) = (forecast.half_width() - fast, forecast.half_width() - naive);
        println!("{own:?}: {by_fast:e} {by_naive:e}");
        assert!((by_fast - by_naive).abs() < 0.15 * by_naive.abs() + 1e-5 * stated, "{own:?}");
        gains.push(by_fast);
    }
    assert!(gains.iter().all(|gain| *gain >= -1e-9), "{gains:?}");
    // added one after another, they give what all together give, and tend to the limit
    let mut more = forecast.clone();
    for cell in 0..more.cells().len() {
        assert!(more.add(cell, 2));
    }
    let mut blocks = fit.blocks.clone();
    for (block, latent) in blocks.iter_mut().zip(&latent) {
        (0..block.cells.len()).for_each(|cell| grown(block, cell, 2, latent));
    }
    let naive = summed_again(&fit, &blocks);
    assert!((more.half_width() / naive - 1.0).abs() < 0.01, "{} {naive}", more.half_width());
    let limit = forecast.half_width_with_hits(100, |_| true);
    assert!(limit < more.half_width() && more.half_width() < forecast.half_width());
    // errors that are stated smaller lower it
    let budget = forecast.budget();
    assert!(budget[&Cause::Noise] > 0.0);
    let halved = forecast.half_width_with(Cause::Spots, 0.5);
    assert!(halved < forecast.half_width());
    assert!((forecast.half_width_with(Cause::Spots, 1.0) / forecast.half_width() - 1.0).abs() < 1e-9);
}

#[test]
fn a_planned_cell_is_predicted_as_it_will_be_measured() {
    let cells = noisy();
    let whole = input(&cells);
    let (_, measured) = forecast(&whole, &[]).expect("identified");
    // one of six points on specimen A is missing in one impact
    let last = whole.cells.len() - 1;
    let left_out = whole.cells[last];
    let without = Input { cells: whole.cells[..last].to_vec(), ..whole.clone() };
    let planned = PlannedCell {
        structure: left_out.structure,
        impact: left_out.impact,
        point: left_out.point,
        point_m: left_out.point_m,
        point_sigma_m: None,
        point_grouping: left_out.point_grouping,
        axes: left_out.axes,
        lasers: false,
    };
    let (_, mut forecast) = forecast(&without, &[planned]).expect("identified");
    let place = forecast.cells().len() - 1;
    let before = forecast.half_width();
    assert_eq!((forecast.cells()[place].hits, forecast.cells().len()), (0, measured.cells().len()));
    let after = forecast.half_width_after(place, 2);
    assert!(after < before, "{after} {before}");
    assert!(forecast.add(place, 2) && forecast.cells()[place].hits == 2);
    assert!((forecast.half_width() / after - 1.0).abs() < 1e-6);
    // the two fits differ by their noise
    let gained = (before - after) / before;
    assert!((after / measured.half_width() - 1.0).abs() < 0.05 + gained, "{after} {}", measured.half_width());
    // an impact that no cell was measured at is not predicted
    let nowhere = PlannedCell { impact: "elsewhere", ..planned };
    let (_, forecast) = super::forecast(&without, &[nowhere]).expect("identified");
    assert_eq!(forecast.cells().len(), measured.cells().len() - 1);
}
