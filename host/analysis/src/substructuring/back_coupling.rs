//! Check of the result: A and B coupled by the identified joint must reproduce the measured
//! assembly.

use super::coupling::{boolean_difference, couple};
use super::joint_over_bands::stiffness_and_damping;
use super::pseudo_inverse::full_rank_inverse;
use crate::band::Band;
use crate::frf::Frf;
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix};

type Line = DMatrix<Complex<f64>>;

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
