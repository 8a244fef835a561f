//! FRFs together with the labels of their file: the signed axes of each response and each force,
//! and the units of the values.
//!
//! Signed directions of labels: ±1, 2, 3 along x, y, z. A value is along its label's signed
//! direction; this module compares it with the direction that a plan or a geometry gives for the
//! same point.

use crate::frf::Frf;
use crate::substructuring::geometry::{Configuration, Point};

/// The label of an output or an input.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Label {
    /// The entity as written, which may include the axis (`1+X`); empty where there is none.
    pub entity: String,
    /// The name of the sensor or impact without the axis.
    pub name: String,
    /// ±1, 2, 3 along x, y, z; 0 where no axis is given.
    pub direction: i64,
}

/// FRFs read from a file. Responses are along positive axes: those along a negative axis had their
/// sign changed. A value is per force along the impact's direction, whose sign the label gives.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledFrf {
    /// The values in SI.
    pub frf: Frf,
    /// Labels of the outputs.
    pub outputs: Vec<Label>,
    /// Labels of the inputs.
    pub inputs: Vec<Label>,
    /// A one-line description of what was read: `mobility in (mm/s)/N, A1 along −z turned`.
    pub taken: String,
    /// What was left out, is missing or is uncertain.
    pub notes: Vec<String>,
}

impl LabelledFrf {
    /// FRFs of a file that gives no directions.
    pub fn unlabelled(frf: Frf, taken: String, notes: Vec<String>) -> Self {
        let labels = |names: &[String]| {
            let label = |name: &String| Label { name: name.clone(), ..Label::default() };
            names.iter().map(label).collect::<Vec<_>>()
        };
        let (outputs, inputs) = (labels(frf.outputs()), labels(frf.inputs()));
        LabelledFrf { frf, outputs, inputs, taken, notes }
    }

    /// Replaces the FRFs; outputs and inputs stay.
    #[must_use]
    pub fn with(self, frf: Frf) -> Self {
        LabelledFrf { frf, ..self }
    }

    /// Turns responses to positive axes; also returns which ones were turned.
    pub(super) fn turned_to_axes(mut self) -> (Self, Vec<(String, i64)>) {
        let is_turned: Vec<bool> =
            self.outputs.iter().map(|label| (-3..0).contains(&label.direction)).collect();
        let mut turned = Vec::new();
        for (label, _) in self.outputs.iter_mut().zip(&is_turned).filter(|(_, turned)| **turned) {
            turned.push((label.name.clone(), label.direction));
            label.direction = -label.direction;
        }
        let none = vec![false; self.inputs.len()];
        (LabelledFrf { frf: negated(self.frf, &is_turned, &none), ..self }, turned)
    }

    /// The FRFs along the directions and under the names of these points, with notes on what was
    /// turned or is uncertain. Outputs and inputs without a point stay as they are.
    ///
    /// # Errors
    /// A label and its point have different axes; the message names both.
    pub fn along(self, points: &Configuration) -> Result<(Frf, Vec<String>), String> {
        let (mut told, mut turned) = (Vec::new(), Vec::new());
        let (channels, impacts) = (points.output_names(), points.input_names());
        let (mut outputs, mut inputs) = (self.frf.outputs().to_vec(), self.frf.inputs().to_vec());
        let mut is_turned = [vec![false; outputs.len()], vec![false; inputs.len()]];
        for (row, label) in self.outputs.iter().enumerate() {
            let Some(at) = channel_of(&outputs[row], label, &channels, &points.channels) else { continue };
            outputs[row].clone_from(&channels[at]);
            // a channel that is named after its axis may have any direction
            let is_named = axis_name(label.direction).is_some_and(|axis| {
                channels[at].ends_with(&format!(":{}", axis.trim_start_matches(['+', '−'])))
            });
            is_turned[0][row] =
                look(label, &points.channels[at], is_named, "sensor", &mut told, &mut turned)?;
        }
        for (column, label) in self.inputs.iter().enumerate() {
            let named = [&inputs[column], &label.entity, &label.name];
            let Some(at) = named.iter().find_map(|name| impacts.iter().position(|own| own == *name)) else {
                continue;
            };
            inputs[column].clone_from(&impacts[at]);
            is_turned[1][column] = look(label, &points.impacts[at], false, "hammer", &mut told, &mut turned)?;
        }
        let [of_outputs, of_inputs] = is_turned;
        told.extend(turned_words(&turned));
        let frf = negated(self.frf, &of_outputs, &of_inputs);
        let frf = frf.renamed(outputs, inputs).map_err(|error| error.to_string())?;
        Ok((frf, told))
    }
}

/// Changes the sign of these outputs and inputs.
fn negated(frf: Frf, outputs: &[bool], inputs: &[bool]) -> Frf {
    if !outputs.contains(&true) && !inputs.contains(&true) {
        return frf;
    }
    frf.map_lines(|_, mut y| {
        for (column, of_column) in inputs.iter().enumerate() {
            for (row, of_row) in outputs.iter().enumerate() {
                if of_row != of_column {
                    y[(row, column)] = -y[(row, column)];
                }
            }
        }
    })
}

/// Finds the channel of an output: by its name, by the entity as written, by name and axis, or as
/// the only channel of its sensor along the label's axis.
fn channel_of(output: &str, label: &Label, names: &[String], channels: &[Point]) -> Option<usize> {
    let axis = axis_name(label.direction).map(|axis| axis.trim_start_matches(['+', '−']).to_owned());
    let with_axis = axis.map(|axis| format!("{}:{axis}", label.name));
    let called = [Some(output), Some(label.entity.as_str()), with_axis.as_deref()];
    called
        .into_iter()
        .flatten()
        .chain(std::iter::once(label.name.as_str()))
        .find_map(|name| names.iter().position(|own| own == name))
        .or_else(|| {
            let along = |(_, point): &(usize, &Point)| {
                point.name == label.name
                    && label.direction != 0
                    && matches!(beside(label.direction, point.direction), Beside::Same | Beside::Opposite)
            };
            let mut own = channels.iter().enumerate().filter(along);
            own.next().filter(|_| own.next().is_none()).map(|(at, _)| at)
        })
}

/// Whether the values of a label change their sign to match the direction of its point.
fn look(
    label: &Label,
    point: &Point,
    is_named: bool,
    what: &str,
    told: &mut Vec<String>,
    turned: &mut Vec<(String, i64)>,
) -> Result<bool, String> {
    let axis = axis_name(label.direction).unwrap_or_default();
    match beside(label.direction, point.direction) {
        Beside::Same => Ok(false),
        Beside::Opposite => {
            turned.push((point.name.clone(), label.direction));
            Ok(true)
        }
        Beside::Untold | Beside::Other if is_named => Ok(false),
        Beside::Untold => {
            told.push(format!(
                "{}: labelled {axis}, but no label can name its direction {}, which is used",
                point.description,
                vector_name(point.direction)
            ));
            Ok(false)
        }
        Beside::Other => Err(format!(
            "the label has the {what} {} along {axis}, the geometry along {}: correct one of them",
            point.name,
            vector_name(point.direction)
        )),
    }
}

/// A label's direction for messages, such as `+z`; `None` where it is not along an axis.
pub fn axis_name(direction: i64) -> Option<String> {
    let axis = ["x", "y", "z"].get(usize::try_from(direction.unsigned_abs()).ok()?.checked_sub(1)?)?;
    Some(format!("{}{axis}", if direction < 0 { '−' } else { '+' }))
}

/// A direction of a plan or a geometry for messages: `−z`, or its three numbers.
pub fn vector_name(direction: [f64; 3]) -> String {
    match along(direction) {
        Some(axis) => axis_name(axis).unwrap_or_default(),
        None => format!("({})", direction.map(|v| format!("{}", (v * 1e3).round() / 1e3)).join(", ")),
    }
}

/// Least component with which a direction of three printed digits counts as along an axis.
const ALONG: f64 = 0.999;

/// ±1, 2, 3 where a unit vector is along an axis, else `None`.
pub(super) fn along(direction: [f64; 3]) -> Option<i64> {
    let found = (1..).zip(direction).find(|(_, part)| part.abs() > ALONG);
    found.map(|(axis, part)| if part < 0.0 { -axis } else { axis })
}

/// How a label's direction relates to the direction of its point in a plan or a geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beside {
    /// The same direction, or the label has none.
    Same,
    /// The opposite: the value changes its sign.
    Opposite,
    /// The point's direction is along no axis and makes an angle over 60° with the label's axis. A
    /// label cannot express such a direction, so it must refer to the sensor's own axes.
    Untold,
    /// Another axis.
    Other,
}

/// Compares a label's direction with that of its point.
pub fn beside(label: i64, direction: [f64; 3]) -> Beside {
    let Some(part) =
        usize::try_from(label.unsigned_abs()).ok().and_then(|axis| direction.get(axis.checked_sub(1)?))
    else {
        return Beside::Same;
    };
    let part = if label < 0 { -part } else { *part };
    match part {
        0.5.. => Beside::Same,
        ..=-0.5 => Beside::Opposite,
        _ if along(direction).is_none() => Beside::Untold,
        _ => Beside::Other,
    }
}

/// `A1 along −z turned`; lists at most five names.
pub(super) fn turned_words(turned: &[(String, i64)]) -> Option<String> {
    let named = |(name, direction): &(String, i64)| match axis_name(*direction) {
        Some(axis) => format!("{name} along {axis}"),
        None => name.clone(),
    };
    let first: Vec<String> = turned.iter().take(5).map(named).collect();
    let more = turned.len().saturating_sub(first.len());
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!first.is_empty()).then(|| format!("{}{more} turned", first.join(", ")))
}

/// As [`vector_name`], for several directions.
pub(super) fn vector_names(all: &[[f64; 3]]) -> String {
    all.iter().map(|axis| vector_name(*axis)).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frf::MotionQuantity;
    use crate::substructuring::geometry::Grouping;
    use nalgebra::DMatrix;
    use num_complex::Complex;

    fn point(name: &str, description: &str, direction: [f64; 3]) -> Point {
        Point {
            name: name.into(),
            description: description.into(),
            grouping: Grouping::InterfaceA,
            position_m: [0.0; 3],
            direction,
        }
    }

    fn label(entity: &str, name: &str, direction: i64) -> Label {
        Label { entity: entity.into(), name: name.into(), direction }
    }

    /// A value of 1 + 0.5 i for every pair of input and output.
    fn ones(outputs: &[(&str, Label)], inputs: &[(&str, Label)]) -> LabelledFrf {
        let names =
            |all: &[(&str, Label)]| all.iter().map(|(name, _)| (*name).to_owned()).collect::<Vec<_>>();
        let labels = |all: &[(&str, Label)]| all.iter().map(|(_, label)| label.clone()).collect::<Vec<_>>();
        let line = DMatrix::from_element(outputs.len(), inputs.len(), Complex::new(1.0, 0.5));
        let frf =
            Frf::new(vec![1.0], 0.0, MotionQuantity::Velocity, names(outputs), names(inputs), vec![line]);
        LabelledFrf {
            frf: frf.expect("all agree"),
            outputs: labels(outputs),
            inputs: labels(inputs),
            taken: String::new(),
            notes: Vec::new(),
        }
    }

    fn signs(frf: &Frf) -> Vec<f64> {
        frf.lines()[0].transpose().iter().map(|v| v.re).collect()
    }

    const X: [f64; 3] = [1.0, 0.0, 0.0];
    const Z: [f64; 3] = [0.0, 0.0, 1.0];
    const DOWN: [f64; 3] = [0.0, 0.0, -1.0];

    #[test]
    fn values_are_turned_into_the_directions_of_the_points() {
        let points = Configuration {
            channels: vec![point("A1", "A1:x", X), point("A1", "A1:z", Z), point("L", "L", DOWN)],
            impacts: vec![point("AZ1", "AZ1", DOWN), point("AX1", "AX1", X)],
        };
        let read = ones(
            &[("A1:x", label("A1", "A1", -1)), ("A1:z", label("A1", "A1", 3)), ("L", label("L", "L", 3))],
            &[("AZ1", label("AZ1", "AZ1", 3)), ("AX1", label("AX1", "AX1", 1))],
        );
        let (read, turned) = read.turned_to_axes();
        assert_eq!(turned, [("A1".to_owned(), -1)]);
        assert_eq!(signs(&read.frf), [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0]);
        let (frf, told) = read.along(&points).expect("no contradiction");
        assert_eq!(signs(&frf), [1.0, -1.0, -1.0, 1.0, 1.0, -1.0]);
        assert_eq!(told, ["L along +z, AZ1 along +z turned"]);
    }

    #[test]
    fn names_are_found_by_entity_axis_or_as_the_only_channel() {
        let points = Configuration {
            channels: vec![
                point("A1", "A1:x", X),
                point("A1", "A1:z", Z),
                point("12", "12:1", Z),
                point("12", "12:2", X),
                point("2+X", "2+X", X),
            ],
            impacts: vec![point("1+Z", "1+Z", Z)],
        };
        let read = ones(
            &[
                ("A1", label("A1", "A1", 3)),
                ("12", label("12", "12", 1)),
                ("2", label("2+X", "2", 1)),
                ("elsewhere", label("elsewhere", "elsewhere", 2)),
            ],
            &[("1", label("1+Z", "1", 3))],
        );
        let (frf, _) = read.along(&points).expect("no contradiction");
        assert_eq!(frf.outputs(), ["A1:z", "12:2", "2+X", "elsewhere"]);
        assert_eq!((frf.inputs(), signs(&frf)), (&["1+Z".to_owned()][..], vec![1.0; 4]));
    }

    #[test]
    fn another_axis_than_the_points_is_refused_with_both_named() {
        let points = Configuration {
            channels: vec![point("L", "L", Z), point("S", "S", [0.6, 0.8, 0.0])],
            impacts: vec![point("AZ1", "AZ1", DOWN)],
        };
        let said = |output: Label, input: Label| {
            ones(&[(&output.name.clone(), output)], &[(&input.name.clone(), input)]).along(&points)
        };
        let good = label("AZ1", "AZ1", -3);
        let text = said(label("L", "L", 1), good.clone()).expect_err("x is not z");
        assert!(text.contains("sensor L") && text.contains("+x") && text.contains("+z"), "{text}");
        let text = said(label("L", "L", 3), label("AZ1", "AZ1", 2)).expect_err("y is not z");
        assert!(text.contains("hammer AZ1") && text.contains("+y") && text.contains("−z"), "{text}");
        let (_, told) = said(label("S", "S", 3), good).expect("no label can say it");
        assert!(told[0].contains("(0.6, 0.8, 0)"), "{told:?}");
    }
}
