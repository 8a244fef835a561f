//! FRF matrices in universal files: one function of type 4 for each pair of output and input.
//!
//! The response entity is the sensor, its direction (1, 2, 3) the axis: outputs are named `A1:x`
//! where a sensor has several axes, else `A1`. A value along a negative axis changes its sign. The
//! reference entity is the impact; its direction is signed, and the value is per force along it.
//! The ordinate's type is 8, 11 or 12 (receptance, mobility, accelerance), the denominator's 13;
//! labels and data set 164 give the units. The format has no field for the damping of an
//! exponential window, so it is in text 4 as `sigma 2.3 1/s`.

use super::labelled_frf::turned_words;
use super::labelled_frf::{Label, LabelledFrf};
use super::uff::{
    Abscissa, Axis, Contents, DataSet, Dof, Encoding, Function, Values, WriteError, kind, quantity, read_only,
};
use super::uff_axes::{Places, Scale, frequency_scale, frf_scale, with_units};
use super::units::StatedUnits;
use crate::frf::common_lines::{OtherLines, shared};
use crate::frf::{Frf, MotionQuantity};
use crate::{advice, untrusted_input};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Why FRFs could not be read from, or written to, a universal file.
#[derive(Debug, thiserror::Error)]
pub enum FrfUffError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}; {}", path.display(), advice::writing(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The contents are not an FRF matrix.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what is needed.
        reason: String,
    },
}

/// Reads the FRFs of a universal file into one matrix in SI, outputs and inputs in the order of
/// their first appearance. Missing pairs hold NaN. `stated` units override the file's.
///
/// # Errors
/// [`FrfUffError`] when there is no FRF, when units contradict one another or are not known, or
/// when FRFs differ in lines, quantity or damping.
pub fn read_frf_uff(path: &Path, stated: &StatedUnits) -> Result<LabelledFrf, FrfUffError> {
    from_contents(&contents(path)?, stated)
        .map_err(|reason| FrfUffError::Content { path: path.into(), reason })
}

/// Reads the functions of a universal file and its units; other data sets are skipped.
///
/// # Errors
/// [`FrfUffError::Open`] if the file cannot be read.
pub fn contents(path: &Path) -> Result<Contents, FrfUffError> {
    let bytes = untrusted_input::bytes(path, untrusted_input::UNIVERSAL)
        .map_err(|source| FrfUffError::Open { path: path.into(), source })?;
    Ok(read_only(&bytes, &[58, 164]))
}

/// An FRF of a file with the information from its axes.
struct FrfPart<'c> {
    function: &'c Function,
    values: &'c [Complex<f64>],
    scale: Scale,
    /// Index of its frequency axis among the distinct ones.
    axis: usize,
}

/// As [`read_frf_uff`], from contents that were read already.
///
/// # Errors
/// What is wrong, in words.
pub fn from_contents(contents: &Contents, stated: &StatedUnits) -> Result<LabelledFrf, String> {
    let mut notes = left_out(contents);
    let mut real = 0;
    let mut functions = Vec::new();
    for (f, system) in with_units(contents)?.into_iter().filter(|(f, _)| f.kind == kind::FRF) {
        match &f.values {
            Values::Complex(values) => functions.push((f, values.as_slice(), system)),
            Values::Real(_) => real += 1,
        }
    }
    if functions.is_empty() {
        let why = notes.first().map_or_else(String::new, |w| format!(" ({w})"));
        return Err(format!(
            "there is no complex FRF (data set 58 of function type 4) in it{why}: give an npz FRF file, or a universal file with FRFs"
        ));
    }
    if real > 0 {
        notes.push(format!("{real} functions of type 4 have real values, so they are not FRFs; left out"));
    }
    let labels =
        |of: fn(&Function) -> &Dof| -> Vec<Label> { functions.iter().map(|(f, ..)| label(of(f))).collect() };
    let (response_labels, reference_labels) = (labels(|f| &f.response), labels(|f| &f.reference));
    let (outputs, inputs) = (output_names(&response_labels), input_names(&reference_labels));
    let mut axes: Vec<(Places<'_>, usize)> = Vec::new();
    let mut parts: Vec<FrfPart<'_>> = Vec::new();
    let mut words: Vec<String> = Vec::new();
    for (at, (f, values, system)) in functions.iter().enumerate() {
        let of = |what: String| format!("the FRF from `{}` to `{}`: {what}", inputs[at], outputs[at]);
        let scale = frf_scale(f, system.as_ref(), stated).map_err(of)?;
        let (factor, frequency) = frequency_scale(&f.axes[0], stated).map_err(of)?;
        for word in std::iter::once(&scale.words).chain(&frequency) {
            if words.len() < MOST_WORDS && !words.contains(word) {
                words.push(word.clone());
            }
        }
        let places = Places::of(f, factor);
        let same = |(own, lines): &(Places<'_>, usize)| *lines == values.len() && own.are(&places);
        let axis = axes.iter().position(same).unwrap_or_else(|| {
            axes.push((places, values.len()));
            axes.len() - 1
        });
        if axes.len() > MOST_AXES {
            return Err(format!("its FRFs have more than {MOST_AXES} frequency axes: split the file"));
        }
        if let Some(note) = scale.note.as_ref().filter(|note| !notes.contains(note)) {
            notes.push(note.clone());
        }
        parts.push(FrfPart { function: f, values, scale, axis });
    }
    let (frequency_hz, kept) = common_axis(&axes, &mut notes).map_err(|(axis, apart)| {
        let at = parts.iter().position(|part| part.axis == axis).unwrap_or(0);
        format!(
            "the FRF from `{}` to `{}` has another frequency axis than the others ({} Hz against {} Hz): export them with the same lines",
            inputs[at], outputs[at], apart.other_hz, apart.one_hz
        )
    })?;
    let first = &parts[0];
    let (quantity, sigma_per_s) = (first.scale.quantity, sigma(first.function)?);
    let lines = frequency_hz.len();
    let ((rows, row_of), (columns, column_of)) = (distinct(&outputs), distinct(&inputs));
    // bounds memory: the matrix must not be mostly missing pairs
    let (pairs, there) = (rows.len().saturating_mul(columns.len()), parts.len());
    let bytes = (pairs.saturating_mul(16).saturating_add(LINE)).saturating_mul(lines);
    if bytes > OF_HOLES.saturating_mul(there * lines * 16).saturating_add(MOST_OF_FEW) {
        return Err(format!(
            "{there} FRFs of {lines} lines name {} outputs and {} inputs, a matrix that is mostly empty: split the file",
            rows.len(),
            columns.len()
        ));
    }
    let hole = Complex::new(f64::NAN, f64::NAN);
    let mut found = vec![DMatrix::from_element(rows.len(), columns.len(), hole); lines];
    let mut filled = DMatrix::from_element(rows.len(), columns.len(), false);
    let mut first_labels = (vec![None; rows.len()], vec![None; columns.len()]);
    for (at, FrfPart { function, values, scale, axis }) in parts.iter().enumerate() {
        let (input, output) = (&inputs[at], &outputs[at]);
        let differs = |what: &str| {
            Err(format!("the FRF from `{input}` to `{output}` has another {what} than the first"))
        };
        if scale.quantity != quantity {
            return differs("quantity");
        }
        if sigma(function)?.to_bits() != sigma_per_s.to_bits() {
            return differs("damping of the exponential window");
        }
        let (row, column) = (row_of[output.as_str()], column_of[input.as_str()]);
        if std::mem::replace(&mut filled[(row, column)], true) {
            return Err(format!(
                "there are two FRFs from `{input}` to `{output}`: keep one, or split the file"
            ));
        }
        let sides = (
            side(&mut first_labels.0[row], &response_labels[at]),
            side(&mut first_labels.1[column], &reference_labels[at]),
        );
        let (Some(of_response), Some(of_reference)) = sides else {
            return Err(format!(
                "the FRF from `{input}` to `{output}`: the labels of one of the two name different axes; give each axis a name of its own"
            ));
        };
        let sign = of_response * of_reference;
        let factor = sign * scale.factor;
        for (y, line) in found.iter_mut().zip(&kept[*axis]) {
            y[(row, column)] = factor * values[*line];
        }
    }
    let holes = filled.iter().filter(|there| !**there).count();
    if holes > 0 {
        notes.push(format!("{holes} of {} pairs of output and input are missing and hold NaN", filled.len()));
    }
    let (of_rows, of_columns) = first_labels;
    let labels = |all: Vec<Option<&Label>>| all.into_iter().flatten().cloned().collect::<Vec<_>>();
    let frf = Frf::new(frequency_hz, sigma_per_s, quantity, rows, columns, found);
    let read = LabelledFrf {
        frf: frf.map_err(|e| e.to_string())?,
        outputs: labels(of_rows),
        inputs: labels(of_columns),
        taken: String::new(),
        notes,
    };
    let (read, turned) = read.turned_to_axes();
    words.extend(turned_words(&turned));
    Ok(LabelledFrf { taken: words.join(", "), ..read })
}

/// The sign of a value relative to the first label of its sensor or impact, which is stored in
/// `known`; `None` where the two name different axes.
fn side<'l>(known: &mut Option<&'l Label>, own: &'l Label) -> Option<f64> {
    let first = known.get_or_insert(own).direction;
    match (first, own.direction) {
        (0, _) | (_, 0) => Some(1.0),
        (first, own) if first == own => Some(1.0),
        (first, own) if first == -own => Some(-1.0),
        _ => None,
    }
}

/// Most units, and most distinct frequency axes, of one file.
const MOST_WORDS: usize = 8;
const MOST_AXES: usize = 64;

/// Lines that several axes share, Hz, and the indices of these lines in each axis.
type CommonAxis = (Vec<f64>, Vec<Vec<usize>>);

/// The lines that all distinct axes share, Hz, with the values of the most precise axis, and for
/// each axis the indices of these lines. Lines left out are noted.
///
/// # Errors
/// An axis whose grid differs from that of the most precise one.
fn common_axis(
    axes: &[(Places<'_>, usize)],
    notes: &mut Vec<String>,
) -> Result<CommonAxis, (usize, OtherLines)> {
    let all: Vec<Vec<f64>> =
        axes.iter().map(|(places, lines)| (0..*lines).map(|i| places.at(i)).collect()).collect();
    let error = |axis: usize, line: usize| axes[axis].0.error(line);
    let last_error = |axis: &usize| error(*axis, axes[*axis].1.saturating_sub(1));
    let best = (0..axes.len()).min_by(|a, b| last_error(a).total_cmp(&last_error(b))).unwrap_or(0);
    let mut kept: Vec<Vec<Option<usize>>> = Vec::new();
    for axis in 0..axes.len() {
        if axis == best {
            kept.push((0..all[best].len()).map(Some).collect());
            continue;
        }
        let tolerance = |i: usize, j: usize| error(best, i) + error(axis, j) + 1e-9 * all[best][i].abs();
        let pairs = shared(&all[best], &all[axis], tolerance).map_err(|apart| (axis, apart))?;
        let mut own = vec![None; all[best].len()];
        for (line, place) in pairs {
            own[line] = Some(place);
        }
        kept.push(own);
    }
    let lines: Vec<usize> =
        (0..all[best].len()).filter(|line| kept.iter().all(|own| own[*line].is_some())).collect();
    if lines.is_empty()
        && let Some(axis) = (0..axes.len()).find(|axis| *axis != best)
    {
        let first = |axis: usize| all[axis].first().copied().unwrap_or(f64::NAN);
        return Err((axis, OtherLines { one_hz: first(best), other_hz: first(axis) }));
    }
    if axes.iter().any(|(_, own)| *own != lines.len()) {
        let counts: Vec<String> = axes.iter().map(|(_, own)| own.to_string()).collect();
        let at = |line: Option<&usize>| line.map_or(f64::NAN, |line| all[best][*line]);
        notes.push(format!(
            "its FRFs have {} lines: only the {} from {} to {} Hz that all have are used",
            counts.join(", "),
            lines.len(),
            at(lines.first()),
            at(lines.last())
        ));
    }
    let frequency_hz = lines.iter().map(|line| all[best][*line]).collect();
    let places = kept.iter().map(|own| lines.iter().filter_map(|line| own[*line]).collect()).collect();
    Ok((frequency_hz, places))
}

/// A matrix may take this many times the memory of its FRFs …
const OF_HOLES: usize = 2;
/// … plus this, bytes, for FRFs of a few lines.
const MOST_OF_FEW: usize = 16 << 20;
/// Bytes that the matrix of a line takes in addition to its values.
const LINE: usize = 64;

/// Most faults of a file that are listed one by one.
const MOST_TOLD: usize = 20;

/// Notes on what could not be read.
pub(super) fn left_out(contents: &Contents) -> Vec<String> {
    let faults = &contents.faults;
    let mut told: Vec<String> =
        faults.iter().take(MOST_TOLD).map(|fault| format!("{fault}; left out")).collect();
    if let Some(more @ 1..) = faults.len().checked_sub(MOST_TOLD) {
        told.push(format!("{more} more data sets could not be read and are left out"));
    }
    for outside in contents.outside.iter().take(MOST_TOLD) {
        told.push(format!(
            "text outside the data sets is ignored: {} lines from byte {}, beginning `{}`",
            outside.lines, outside.offset, outside.text
        ));
    }
    told
}

/// The distinct names in the order of their first appearance, and the index of each.
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

/// The label of a degree of freedom. An entity may end with its axis, as in `1+X`; the axis is then
/// removed from the name.
pub(super) fn label(dof: &Dof) -> Label {
    let entity = match dof.entity.trim() {
        "NONE" => "",
        entity => entity,
    };
    let own = Label { entity: entity.into(), name: entity.into(), direction: dof.direction };
    if entity.is_empty() {
        return Label { name: dof.node.to_string(), ..own };
    }
    let mut letters = entity.chars();
    let axis = letters.next_back().and_then(|letter| "xyz".find(letter.to_ascii_lowercase()));
    let sign = letters.next_back().filter(|sign| ['+', '-'].contains(sign));
    let name = letters.as_str().trim_end_matches([':', ' ']);
    let (Some(axis), Some(sign), false) = (axis, sign, name.is_empty()) else { return own };
    let axis = i64::try_from(axis).unwrap_or(0) + 1;
    match own.direction.saturating_abs() {
        0 => Label { name: name.into(), direction: if sign == '-' { -axis } else { axis }, ..own },
        same if same == axis => Label { name: name.into(), ..own },
        _ => own,
    }
}

/// Names of outputs: with the axis where a sensor has several.
fn output_names(labels: &[Label]) -> Vec<String> {
    let mut directions: HashMap<&str, (i64, bool)> = HashMap::new();
    for label in labels {
        let axis = label.direction.saturating_abs();
        let (first, several) = directions.entry(&label.name).or_insert((axis, false));
        *several |= *first != axis;
    }
    let name = |label: &Label| match label.direction.saturating_abs() {
        axis @ 1..=6 if directions[label.name.as_str()].1 => {
            format!("{}:{}", label.name, ["x", "y", "z", "rx", "ry", "rz"][axis as usize - 1])
        }
        _ => label.name.clone(),
    };
    labels.iter().map(name).collect()
}

/// Names of inputs: an impact that has several axes is named by its entity.
fn input_names(labels: &[Label]) -> Vec<String> {
    let mut axes: HashMap<&str, (i64, bool)> = HashMap::new();
    for label in labels {
        let axis = label.direction.saturating_abs();
        let (first, several) = axes.entry(&label.name).or_insert((axis, false));
        *several |= *first != axis;
    }
    let name = |label: &Label| {
        let entity = axes[label.name.as_str()].1 && !label.entity.is_empty();
        if entity { label.entity.clone() } else { label.name.clone() }
    };
    labels.iter().map(name).collect()
}

/// The damping in text 4, 1/s; 0 where there is none.
fn sigma(f: &Function) -> Result<f64, String> {
    let words: Vec<&str> = f.id[3].split_whitespace().collect();
    match words[..] {
        ["sigma", value, "1/s"] => value.parse().map_err(|_| format!("`{}` is not a damping", f.id[3])),
        _ => Ok(0.0),
    }
}

/// Converts FRFs to functions. `input_directions` holds the direction of each input (±1, 2, 3; 0
/// unknown). Outputs named `NAME:x` and so on become the sensor NAME with a direction.
///
/// # Errors
/// None at present. A name longer than the format's 10 characters is an error of [`write_uff`].
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

/// Sensor and direction in the name of an output.
fn split(name: &str) -> (&str, i64) {
    let axis = |axis: &str| (1..).zip(["x", "y", "z", "rx", "ry", "rz"]).find(|(_, a)| *a == axis);
    name.rsplit_once(':').and_then(|(sensor, a)| Some((sensor, axis(a)?.0))).unwrap_or((name, 0))
}

/// Writes data sets to a file.
///
/// # Errors
/// The data sets do not fit the format, or the file cannot be written.
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

    fn read_back(sets: &[DataSet]) -> Result<LabelledFrf, String> {
        from_contents(&read(&write(sets).expect("writable")), &StatedUnits::default())
    }

    #[test]
    fn a_matrix_comes_back_in_its_order_with_its_damping() {
        for encoding in [Encoding::Ascii, Encoding::Binary(ByteOrder::Big)] {
            let sets = to_functions(&frf(), &[-3, 1], encoding).expect("consistent");
            let back = read_back(&sets).expect("FRFs");
            assert_eq!((back.frf, back.notes), (frf(), vec![]));
            let along = |labels: &[Label]| labels.iter().map(|label| label.direction).collect::<Vec<_>>();
            assert_eq!((along(&back.outputs), along(&back.inputs)), (vec![1, 3, 0], vec![-3, 1]));
            assert_eq!(back.taken, "mobility: velocity in m/s, force in N");
        }
    }

    #[test]
    fn a_missing_pair_is_nan_and_said() {
        let mut sets = to_functions(&frf(), &[-3, 1], Encoding::Ascii).expect("consistent");
        sets.remove(1);
        let back = read_back(&sets).expect("FRFs");
        assert!(back.frf.check_finite().is_err() && back.notes[0].contains("1 of 6"), "{:?}", back.notes);
    }

    #[test]
    fn doubles_and_strangers_are_refused_by_name() {
        let mut sets = to_functions(&frf(), &[-3, 1], Encoding::Ascii).expect("consistent");
        sets.push(sets[0].clone());
        let error = |sets: &[DataSet]| read_back(sets).expect_err("refused");
        assert!(error(&sets).contains("two FRFs from `AZ1` to `A1:x`"), "{}", error(&sets));
        if let Some(DataSet::Function(f)) = sets.last_mut() {
            f.axes[1].quantity = quantity::FORCE;
        }
        assert!(error(&sets).contains("type 13"));
        assert!(error(&[]).contains("no complex FRF"));
    }

    /// The functions of a matrix, each changed.
    fn changed(mut change: impl FnMut(usize, &mut Function)) -> Vec<DataSet> {
        let mut sets =
            to_functions(&frf(), &[-3, 1], Encoding::Binary(ByteOrder::Little)).expect("consistent");
        for (at, set) in sets.iter_mut().enumerate() {
            if let DataSet::Function(f) = set {
                change(at, f);
            }
        }
        sets
    }

    fn scale(f: &mut Function, factor: f64) {
        if let Values::Complex(values) = &mut f.values {
            for v in values {
                *v *= factor;
            }
        }
    }

    fn near(found: &Frf, wanted: &Frf) {
        for (a, b) in found.lines().iter().flatten().zip(wanted.lines().iter().flatten()) {
            assert!((a - b).norm() <= 1e-9 * b.norm(), "{a} {b}");
        }
    }

    #[test]
    fn units_of_labels_and_of_the_file_are_applied_once() {
        let of_file = |length: f64| {
            let units = super::super::uff::Units { code: 9, length, ..super::super::uff::Units::si() };
            DataSet::Units(units)
        };
        let milli = |label: &'static str| {
            changed(move |_, f| {
                scale(f, 1e3);
                f.axes[1].unit = label.into();
            })
        };
        for sets in [
            milli("mm/s"),
            milli("(mm/s)/N"),
            [vec![of_file(1e3)], milli("mm/s")].concat(),
            [vec![of_file(1e3)], milli("")].concat(),
            // the data set 164 that precedes a function applies to it
            [vec![of_file(1.0)], milli("")[..0].to_vec(), vec![of_file(1e3)], milli("")].concat(),
        ] {
            let back = read_back(&sets).expect("read");
            near(&back.frf, &frf());
            assert!(back.taken.contains("mm/s") || back.taken.contains("data set 164"), "{}", back.taken);
        }
        let said = read_back(&[vec![of_file(1.0)], milli("mm/s")].concat()).expect_err("a contradiction");
        assert!(said.contains("`mm/s`") && said.contains("data set 164") && said.contains("`AZ1`"), "{said}");
        let turns = changed(|_, f| {
            f.axes[0].unit = "rad/s".into();
            f.abscissa =
                Abscissa::Even { start: std::f64::consts::TAU * 300.0, step: std::f64::consts::TAU * 20.0 };
        });
        let back = read_back(&turns).expect("read");
        assert!((back.frf.frequency_hz()[2] - 340.0).abs() < 1e-3, "{:?}", back.frf.frequency_hz());
        assert!(back.taken.contains("frequency in rad/s"), "{}", back.taken);
    }

    #[test]
    fn responses_are_turned_to_positive_axes_and_impacts_keep_their_own() {
        let sets = changed(|at, f| {
            if at % 3 == 1 {
                f.response.direction = -3;
                scale(f, -1.0);
            }
        });
        let back = read_back(&sets).expect("read");
        near(&back.frf, &frf());
        assert!(back.taken.contains("A1 along −z turned"), "{}", back.taken);
        // both signs within one file
        let sets = changed(|at, f| {
            if at == 1 || at == 3 {
                f.response.direction = -f.response.direction;
                scale(f, -1.0);
            }
            if at == 4 {
                f.reference.direction = -1;
                scale(f, -1.0);
            }
        });
        let back = read_back(&sets).expect("read");
        near(&back.frf, &frf());
        assert_eq!(back.inputs[1].direction, 1);
        let sets = changed(|at, f| f.reference.direction = if at == 1 { 2 } else { f.reference.direction });
        assert!(read_back(&sets).expect_err("two axes").contains("different axes"));
    }

    #[test]
    fn listed_and_even_lines_are_one_axis_and_bands_share_theirs() {
        let sets = changed(|at, f| {
            if at == 2 {
                f.abscissa = Abscissa::Uneven(vec![300.0, 320.0, 340.0]);
            }
        });
        let back = read_back(&sets).expect("one axis");
        assert_eq!((back.frf, back.notes), (frf(), vec![]));
        let sets = changed(|at, f| {
            if at == 2 {
                f.abscissa = Abscissa::Even { start: 320.0, step: 20.0 };
                if let Values::Complex(values) = &mut f.values {
                    values.remove(0);
                }
            }
        });
        let back = read_back(&sets).expect("common lines");
        assert_eq!(back.frf.frequency_hz(), [320.0, 340.0]);
        assert_eq!(back.frf.lines(), &frf().lines()[1..]);
        assert!(back.notes[0].contains("only the 2 from 320 to 340 Hz"), "{:?}", back.notes);
        let sets = changed(|at, f| {
            if at == 2 {
                f.abscissa = Abscissa::Even { start: 301.0, step: 20.0 };
            }
        });
        let said = read_back(&sets).expect_err("another grid");
        assert!(said.contains("another frequency axis") && said.contains("301 Hz against 300 Hz"), "{said}");
    }

    #[test]
    fn an_entity_may_name_its_axis() {
        let named = |entity: &str, direction: i64| {
            let label = label(&Dof { entity: entity.into(), node: 7, direction });
            (label.name, label.direction)
        };
        for (entity, direction, name, axis) in [
            ("1+X", 1, "1", 1),
            ("1:+Z", -3, "1", -3),
            ("plate 4-y", 0, "plate 4", -2),
            ("1+X", 3, "1+X", 3),
            ("AX", 1, "AX", 1),
            ("+X", 1, "+X", 1),
            ("NONE", 2, "7", 2),
            ("", 0, "7", 0),
        ] {
            assert_eq!(named(entity, direction), (name.to_owned(), axis), "{entity}");
        }
    }
}
