use super::chart::At;
use super::*;
use crate::substructuring::exact_rig_tests::rig;
use nalgebra::DMatrix;

const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };

struct Case {
    frf: [Frf; 3],
    geometry: Geometry,
}

impl Case {
    /// The rig's exact FRFs with this stated noise, relative to their mean magnitude.
    fn rigid(relative: f64) -> Case {
        let (frf, geometry) = rig();
        let frf = frf.map(|frf| {
            let variance = frf.lines().iter().map(|y| {
                let mean = y.map(|v| v.norm_sqr()).mean();
                DMatrix::from_element(y.nrows(), y.ncols(), relative * relative * mean / 2.0)
            });
            let variance = variance.collect();
            frf.with_variance(variance).expect("one for each value")
        });
        Case { frf, geometry }
    }
}

/// Jacobian of Eq. (1) by the joint, in both charts, compared with difference quotients.
#[test]
fn the_analytic_derivatives_are_the_difference_quotients() {
    let case = Case::rigid(1e-3);
    let [a, b, ajb] = &case.frf;
    let problem =
        problem(a, b, ajb, &case.geometry, IdmSet::Six, BAND, &Options::default()).expect("exact data");
    let diagonal = solver::chart(&problem);
    let p = nalgebra::DVector::from_fn(12, |i, _| {
        [0.95, 0.9, 0.6, 0.05, 0.2, 0.1][i % 6] * if i < 6 { 1.0 } else { 0.3 }
    });
    let (full, mut q) = diagonal.full(&p);
    // away from the diagonal
    for i in 0..q.len() {
        q[i] += 0.01 * (i as f64).sin();
    }
    let parts = [0, 1].map(|side: usize| problem.parts[side].reduce(&problem.parts[side].cells[10]));
    for (chart, p) in [(&diagonal, &p), (&full, &q)] {
        let all = model::Wanted { y: true, gains: true, slopes: true };
        let with = |p: &nalgebra::DVector<f64>, [a, b]: [&DMatrix<nalgebra::Complex<f64>>; 2]| {
            let parts = [std::slice::from_ref(a), std::slice::from_ref(b)];
            problem.predict(chart, p, parts, 10..11, all).expect("regular").remove(0)
        };
        let at = |p: &nalgebra::DVector<f64>| with(p, [&parts[0], &parts[1]]);
        let here = at(p);
        let dyads = here.slopes.moved.ncols() / chart.count();
        for i in 0..chart.count() {
            let own = |of: &DMatrix<nalgebra::Complex<f64>>| of.columns(i * dyads, dyads).clone_owned();
            let slope = own(&here.slopes.moved) * own(&here.slopes.by).transpose();
            let step = 1e-5;
            let (mut up, mut down) = (p.clone(), p.clone());
            up[i] += step;
            down[i] -= step;
            let quotient = (at(&up).y - at(&down).y) / nalgebra::Complex::from(2.0 * step);
            // third order of a step of 1e-5, and rounding divided by it
            assert!(
                (&slope - &quotient).norm() < 1e-5 * quotient.norm() + 1e-9 * here.y.norm(),
                "parameter {i}"
            );
        }
        // L δY R is the effect of a change of Y^A
        let change = &parts[0] * nalgebra::Complex::from(1e-6);
        let moved = with(p, [&(&parts[0] + &change), &parts[1]]).y;
        let left = problem.layout.left(&here, 0);
        let right = problem.layout.right(&here, 0);
        let linear = left * &change * right;
        assert!((moved - &here.y - &linear).norm() < 1e-4 * linear.norm());
    }
}

/// Lines of one vector: a regular one, one that needs pivoted QR, a singular one, and a regular one
/// again.
#[test]
fn a_line_of_the_model_in_doubt_is_inverted_with_care_and_leaves_its_neighbours_alone() {
    let case = Case::rigid(1e-3);
    let [a, b, ajb] = &case.frf;
    let problem =
        problem(a, b, ajb, &case.geometry, IdmSet::Six, BAND, &Options::default()).expect("exact data");
    let layout = &problem.layout;
    let lines = 4;
    let parts = [0, 1].map(|side: usize| -> Vec<DMatrix<nalgebra::Complex<f64>>> {
        let block = &problem.parts[side];
        block.cells[..lines].iter().map(|cells| block.reduce(cells)).collect()
    });
    let diagonal = |last: [f64; 2]| {
        let of = |one: f64, last: f64| {
            let values =
                (0..layout.n).map(|i| nalgebra::Complex::from(if i + 1 < layout.n { one } else { last }));
            DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(layout.n, values))
        };
        chart::At { d: of(1.0, last[0]), e: of(1.0, last[1]), slopes: None }
    };
    // beyond doubt, below the limit of the fast method, singular
    let joint = [[1.0, 1.0], [0.0, 1e-10], [0.0, 0.0], [1.0, 1.0]].map(diagonal);
    let wanted = model::Wanted { y: true, ..model::Wanted::default() };
    let found = layout.predict(&joint, parts.each_ref().map(Vec::as_slice), wanted);
    assert_eq!(found.iter().map(Option::is_some).collect::<Vec<_>>(), [true, true, false, true]);
    for (l, found) in found.into_iter().enumerate() {
        let Some(found) = found else { continue };
        let own = [&parts[0][l], &parts[1][l]];
        let (rows, columns) = layout.shape();
        let mut apart = DMatrix::zeros(rows, columns);
        let mut b = DMatrix::zeros(layout.n, rows);
        for side in 0..2 {
            apart.view_mut(layout.corner(side), own[side].shape()).copy_from(own[side]);
            let sign = nalgebra::Complex::from(if side == 0 { 1.0 } else { -1.0 });
            for i in 0..layout.n {
                b[(i, layout.corner(side).0 + layout.rows[side].first[0] + i)] = sign;
            }
        }
        // rows and columns are the interface's only here, so that one B serves both
        assert_eq!(rows, columns);
        let At { d, e, .. } = &joint[l];
        let held = (d * layout.interface(own) + e).try_inverse().expect("regular");
        let y = &apart - &apart * b.transpose() * held * d * &b * &apart;
        // rounding, because the last degree of freedom is almost free where its inverse is in doubt
        assert!((found.y - &y).norm() < 1e-12 * y.norm(), "line {l}");
    }
}
