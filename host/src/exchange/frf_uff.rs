//! FRF matrices in universal files: one function of type 4 for each pair of output and input.
//!
//! The response entity is the sensor, its direction (1, 2, 3) the axis: outputs are called `A1:x` where a sensor has several, else `A1`.
//! The reference entity is the impact; its direction is signed, and the value stands as measured, not multiplied by that
//! sign. The ordinate's quantity is 8, 11 or 12 (receptance, mobility, accelerance). The damping of an exponential window, which the
//! format has no field for, is in text 4 as `sigma 2.3 1/s`.

use super::uff::{
    Abscissa, Axis, Contents, DataSet, Dof, Encoding, Function, Values, WriteError, kind, quantity,
    read_functions,
};
use crate::frf::{Frf, MotionQuantity};
use crate::{advice, foreign};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Why a universal file does not give FRFs.
#[derive(Debug, thiserror::Error)]
pub enum FrfUffError {
    /// The file cannot be read at all.
    #[error("{}: cannot be read: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}; {}", path.display(), advice::writing(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// What is in it is no FRF matrix.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what is needed.
        reason: String,
    },
}

/// Reads the FRFs of a universal file into one matrix, outputs and inputs in the order of their first appearance. The second
/// value says what was left out or is missing; missing pairs hold NaN.
///
/// # Errors
/// [`FrfUffError`] when there is no FRF, or they differ in lines, quantity or damping.
pub fn read_frf_uff(path: &Path) -> Result<(Frf, Vec<String>), FrfUffError> {
    from_contents(&contents(path)?).map_err(|reason| FrfUffError::Content { path: path.into(), reason })
}

/// The functions of a universal file; everything else in it is passed over.
///
/// # Errors
/// [`FrfUffError::Open`].
pub fn contents(path: &Path) -> Result<Contents, FrfUffError> {
    let bytes = foreign::bytes(path, foreign::UNIVERSAL)
        .map_err(|source| FrfUffError::Open { path: path.into(), source })?;
    Ok(read_functions(&bytes))
}

/// The same from what was read of a file.
///
/// # Errors
/// The reason in words.
pub fn from_contents(contents: &Contents) -> Result<(Frf, Vec<String>), String> {
    let mut warnings = left_out(contents);
    let functions: Vec<(&Function, &[Complex<f64>])> = contents
        .functions()
        .filter(|f| f.kind == kind::FRF)
        .filter_map(|f| match &f.values {
            Values::Complex(values) => Some((f, values.as_slice())),
            Values::Real(_) => None,
        })
        .collect();
    let Some((first, values)) = functions.first() else {
        let why = warnings.first().map_or_else(String::new, |w| format!(" ({w})"));
        return Err(format!(
            "there is no complex FRF (data set 58 of function type 4) in it{why}: give an npz FRF file, or a universal file with FRFs"
        ));
    };
    let quantity = quantity_of(first)?;
    let (lines, sigma_per_s) = (values.len(), sigma(first)?);
    let outputs = names(functions.iter().map(|(f, _)| (&f.response, true)));
    let inputs = names(functions.iter().map(|(f, _)| (&f.reference, false)));
    let ((rows, row_of), (columns, column_of)) = (distinct(&outputs), distinct(&inputs));
    // as many values as there are, or a matrix that is mostly holes
    let (pairs, there) = (rows.len().saturating_mul(columns.len()), functions.len());
    let bytes = (pairs.saturating_mul(16).saturating_add(LINE)).saturating_mul(lines);
    if bytes > OF_HOLES.saturating_mul(there * lines * 16).saturating_add(MOST_OF_FEW) {
        return Err(format!(
            "{there} FRFs of {lines} lines name {} outputs and {} inputs, a matrix that is mostly holes: split the file",
            rows.len(),
            columns.len()
        ));
    }
    let hole = Complex::new(f64::NAN, f64::NAN);
    let mut found = vec![DMatrix::from_element(rows.len(), columns.len(), hole); lines];
    let mut filled = DMatrix::from_element(rows.len(), columns.len(), false);
    for (((f, values), output), input) in functions.iter().zip(&outputs).zip(&inputs) {
        let differs = |what: &str| {
            Err(format!("the FRF from `{input}` to `{output}` has another {what} than the first"))
        };
        if values.len() != lines || f.abscissa != first.abscissa {
            return differs("frequency axis");
        }
        if quantity_of(f)? != quantity {
            return differs("quantity");
        }
        if sigma(f)?.to_bits() != sigma_per_s.to_bits() {
            return differs("damping of the exponential window");
        }
        let (row, column) = (row_of[output.as_str()], column_of[input.as_str()]);
        if std::mem::replace(&mut filled[(row, column)], true) {
            return Err(format!(
                "there are two FRFs from `{input}` to `{output}`: keep one, or split the file"
            ));
        }
        for (y, value) in found.iter_mut().zip(*values) {
            y[(row, column)] = *value;
        }
    }
    let holes = filled.iter().filter(|there| !**there).count();
    if holes > 0 {
        warnings
            .push(format!("{holes} of {} pairs of output and input are missing and hold NaN", filled.len()));
    }
    let frequency_hz = (0..lines).map(|i| first.abscissa.at(i)).collect();
    let frf = Frf::new(frequency_hz, sigma_per_s, quantity, rows, columns, found);
    let frf = frf.map_err(|e| e.to_string())?;
    Ok((frf, warnings))
}

/// A matrix may take so many times the memory of its FRFs …
const OF_HOLES: usize = 2;
/// … and of a few lines so much, bytes.
const MOST_OF_FEW: usize = 16 << 20;
/// Bytes of a line's matrix beside its values.
const LINE: usize = 64;

/// Most faults of a file that are told one by one.
const MOST_TOLD: usize = 20;

/// What could not be read, for people.
pub(super) fn left_out(contents: &Contents) -> Vec<String> {
    let faults = &contents.faults;
    let mut told: Vec<String> =
        faults.iter().take(MOST_TOLD).map(|fault| format!("{fault}; left out")).collect();
    if let Some(more @ 1..) = faults.len().checked_sub(MOST_TOLD) {
        told.push(format!("{more} more data sets could not be read and are left out"));
    }
    told
}

/// Names in the order in which they appear first, and where each stands in it.
fn distinct(names: &[String]) -> (Vec<String>, HashMap<&str, usize>) {
    let (mut order, mut place) = (Vec::new(), HashMap::new());
    for name in names {
        place.entry(name.as_str()).or_insert_with(|| {
            order.push(name.clone());
            order.len() - 1
        });
    }
    (order, place)
}

/// The names of DoFs: with the axis where `axes` is asked for and the entity has several directions.
fn names<'a>(dofs: impl Iterator<Item = (&'a Dof, bool)> + Clone) -> Vec<String> {
    let entity = |dof: &Dof| if dof.entity.is_empty() { dof.node.to_string() } else { dof.entity.clone() };
    let all: Vec<(String, i64, bool)> =
        dofs.map(|(dof, axes)| (entity(dof), dof.direction.saturating_abs(), axes)).collect();
    let mut directions: HashMap<&str, (i64, bool)> = HashMap::new();
    for (name, direction, _) in &all {
        let (first, several) = directions.entry(name).or_insert((*direction, false));
        *several |= first != direction;
    }
    all.iter()
        .map(|(name, direction, axes)| {
            let several = directions[name.as_str()].1;
            match direction {
                1..=6 if *axes && several => {
                    format!("{name}:{}", ["x", "y", "z", "rx", "ry", "rz"][*direction as usize - 1])
                }
                _ => name.clone(),
            }
        })
        .collect()
}

fn quantity_of(f: &Function) -> Result<MotionQuantity, String> {
    match f.axes[1].quantity {
        quantity::DISPLACEMENT => Ok(MotionQuantity::Displacement),
        quantity::VELOCITY => Ok(MotionQuantity::Velocity),
        quantity::ACCELERATION => Ok(MotionQuantity::Acceleration),
        other => Err(format!(
            "an FRF's ordinate is of type {other}: 8 (displacement), 11 (velocity) or 12 (acceleration) per force is needed"
        )),
    }
}

/// The damping that text 4 tells, 1/s; 0 where it tells none.
fn sigma(f: &Function) -> Result<f64, String> {
    let words: Vec<&str> = f.id[3].split_whitespace().collect();
    match words[..] {
        ["sigma", value, "1/s"] => value.parse().map_err(|_| format!("`{}` is no damping", f.id[3])),
        _ => Ok(0.0),
    }
}

/// The FRFs as functions. `input_directions` are the impacts' directions (±1, 2, 3; 0 unknown), one for each input. Outputs called
/// `NAME:x` and so on become the sensor NAME with a direction.
///
/// # Errors
/// The matrix contradicts itself, or a name is longer than the format's 10 characters (when written).
pub fn to_functions(frf: &Frf, input_directions: &[i64], encoding: Encoding) -> Result<Vec<DataSet>, String> {
    let (ordinate, label, unit) = match frf.quantity() {
        MotionQuantity::Displacement => (quantity::DISPLACEMENT, "Displacement", "m"),
        MotionQuantity::Velocity => (quantity::VELOCITY, "Velocity", "m/s"),
        MotionQuantity::Acceleration => (quantity::ACCELERATION, "Acceleration", "m/s^2"),
    };
    let axis = |quantity, label: &str, unit: &str| Axis {
        quantity,
        exponents: [0; 3],
        label: label.into(),
        unit: unit.into(),
    };
    let axes = [
        axis(quantity::FREQUENCY, "Frequency", "Hz"),
        axis(ordinate, label, unit),
        axis(quantity::FORCE, "Excitation Force", "N"),
        Axis::default(),
    ];
    let damping =
        if frf.sigma_per_s() == 0.0 { String::new() } else { format!("sigma {} 1/s", frf.sigma_per_s()) };
    let mut sensors: Vec<&str> = Vec::new();
    for (sensor, _) in frf.outputs().iter().map(|name| split(name)) {
        if !sensors.contains(&sensor) {
            sensors.push(sensor);
        }
    }
    let abscissa = Abscissa::of(frf.frequency_hz());
    let mut sets = Vec::with_capacity(frf.outputs().len() * frf.inputs().len());
    for ((column, input), node) in frf.inputs().iter().enumerate().zip(101..) {
        for (row, output) in frf.outputs().iter().enumerate() {
            let (sensor, direction) = split(output);
            let number = (1..).zip(&sensors).find(|(_, name)| **name == sensor).map_or(0, |(at, _)| at);
            let values = Values::Complex(frf.lines().iter().map(|y| y[(row, column)]).collect());
            let mut function = Function::new(kind::FRF, abscissa.clone(), values);
            function.id[0] = format!("{output} / {input}");
            function.id[3].clone_from(&damping);
            function.response = Dof { entity: sensor.into(), node: number, direction };
            let direction = input_directions.get(column).copied().unwrap_or(0);
            function.reference = Dof { entity: input.clone(), node, direction };
            function.axes.clone_from(&axes);
            function.encoding = encoding;
            sets.push(function.into());
        }
    }
    Ok(sets)
}

/// Sensor and direction of an output's name.
fn split(name: &str) -> (&str, i64) {
    let axis = |axis: &str| (1..).zip(["x", "y", "z", "rx", "ry", "rz"]).find(|(_, a)| *a == axis);
    name.rsplit_once(':').and_then(|(sensor, a)| Some((sensor, axis(a)?.0))).unwrap_or((name, 0))
}

/// Writes data sets to a file.
///
/// # Errors
/// What does not fit the format, or the disk's.
pub fn write_uff(path: &Path, sets: &[DataSet]) -> Result<(), FrfUffError> {
    let content = |e: WriteError| FrfUffError::Content { path: path.into(), reason: e.to_string() };
    let bytes = super::uff::write(sets).map_err(content)?;
    std::fs::write(path, bytes).map_err(|source| FrfUffError::Write { path: path.into(), source })
}

#[cfg(test)]
mod tests {
    use super::super::uff::{ByteOrder, read, write};
    use super::*;

    fn frf() -> Frf {
        Frf::new(
            vec![300.0, 320.0, 340.0],
            2.3,
            MotionQuantity::Velocity,
            vec!["A1:x".into(), "A1:z".into(), "A4".into()],
            vec!["AZ1".into(), "AX1".into()],
            (0..3)
                .map(|l| DMatrix::from_fn(3, 2, |r, c| Complex::new(l as f64 + 0.25, (10 * r + c) as f64)))
                .collect(),
        )
        .expect("all agree")
    }

    #[test]
    fn a_matrix_comes_back_in_its_order_with_its_damping() {
        for encoding in [Encoding::Ascii, Encoding::Binary(ByteOrder::Big)] {
            let sets = to_functions(&frf(), &[-3, 1], encoding).expect("consistent");
            let bytes = write(&sets).expect("writable");
            let (back, warnings) = from_contents(&read(&bytes)).expect("FRFs");
            assert_eq!((back, warnings), (frf(), vec![]));
        }
    }

    #[test]
    fn a_missing_pair_is_nan_and_said() {
        let mut sets = to_functions(&frf(), &[-3, 1], Encoding::Ascii).expect("consistent");
        sets.remove(1);
        let (back, warnings) = from_contents(&read(&write(&sets).expect("writable"))).expect("FRFs");
        assert!(back.check_finite().is_err() && warnings[0].contains("1 of 6"), "{warnings:?}");
    }

    #[test]
    fn doubles_and_strangers_are_refused_by_name() {
        let mut sets = to_functions(&frf(), &[-3, 1], Encoding::Ascii).expect("consistent");
        sets.push(sets[0].clone());
        let error =
            |sets: &[DataSet]| from_contents(&read(&write(sets).expect("writable"))).expect_err("refused");
        assert!(error(&sets).contains("two FRFs from `AZ1` to `A1:x`"), "{}", error(&sets));
        if let Some(DataSet::Function(f)) = sets.last_mut() {
            f.axes[1].quantity = quantity::FORCE;
        }
        assert!(error(&sets).contains("type 13"));
        assert!(error(&[]).contains("no complex FRF"));
    }
}
