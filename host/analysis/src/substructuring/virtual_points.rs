//! Any number of virtual points in one FRF matrix, each with its own modes; channels and impacts
//! that belong to none are passed through.

use super::geometry::{Configuration, Grouping, Point};
use super::idm::IdmSet;
use super::vpt::{self, Transformation, VptError, reduce_inputs, reduce_outputs};
use crate::frf::{Frf, FrfError};
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, Vector3};

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
    side("output", frf.outputs(), &known, &chosen, weights, vpt::responses)
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
        let found = vpt::impacts(points, origin, idms, weights)?;
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
