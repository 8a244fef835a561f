//! FRFs in npz: `frequency` (line) Hz, `frf` (line, output, input), `quantity`, `outputs`,
//! `inputs`. Optional are `sigma`, the damping of the exponential window in 1/s (0 where it is
//! missing); `variance` of the real part of each value and `coherence`, both shaped like `frf`;
//! `unit` of the values, `unit_frequency`; and `output_direction`, `input_direction`: ±1, 2, 3
//! along x, y, z, 0 where unknown.

use super::labelled_frf::turned_words;
use super::labelled_frf::{Label, LabelledFrf};
use super::npz::NpzError;
use super::npz::NpzOutput;
use super::npz::{Array, NpzFile};
use super::units::{Dimension, StatedUnits, Unit};
use crate::frf::{COHERENCE_ROUNDING, Frf, MotionQuantity};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::path::Path;

/// Additional arrays of an FRF file under their own names, each (line, output) or (line, output,
/// input).
#[derive(Debug, Clone, PartialEq)]
pub enum Extra {
    /// Real, e.g. `coherence`, `variance`.
    Real(String, Array<f64>),
    /// Complex, e.g. `h2`, `hv`.
    Complex(String, Array<Complex<f64>>),
}

/// Bytes that the matrix of a line takes in addition to its values.
const LINE: u64 = 64;

/// Reads an FRF file in SI, with variance and coherence where it has them. Values may be NaN: they
/// are checked where a cell is used. A coherence of another shape than the FRFs' is ignored.
///
/// # Errors
/// [`NpzError`] naming the array that is missing or does not fit.
pub fn read_frf(path: &Path) -> Result<Frf, NpzError> {
    read_labelled(path, &StatedUnits::default()).map(|read| read.frf)
}

/// As [`read_frf`], together with the file's directions; `stated` units override the file's.
///
/// # Errors
/// As [`read_frf`]; also for units that are unknown or contradict the quantity.
pub fn read_labelled(path: &Path, stated: &StatedUnits) -> Result<LabelledFrf, NpzError> {
    let mut file = NpzFile::open(path)?;
    file.refuse_other_units(&["unit", "unit_frf", "unit_frequency"])?;
    let mut frequency_hz = file.real("frequency", "the frequency of each line, Hz")?.values;
    let outputs = file.text("outputs", "the names of the outputs")?.values;
    let inputs = file.text("inputs", "the names of the inputs")?.values;
    let word = file.word("quantity", "receptance, mobility or accelerance")?;
    let quantity = MotionQuantity::from_frf_name(&word).ok_or_else(|| {
        file.unexpected("quantity", &format!("is `{word}`"), "receptance, mobility or accelerance")
    })?;
    let sigma_per_s =
        if file.has("sigma") { file.number("sigma", "the exponential window's damping, 1/s")? } else { 0.0 };
    let (factor, mut taken) = frf_factor(&mut file, quantity, stated)?;
    if let Some(unit) = file.unit("unit_frequency", stated.frequency.as_deref(), Unit::of_frequency)? {
        for f in &mut frequency_hz {
            *f *= unit.factor;
        }
        taken = format!("{taken}, frequency in {}", unit.label);
    }
    let expected = format!(
        "shape (line, output, input) = ({}, {}, {}), complex",
        frequency_hz.len(),
        outputs.len(),
        inputs.len()
    );
    let mut frf = file.complex("frf", &expected)?;
    let (rows, columns) = (outputs.len(), inputs.len());
    if frf.shape != [frequency_hz.len(), rows, columns] {
        return Err(file.unexpected("frf", &format!("has shape {:?}", frf.shape), &expected));
    }
    file.charge("frf", frequency_hz.len(), LINE + 16 * (rows * columns) as u64, &expected)?;
    if factor != 1.0 {
        frf.values.iter_mut().for_each(|v| *v *= factor);
    }
    // `chunks` panics on length zero; an FRF without rows or columns has empty matrices
    let lines = if rows * columns == 0 {
        vec![DMatrix::zeros(rows, columns); frequency_hz.len()]
    } else {
        frf.values.chunks(rows * columns).map(|line| DMatrix::from_row_slice(rows, columns, line)).collect()
    };
    let mut whole = Frf::new(frequency_hz, sigma_per_s, quantity, outputs, inputs, lines)
        .map_err(|e| file.content(e.to_string()))?;
    let mut notes = Vec::new();
    if file.has("variance") {
        let (lines, rows, columns) = shape(&whole);
        let expected = format!("the variance of each value's real part, shape ({lines}, {rows}, {columns})");
        let mut array = file.real("variance", &expected)?;
        if !fits(&array, &whole) {
            return Err(file.unexpected("variance", &format!("has shape {:?}", array.shape), &expected));
        }
        file.charge("variance", lines, LINE + 8 * (rows * columns) as u64, &expected)?;
        if factor != 1.0 {
            array.values.iter_mut().for_each(|v| *v *= factor * factor);
        }
        whole =
            whole.with_variance(by_line(&array, rows, columns)).map_err(|e| file.content(e.to_string()))?;
        whole.check_variance().map_err(|e| file.content(e.to_string()))?;
    }
    if file.has("coherence")
        && let Ok(array) = file.real("coherence", "the coherence of each value")
        && fits(&array, &whole)
    {
        let expected = "the coherence of each value";
        file.charge("coherence", array.values.len() / (rows * columns), LINE, expected)?;
        let coherence = by_line(&array, rows, columns);
        let checked = whole.with_coherence(coherence).and_then(Frf::with_coherence_in_range);
        let (checked, rounded) = checked.map_err(|e| file.content(e.to_string()))?;
        whole = checked;
        if rounded > 0 {
            notes.push(format!(
                "{rounded} coherences are outside 0 to 1 by no more than {COHERENCE_ROUNDING}: they are set to the end of the range"
            ));
        }
    }
    let [outputs, inputs] = [
        directions(&mut file, "output_direction", whole.outputs())?,
        directions(&mut file, "input_direction", whole.inputs())?,
    ];
    let read = LabelledFrf { outputs, inputs, ..LabelledFrf::unlabelled(whole, String::new(), notes) };
    let (read, turned) = read.turned_to_axes();
    let taken = std::iter::once(taken).chain(turned_words(&turned)).collect::<Vec<_>>().join(", ");
    Ok(LabelledFrf { taken, ..read })
}

/// The factor from the values to SI, and a description of their unit.
fn frf_factor(
    file: &mut NpzFile,
    quantity: MotionQuantity,
    stated: &StatedUnits,
) -> Result<(f64, String), NpzError> {
    let motion = Dimension::of(quantity);
    let wanted = [motion.per_force(), motion, motion.rotating().per_force()];
    let parse = |label: &str| Unit::parse(label, &wanted);
    let array = if file.has("unit_frf") { "unit_frf" } else { "unit" };
    let own = file.unit(array, stated.response.as_deref(), parse)?;
    let force = stated.force.as_deref().and_then(|label| Unit::parse(label, &[Dimension::FORCE]).ok());
    let name = quantity.frf_name();
    let Some(own) = own else {
        let per = force.as_ref().map_or(1.0, |force| 1.0 / force.factor);
        let words = force.map_or_else(
            || format!("{name} in SI"),
            |force| format!("{name} in SI, force in {}", force.label),
        );
        return Ok((per, words));
    };
    match force {
        Some(force) if own.dimension == motion => {
            Ok((own.factor / force.factor, format!("{name}: {} per {}", own.label, force.label)))
        }
        Some(force) if (own.of_force * force.factor - 1.0).abs() > 1e-3 => Err(file.content(format!(
            "the values are in {} and the force is stated in {}: these are two units of force",
            own.label, force.label
        ))),
        _ if own.dimension == motion => Ok((own.factor, format!("{name}: {} per N", own.label))),
        _ => Ok((own.factor, format!("{name} in {}", own.label))),
    }
}

/// Labels with the directions of an array, one for each name.
fn directions(file: &mut NpzFile, array: &str, names: &[String]) -> Result<Vec<Label>, NpzError> {
    let expected = "±1, 2 or 3 along x, y or z for each name, 0 where it is unknown";
    let all = if file.has(array) { file.real(array, expected)?.values } else { vec![0.0; names.len()] };
    if all.len() != names.len() {
        return Err(file.unexpected(
            array,
            &format!("has {} values for {} names", all.len(), names.len()),
            expected,
        ));
    }
    let label = |(name, direction): (&String, f64)| {
        if direction.fract() != 0.0 || direction.abs() > 6.0 {
            return Err(file.unexpected(array, &format!("has {direction} for {name}"), expected));
        }
        let sensor = match name.rsplit_once(':') {
            Some((sensor, "x" | "y" | "z" | "rx" | "ry" | "rz")) => sensor,
            _ => name,
        };
        Ok(Label { entity: String::new(), name: sensor.into(), direction: direction as i64 })
    };
    names.iter().zip(all).map(label).collect()
}

/// The directions of a file's labels as additional arrays; empty where no label has one.
pub fn direction_arrays(read: &LabelledFrf) -> Vec<Extra> {
    let along = |labels: &[Label]| labels.iter().map(|label| label.direction).collect::<Vec<_>>();
    direction_extras(&along(&read.outputs), &along(&read.inputs))
}

/// Directions of outputs and inputs as additional arrays, where any is known.
pub fn direction_extras(outputs: &[i64], inputs: &[i64]) -> Vec<Extra> {
    let array = |name: &str, directions: &[i64]| {
        let values: Vec<f64> = directions.iter().map(|direction| *direction as f64).collect();
        let told = directions.iter().any(|direction| *direction != 0);
        told.then(|| Extra::Real(name.into(), Array { shape: vec![values.len()], values }))
    };
    [array("output_direction", outputs), array("input_direction", inputs)].into_iter().flatten().collect()
}

fn shape(frf: &Frf) -> (usize, usize, usize) {
    (frf.lines().len(), frf.outputs().len(), frf.inputs().len())
}

/// Whether there is one number for each value; FRFs of a single impact may omit the input axis.
fn fits(array: &Array<f64>, frf: &Frf) -> bool {
    let (lines, rows, columns) = shape(frf);
    let alike = array.shape == [lines, rows, columns] || (columns == 1 && array.shape == [lines, rows]);
    alike && rows * columns > 0
}

fn by_line(array: &Array<f64>, rows: usize, columns: usize) -> Vec<DMatrix<f64>> {
    array.values.chunks(rows * columns).map(|line| DMatrix::from_row_slice(rows, columns, line)).collect()
}

/// Writes an FRF file with its coherence and variance where known, and additional arrays.
///
/// # Errors
/// [`NpzError::Write`].
pub fn write_frf(path: &Path, frf: &Frf, extras: &[Extra]) -> Result<(), NpzError> {
    // not compressed: FRF values use all their bits, and two of three files would grow
    let mut out = NpzOutput::create(path)?.unpacked();
    out.real("frequency", &[frf.frequency_hz().len()], frf.frequency_hz())?;
    let (lines, rows, columns) = shape(frf);
    out.complex("frf", &[lines, rows, columns], in_c_order(frf.lines()))?;
    out.text("quantity", &[], &[frf.quantity().frf_name().into()])?;
    out.text("outputs", &[frf.outputs().len()], frf.outputs())?;
    out.text("inputs", &[frf.inputs().len()], frf.inputs())?;
    out.real("sigma", &[], [frf.sigma_per_s()])?;
    for (name, known) in [("coherence", frf.coherence()), ("variance", frf.variance())] {
        if let Some(known) = known {
            out.real(name, &[lines, rows, columns], in_c_order(known))?;
        }
    }
    for extra in extras {
        match extra {
            Extra::Real(name, array) => out.real(name, &array.shape, &array.values)?,
            Extra::Complex(name, array) => out.complex(name, &array.shape, &array.values)?,
        }
    }
    out.finish()
}

/// (line, output, input) in C order: the matrices are stored by columns and read out by rows.
fn in_c_order<T: nalgebra::Scalar>(lines: &[DMatrix<T>]) -> impl Iterator<Item = &T> {
    lines.iter().flat_map(|y| {
        let rows = y.nrows();
        (0..rows).flat_map(move |row| y.as_slice().iter().skip(row).step_by(rows))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_frf_file_comes_back_with_its_extras() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        let frf = Frf::new(
            vec![10.0, 20.0],
            2.3,
            MotionQuantity::Velocity,
            vec!["A1:x".into(), "A1:y".into(), "A1:z".into()],
            vec!["AZ1".into(), "AZ2".into()],
            (0..2)
                .map(|l| DMatrix::from_fn(3, 2, |r, c| Complex::new(l as f64, (10 * r + c) as f64)))
                .collect(),
        )
        .expect("all agree");
        let coherence = Array { shape: vec![2, 3], values: vec![1.0; 6] };
        write_frf(&path, &frf, &[Extra::Real("coherence".into(), coherence)]).expect("written");
        assert_eq!(read_frf(&path).expect("read"), frf);
        assert!(NpzFile::open(&path).expect("open").has("coherence"));
    }

    /// A small file with the required arrays and those that `write` adds.
    fn with(path: &Path, quantity: &str, write: impl FnOnce(&mut NpzOutput)) {
        let mut out = NpzOutput::create(path).expect("writable");
        out.real("frequency", &[2], [1.0, 2.0]).expect("written");
        out.text("outputs", &[1], &["A1:z".into()]).expect("written");
        out.text("inputs", &[1], &["f".into()]).expect("written");
        out.text("quantity", &[], &[quantity.into()]).expect("written");
        out.complex("frf", &[2, 1, 1], [Complex::new(1.0, 0.5); 2]).expect("written");
        write(&mut out);
        out.finish().expect("closed");
    }

    #[test]
    fn units_and_directions_of_the_file_are_applied() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        for (quantity, unit, factor) in [
            ("mobility", "(mm/s)/N", 1e-3),
            ("mobility", "mm/s", 1e-3),
            ("accelerance", "g/lbf", 9.80665 / 4.448_221_615_260_5),
            ("receptance", "µm/N", 1e-6),
        ] {
            with(&path, quantity, |out| {
                out.text("unit", &[], &[unit.into()]).expect("written");
                out.text("unit_frequency", &[], &["kHz".into()]).expect("written");
                out.real("output_direction", &[1], [-3.0]).expect("written");
                out.real("input_direction", &[1], [-1.0]).expect("written");
                out.real("variance", &[2, 1, 1], [4.0, 4.0]).expect("written");
            });
            let read = read_labelled(&path, &StatedUnits::default()).expect(unit);
            assert!((read.frf.lines()[1][(0, 0)].re / -factor - 1.0).abs() < 1e-12, "{unit}");
            assert!(
                (read.frf.variance().expect("told")[0][(0, 0)] / (4.0 * factor * factor) - 1.0).abs() < 1e-12
            );
            assert_eq!(read.frf.frequency_hz(), [1e3, 2e3]);
            assert_eq!((read.outputs[0].direction, read.inputs[0].direction), (3, -1));
            assert!(
                read.taken.contains("kHz") && read.taken.ends_with("A1 along −z turned"),
                "{}",
                read.taken
            );
            let stated = "response=m/s".parse().expect("a unit");
            assert_eq!(read_labelled(&path, &stated).is_ok(), quantity == "mobility", "{unit}");
        }
        for (array, text, part) in [
            ("unit", "m/s^2", "a mobility"),
            ("unit", "V/N", "electrical"),
            ("units", "m/s", "units are read from"),
        ] {
            with(&path, "mobility", |out| out.text(array, &[], &[text.into()]).expect("written"));
            let said = read_frf(&path).expect_err("refused").to_string();
            assert!(said.contains(array) && said.contains(part), "{said}");
        }
        with(&path, "mobility", |out| out.real("input_direction", &[1], [0.5]).expect("written"));
        assert!(read_frf(&path).expect_err("no axis").to_string().contains("`input_direction` has 0.5"));
    }

    #[test]
    fn a_coherence_above_one_is_refused_and_a_rounded_one_said() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        let coherent = |value: f64| {
            with(&path, "mobility", |out| out.real("coherence", &[2, 1], [0.5, value]).expect("written"));
            read_labelled(&path, &StatedUnits::default())
        };
        let said = coherent(1.246).expect_err("no coherence").to_string();
        for part in ["frf.npz", "coherence", "`f`", "`A1:z`", "2 Hz", "1.246"] {
            assert!(said.contains(part), "{said} lacks {part}");
        }
        let read = coherent(1.000_000_1).expect("rounding");
        assert_eq!(read.frf.coherence().expect("kept")[1][(0, 0)], 1.0);
        assert!(read.notes[0].contains("1 coherences"), "{:?}", read.notes);
    }

    #[test]
    fn a_wrong_shape_names_the_array() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.npz");
        let mut out = NpzOutput::create(&path).expect("writable");
        out.real("frequency", &[2], [1.0, 2.0]).expect("written");
        out.text("outputs", &[1], &["a".into()]).expect("written");
        out.text("inputs", &[1], &["f".into()]).expect("written");
        out.text("quantity", &[], &["mobility".into()]).expect("written");
        out.complex("frf", &[1, 1, 1], [Complex::new(0.0, 0.0)]).expect("written");
        out.finish().expect("closed");
        let text = read_frf(&path).expect_err("one line of two").to_string();
        assert!(text.contains("`frf`") && text.contains("(2, 1, 1)"), "{text}");
    }
}
