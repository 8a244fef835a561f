//! Coupling: the assembly's admittance from its parts, with or without a compliant joint; and the
//! check of a result by it: A and B coupled by the identified joint must reproduce the measured
//! assembly.

use super::joint_over_bands::stiffness_and_damping;
use super::pseudo_inverse::{RankLost, full_rank_inverse};
use crate::Line;
use crate::band::Band;
use crate::frf::{Frf, FrfError};
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix};

/// The reason why parts cannot be coupled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CouplingError {
    /// A name is missing or occurs twice.
    #[error(transparent)]
    Frf(#[from] FrfError),
    /// The parts are on different lines, in different quantities, or under different windows.
    #[error(
        "`{name}` does not fit the first part ({what}): couple FRFs of the same lines, quantity and window only"
    )]
    Unlike {
        /// The part.
        name: String,
        /// What differs.
        what: &'static str,
    },
    /// A matrix does not have the required shape.
    #[error("{what} is {rows} × {columns}, {wanted_rows} × {wanted_columns} is needed")]
    Shape {
        /// Which matrix.
        what: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Rows needed.
        wanted_rows: usize,
        /// Columns needed.
        wanted_columns: usize,
    },
    /// The interface flexibility is singular: a constraint is redundant.
    #[error(transparent)]
    Singular(#[from] RankLost),
}

/// Ỹ = Y − Y B_fᵀ (B_u Y B_fᵀ + Y^J)⁻¹ B_u Y.
///
/// Implements Eq. (1).
///
/// `y` (outputs × inputs) holds the uncoupled parts, `b_u` (m × outputs) and `b_f` (m × inputs) the
/// signed Boolean matrices of the m couplings. With `joint` = Y^J (m × m) the interface is
/// compliant; without it this is the rigid coupling of LM-FBS, the limit Y^J = 0.
///
/// # Errors
/// Shapes that do not fit; redundant couplings.
pub fn couple(
    y: &DMatrix<Complex<f64>>,
    b_u: &DMatrix<f64>,
    b_f: &DMatrix<f64>,
    joint: Option<&DMatrix<Complex<f64>>>,
) -> Result<DMatrix<Complex<f64>>, CouplingError> {
    let m = b_u.nrows();
    let fits = |what, found: (usize, usize), wanted: (usize, usize)| {
        let ((rows, columns), (wanted_rows, wanted_columns)) = (found, wanted);
        if found == wanted {
            Ok(())
        } else {
            Err(CouplingError::Shape { what, rows, columns, wanted_rows, wanted_columns })
        }
    };
    fits("B of the responses", b_u.shape(), (m, y.nrows()))?;
    fits("B of the forces", b_f.shape(), (m, y.ncols()))?;
    if m == 0 {
        return Ok(y.clone());
    }
    let gap = b_u.map(Complex::from) * y;
    let push = y * b_f.transpose().map(Complex::from);
    let mut flexibility = &gap * b_f.transpose().map(Complex::from);
    if let Some(joint) = joint {
        fits("Y^J", joint.shape(), (m, m))?;
        flexibility += joint;
    }
    Ok(y - push * full_rank_inverse(&flexibility, "the interface flexibility B Y Bᵀ + Y^J")? * gap)
}

/// Combines parts in block-diagonal form; every output and input is named `part/name`.
///
/// # Errors
/// Parts that differ in lines, quantity or window; duplicate names.
pub fn block_diagonal(parts: &[(&str, &Frf)]) -> Result<Frf, CouplingError> {
    let (mut frequency_hz, mut sigma_per_s, mut quantity) =
        (&[][..], 0.0, super::MotionQuantity::Displacement);
    if let Some((_, first)) = parts.first() {
        (frequency_hz, sigma_per_s, quantity) = (first.frequency_hz(), first.sigma_per_s(), first.quantity());
    }
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for (name, part) in parts {
        let unlike = |what| CouplingError::Unlike { name: (*name).into(), what };
        if part.quantity() != quantity {
            return Err(unlike("quantity"));
        }
        if part.sigma_per_s() != sigma_per_s {
            return Err(unlike("window"));
        }
        if part.frequency_hz() != frequency_hz {
            return Err(unlike("lines"));
        }
        outputs.extend(part.outputs().iter().map(|o| format!("{name}/{o}")));
        inputs.extend(part.inputs().iter().map(|i| format!("{name}/{i}")));
    }
    let lines = (0..frequency_hz.len())
        .map(|l| {
            let mut line = DMatrix::zeros(outputs.len(), inputs.len());
            let (mut r, mut c) = (0, 0);
            for (_, part) in parts {
                let y = &part.lines()[l];
                line.view_mut((r, c), y.shape()).copy_from(y);
                (r, c) = (r + y.nrows(), c + y.ncols());
            }
            line
        })
        .collect();
    Ok(Frf::new(frequency_hz.to_vec(), sigma_per_s, quantity, outputs, inputs, lines)?)
}

/// \[I, −I\]: the first `n` degrees of freedom minus the next `n`.
pub fn boolean_difference(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, 2 * n, |r, c| f64::from(i8::from(c == r)) - f64::from(i8::from(c == n + r)))
}

/// The signed Boolean matrix whose row k is `pairs[k].0` minus `pairs[k].1`, among `names`.
///
/// # Errors
/// A name that does not exist.
pub fn boolean(names: &[String], pairs: &[(&str, &str)]) -> Result<DMatrix<f64>, CouplingError> {
    let mut b = DMatrix::zeros(pairs.len(), names.len());
    for (k, (plus, minus)) in pairs.iter().enumerate() {
        for (name, sign) in [(plus, 1.0), (minus, -1.0)] {
            let at = names.iter().position(|n| n == name).ok_or_else(|| FrfError::MissingName {
                side: "degrees of freedom to couple",
                name: (*name).to_string(),
                available: names.join(", "),
            })?;
            b[(k, at)] += sign;
        }
    }
    Ok(b)
}

/// Difference between the coupled and the measured assembly, line by line.
#[derive(Debug, Clone, PartialEq)]
pub struct BackCoupling {
    /// Lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// (coupled − measured) / ‖measured‖ at both virtual points (2n_c × 2n_c), rotations in metres
    /// over 40 mm.
    pub difference: Vec<Line>,
}

impl BackCoupling {
    /// Couples Y^A and Y^B (n_c × n_c) by Eq. (1) with one spring and damper for all lines, K + sC:
    /// the mean of `z` over `band`. Admittances are in the quantity of `axis`. None if no line lies
    /// in the band or the mean joint has no inverse.
    pub fn of(
        axis: &Frf,
        y_a: &[Line],
        y_b: &[Line],
        y_ajb: &[Line],
        z: &[Line],
        band: Band,
    ) -> Option<BackCoupling> {
        let n = y_a.first()?.nrows();
        let inside: Vec<usize> =
            (0..axis.frequency_hz().len()).filter(|&l| band.contains(axis.frequency_hz()[l])).collect();
        let mut stiffness = DMatrix::<f64>::zeros(n, n);
        let mut damping = DMatrix::<f64>::zeros(n, n);
        for &l in &inside {
            let s = axis.s(l);
            for ((k, c), z) in stiffness.iter_mut().zip(damping.iter_mut()).zip(z[l].iter()) {
                let (stiffness, damping) = stiffness_and_damping(*z, s);
                *k += stiffness / inside.len() as f64;
                *c += damping / inside.len() as f64;
            }
        }
        let b = boolean_difference(n);
        let difference = (0..axis.frequency_hz().len())
            .into_par_iter()
            .map(|l| {
                let s = axis.s(l);
                let joint = DMatrix::from_fn(n, n, |r, c| s * damping[(r, c)] + stiffness[(r, c)]);
                let to_quantity = s.powi(axis.quantity().order_of_s());
                let joint = full_rank_inverse(&joint, "the mean joint").ok()? * to_quantity;
                let mut y = Line::zeros(2 * n, 2 * n);
                y.view_mut((0, 0), (n, n)).copy_from(&y_a[l]);
                y.view_mut((n, n), (n, n)).copy_from(&y_b[l]);
                let coupled = couple(&y, &b, &b, Some(&joint)).ok()?;
                Some((coupled - &y_ajb[l]) / Complex::from(y_ajb[l].norm()))
            })
            .collect::<Option<_>>()?;
        (!inside.is_empty()).then(|| BackCoupling { frequency_hz: axis.frequency_hz().to_vec(), difference })
    }

    /// ‖coupled − measured‖ / ‖measured‖ line by line.
    pub fn error(&self) -> Vec<f64> {
        self.difference.iter().map(DMatrix::norm).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::MotionQuantity;
    use super::*;
    use std::f64::consts::TAU;

    /// Receptance of springs (n × n) and masses at frequency f: (K − ω²M)⁻¹.
    fn receptance(k: &DMatrix<f64>, m: &DMatrix<f64>, f: f64) -> DMatrix<Complex<f64>> {
        let w = TAU * f;
        let z = DMatrix::from_fn(k.nrows(), k.ncols(), |r, c| {
            // a loss factor keeps it regular everywhere
            Complex::new(k[(r, c)] - w * w * m[(r, c)], 0.01 * k[(r, c)])
        });
        z.try_inverse().expect("damped")
    }

    fn part(names: &[&str], k: &DMatrix<f64>, m: &DMatrix<f64>, lines: &[f64]) -> Frf {
        let names: Vec<String> = names.iter().map(|n| (*n).to_string()).collect();
        Frf::new(
            lines.to_vec(),
            0.0,
            MotionQuantity::Displacement,
            names.clone(),
            names,
            lines.iter().map(|f| receptance(k, m, *f)).collect(),
        )
        .expect("all agree")
    }

    /// Two chains of two masses, coupled at one end of each, compared with the matrices of the
    /// whole.
    #[test]
    fn coupling_is_direct_assembly() {
        let lines = [40.0, 95.0, 210.0];
        let chain = |k: f64, ground: f64| DMatrix::from_row_slice(2, 2, &[k + ground, -k, -k, k]);
        let (ka, kb) = (chain(2e6, 1e6), chain(3e6, 5e5));
        let (ma, mb) = (DMatrix::from_diagonal_element(2, 2, 1.4), DMatrix::from_diagonal_element(2, 2, 2.2));
        let (a, b) = (part(&["in", "end"], &ka, &ma, &lines), part(&["in", "end"], &kb, &mb, &lines));
        let y = block_diagonal(&[("A", &a), ("B", &b)]).expect("alike");
        let pairs = [("A/end", "B/end")];
        let (b_u, b_f) =
            (boolean(y.outputs(), &pairs).expect("named"), boolean(y.inputs(), &pairs).expect("named"));
        let whole = |extra: Option<f64>| {
            let mut k = DMatrix::zeros(4, 4);
            k.view_mut((0, 0), (2, 2)).copy_from(&ka);
            k.view_mut((2, 2), (2, 2)).copy_from(&kb);
            let mut m = DMatrix::zeros(4, 4);
            m.view_mut((0, 0), (2, 2)).copy_from(&ma);
            m.view_mut((2, 2), (2, 2)).copy_from(&mb);
            if let Some(spring) = extra {
                for (r, c, sign) in [(1, 1, 1.0), (3, 3, 1.0), (1, 3, -1.0), (3, 1, -1.0)] {
                    k[(r, c)] += sign * spring;
                }
            }
            (k, m)
        };
        let spring = 7e6;
        let (k, m) = whole(Some(spring));
        for (l, f) in lines.iter().enumerate() {
            let joint = DMatrix::from_element(1, 1, Complex::new(spring, 0.01 * spring).inv());
            let coupled = couple(&y.lines()[l], &b_u, &b_f, Some(&joint)).expect("regular");
            let direct = receptance(&k, &m, *f);
            // rounding of 4 × 4 inverses
            assert!((&coupled - &direct).norm() < 1e-12 * direct.norm());
            let rigid = couple(&y.lines()[l], &b_u, &b_f, None).expect("regular");
            // compatibility, and the limit of a stiff joint
            assert!((&b_u.map(Complex::from) * &rigid).norm() < 1e-12 * rigid.norm());
            let stiff = DMatrix::from_element(1, 1, Complex::new(1e-18, 0.0));
            let limit = couple(&y.lines()[l], &b_u, &b_f, Some(&stiff)).expect("regular");
            assert!((rigid - &limit).norm() < 1e-9 * limit.norm());
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        let one = DMatrix::from_element(1, 1, 1.0);
        let a = part(&["p"], &one, &one, &[1.0, 2.0]);
        let b = part(&["p"], &one, &one, &[1.0, 3.0]);
        let text = block_diagonal(&[("A", &a), ("B", &b)]).expect_err("other lines").to_string();
        assert!(text.contains("`B`") && text.contains("lines"), "{text}");
        let text = boolean(a.outputs(), &[("p", "q")]).expect_err("no q").to_string();
        assert!(text.contains("`q`"), "{text}");
        // the same constraint twice
        let y = block_diagonal(&[("A", &a), ("B", &a)]).expect("alike");
        let twice = boolean(y.outputs(), &[("A/p", "B/p"), ("A/p", "B/p")]).expect("named");
        assert!(matches!(couple(&y.lines()[0], &twice, &twice, None), Err(CouplingError::Singular(_))));
        let wide = DMatrix::zeros(1, 3);
        assert!(matches!(couple(&y.lines()[0], &wide, &wide, None), Err(CouplingError::Shape { .. })));
    }
}

#[cfg(test)]
mod back_coupling_tests {
    use super::*;
    use crate::frf::MotionQuantity;

    /// Two single masses on springs, joined by 1e6 N/m below 200 Hz and by half of it above.
    fn measured() -> (Frf, [Vec<Line>; 4]) {
        let frequency_hz: Vec<f64> = (20..400).map(f64::from).collect();
        let axis = Frf::new(
            frequency_hz.clone(),
            2.0,
            MotionQuantity::Displacement,
            vec![],
            vec![],
            vec![Line::zeros(0, 0); frequency_hz.len()],
        )
        .expect("all agree");
        let one = |z: Complex<f64>| Line::from_element(1, 1, z.inv());
        let mut all: [Vec<Line>; 4] = Default::default();
        for (l, &f) in frequency_hz.iter().enumerate() {
            let s = axis.s(l);
            let spring = |k: f64| s * (1e-4 * k) + k;
            let (a, b) = (s * s * 1.3 + spring(2e5), s * s * 0.7 + spring(4e5));
            let z = if f < 200.0 { spring(1e6) } else { spring(5e5) };
            let whole = Line::from_row_slice(2, 2, &[a + z, -z, -z, b + z]);
            all[0].push(one(a));
            all[1].push(one(b));
            all[2].push(whole.try_inverse().expect("damped"));
            all[3].push(Line::from_element(1, 1, z));
        }
        (axis, all)
    }

    #[test]
    fn the_right_joint_gives_the_assembly_and_a_wrong_one_says_from_where() {
        let (axis, [a, b, ajb, z]) = measured();
        let above = Band { low_hz: 250.0, high_hz: 350.0 };
        let found = BackCoupling::of(&axis, &a, &b, &ajb, &z, above).expect("lines");
        let (l, error) = (300 - 20, found.error());
        // rounding of 2 × 2 inverses
        assert!(error[l] < 1e-10 && error[100 - 20] > 0.05, "{error:?}");
        let nowhere = Band { low_hz: 1e4, high_hz: 2e4 };
        assert_eq!(BackCoupling::of(&axis, &a, &b, &ajb, &z, nowhere), None);
    }
}
