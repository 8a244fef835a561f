//! Writes FRFs and records of a campaign as universal files: header, units, nodes and functions.

use super::frf_uff::{FrfUffError, to_functions, write_uff};
use super::uff::{
    Abscissa, Axis, ByteOrder, DataSet, Dof, Encoding, Function, Header, Node, Units, Values, kind, quantity,
};
use crate::frf::Frf;
use crate::hysteresis::{HysteresisRecord, RelativeMotion};
use crate::spectra::{ImpactRecords, MotionQuantity};
use crate::substructuring::geometry::{Configuration, Point};
use std::path::Path;

/// Compact, exact and supported by all readers.
const ENCODING: Encoding = Encoding::Binary(ByteOrder::Little);

/// Writes a configuration: its measured FRFs, their coherences where known, and its points as
/// nodes: sensors from 1, impacts from 101.
///
/// # Errors
/// The data does not fit the format, or the file cannot be written.
pub fn write_frf(path: &Path, frf: &Frf, points: &Configuration) -> Result<(), FrfUffError> {
    let directions: Vec<i64> = frf
        .inputs()
        .iter()
        .map(|name| points.impacts.iter().find(|p| p.name == *name).map_or(0, direction))
        .collect();
    let functions = to_functions(frf, &directions, ENCODING)
        .map_err(|reason| FrfUffError::Content { path: path.into(), reason })?;
    let mut sets = start();
    sets.push(DataSet::NodesDouble(nodes(points)));
    for (pair, function) in functions.into_iter().enumerate() {
        let (input, output) = (pair / frf.outputs().len(), pair % frf.outputs().len());
        let DataSet::Function(function) = function else { continue };
        let Values::Complex(values) = &function.values else { continue };
        // pairs that were not measured are left out; readers accept gaps
        if values.iter().any(|v| !v.re.is_finite() || !v.im.is_finite()) {
            continue;
        }
        let of_pair: Option<Vec<f64>> =
            frf.coherence().map(|all| all.iter().map(|line| line[(output, input)]).collect());
        if let Some(of_pair) = of_pair.filter(|all| all.iter().all(|v| v.is_finite())) {
            let coherence = Function {
                kind: kind::COHERENCE,
                values: Values::Real(of_pair),
                axes: [function.axes[0].clone(), Axis::default(), Axis::default(), Axis::default()],
                ..(*function).clone()
            };
            sets.push(coherence.into());
        }
        sets.push(DataSet::Function(function));
    }
    write_uff(path, &sets)
}

/// Writes the hits of a cell as time responses: the force, then the responses (along x, y, z where
/// there are three), one hit after another; the version is the hit's number, from 1.
///
/// # Errors
/// The data does not fit the format, or the file cannot be written.
pub fn write_records(
    path: &Path,
    records: &ImpactRecords,
    response: &str,
    impact: &str,
) -> Result<(), FrfUffError> {
    let (motion, unit) = match records.quantity {
        MotionQuantity::Displacement => (quantity::DISPLACEMENT, "m"),
        MotionQuantity::Velocity => (quantity::VELOCITY, "m/s"),
        MotionQuantity::Acceleration => (quantity::ACCELERATION, "m/s^2"),
    };
    let mut sets = start();
    for (version, (force_n, responses)) in (1..).zip(records.force_n.iter().zip(&records.response)) {
        let reference = Dof { entity: impact.into(), node: 101, direction: 0 };
        let function = |dof: Dof, values: &[f64], quantity: i64, unit: &str| {
            let id = format!("hit {}", version - 1);
            time_response((&id, version), [dof, reference.clone()], (values, records.fs_hz), (quantity, unit))
        };
        let at_impact = Dof { entity: impact.into(), node: 101, direction: 0 };
        sets.push(function(at_impact, force_n, quantity::FORCE, "N"));
        let three = responses.len() == 3;
        for (axis, x) in (1..).zip(responses) {
            let direction = if three { axis } else { 0 };
            sets.push(function(Dof { entity: response.into(), node: 1, direction }, x, motion, unit));
        }
    }
    write_uff(path, &sets)
}

/// Writes a level's record as time responses along z: specimen A (node 1), B (node 2), the
/// tangential force (node 3); the version is the level's number.
///
/// # Errors
/// The data does not fit the format, or the file cannot be written.
pub fn write_loop(path: &Path, record: &HysteresisRecord, level: i64) -> Result<(), FrfUffError> {
    let (a, b, motion) = match &record.motion {
        RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => {
            (a_m_per_s, b_m_per_s, (quantity::VELOCITY, "m/s"))
        }
        RelativeMotion::Displacement { a_m, b_m } => (a_m, b_m, (quantity::DISPLACEMENT, "m")),
    };
    let excitation = record.excitation_hz.map_or("sweep".into(), |f| format!("{f} Hz"));
    let id = format!("level {level}, {excitation}");
    let signals = [
        ("specimen_a", 1, a, motion),
        ("specimen_b", 2, b, motion),
        ("contact", 3, &record.force_n, (quantity::FORCE, "N")),
    ];
    let mut sets = start();
    sets.extend(signals.into_iter().map(|(entity, node, values, unit)| {
        let dof = Dof { entity: entity.into(), node, direction: 3 };
        time_response((&id, level), [dof.clone(), dof], (values, record.fs_hz), unit)
    }));
    write_uff(path, &sets)
}

/// One signal over time: (name, version), [response, reference], (values, sampling rate),
/// (quantity, unit).
fn time_response(
    (id, version): (&str, i64),
    [response, reference]: [Dof; 2],
    (values, fs_hz): (&[f64], f64),
    (quantity, unit): (i64, &str),
) -> DataSet {
    let axis = |quantity, unit: &str| Axis { quantity, unit: unit.into(), ..Axis::default() };
    let places: Vec<f64> = (0..values.len()).map(|i| i as f64 / fs_hz).collect();
    let mut function = Function::new(kind::TIME, Abscissa::of(&places), Values::Real(values.to_vec()));
    function.id[0] = id.into();
    function.version = version;
    (function.response, function.reference) = (response, reference);
    function.axes = [axis(quantity::TIME, "s"), axis(quantity, unit), Axis::default(), Axis::default()];
    function.encoding = ENCODING;
    function.into()
}

/// Header and units.
pub(super) fn start() -> Vec<DataSet> {
    let header = Header { program: "jointrig".into(), ..Header::default() };
    vec![DataSet::Header(header), DataSet::Units(Units::si())]
}

fn nodes(points: &Configuration) -> Vec<Node> {
    let mut sensors: Vec<&Point> = Vec::new();
    for channel in &points.channels {
        if !sensors.iter().any(|p| p.name == channel.name) {
            sensors.push(channel);
        }
    }
    let numbered = |points: Vec<&Point>, from: i64| {
        points
            .into_iter()
            .zip(from..)
            .map(|(point, label)| Node {
                label,
                definition_system: 0,
                displacement_system: 0,
                color: 1,
                position: point.position_m,
            })
            .collect::<Vec<_>>()
    };
    [numbered(sensors, 1), numbered(points.impacts.iter().collect(), 101)].concat()
}

/// ±1, 2, 3 where the direction is along an axis, 0 where it is oblique.
fn direction(point: &Point) -> i64 {
    (1..)
        .zip(point.direction)
        .find(|(_, along)| along.abs() == 1.0)
        .map_or(0, |(number, along)| if along < 0.0 { -number } else { number })
}
