//! Writes modes: as npz with everything that is known of them, and as universal files (data set 55)
//! for programs that draw shapes.

use super::frf_uff::{FrfUffError, write_uff};
use super::npz::{NpzError, NpzOutput};
use super::uff::{DataSet, NodalData, Node};
use super::uff_output::start;
use crate::modes::{Mode, Modes, NoiseKnown, OutputPoint, Scaling};
use num_complex::Complex;
use std::path::Path;

/// Writes the modes as arrays: `frequency` and `frequency_std` (mode) Hz, `damping_ratio` and
/// `damping_ratio_std` (mode), `pole` (mode) 1/s and `pole_covariance` (mode, 2, 2) of its real and
/// imaginary part, `shape` (mode, output) and `participation` (mode, input), complex, each with
/// `_std` (…, 2) of real and imaginary part, `evidence` (mode), `outputs`, `inputs`, `scaling`,
/// `band`, `noise`, `chi2_per_dof`; `output_position` m and `output_direction` (output, 3) where
/// those of all outputs are known.
///
/// # Errors
/// [`NpzError::Write`].
pub fn write_npz(path: &Path, modes: &Modes, points: &[OutputPoint], scaling: &str) -> Result<(), NpzError> {
    let mut out = NpzOutput::create(path)?;
    let n = modes.modes.len();
    let (outputs, inputs) = (modes.outputs.len(), modes.inputs.len());
    let each = |value: fn(&Mode) -> f64| modes.modes.iter().map(value);
    out.real("frequency", &[n], each(|mode| mode.frequency_hz))?;
    out.real("frequency_std", &[n], each(|mode| mode.frequency_std_hz))?;
    out.real("damping_ratio", &[n], each(|mode| mode.damping_ratio))?;
    out.real("damping_ratio_std", &[n], each(|mode| mode.damping_ratio_std))?;
    out.complex("pole", &[n], modes.modes.iter().map(|mode| mode.pole_per_s))?;
    let covariances = modes.modes.iter().flat_map(|mode| mode.pole_covariance.as_flattened());
    out.real("pole_covariance", &[n, 2, 2], covariances)?;
    out.complex("shape", &[n, outputs], modes.modes.iter().flat_map(|mode| &mode.shape))?;
    let stds = modes.modes.iter().flat_map(|mode| mode.shape_std.as_flattened());
    out.real("shape_std", &[n, outputs, 2], stds)?;
    out.complex("participation", &[n, inputs], modes.modes.iter().flat_map(|mode| &mode.participation))?;
    let stds = modes.modes.iter().flat_map(|mode| mode.participation_std.as_flattened());
    out.real("participation_std", &[n, inputs, 2], stds)?;
    out.real("evidence", &[n], each(|mode| mode.evidence))?;
    out.text("outputs", &[outputs], &modes.outputs)?;
    out.text("inputs", &[inputs], &modes.inputs)?;
    out.text("scaling", &[], &[scaling.into()])?;
    out.real("band", &[2], [modes.band.low_hz, modes.band.high_hz])?;
    let noise = if modes.noise == NoiseKnown::Given { "given" } else { "estimated" };
    out.text("noise", &[], &[noise.into()])?;
    out.real("chi2_per_dof", &[], [modes.chi2_per_dof])?;
    let positions: Option<Vec<[f64; 3]>> = points.iter().map(|point| point.position_m).collect();
    let directions: Option<Vec<[f64; 3]>> = points.iter().map(|point| point.direction).collect();
    for (name, known) in [("output_position", positions), ("output_direction", directions)] {
        if let Some(all) = known {
            out.real(name, &[all.len(), 3], all.as_flattened())?;
        }
    }
    out.finish()
}

/// Writes the modes as a universal file: header, units, nodes (data set 2411) where their positions
/// are known, and one data set 55 for each mode, with the complex eigenvalue and the displacement
/// of each node along x, y and z. A direction that was not measured is zero. Sensors are numbered
/// from 1 in their order.
///
/// # Errors
/// An output has no direction, or the file cannot be written.
pub fn write_unv(path: &Path, modes: &Modes, points: &[OutputPoint], title: &str) -> Result<(), FrfUffError> {
    let content = |reason: String| FrfUffError::Content { path: path.into(), reason };
    let mut sensors: Vec<&str> = Vec::new();
    let (mut number_of, mut directions) = (Vec::new(), Vec::new());
    for (point, output) in points.iter().zip(&modes.outputs) {
        let Some(direction) = point.direction else {
            return Err(content(format!(
                "output `{output}` has no direction, without which its motion cannot be written as x, y and z: \
                 label it, as in `A1:z`, or write an .npz"
            )));
        };
        let at = sensors.iter().position(|name| *name == point.name).unwrap_or_else(|| {
            sensors.push(&point.name);
            sensors.len() - 1
        });
        number_of.push(at);
        directions.push(direction);
    }
    let mut sets = start();
    let position = |at: usize| number_of.iter().position(|n| *n == at).and_then(|o| points[o].position_m);
    let positions: Option<Vec<[f64; 3]>> = (0..sensors.len()).map(position).collect();
    if let Some(positions) = positions {
        let node = |(label, position)| Node {
            label,
            definition_system: 0,
            displacement_system: 0,
            color: 1,
            position,
        };
        sets.push(DataSet::NodesDouble((1..).zip(positions).map(node).collect()));
    }
    for (number, mode) in (1..).zip(&modes.modes) {
        let mut nodes: Vec<(i64, Vec<Complex<f64>>)> =
            (1..).zip(&sensors).map(|(label, _)| (label, vec![Complex::default(); 3])).collect();
        for ((at, direction), value) in number_of.iter().zip(&directions).zip(&mode.shape) {
            for (sum, along) in nodes[*at].1.iter_mut().zip(direction) {
                *sum += value * along;
            }
        }
        sets.push(DataSet::NodalData(of_mode(number, mode, title, nodes)));
    }
    write_uff(path, &sets)
}

/// The data set of one mode.
fn of_mode(number: i64, mode: &Mode, title: &str, nodes: Vec<(i64, Vec<Complex<f64>>)>) -> NodalData {
    let (scaled, modal_a) = match mode.scaling {
        Scaling::UnitModalA => ("modal A is 1, shape in sqrt(m/(N s))", 1.0),
        _ => ("largest component is 1, modal A is not known and written as 0", 0.0),
    };
    NodalData {
        id: [
            format!("mode {number} of {title}"),
            format!("frequency {:.6} Hz, damping ratio {:.6e}", mode.frequency_hz, mode.damping_ratio),
            format!("standard deviations {:.3e} Hz, {:.3e}", mode.frequency_std_hz, mode.damping_ratio_std),
            scaled.into(),
            String::new(),
        ],
        model: 1,
        analysis: 3,
        characteristic: 2,
        quantity: 8,
        integers: vec![1, number],
        reals: vec![mode.pole_per_s.re, mode.pole_per_s.im, modal_a, 0.0, 0.0, 0.0],
        is_complex: true,
        nodes,
    }
}
