//! Properties of every passive linear structure: driving points absorb energy, and cause and effect
//! can be exchanged.

use nalgebra::{Complex, DMatrix};

/// Fraction of lines, 0…1, at which the real part of the driving-point mobility s Y_dd is not
/// negative, by degree of freedom.
///
/// On s = σ + iω with σ ≥ 0 this holds at every line of a passive structure; lines at which it
/// fails have a wrong phase, sign or position. `lines` are receptances with the same rows and
/// columns; the result is empty without lines.
pub fn passivity(lines: &[DMatrix<Complex<f64>>], s: &[Complex<f64>]) -> Vec<f64> {
    let n = lines.first().map_or(0, DMatrix::nrows);
    (0..n)
        .map(|d| {
            let passive = lines.iter().zip(s).filter(|(y, s)| (y[(d, d)] * **s).re >= 0.0).count();
            passive as f64 / lines.len() as f64
        })
        .collect()
}

/// Mean over lines of Σ |Y_ij + Y_ji|² / Σ 2(|Y_ij|² + |Y_ji|²) over all pairs i < j, 0…1: 1 for a
/// reciprocal structure.
///
/// The pairs of a line are summed first, so that couplings that are zero by symmetry except for
/// rounding have no weight. Rows and columns should have one unit. NaN without pairs or lines.
pub fn reciprocity(lines: &[DMatrix<Complex<f64>>]) -> f64 {
    let mut values = Vec::new();
    for y in lines {
        let (mut common, mut whole) = (0.0, 0.0);
        for i in 0..y.nrows() {
            for j in i + 1..y.nrows() {
                common += (y[(i, j)] + y[(j, i)]).norm_sqr();
                whole += 2.0 * (y[(i, j)].norm_sqr() + y[(j, i)].norm_sqr());
            }
        }
        if whole > 0.0 {
            values.push(common / whole);
        }
    }
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Two masses on damped springs: (s²M + sC + K)⁻¹.
    fn structure() -> (Vec<DMatrix<Complex<f64>>>, Vec<Complex<f64>>) {
        let s: Vec<Complex<f64>> = (1..60).map(|l| Complex::new(2.3, TAU * 5.0 * f64::from(l))).collect();
        let lines = s
            .iter()
            .map(|s| {
                let spring = (s * 1e-4 + 1.0) * 1e6;
                let z = DMatrix::from_row_slice(
                    2,
                    2,
                    &[spring * 2.0 + s * s, -spring, -spring, spring + s * s * 2.0],
                );
                z.try_inverse().expect("damped")
            })
            .collect();
        (lines, s)
    }

    #[test]
    fn a_structure_is_passive_and_reciprocal() {
        let (lines, s) = structure();
        assert_eq!(passivity(&lines, &s), [1.0, 1.0]);
        // rounding of a 2 × 2 inverse
        assert!((reciprocity(&lines) - 1.0).abs() < 1e-12);
        assert!(reciprocity(&[]).is_nan() && passivity(&[], &[]).is_empty());
    }

    #[test]
    fn a_sensor_turned_round_is_neither() {
        let (mut lines, s) = structure();
        for y in &mut lines {
            y.row_mut(1).neg_mut();
        }
        assert_eq!(passivity(&lines, &s), [1.0, 0.0]);
        assert!(reciprocity(&lines) < 1e-12);
    }
}
