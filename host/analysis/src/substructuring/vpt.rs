//! The virtual point transformation: measured responses and impacts onto the interface's
//! deformation modes, of one virtual point, or of any number in one FRF matrix ([`transform`]):
//! each with its own modes, while channels and impacts that belong to none are passed through.
//!
//! Each response is a row of R_u, eᵀ \[I, −skew(r)\] for rigid modes (channel × degree of freedom),
//! each impact one of R_f. With weights W: T_u = (R_uᵀ W R_u)⁻¹ R_uᵀ W and T_f = W⁻¹ R_f (R_fᵀ W⁻¹
//! R_f)⁻¹, and Y_vp = T_u Y T_f (the paper's Sec. 2.4; van der Seijs et al.).

use super::geometry::{Configuration, Grouping, Point};
use super::idm::IdmSet;
use super::product::product;
use crate::frf::{Frf, FrfError};
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix, Vector3};

/// Length by which rotations are compared with translations, m: about the distance of the rig's
/// sensors from the contact. Without a length a condition number mixes metres with radians and
/// means nothing. The length affects only that number and the rounding, not the result.
pub const ROTATION_LENGTH_M: f64 = 0.040;

/// Scaled singular values below this fraction of the largest carry no information: at 40 mm this is
/// a displacement of 40 nm over the sensor's distance, far below any position's accuracy.
const RANK_FLOOR: f64 = 1e-6;

/// The reason why a set of channels or impacts cannot form a virtual point.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VptError {
    /// Too few points, or points that cannot distinguish two motions.
    #[error(
        "the {kind} ({names}) determine only {rank} of {needed} motions of the virtual point (scaled singular values {singular_values:.6?}): \
         add points off the line of the others, or use fewer IDMs"
    )]
    RankDeficient {
        /// `responses` or `impacts`.
        kind: &'static str,
        /// Names of the points.
        names: String,
        /// Number of motions determined.
        rank: usize,
        /// Number of motions required.
        needed: usize,
        /// Singular values of R with rotations scaled by [`ROTATION_LENGTH_M`].
        singular_values: Vec<f64>,
    },
    /// Weights must be positive, one per point.
    #[error("{kind}: {given} weights for {points} points, and each must be a positive number")]
    Weights {
        /// `responses` or `impacts`.
        kind: &'static str,
        /// Weights given.
        given: usize,
        /// Points given.
        points: usize,
    },
}

/// One side (responses or impacts) of a virtual point.
#[derive(Debug, Clone, PartialEq)]
pub struct Transformation {
    /// The modes.
    pub idms: IdmSet,
    /// R (point × degree of freedom): m per m, m per rad.
    pub r: DMatrix<f64>,
    /// For responses T_u (degree of freedom × point); for impacts T_f (point × degree of freedom).
    pub t: DMatrix<f64>,
    /// Condition number of R with rotations scaled by [`ROTATION_LENGTH_M`].
    pub condition: f64,
}

/// T_u of these channels about `virtual_point_m`; `weights` are the diagonal of W.
///
/// # Errors
/// [`VptError`] if the channels cannot distinguish the motions.
pub fn responses(
    channels: &[Point],
    virtual_point_m: Vector3<f64>,
    idms: IdmSet,
    weights: Option<&[f64]>,
) -> Result<Transformation, VptError> {
    let root = root_weights("responses", channels.len(), weights)?;
    let (r, plus, condition) = weighted_inverse("responses", channels, virtual_point_m, idms, &root)?;
    // T_u = (W½ R)⁺ W½
    let t = DMatrix::from_fn(plus.nrows(), plus.ncols(), |d, i| plus[(d, i)] * root[i]);
    Ok(Transformation { idms, r, t, condition })
}

/// T_f of these impacts about `virtual_point_m`; `weights` are the diagonal of W (a large weight
/// means little trust).
///
/// # Errors
/// [`VptError`] if the impacts cannot excite the motions independently.
pub fn impacts(
    points: &[Point],
    virtual_point_m: Vector3<f64>,
    idms: IdmSet,
    weights: Option<&[f64]>,
) -> Result<Transformation, VptError> {
    let root: Vec<f64> =
        root_weights("impacts", points.len(), weights)?.into_iter().map(|w| 1.0 / w).collect();
    let (r, plus, condition) = weighted_inverse("impacts", points, virtual_point_m, idms, &root)?;
    // T_f = W^-½ ((W^-½ R)⁺)ᵀ
    let t = DMatrix::from_fn(plus.ncols(), plus.nrows(), |i, d| plus[(d, i)] * root[i]);
    Ok(Transformation { idms, r, t, condition })
}

/// T_u Y: outputs reduced to the virtual point.
pub fn reduce_outputs(t_u: &DMatrix<f64>, y: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    product(t_u, y)
}

/// Y T_f: inputs reduced to the virtual point.
pub fn reduce_inputs(y: &DMatrix<Complex<f64>>, t_f: &DMatrix<f64>) -> DMatrix<Complex<f64>> {
    product(y, t_f)
}

fn root_weights(kind: &'static str, points: usize, weights: Option<&[f64]>) -> Result<Vec<f64>, VptError> {
    let Some(weights) = weights else { return Ok(vec![1.0; points]) };
    if weights.len() != points || weights.iter().any(|w| !w.is_finite() || *w <= 0.0) {
        return Err(VptError::Weights { kind, given: weights.len(), points });
    }
    Ok(weights.iter().map(|w| w.sqrt()).collect())
}

/// R, (diag(row_scale) R)⁺ and the scaled condition number.
fn weighted_inverse(
    kind: &'static str,
    points: &[Point],
    virtual_point_m: Vector3<f64>,
    idms: IdmSet,
    row_scale: &[f64],
) -> Result<(DMatrix<f64>, DMatrix<f64>, f64), VptError> {
    let dofs = idms.dofs();
    let r = DMatrix::from_fn(points.len(), dofs.len(), |i, d| {
        dofs[d].displacement(points[i].position() - virtual_point_m).dot(&points[i].direction())
    });
    let per_length: Vec<f64> = dofs.iter().map(|d| ROTATION_LENGTH_M.powi(-d.power_of_length())).collect();
    let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, d| row_scale[i] * r[(i, d)] * per_length[d]);
    let needed = dofs.len();
    let svd = scaled.clone().svd(true, true);
    let mut singular_values: Vec<f64> = svd.singular_values.iter().copied().collect();
    singular_values.sort_by(|a, b| b.total_cmp(a));
    let largest = singular_values.first().copied().unwrap_or(0.0);
    let rank = singular_values.iter().filter(|&&v| v > largest * RANK_FLOOR && v > 0.0).count();
    let deficient = |singular_values: Vec<f64>| VptError::RankDeficient {
        kind,
        names: points.iter().map(|p| p.description.as_str()).collect::<Vec<_>>().join(", "),
        rank,
        needed,
        singular_values,
    };
    if rank < needed {
        return Err(deficient(singular_values));
    }
    let condition = largest / singular_values[needed - 1];
    let Ok(mut plus) = svd.pseudo_inverse(0.0) else { return Err(deficient(singular_values)) };
    for (d, scale) in per_length.iter().enumerate() {
        plus.row_mut(d).scale_mut(*scale);
    }
    Ok((r, plus, condition))
}

/// One virtual point: its position, modes, outputs and inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct VirtualPoint {
    /// Its name; its degrees of freedom are named `name:x` and so on.
    pub name: String,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Its modes.
    pub idms: IdmSet,
    /// Names of its outputs; empty for a point of forces only.
    pub outputs: Vec<String>,
    /// Names of its inputs; empty for a point of motions only.
    pub inputs: Vec<String>,
}

impl VirtualPoint {
    /// A virtual point of all channels and impacts of one grouping.
    pub fn of_grouping(
        name: &str,
        position_m: [f64; 3],
        idms: IdmSet,
        points: &Configuration,
        grouping: Grouping,
    ) -> Self {
        let names = |points: &[Point], names: Vec<String>| {
            points.iter().zip(names).filter(|(p, _)| p.grouping == grouping).map(|(_, n)| n).collect()
        };
        VirtualPoint {
            name: name.into(),
            position_m,
            idms,
            outputs: names(&points.channels, points.output_names()),
            inputs: names(&points.impacts, points.input_names()),
        }
    }
}

/// Diagonals of W_u and W_f: one row for all lines, or one row per line, each with a positive
/// weight for every output or input of the matrix. A large W_u means more trust in a channel, a
/// large W_f less trust in an impact.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weights {
    /// \[line\]\[output\]; empty for equal weights.
    pub outputs: Vec<Vec<f64>>,
    /// \[line\]\[input\]; empty for equal weights.
    pub inputs: Vec<Vec<f64>>,
}

/// The reason why virtual points cannot be formed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VirtualPointsError {
    /// The matrix is invalid, or lacks a name.
    #[error(transparent)]
    Frf(#[from] FrfError),
    /// The points cannot determine the modes.
    #[error("virtual point `{name}`: {source}")]
    Vpt {
        /// Its name.
        name: String,
        /// Why.
        source: VptError,
    },
    /// The geometry has no such channel or impact.
    #[error("the geometry has no {kind} `{name}`, which virtual point `{point}` needs")]
    Unknown {
        /// `output` or `input`.
        kind: &'static str,
        /// The name.
        name: String,
        /// The virtual point.
        point: String,
    },
    /// One channel or impact belongs to two virtual points.
    #[error("{kind} `{name}` belongs to two virtual points: it may belong to only one")]
    Shared {
        /// `output` or `input`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// The number of weights does not match that of lines or names.
    #[error("the weights of the {side} are {rows} rows of {columns}, {lines} (or one) of {names} are needed")]
    Weights {
        /// `outputs` or `inputs`.
        side: &'static str,
        /// Rows given.
        rows: usize,
        /// Length of the first row with a wrong length, otherwise of the first row.
        columns: usize,
        /// Number of lines of the matrix.
        lines: usize,
        /// Number of names of the matrix.
        names: usize,
    },
}

/// One side of the matrix: the overall transformation, T_u (new × old) or T_f (old × new), and the
/// new names.
struct MatrixSide {
    t: DMatrix<f64>,
    names: Vec<String>,
}

/// Y_vp = T_u Y T_f of the whole matrix: the degrees of freedom of the virtual points in their
/// order, then the outputs and inputs that belong to none.
///
/// Names in matrix and geometry must agree. Weights may differ from line to line.
///
/// # Errors
/// [`VirtualPointsError`].
pub fn transform(
    frf: &Frf,
    geometry: &Configuration,
    virtual_points: &[VirtualPoint],
    weights: &Weights,
) -> Result<Frf, VirtualPointsError> {
    let fits = |side, given: &[Vec<f64>], names: usize| {
        let wrong = given.iter().find(|row| row.len() != names);
        if wrong.is_none() && [0, 1, frf.lines().len()].contains(&given.len()) {
            return Ok(());
        }
        let columns = wrong.or(given.first()).map_or(0, Vec::len);
        Err(VirtualPointsError::Weights { side, rows: given.len(), columns, lines: frf.lines().len(), names })
    };
    fits("outputs", &weights.outputs, frf.outputs().len())?;
    fits("inputs", &weights.inputs, frf.inputs().len())?;
    let outputs = |row: Option<&Vec<f64>>| outputs_side(frf, geometry, virtual_points, row);
    let inputs = |row: Option<&Vec<f64>>| inputs_side(frf, geometry, virtual_points, row);
    let (first_u, first_f) = (outputs(weights.outputs.first())?, inputs(weights.inputs.first())?);
    let lines = frf
        .lines()
        .par_iter()
        .enumerate()
        .map(|(l, y)| {
            let own = |all: &[Vec<f64>]| (l > 0 && all.len() > 1).then_some(l);
            let motions = match own(&weights.outputs) {
                Some(l) => reduce_outputs(&outputs(weights.outputs.get(l))?.t, y),
                None => reduce_outputs(&first_u.t, y),
            };
            Ok(match own(&weights.inputs) {
                Some(l) => reduce_inputs(&motions, &inputs(weights.inputs.get(l))?.t),
                None => reduce_inputs(&motions, &first_f.t),
            })
        })
        .collect::<Result<_, VirtualPointsError>>()?;
    let (frequency_hz, sigma_per_s) = (frf.frequency_hz().to_vec(), frf.sigma_per_s());
    Ok(Frf::new(frequency_hz, sigma_per_s, frf.quantity(), first_u.names, first_f.names, lines)?)
}

fn outputs_side(
    frf: &Frf,
    geometry: &Configuration,
    virtual_points: &[VirtualPoint],
    weights: Option<&Vec<f64>>,
) -> Result<MatrixSide, VirtualPointsError> {
    let known = (geometry.channels.as_slice(), geometry.output_names());
    let chosen: Vec<(&VirtualPoint, &[String])> =
        virtual_points.iter().map(|vp| (vp, vp.outputs.as_slice())).collect();
    side("output", frf.outputs(), &known, &chosen, weights, responses)
}

fn inputs_side(
    frf: &Frf,
    geometry: &Configuration,
    virtual_points: &[VirtualPoint],
    weights: Option<&Vec<f64>>,
) -> Result<MatrixSide, VirtualPointsError> {
    let known = (geometry.impacts.as_slice(), geometry.input_names());
    let chosen: Vec<(&VirtualPoint, &[String])> =
        virtual_points.iter().map(|vp| (vp, vp.inputs.as_slice())).collect();
    let transposed = |points: &[Point], origin, idms, weights: Option<&[f64]>| {
        let found = impacts(points, origin, idms, weights)?;
        Ok(Transformation { t: found.t.transpose(), ..found })
    };
    let side = side("input", frf.inputs(), &known, &chosen, weights, transposed)?;
    Ok(MatrixSide { t: side.t.transpose(), ..side })
}

/// One side as new × old.
fn side(
    kind: &'static str,
    names: &[String],
    known: &(&[Point], Vec<String>),
    chosen: &[(&VirtualPoint, &[String])],
    weights: Option<&Vec<f64>>,
    one: impl Fn(&[Point], Vector3<f64>, IdmSet, Option<&[f64]>) -> Result<Transformation, VptError>,
) -> Result<MatrixSide, VirtualPointsError> {
    let mut free = vec![true; names.len()];
    let mut rows: Vec<(String, Vec<(usize, f64)>)> = Vec::new();
    for (vp, wanted) in chosen {
        if wanted.is_empty() {
            continue;
        }
        let (mut at, mut points) = (Vec::new(), Vec::new());
        for name in *wanted {
            let place = names.iter().position(|n| n == name).ok_or_else(|| FrfError::MissingName {
                side: if kind == "output" { "outputs" } else { "inputs" },
                name: name.clone(),
                available: names.join(", "),
            })?;
            let point = known.1.iter().position(|n| n == name).ok_or_else(|| {
                VirtualPointsError::Unknown { kind, name: name.clone(), point: vp.name.clone() }
            })?;
            if !std::mem::replace(&mut free[place], false) {
                return Err(VirtualPointsError::Shared { kind, name: name.clone() });
            }
            at.push(place);
            points.push(known.0[point].clone());
        }
        let own: Option<Vec<f64>> = weights.map(|w| at.iter().map(|i| w[*i]).collect());
        let found = one(&points, Vector3::from(vp.position_m), vp.idms, own.as_deref())
            .map_err(|source| VirtualPointsError::Vpt { name: vp.name.clone(), source })?;
        for (d, dof) in vp.idms.dofs().into_iter().enumerate() {
            let row = at.iter().enumerate().map(|(i, place)| (*place, found.t[(d, i)])).collect();
            rows.push((format!("{}:{dof}", vp.name), row));
        }
    }
    let rest = names.iter().enumerate().filter(|(i, _)| free[*i]);
    rows.extend(rest.map(|(i, name)| (name.clone(), vec![(i, 1.0)])));
    let mut t = DMatrix::zeros(rows.len(), names.len());
    for (r, (_, entries)) in rows.iter().enumerate() {
        for &(c, value) in entries {
            t[(r, c)] = value;
        }
    }
    Ok(MatrixSide { t, names: rows.into_iter().map(|(name, _)| name).collect() })
}

#[cfg(test)]
mod tests {
    use super::super::geometry::Grouping;
    use super::*;
    use proptest::prelude::*;

    fn point(position_m: [f64; 3], direction: [f64; 3]) -> Point {
        Point {
            name: "p".into(),
            description: "p".into(),
            grouping: Grouping::InterfaceA,
            position_m,
            direction,
        }
    }

    fn triaxial(positions: &[[f64; 3]]) -> Vec<Point> {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        positions.iter().flat_map(|&p| axes.map(|e| point(p, e))).collect()
    }

    #[test]
    fn two_triaxial_points_cannot_give_six_motions() {
        let two = triaxial(&[[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03]]);
        let error =
            responses(&two, Vector3::zeros(), IdmSet::Six, None).expect_err("rotation about the line");
        assert!(matches!(error, VptError::RankDeficient { rank: 5, needed: 6, .. }), "{error}");
        let three = triaxial(&[[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, 0.03]]);
        let t = responses(&three, Vector3::zeros(), IdmSet::Six, None).expect("three points do");
        assert!(t.condition > 1.0 && t.condition < 50.0, "condition {}", t.condition);
    }

    #[test]
    fn weights_must_fit() {
        let three = triaxial(&[[-0.02, 0.02, 0.03], [0.02, 0.02, 0.03], [0.0, 0.045, 0.03]]);
        assert!(responses(&three, Vector3::zeros(), IdmSet::Two, Some(&[1.0])).is_err());
        assert!(impacts(&three, Vector3::zeros(), IdmSet::Two, Some(&[0.0; 9])).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        /// T_u R_u = I and R_fᵀ T_f = I for any weights: a rigid motion is reproduced.
        #[test]
        fn transformations_are_left_inverses(
            v in prop::collection::vec(-0.05..0.05f64, 12),
            w in prop::collection::vec(0.1..10.0f64, 12),
        ) {
            let positions: Vec<[f64; 3]> = v.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
            let points = triaxial(&positions);
            let identity = DMatrix::<f64>::identity(6, 6);
            if let Ok(u) = responses(&points, Vector3::zeros(), IdmSet::Six, Some(&w)) {
                // rounding grows with the condition number
                prop_assert!((&u.t * &u.r - &identity).norm() < 1e-11 * u.condition);
            }
            if let Ok(f) = impacts(&points, Vector3::zeros(), IdmSet::Six, Some(&w)) {
                prop_assert!((f.r.transpose() * &f.t - &identity).norm() < 1e-11 * f.condition);
            }
        }
    }
}

#[cfg(test)]
mod virtual_points_tests {
    use super::super::idm::Dof;
    use super::*;
    use crate::frf::MotionQuantity;
    use nalgebra::Complex;

    const CORNERS: [[f64; 3]; 4] =
        [[0.01, 0.02, 0.03], [-0.02, 0.02, 0.01], [0.0, -0.03, 0.02], [0.02, 0.01, -0.03]];

    /// Triaxial sensors and hits at four corners around each of `origins`.
    fn around(origins: &[[f64; 3]]) -> Configuration {
        let axes = [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])];
        let mut points = Vec::new();
        for (o, origin) in origins.iter().enumerate() {
            for (c, corner) in CORNERS.iter().enumerate() {
                points.extend(axes.map(|(axis, direction)| Point {
                    name: format!("{o}{c}{axis}"),
                    description: format!("{o}{c}{axis}"),
                    grouping: Grouping::InterfaceA,
                    position_m: [0, 1, 2].map(|i| origin[i] + corner[i]),
                    direction,
                }));
            }
        }
        Configuration { channels: points.clone(), impacts: points }
    }

    fn plan(name: &str, origin: usize, origins: &[[f64; 3]], idms: IdmSet) -> VirtualPoint {
        let names: Vec<String> = around(origins).output_names();
        let own: Vec<String> = names.into_iter().filter(|n| n.starts_with(&origin.to_string())).collect();
        VirtualPoint {
            name: name.into(),
            position_m: origins[origin],
            idms,
            outputs: own.clone(),
            inputs: own,
        }
    }

    /// A matrix built from these motions of these points only is reproduced.
    #[test]
    fn three_points_with_modes_of_their_own_come_back() {
        let origins = [[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.7, 0.1]];
        let geometry = around(&origins);
        let flexible =
            IdmSet::of(&[Dof::X, Dof::Y, Dof::Z, Dof::Rx, Dof::Ry, Dof::Rz, Dof::Ez, Dof::Ty, Dof::Bxy])
                .expect("nine modes");
        let plans = [
            plan("one", 0, &origins, IdmSet::Six),
            plan("two", 1, &origins, flexible),
            plan("three", 2, &origins, IdmSet::of(&[Dof::X, Dof::Z, Dof::Ry]).expect("three modes")),
        ];
        let names = geometry.output_names();
        let dofs: Vec<(usize, Dof)> = plans
            .iter()
            .enumerate()
            .flat_map(|(p, plan)| plan.idms.dofs().into_iter().map(move |d| (p, d)))
            .collect();
        let r = DMatrix::from_fn(names.len(), dofs.len(), |i, d| {
            let (p, dof) = dofs[d];
            let point = &geometry.channels[i];
            if point.name.starts_with(&p.to_string()) {
                dof.displacement(point.position() - Vector3::from(origins[p])).dot(&point.direction())
            } else {
                0.0
            }
        })
        .map(Complex::from);
        let truth = DMatrix::from_fn(dofs.len(), dofs.len(), |i, j| {
            Complex::new(((3 * i + 5 * j) % 7) as f64, ((i + 2 * j) % 5) as f64)
        });
        let frf = Frf::new(
            vec![100.0, 101.0],
            0.0,
            MotionQuantity::Velocity,
            names.clone(),
            names.clone(),
            vec![&r * &truth * r.transpose(); 2],
        )
        .expect("all agree");
        let uneven =
            |line: usize| (0..names.len()).map(|i| 0.5 + ((i * 3 + line) % 4) as f64).collect::<Vec<f64>>();
        let weights = Weights { outputs: vec![uneven(0), uneven(1)], inputs: vec![uneven(2)] };
        for weights in [Weights::default(), weights] {
            let found = transform(&frf, &geometry, &plans, &weights).expect("enough points");
            assert_eq!(found.outputs()[..2], ["one:x".to_owned(), "one:y".to_owned()]);
            assert_eq!(found.inputs()[dofs.len() - 1], "three:ry");
            for line in found.lines() {
                // bending of unit size moves a corner by 5e-4: this many digits are lost on either
                // side
                assert!((line - &truth).norm() < 1e-8 * truth.norm(), "{}", (line - &truth).norm());
            }
        }
        // two points: the third's channels are passed through
        let two = transform(&frf, &geometry, &plans[..2], &Weights::default()).expect("enough points");
        assert_eq!((two.outputs().len(), two.inputs().len()), (6 + 9 + 12, 6 + 9 + 12));
        assert_eq!(two.lines()[0][(20, 20)], frf.lines()[0][(29, 29)]);
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        let origins = [[0.0; 3]];
        let geometry = around(&origins);
        let names = geometry.output_names();
        let frf = Frf::new(
            vec![100.0],
            0.0,
            MotionQuantity::Velocity,
            names.clone(),
            names.clone(),
            vec![DMatrix::zeros(names.len(), names.len())],
        )
        .expect("all agree");
        let one = plan("one", 0, &origins, IdmSet::Six);
        let refused = |points: &[VirtualPoint], weights: &Weights| {
            transform(&frf, &geometry, points, weights).expect_err("refused").to_string()
        };
        let even = Weights::default();
        assert!(refused(&[one.clone(), one.clone()], &even).contains("two virtual points"));
        let mut wrong = one.clone();
        wrong.inputs[0] = "nowhere".into();
        assert!(refused(&[wrong], &even).contains("`nowhere`"));
        let mut few = one.clone();
        few.outputs.truncate(5);
        let text = refused(&[few], &even);
        assert!(text.contains("`one`") && text.contains("of 6 motions"), "{text}");
        let short = Weights { outputs: vec![vec![1.0; 3]], inputs: vec![] };
        assert!(refused(&[one], &short).contains("1 rows of 3"));
    }
}
