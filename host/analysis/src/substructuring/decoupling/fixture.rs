//! The transmission simulator: a fixture replaces the partner while A is measured, and is removed
//! numerically.
//!
//! A alone has a free, unloaded interface. Measured with a fixture clamped to it as the partner
//! will be, A deforms and is loaded as in the assembly; the fixture's own FRFs, measured alone, are
//! then decoupled (Mayes and Arviso 2010; with a virtual point Pasma et al. 2018, the paper's Refs.
//! 45 and 46). For this rig it gives a substructure A with the same clamping as in the assembly.

use super::super::pseudo_inverse::full_rank_inverse;
use super::DecouplingError;
use nalgebra::{Complex, DMatrix};

type Line = DMatrix<Complex<f64>>;

/// The motions of the fixture for which compatibility and equilibrium are required.
#[derive(Debug, Clone, Copy)]
pub struct Weakening<'a> {
    /// T_u (motion × output on the fixture), for instance from
    /// [`crate::substructuring::vpt::responses`].
    pub outputs: &'a DMatrix<f64>,
    /// T_f (input on the fixture × force).
    pub inputs: &'a DMatrix<f64>,
}

/// The admittance of A at all its measured points, from A with the fixture and the fixture alone.
///
/// `with_fixture` is outputs × inputs; its rows `outputs` and columns `inputs` are on the fixture,
/// in the order of `fixture`. Dual disassembly: Y − Y_f (Y_ff − Y^F)⁻¹ Y_f, the coupling of the
/// negative fixture. Points on the fixture beyond its interface (the extended interface) are
/// redundant; then Y_ff − Y^F is singular, and the conditions are required for the fixture's own
/// motions only, through `weakening`.
///
/// # Errors
/// [`DecouplingError::RankLost`]: the fixture has more points than motions and no weakening was
/// given, or fewer.
pub fn remove_fixture(
    with_fixture: &Line,
    fixture: &Line,
    outputs: &[usize],
    inputs: &[usize],
    weakening: Option<Weakening<'_>>,
) -> Result<Line, DecouplingError> {
    let all_rows: Vec<usize> = (0..with_fixture.nrows()).collect();
    let all_columns: Vec<usize> = (0..with_fixture.ncols()).collect();
    let part = |rows: &[usize], columns: &[usize]| crate::frf::block(with_fixture, rows, columns);
    let mut flexibility = part(outputs, inputs) - fixture;
    let mut gap = part(outputs, &all_columns);
    let mut push = part(&all_rows, inputs);
    if let Some(weakening) = weakening {
        let (t_u, t_f) = (weakening.outputs.map(Complex::from), weakening.inputs.map(Complex::from));
        flexibility = &t_u * flexibility * &t_f;
        gap = t_u * gap;
        push *= t_f;
    }
    Ok(with_fixture
        - push * full_rank_inverse(&flexibility, "Y with the fixture minus the fixture's own")? * gap)
}

#[cfg(test)]
mod tests {
    use super::super::super::geometry::{Grouping, Point};
    use super::super::super::idm::IdmSet;
    use super::super::super::vpt;
    use super::*;
    use nalgebra::Vector3;
    use std::f64::consts::TAU;

    /// Nine channels on a rigid body, as R (9 × 6).
    fn points() -> Vec<Point> {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        [[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, -0.03]]
            .into_iter()
            .flat_map(|position_m| {
                axes.map(|direction| Point {
                    name: "p".into(),
                    description: "p".into(),
                    grouping: Grouping::InterfaceA,
                    position_m,
                    direction,
                })
            })
            .collect()
    }

    /// Impedance of a rigid body (mass, inertias) on springs of all six motions.
    fn body(mass: f64, inertia: f64, spring: f64, f: f64) -> Line {
        let w = TAU * f;
        Line::from_fn(6, 6, |r, c| {
            let (m, k) = if r < 3 { (mass, spring) } else { (inertia, spring * 1e-3) };
            let coupling = if r == c { 1.0 } else { 0.02 };
            Complex::new(k * coupling - if r == c { w * w * m } else { 0.0 }, 0.01 * k * coupling)
        })
    }

    #[test]
    fn what_was_clamped_on_comes_off_again() {
        let points = points();
        let u = vpt::responses(&points, Vector3::zeros(), IdmSet::Six, None).expect("three points");
        let e = vpt::impacts(&points, Vector3::zeros(), IdmSet::Six, None).expect("three points");
        let r = u.r.map(Complex::from);
        for f in [80.0, 150.0, 420.0] {
            // A: two bodies, an inner one (unknown) and the interface; the fixture is rigidly
            // joined to the latter
            let (inner, outer, fixture) =
                (body(2.0, 3e-3, 4e6, f), body(1.1, 2e-3, 1e5, f), body(0.7, 8e-4, 1e2, f));
            let link = body(0.0, 0.0, 3e6, f);
            let a = |outer: &Line| {
                let mut z = Line::zeros(12, 12);
                z.view_mut((0, 0), (6, 6)).copy_from(&(&inner + &link));
                z.view_mut((6, 6), (6, 6)).copy_from(&(outer + &link));
                z.view_mut((0, 6), (6, 6)).copy_from(&-&link);
                z.view_mut((6, 0), (6, 6)).copy_from(&-&link);
                z.try_inverse().expect("damped")
            };
            let seen = |y: &Line| {
                // six inner DoFs unchanged, the interface through nine channels and nine hits
                let mut rows = Line::zeros(15, 12);
                rows.view_mut((0, 0), (6, 6)).fill_with_identity();
                rows.view_mut((6, 6), (9, 6)).copy_from(&r);
                &rows * y * rows.transpose()
            };
            let (alone, with) = (seen(&a(&outer)), seen(&a(&(&outer + &fixture))));
            let own = &r * fixture.try_inverse().expect("damped") * r.transpose();
            let on_fixture: Vec<usize> = (6..15).collect();
            let weakening = Weakening { outputs: &u.t, inputs: &e.t };
            let found =
                remove_fixture(&with, &own, &on_fixture, &on_fixture, Some(weakening)).expect("six motions");
            // condition numbers of these matrices stay below 1e5
            assert!((&found - &alone).norm() < 1e-9 * alone.norm(), "{f} Hz");
            let refused =
                remove_fixture(&with, &own, &on_fixture, &on_fixture, None).expect_err("nine for six");
            assert!(refused.to_string().contains("has rank 6, 9 is needed"), "{refused}");
        }
    }
}
