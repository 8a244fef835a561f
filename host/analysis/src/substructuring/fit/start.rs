//! Start values of the search.

use super::block::Line;
use super::chart::Chart;
use super::model::Layout;
use super::problem::Problem;
use crate::substructuring::idm::IdmSet;
use crate::substructuring::joint_over_bands::median;
use crate::substructuring::pseudo_inverse::full_rank_inverse;
use nalgebra::{Complex, DVector};

/// Range of κ: from a joint with hardly any stiffness to one with hardly any compliance.
const ENDS: [f64; 2] = [1e-3, 0.999];

/// The chart whose unit is the magnitude of Y^A + Y^B, the median over the lines of the band.
pub(super) fn chart(problem: &Problem) -> Chart {
    let w: Vec<Line> = (0..problem.s.len())
        .map(|l| {
            let parts = [0, 1].map(|side: usize| {
                let block = &problem.parts[side];
                block.reduce(&block.cells[l])
            });
            problem.layout.interface([&parts[0], &parts[1]])
        })
        .collect();
    let unit = (0..problem.layout.n)
        .map(|d| median(&w.iter().map(|w| w[(d, d)].norm()).collect::<Vec<f64>>()))
        .collect();
    let omega = problem.s.iter().map(|s| s.im).sum::<f64>() / problem.s.len() as f64;
    Chart::diagonal(unit, omega)
}

/// Start values to be tried in this order until one fits.
///
/// If the assembly's virtual points are measured, translations start from `inverse`: the median of
/// κ over lines, which is robust against single lines. Rotations start soft, then from `inverse`
/// too: for a small contact they have hardly any effect compared with the arms' inertia, and noise
/// makes them look stiff in `inverse`. Without virtual points in the assembly, translations start
/// at three sizes.
pub(super) fn candidates(problem: &Problem, chart: &Chart, idms: IdmSet) -> Vec<DVector<f64>> {
    let n = chart.n();
    let rotation = |d: usize| idms.dofs()[d].is_rotation();
    let from = |kappa: &dyn Fn(usize) -> f64| {
        DVector::from_fn(2 * n, |i, _| if i < n { kappa(i).clamp(ENDS[0], ENDS[1]) } else { 0.0 })
    };
    match by_inverse(problem, chart) {
        Some(kappa) => vec![
            from(&|d| if rotation(d) { ENDS[0] } else { kappa[d] }),
            from(&|d| kappa[d]),
            from(&|d| if rotation(d) { 0.1 } else { kappa[d] }),
        ],
        None => [0.7, 0.95, 0.3]
            .iter()
            .map(|translation| from(&|d| if rotation(d) { ENDS[0] } else { *translation }))
            .collect(),
    }
}

/// κ of each degree of freedom by Eq. (A.1); none if a virtual point is missing or a line singular.
fn by_inverse(problem: &Problem, chart: &Chart) -> Option<Vec<f64>> {
    let n = chart.n();
    let Layout { rows, columns, .. } = &problem.layout;
    let corners = [0, 1].map(|side| problem.layout.corner(side));
    let places = |first: [usize; 2]| -> Vec<usize> { first.iter().flat_map(|f| *f..f + n).collect() };
    let out = places([corners[0].0 + rows[0].first[0], corners[1].0 + rows[1].first[0]]);
    let input = places([corners[0].1 + columns[0].first[0], corners[1].1 + columns[1].first[0]]);
    if !(out.iter().all(|r| problem.rows.contains(r)) && input.iter().all(|c| problem.columns.contains(c))) {
        return None;
    }
    let z: Vec<Line> = (problem.ajb.cells.iter())
        .map(|cells| {
            let y = problem.ajb.reduce(cells).select_rows(&out).select_columns(&input);
            full_rank_inverse(&y, "the assembly's interface admittance").ok()
        })
        .collect::<Option<_>>()?;
    Some(
        (0..n)
            .map(|d| {
                let kappa: Vec<f64> = z
                    .iter()
                    .map(|z| {
                        let joint: Complex<f64> = -(z[(d, n + d)] + z[(n + d, d)]) * 0.5 * chart.unit[d];
                        (joint / (1.0 + joint)).re
                    })
                    .collect();
                median(&kappa)
            })
            .collect(),
    )
}
