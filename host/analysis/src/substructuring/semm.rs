//! System equivalent model mixing (SEMM): a model's admittance at many points, corrected by a
//! measurement at a few.
//!
//! The numerical parent Y^par spans all points; its part at the measured ones (removed model Y^rem)
//! is decoupled, and the measurement (overlay Y^ov) is coupled in its place (Klaassen, van der
//! Seijs, de Klerk, MSSP 105 (2018), Eqs. 21 and 31). With all points g and the measured ones b:
//!
//! - basic: Y^par − Y^par_gb (Y^rem)⁻¹ (Y^rem − Y^ov) (Y^rem)⁻¹ Y^par_bg,
//! - fully extended: Y^par − Y^par (Y^par_bg)⁺ (Y^rem − Y^ov) (Y^par_gb)⁺ Y^par.
//!
//! In the extended form the smallest singular values of either inverse can be left out: directions
//! in which noise of the overlay would be amplified. pyFBS 1.0.7 has that option too
//! (`fully-extend-svd`), but never reaches it: its condition `semm_type == "fully-extend" or
//! "extended"` is always true. Here it truncates.

use super::pseudo_inverse::{RankLost, full_rank_inverse};
use crate::Line;
use crate::frf::{Frf, FrfError, block};
use crate::parallel::prelude::*;
use nalgebra::Complex;

/// Singular values below this fraction of the largest are rounding.
const ROUNDING: f64 = 1e-13;

/// The DoFs at which compatibility and equilibrium are required.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// The measured ones only.
    Basic,
    /// All of the parent's, with the given number of smallest singular values left out of each
    /// inverse.
    FullyExtended {
        /// Number left out of (Y^par_bg)⁺, compatibility.
        drop_compatibility: usize,
        /// Number left out of (Y^par_gb)⁺, equilibrium.
        drop_equilibrium: usize,
    },
}

/// The fully extended form with nothing left out.
pub const FULLY_EXTENDED: Form = Form::FullyExtended { drop_compatibility: 0, drop_equilibrium: 0 };

/// The reason why models cannot be mixed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SemmError {
    /// The overlay has a name that the parent lacks, or a matrix is invalid.
    #[error(transparent)]
    Frf(#[from] FrfError),
    /// Parent and overlay are on different lines, in different quantities, or under different
    /// windows.
    #[error("overlay and parent differ in {0}: mix FRFs of the same lines, quantity and window only")]
    Unlike(&'static str),
    /// The overlay's shape does not match the given rows and columns.
    #[error(
        "the overlay is {rows} × {columns}, but {outputs} outputs and {inputs} inputs of the parent were named"
    )]
    Shape {
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Rows named.
        outputs: usize,
        /// Columns named.
        inputs: usize,
    },
    /// The parent cannot distinguish the measured points.
    #[error("{0}; or leave out its smallest singular values")]
    Singular(#[from] RankLost),
    /// Only rounding, or nothing, would remain of an inverse.
    #[error(
        "with {dropped} of {all} singular values left out, {left} remain that are above rounding errors: leave out fewer, or others"
    )]
    Truncation {
        /// Number to be left out.
        dropped: usize,
        /// Number of singular values.
        all: usize,
        /// Number of usable ones among those that remain.
        left: usize,
    },
}

/// Mixes one line: `parent` (g × g'), and `overlay` measured at its rows `outputs` and columns
/// `inputs`.
///
/// # Errors
/// [`SemmError`]: shapes, or a parent without the rank that the form needs.
pub fn mix(
    parent: &Line,
    overlay: &Line,
    outputs: &[usize],
    inputs: &[usize],
    form: Form,
) -> Result<Line, SemmError> {
    if overlay.shape() != (outputs.len(), inputs.len()) {
        let (rows, columns) = overlay.shape();
        return Err(SemmError::Shape { rows, columns, outputs: outputs.len(), inputs: inputs.len() });
    }
    let all = |n: usize| (0..n).collect::<Vec<usize>>();
    let rows_b = block(parent, outputs, &all(parent.ncols()));
    let columns_b = block(parent, &all(parent.nrows()), inputs);
    let removed = block(parent, outputs, inputs);
    let change = &removed - overlay;
    Ok(match form {
        Form::Basic => {
            let inverse = full_rank_inverse(&removed, "the parent at the measured points")?;
            parent - columns_b * &inverse * change * &inverse * rows_b
        }
        Form::FullyExtended { drop_compatibility, drop_equilibrium } => {
            let left =
                pseudo_inverse(&rows_b, drop_compatibility, "the parent's rows at the measured outputs")?;
            let right =
                pseudo_inverse(&columns_b, drop_equilibrium, "the parent's columns at the measured inputs")?;
            parent - parent * left * change * right * parent
        }
    })
}

/// Mixes all lines; the overlay's outputs and inputs are found among the parent's by name.
///
/// # Errors
/// [`SemmError`].
pub fn semm(parent: &Frf, overlay: &Frf, form: Form) -> Result<Frf, SemmError> {
    if parent.frequency_hz() != overlay.frequency_hz() {
        return Err(SemmError::Unlike("lines"));
    }
    if parent.quantity() != overlay.quantity() {
        return Err(SemmError::Unlike("quantity"));
    }
    if parent.sigma_per_s() != overlay.sigma_per_s() {
        return Err(SemmError::Unlike("window"));
    }
    let places = |names: &[String], wanted: &[String], side| {
        wanted
            .iter()
            .map(|name| {
                names.iter().position(|n| n == name).ok_or_else(|| FrfError::MissingName {
                    side,
                    name: name.clone(),
                    available: names.join(", "),
                })
            })
            .collect::<Result<Vec<usize>, FrfError>>()
    };
    let outputs = places(parent.outputs(), overlay.outputs(), "parent's outputs")?;
    let inputs = places(parent.inputs(), overlay.inputs(), "parent's inputs")?;
    let lines = parent
        .lines()
        .par_iter()
        .zip(overlay.lines())
        .map(|(y, measured)| mix(y, measured, &outputs, &inputs, form))
        .collect::<Result<_, _>>()?;
    Ok(parent.with_values(lines)?)
}

/// The pseudo-inverse without the `dropped` smallest singular values; if `dropped` is 0, full rank
/// is required.
fn pseudo_inverse(a: &Line, dropped: usize, name: &'static str) -> Result<Line, SemmError> {
    if dropped == 0 {
        return Ok(full_rank_inverse(a, name)?);
    }
    let svd = a.clone().svd(true, true);
    let values = &svd.singular_values;
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|i, j| values[*j].total_cmp(&values[*i]));
    let kept = &order[..order.len().saturating_sub(dropped)];
    let usable = kept.iter().filter(|i| values[**i] > ROUNDING * values[order[0]]).count();
    let (Some(u), Some(v_t), true) = (&svd.u, &svd.v_t, usable == kept.len() && usable > 0) else {
        return Err(SemmError::Truncation { dropped, all: order.len(), left: usable });
    };
    let mut inverse = Line::zeros(a.ncols(), a.nrows());
    for &i in kept {
        inverse += v_t.row(i).adjoint() * u.column(i).adjoint() / Complex::from(values[i]);
    }
    Ok(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frf::MotionQuantity;
    use proptest::prelude::*;

    fn matrix(n: usize, v: &[f64], diagonal: f64) -> Line {
        Line::from_fn(n, n, |r, c| {
            let i = 2 * (r * n + c);
            Complex::new(v[i] + if r == c { diagonal } else { 0.0 }, v[i + 1])
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(8), ..ProptestConfig::default() })]

        /// An overlay equal to the parent changes nothing; any other one is reproduced where it was
        /// measured.
        #[test]
        fn the_hybrid_is_the_measurement_where_there_is_one(v in prop::collection::vec(-1.0..1.0f64, 50 + 18)) {
            let (parent, overlay) = (matrix(5, &v[..50], 3.0), matrix(3, &v[50..], 2.0));
            let at = [4, 0, 2];
            for form in [Form::Basic, FULLY_EXTENDED] {
                let same = mix(&parent, &block(&parent, &at, &at), &at, &at, form).expect("dominant diagonal");
                // condition numbers of these matrices stay below 1e3
                prop_assert!((&same - &parent).norm() < 1e-11 * parent.norm());
                let hybrid = mix(&parent, &overlay, &at, &at, form).expect("dominant diagonal");
                prop_assert!((block(&hybrid, &at, &at) - &overlay).norm() < 1e-10 * overlay.norm());
            }
        }

        /// With singular values left out, the correction has exactly the remaining rank.
        #[test]
        fn truncation_truncates(v in prop::collection::vec(-1.0..1.0f64, 50 + 18)) {
            let (parent, overlay) = (matrix(5, &v[..50], 3.0), matrix(3, &v[50..], 2.0));
            let at = [0, 1, 3];
            let rank = |drop_compatibility, drop_equilibrium| {
                let form = Form::FullyExtended { drop_compatibility, drop_equilibrium };
                let hybrid = mix(&parent, &overlay, &at, &at, form).expect("one is left");
                let values = (hybrid - &parent).svd(false, false).singular_values;
                values.iter().filter(|s| **s > 1e-11 * values.max()).count()
            };
            prop_assert_eq!([rank(0, 0), rank(1, 0), rank(0, 1), rank(2, 1)], [3, 2, 2, 1]);
            let none = Form::FullyExtended { drop_compatibility: 3, drop_equilibrium: 0 };
            prop_assert!(mix(&parent, &overlay, &at, &at, none).is_err());
        }
    }

    fn file(names: &[&str], y: Line) -> Frf {
        let names: Vec<String> = names.iter().map(|n| (*n).to_string()).collect();
        Frf::new(vec![100.0], 0.0, MotionQuantity::Velocity, names.clone(), names, vec![y])
            .expect("all agree")
    }

    #[test]
    fn points_are_found_by_name_and_what_does_not_fit_is_refused() {
        let v: Vec<f64> = (0..32).map(|i| f64::from(i * 7 % 11) / 11.0).collect();
        let parent = file(&["p", "q", "r", "s"], matrix(4, &v, 4.0));
        let overlay = file(&["r", "p"], matrix(2, &v, 2.0));
        let hybrid = semm(&parent, &overlay, Form::Basic).expect("regular");
        assert!((hybrid.lines()[0][(2, 0)] - overlay.lines()[0][(0, 1)]).norm() < 1e-12);
        let refused = |parent: &Frf, overlay: &Frf| {
            semm(parent, overlay, FULLY_EXTENDED).expect_err("refused").to_string()
        };
        let wrong = file(&["t", "p"], overlay.lines()[0].clone());
        assert!(refused(&parent, &wrong).contains("`t`"));
        let (outputs, inputs) = (overlay.outputs().to_vec(), overlay.inputs().to_vec());
        let lines = overlay.lines().to_vec();
        let wrong =
            Frf::new(vec![90.0], 0.0, MotionQuantity::Velocity, outputs, inputs, lines).expect("all agree");
        assert!(refused(&parent, &wrong).contains("lines"));
        let flat = file(&["p", "q", "r", "s"], Line::from_element(4, 4, Complex::from(1.0)));
        assert!(refused(&flat, &overlay).contains("rank 1"));
    }
}
