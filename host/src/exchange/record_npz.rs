//! Time records in npz: impact records, and hysteresis records.

use super::npz::NpzError;
use super::npz::NpzFile;
use super::npz::NpzOutput;
use super::other_formats::{Contents, not_read_here};
use super::record_file::{Directions, RecordFile};
use super::units::{Dimension, StatedUnits, Unit};
use crate::hysteresis::{HysteresisRecord, RelativeMotion};
use crate::spectra::{ImpactRecords, MotionQuantity};
use std::path::Path;

/// Most hits of a file, and most channels of a hit: larger numbers mean that the axes are in the
/// wrong order.
pub(super) const MOST_HITS: usize = 10_000;
pub(super) const MOST_CHANNELS: usize = 1000;

/// Reads impact records: `fs` (Hz), `force` (hit, sample) N, `response` (hit, channel, sample) SI,
/// `quantity` = velocity | acceleration | displacement. A single hit may omit the hit axis, a
/// single channel the channel axis.
///
/// # Errors
/// [`NpzError`] naming the array that is missing or does not fit.
pub fn read_impacts(path: &Path) -> Result<ImpactRecords, NpzError> {
    read_records(path, &StatedUnits::default()).map(|read| read.records)
}

/// As [`read_impacts`], together with units and directions. `unit_force`, `unit_response` and
/// `unit_fs` may name other units; `stated` units override them.
///
/// # Errors
/// As [`read_impacts`]; also for units that are unknown or contradict the quantity.
pub fn read_records(path: &Path, stated: &StatedUnits) -> Result<RecordFile, NpzError> {
    let mut file = NpzFile::open(path)?;
    file.refuse_other_units(&["unit_force", "unit_response", "unit_fs"])?;
    let mut fs_hz = positive(&mut file, "fs", "the sampling rate, Hz (positive)")?;
    if let Some(unit) = file.unit("unit_fs", stated.frequency.as_deref(), Unit::of_frequency)? {
        fs_hz *= unit.factor;
    }
    let mut force = file.real("force", "the hammer force (hit, sample), N")?;
    let (hits, samples) = match force.shape[..] {
        [samples] => (1, samples),
        [hits, samples] => (hits, samples),
        _ => return Err(file.unexpected("force", &format!("has shape {:?}", force.shape), "(hit, sample)")),
    };
    if hits > MOST_HITS {
        let found = format!("has {hits} hits, at most {MOST_HITS} are read");
        return Err(file.unexpected("force", &found, "(hit, sample): is the first axis the hit?"));
    }
    let expected = format!("(hit, channel, sample) = ({hits}, channels, {samples})");
    let mut response = file.real("response", &expected)?;
    let channels = match response.shape[..] {
        [h, c, n] if h == hits && n == samples => c,
        [h, n] if h == hits && n == samples => 1,
        [c, n] if hits == 1 && n == samples => c,
        [n] if hits == 1 && n == samples => 1,
        _ => {
            return Err(file.unexpected("response", &format!("has shape {:?}", response.shape), &expected));
        }
    };
    if hits == 0 || samples == 0 || channels == 0 {
        return Err(file.content("there is no hit, no channel or no sample in it"));
    }
    if channels > MOST_CHANNELS {
        let found = format!("has {channels} channels, at most {MOST_CHANNELS} are read");
        return Err(file.unexpected(
            "response",
            &found,
            "(hit, channel, sample): is the second axis the channel?",
        ));
    }
    let word = file.word("quantity", "velocity, acceleration or displacement")?;
    let quantity = MotionQuantity::from_name(&word).ok_or_else(|| {
        file.unexpected("quantity", &format!("is `{word}`"), "velocity, acceleration or displacement")
    })?;
    let motion = Dimension::of(quantity);
    let of_response =
        file.unit("unit_response", stated.response.as_deref(), |label| Unit::parse(label, &[motion]))?;
    let of_force =
        file.unit("unit_force", stated.force.as_deref(), |label| Unit::parse(label, &[Dimension::FORCE]))?;
    for (unit, values) in [(&of_response, &mut response.values), (&of_force, &mut force.values)] {
        if let Some(unit) = unit {
            for v in &mut *values {
                *v *= unit.factor;
            }
        }
    }
    let word = |unit: &Option<Unit>, si: &str| {
        unit.as_ref().map_or_else(|| si.to_owned(), |unit| unit.label.clone())
    };
    let taken = format!(
        "{} in {}, force in {}",
        quantity.name(),
        word(&of_response, si_unit(quantity)),
        word(&of_force, "N")
    );
    let records = ImpactRecords {
        fs_hz,
        force_n: apart(force.values, samples),
        response: apart(response.values, samples * channels)
            .into_iter()
            .map(|hit| apart(hit, samples))
            .collect(),
        quantity,
    };
    Ok(RecordFile {
        records,
        delay_s: vec![0.0; channels],
        directions: Directions { force: 0, responses: vec![0; channels] },
        taken,
        notes: Vec::new(),
    })
}

/// The SI unit of a motion.
fn si_unit(quantity: MotionQuantity) -> &'static str {
    match quantity {
        MotionQuantity::Displacement => "m",
        MotionQuantity::Velocity => "m/s",
        MotionQuantity::Acceleration => "m/s²",
    }
}

/// Splits values into signals of `each` samples, from the last to the first, so that there is never
/// a second copy of all values.
fn apart(mut all: Vec<f64>, each: usize) -> Vec<Vec<f64>> {
    let mut signals = Vec::with_capacity(all.len().div_ceil(each));
    while !all.is_empty() {
        signals.push(all.split_off((all.len() - 1) / each * each));
        all.shrink_to_fit();
    }
    signals.reverse();
    signals
}

/// Writes impact records in the form that [`read_impacts`] reads.
///
/// # Errors
/// [`NpzError::Write`]; [`NpzError::Content`] when hits differ in length.
pub fn write_impacts(path: &Path, records: &ImpactRecords) -> Result<(), NpzError> {
    let content = |reason: &str| NpzError::Content { path: path.into(), reason: reason.into() };
    let hits = records.force_n.len();
    let samples = records.force_n.first().map_or(0, Vec::len);
    let channels = records.response.first().map_or(0, Vec::len);
    if records.response.len() != hits
        || records.force_n.iter().any(|f| f.len() != samples)
        || records.response.iter().any(|h| h.len() != channels || h.iter().any(|c| c.len() != samples))
    {
        return Err(content("every hit needs the same channels and the same number of samples"));
    }
    let mut out = NpzOutput::create(path)?;
    out.real("fs", &[], [records.fs_hz])?;
    out.real("force", &[hits, samples], records.force_n.iter().flatten())?;
    out.real("response", &[hits, channels, samples], records.response.iter().flatten().flatten())?;
    out.text("quantity", &[], &[records.quantity.name().into()])?;
    out.finish()
}

/// Reads a hysteresis record: `fs`, `velocity_a` and `velocity_b` (m/s) or `displacement_a` and
/// `displacement_b` (m), `force` (N) or `load_cells` (cell, sample; summed), optional `excitation`
/// (Hz) and `normal_load` (N). Other units may be named by `unit_velocity`, `unit_displacement`,
/// `unit_force` (also for the load) and `unit_fs`. The motions are taken as those of the contact
/// itself, unless `measured` is "beside the contact" ([`is_beside_the_contact`]).
///
/// # Errors
/// [`NpzError`] naming the array that is missing or does not fit.
pub fn read_hysteresis(path: &Path) -> Result<HysteresisRecord, NpzError> {
    if let Ok(Some(reason)) = not_read_here(path, Contents::Loop) {
        return Err(NpzError::Content { path: path.into(), reason });
    }
    let mut file = NpzFile::open(path)?;
    file.refuse_other_units(&["unit_force", "unit_velocity", "unit_displacement", "unit_fs"])?;
    let mut fs_hz = positive(&mut file, "fs", "the sampling rate, Hz (positive)")?;
    if let Some(unit) = file.unit("unit_fs", None, Unit::of_frequency)? {
        fs_hz *= unit.factor;
    }
    let velocities = file.has("velocity_a") || file.has("velocity_b");
    if velocities && (file.has("displacement_a") || file.has("displacement_b")) {
        return Err(file.content("it has both velocities and displacements: keep the pair that was measured"));
    }
    let names = if velocities || !file.has("displacement_a") {
        ["velocity_a", "velocity_b"]
    } else {
        ["displacement_a", "displacement_b"]
    };
    let expected = "the motion beside the contact (sample), velocity_* in m/s or displacement_* in m";
    let mut a = one_axis(&mut file, names[0], expected)?;
    let mut b = one_axis(&mut file, names[1], expected)?;
    let mut force_n = if file.has("force") {
        one_axis(&mut file, "force", "the tangential force (sample), N")?
    } else {
        let cells = file.real("load_cells", "the load cells (cell, sample), N, where there is no `force`")?;
        match cells.shape[..] {
            [n] | [1, n] if n > 0 => cells.values,
            [_, n] if n > 0 => {
                let mut sum = vec![0.0; n];
                for cell in cells.values.chunks(n) {
                    for (total, value) in sum.iter_mut().zip(cell) {
                        *total += value;
                    }
                }
                sum
            }
            _ => {
                return Err(file.unexpected(
                    "load_cells",
                    &format!("has shape {:?}", cells.shape),
                    "(cell, sample)",
                ));
            }
        }
    };
    if a.len() != b.len() || a.len() != force_n.len() || a.is_empty() {
        return Err(file.content(format!(
            "{} has {} samples, {} {} and the force {}: all three need the same number",
            names[0],
            a.len(),
            names[1],
            b.len(),
            force_n.len()
        )));
    }
    if let Some(at) = (0..a.len()).find(|&i| !(a[i] + b[i] + force_n[i]).is_finite()) {
        return Err(file.content(format!("sample {at} is not a number: cut the record before it")));
    }
    let excitation_hz = optional(&mut file, "excitation", "the excitation frequency, Hz (positive)")?;
    let mut normal_load_n = optional(&mut file, "normal_load", "the normal load, N (positive)")?;
    let (unit_motion, dimension) = if velocities {
        ("unit_velocity", Dimension::VELOCITY)
    } else {
        ("unit_displacement", Dimension::DISPLACEMENT)
    };
    if let Some(unit) = file.unit(unit_motion, None, |label| Unit::parse(label, &[dimension]))? {
        a.iter_mut().chain(&mut b).for_each(|v| *v *= unit.factor);
    }
    if let Some(unit) = file.unit("unit_force", None, |label| Unit::parse(label, &[Dimension::FORCE]))? {
        force_n.iter_mut().chain(&mut normal_load_n).for_each(|v| *v *= unit.factor);
    }
    let motion = if velocities {
        RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b }
    } else {
        RelativeMotion::Displacement { a_m: a, b_m: b }
    };
    Ok(HysteresisRecord { fs_hz, motion, force_n, excitation_hz, normal_load_n })
}

/// Writes a hysteresis record in the form that [`read_hysteresis`] reads (the force summed).
///
/// # Errors
/// [`NpzError::Write`].
pub fn write_hysteresis(path: &Path, record: &HysteresisRecord) -> Result<(), NpzError> {
    write_loop(path, record, None)
}

/// As [`write_hysteresis`], for a level of a rig, whose motions are measured next to the contact:
/// the array `measured` states this.
///
/// # Errors
/// [`NpzError::Write`].
pub fn write_level(path: &Path, record: &HysteresisRecord) -> Result<(), NpzError> {
    write_loop(path, record, Some(BESIDE))
}

/// Whether a file states that its motions were measured next to the contact.
///
/// # Errors
/// [`NpzError`] where it cannot be read, or `measured` has an unknown value.
pub fn is_beside_the_contact(path: &Path) -> Result<bool, NpzError> {
    let mut file = NpzFile::open(path)?;
    if !file.has("measured") {
        return Ok(false);
    }
    let word = file.word("measured", BESIDE)?;
    if word == BESIDE { Ok(true) } else { Err(file.unexpected("measured", &format!("is `{word}`"), BESIDE)) }
}

/// Value of `measured` for motions measured next to the contact.
const BESIDE: &str = "beside the contact";

fn write_loop(path: &Path, record: &HysteresisRecord, measured: Option<&str>) -> Result<(), NpzError> {
    let mut out = NpzOutput::create(path)?;
    if let Some(measured) = measured {
        out.text("measured", &[], &[measured.into()])?;
    }
    out.real("fs", &[], [record.fs_hz])?;
    let (names, a, b) = match &record.motion {
        RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => {
            (["velocity_a", "velocity_b"], a_m_per_s, b_m_per_s)
        }
        RelativeMotion::Displacement { a_m, b_m } => (["displacement_a", "displacement_b"], a_m, b_m),
    };
    out.real(names[0], &[a.len()], a)?;
    out.real(names[1], &[b.len()], b)?;
    out.real("force", &[record.force_n.len()], &record.force_n)?;
    if let Some(f) = record.excitation_hz {
        out.real("excitation", &[], [f])?;
    }
    if let Some(n) = record.normal_load_n {
        out.real("normal_load", &[], [n])?;
    }
    out.finish()
}

fn one_axis(file: &mut NpzFile, name: &str, expected: &str) -> Result<Vec<f64>, NpzError> {
    let array = file.real(name, expected)?;
    match array.shape[..] {
        [_] | [1, _] => Ok(array.values),
        _ => Err(file.unexpected(name, &format!("has shape {:?}", array.shape), expected)),
    }
}

fn positive(file: &mut NpzFile, name: &str, expected: &str) -> Result<f64, NpzError> {
    let value = file.number(name, expected)?;
    if value > 0.0 { Ok(value) } else { Err(file.unexpected(name, &format!("is {value}"), expected)) }
}

fn optional(file: &mut NpzFile, name: &str, expected: &str) -> Result<Option<f64>, NpzError> {
    if file.has(name) { positive(file, name, expected).map(Some) } else { Ok(None) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("records.npz");
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: vec![vec![0.0, 1.0, 0.0], vec![0.0, 2.0, 0.0]],
            response: vec![vec![vec![0.0, 0.5, 0.25]; 2]; 2],
            quantity: MotionQuantity::Velocity,
        };
        write_impacts(&path, &records).expect("written");
        assert_eq!(read_impacts(&path).expect("read"), records);

        let path = dir.path().join("loop.npz");
        let record = HysteresisRecord {
            fs_hz: 51_200.0,
            motion: RelativeMotion::Displacement { a_m: vec![0.0, 1e-6], b_m: vec![0.0, 0.0] },
            force_n: vec![1.0, 2.0],
            excitation_hz: Some(80.0),
            normal_load_n: None,
        };
        write_hysteresis(&path, &record).expect("written");
        assert_eq!(read_hysteresis(&path).expect("read"), record);
    }

    #[test]
    fn other_units_are_applied_and_unknown_ones_refused() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("records.npz");
        let write = |units: &[(&str, &str)]| {
            let mut out = NpzOutput::create(&path).expect("writable");
            out.real("fs", &[], [10.0]).expect("written");
            out.real("force", &[2], [1.0, 2.0]).expect("written");
            out.real("response", &[2], [3.0, 4.0]).expect("written");
            out.text("quantity", &[], &["velocity".into()]).expect("written");
            out.real("displacement_a", &[2], [3.0, 4.0]).expect("written");
            out.real("displacement_b", &[2], [0.0, 0.0]).expect("written");
            out.real("normal_load", &[], [5.0]).expect("written");
            for (name, unit) in units {
                out.text(name, &[], &[(*unit).into()]).expect("written");
            }
            out.finish().expect("closed");
        };
        let near =
            |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
        write(&[("unit_force", "lbf"), ("unit_response", "mm/s"), ("unit_fs", "kHz")]);
        let read = read_records(&path, &StatedUnits::default()).expect("units");
        near(read.records.force_n[0][1], 2.0 * 4.448_221_615_260_5);
        near(read.records.response[0][0][1], 4e-3);
        near(read.records.fs_hz, 1e4);
        assert_eq!(read.taken, "velocity in mm/s, force in lbf");
        let stated = "response=in/s,force=N".parse().expect("units");
        near(read_records(&path, &stated).expect("stated").records.response[0][0][1], 4.0 * 0.0254);

        write(&[("unit_force", "kN"), ("unit_displacement", "µm"), ("unit_fs", "Hz")]);
        let record = read_hysteresis(&path).expect("units");
        let RelativeMotion::Displacement { a_m, .. } = &record.motion else { panic!("{record:?}") };
        near(a_m[1], 4e-6);
        near(record.force_n[0], 1e3);
        near(record.normal_load_n.expect("told"), 5e3);

        for (units, part) in [
            (("unit_force", "mV"), "sensitivity"),
            (("unit_response", "m/s^2"), "a velocity is needed"),
            (("units", "mm/s"), "units are read from unit_force"),
            (("unit_force", "stone"), "`stone`"),
        ] {
            write(&[units]);
            let said = read_records(&path, &StatedUnits::default()).expect_err("refused").to_string();
            assert!(said.contains(units.0) && said.contains(part), "{said}");
        }
    }

    #[test]
    fn load_cells_are_summed() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("loop.npz");
        let mut out = NpzOutput::create(&path).expect("writable");
        out.real("fs", &[1], [100.0]).expect("written");
        out.real("velocity_a", &[2], [1.0, 2.0]).expect("written");
        out.real("velocity_b", &[2], [0.0, 0.0]).expect("written");
        out.real("load_cells", &[3, 2], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).expect("written");
        out.finish().expect("closed");
        assert_eq!(read_hysteresis(&path).expect("read").force_n, [9.0, 12.0]);
    }

    #[test]
    fn a_missing_force_and_unequal_lengths_are_named() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("loop.npz");
        let mut out = NpzOutput::create(&path).expect("writable");
        out.real("fs", &[], [100.0]).expect("written");
        out.real("velocity_a", &[2], [1.0, 2.0]).expect("written");
        out.real("velocity_b", &[3], [0.0, 0.0, 0.0]).expect("written");
        out.finish().expect("closed");
        assert!(read_hysteresis(&path).expect_err("no force").to_string().contains("load_cells"));
        assert!(read_impacts(&path).expect_err("no force").to_string().contains("`force`"));
    }
}
