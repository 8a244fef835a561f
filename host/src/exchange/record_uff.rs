//! Impact records in universal files: time responses (function type 1), hit after hit.
//!
//! A function whose ordinate is a force begins a hit; the motions that follow it, up to the next force, are its responses. Responses
//! along x, y and z (directions ±1, ±2, ±3) are put in this order, one along a negative axis is turned; others stay as they stand.

use super::record_npz::{MOST_CHANNELS, MOST_HITS};
use super::uff::{Abscissa, Contents, Dof, Function, Values, kind, quantity};
use super::{FrfUffError, NpzError, frf_file, frf_uff, read_impacts};
use crate::spectra::{ImpactRecords, MotionQuantity};
use std::collections::HashMap;
use std::path::Path;

/// Sampling rates this close to a whole number are one: the format keeps the step's digits, not the rate's.
const WHOLE_HZ: f64 = 1e-6;

/// Why a file gives no impact records.
#[derive(Debug, thiserror::Error)]
pub enum RecordFileError {
    /// It cannot be read.
    #[error(transparent)]
    Open(#[from] frf_file::FrfFileError),
    /// It is an npz file that holds no impact records.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// It is not an npz file, and as a universal file it holds no impact records.
    #[error(transparent)]
    Uff(#[from] FrfUffError),
}

/// Reads impact records from an npz or a universal file; the second value says what was left out.
///
/// # Errors
/// [`RecordFileError`] with the file and what is wrong in it.
pub fn read_record_file(path: &Path) -> Result<(ImpactRecords, Vec<String>), RecordFileError> {
    if frf_file::is_npz(path)? {
        return Ok((read_impacts(path)?, Vec::new()));
    }
    let contents = frf_uff::contents(path)?;
    Ok(from_contents(&contents).map_err(|reason| FrfUffError::Content { path: path.into(), reason })?)
}

/// Records of one place of impact and one sensor, with the names that the labels give them.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledRecords {
    /// Where the hammer struck: the force's own entity, or its node.
    pub impact: String,
    /// Where the sensor was.
    pub response: String,
    /// The hits.
    pub records: ImpactRecords,
}

/// A hit: its force first, then its responses.
type Hit<'c> = Vec<(&'c Function, &'c [f64])>;

/// The records among what was read of a file.
///
/// # Errors
/// The reason in words.
pub fn from_contents(contents: &Contents) -> Result<(ImpactRecords, Vec<String>), String> {
    let (hits, warnings) = hits(contents)?;
    Ok((records(&hits)?, warnings))
}

/// The same, apart by place of impact and by sensor, as the labels name them: one hit that several sensors heard fills as many rows.
///
/// # Errors
/// The reason in words, also where a label names neither entity nor node.
pub fn by_label(contents: &Contents) -> Result<(Vec<LabelledRecords>, Vec<String>), String> {
    let (hits, warnings) = hits(contents)?;
    let mut rows: Vec<(String, String, Vec<Hit<'_>>)> = Vec::new();
    let mut row_of: HashMap<(String, String), usize> = HashMap::new();
    for (number, hit) in hits.iter().enumerate() {
        let force = hit[0];
        let impact = name_of(&force.0.response)
            .ok_or_else(|| format!("the force of hit {number} names neither entity nor node"))?;
        let mut own: Vec<(String, Hit<'_>)> = Vec::new();
        for response in &hit[1..] {
            let name = name_of(&response.0.response)
                .ok_or_else(|| format!("a response of hit {number} names neither entity nor node"))?;
            match own.iter_mut().find(|(known, _)| *known == name) {
                Some((_, functions)) => functions.push(*response),
                // a hit has no more responses than a rig has sensors
                None => own.push((name, vec![force, *response])),
            }
        }
        for (response, functions) in own {
            let row = *row_of.entry((impact.clone(), response.clone())).or_insert_with(|| {
                rows.push((impact.clone(), response, Vec::new()));
                rows.len() - 1
            });
            rows[row].2.push(functions);
        }
    }
    let labelled = rows.into_iter().map(|(impact, response, hits)| {
        let records = records(&hits).map_err(|what| format!("{impact} to {response}: {what}"))?;
        Ok(LabelledRecords { impact, response, records })
    });
    Ok((labelled.collect::<Result<_, String>>()?, warnings))
}

/// Whether there is a force over time among the contents: impact records, and not FRFs.
pub fn holds_records(contents: &Contents) -> bool {
    let is_force = |f: &Function| f.kind == kind::TIME && f.axes[1].quantity == quantity::FORCE;
    contents.functions().any(is_force)
}

/// What a label calls its place.
fn name_of(dof: &Dof) -> Option<String> {
    match dof.entity.trim() {
        "" | "NONE" if dof.node == 0 => None,
        "" | "NONE" => Some(dof.node.to_string()),
        entity => Some(entity.into()),
    }
}

fn hits(contents: &Contents) -> Result<(Vec<Hit<'_>>, Vec<String>), String> {
    let warnings = frf_uff::left_out(contents);
    let mut hits: Vec<Hit<'_>> = Vec::new();
    for function in contents.functions() {
        let (kind::TIME, Values::Real(values)) = (function.kind, &function.values) else { continue };
        let full = hits.len() == MOST_HITS;
        match (function.axes[1].quantity, hits.last_mut()) {
            (quantity::FORCE, _) if full => {
                return Err(format!("it has more than {MOST_HITS} hits: split the file"));
            }
            (_, Some(hit)) if hit.len() > MOST_CHANNELS => {
                return Err(format!(
                    "a force is followed by more than {MOST_CHANNELS} responses: every hit begins with its force"
                ));
            }
            (quantity::FORCE, _) => hits.push(vec![(function, values)]),
            (_, Some(hit)) => hit.push((function, values)),
            (_, None) => {
                return Err(
                    "a time response stands before the first force: every hit begins with its force".into()
                );
            }
        }
    }
    if hits.is_empty() {
        let why = warnings.first().map_or_else(String::new, |w| format!(" ({w})"));
        return Err(format!(
            "there is no force over time in it (data set 58 of function type 1 with an ordinate of type 13){why}: give an npz of impact records, or a universal file with time responses"
        ));
    }
    Ok((hits, warnings))
}

/// Hits that one force and the same responses describe.
fn records(hits: &[Hit<'_>]) -> Result<ImpactRecords, String> {
    let Some((first, samples)) = hits.first().and_then(|hit| hit.first()) else {
        return Err("there is no hit".into());
    };
    let Abscissa::Even { step, .. } = first.abscissa else {
        return Err("the force is not evenly sampled: resample it".into());
    };
    let rate_hz = 1.0 / step;
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(format!("the time step is {step} s"));
    }
    let whole = (rate_hz - rate_hz.round()).abs() <= WHOLE_HZ * rate_hz;
    let fs_hz = if whole { rate_hz.round() } else { rate_hz };
    let motion = motion(hits)?;
    let channels = hits[0].len() - 1;
    let mut records = ImpactRecords { fs_hz, force_n: Vec::new(), response: Vec::new(), quantity: motion };
    for (number, hit) in hits.iter().enumerate() {
        if hit.len() - 1 != channels {
            return Err(format!("hit {number} has {} responses, the first one {channels}", hit.len() - 1));
        }
        for (function, values) in hit {
            let Abscissa::Even { step: own, .. } = function.abscissa else {
                return Err(format!("hit {number} is not evenly sampled: resample it"));
            };
            if (own - step).abs() > WHOLE_HZ * step || values.len() != samples.len() {
                return Err(format!("hit {number} has another sampling rate or length than the first one"));
            }
        }
        records.force_n.push(hit[0].1.to_vec());
        records.response.push(responses(&hit[1..]));
    }
    Ok(records)
}

/// The one quantity that all responses measure.
fn motion(hits: &[Hit<'_>]) -> Result<MotionQuantity, String> {
    let mut found: Vec<i64> = Vec::new();
    for (function, _) in hits.iter().flat_map(|hit| &hit[1..]) {
        let quantity = function.axes[1].quantity;
        // two are one too many already
        if found.len() < 4 && !found.contains(&quantity) {
            found.push(quantity);
        }
    }
    match found[..] {
        [quantity::DISPLACEMENT] => Ok(MotionQuantity::Displacement),
        [quantity::VELOCITY] => Ok(MotionQuantity::Velocity),
        [quantity::ACCELERATION] => Ok(MotionQuantity::Acceleration),
        [] => Err("no response follows the force".into()),
        _ => Err(format!(
            "the responses' ordinates are of type {found:?}: all must be 8 (displacement), 11 (velocity) or 12 (acceleration)"
        )),
    }
}

fn responses(functions: &[(&Function, &[f64])]) -> Vec<Vec<f64>> {
    let along = |axis: i64| functions.iter().find(|(f, _)| f.response.direction.saturating_abs() == axis);
    match [along(1), along(2), along(3)] {
        [Some(x), Some(y), Some(z)] if functions.len() == 3 => [x, y, z]
            .map(|(function, values)| {
                let sign = if function.response.direction < 0 { -1.0 } else { 1.0 };
                values.iter().map(|v| sign * v).collect()
            })
            .to_vec(),
        _ => functions.iter().map(|(_, values)| values.to_vec()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::uff::{DataSet, read, write};
    use super::super::uff_output::write_records;
    use super::*;

    fn records() -> ImpactRecords {
        let signal = |seed: usize| (0..64).map(|i| ((i * 37 + seed * 11) % 101) as f64 * 1e-3).collect();
        ImpactRecords {
            fs_hz: 51_200.0,
            force_n: (0..3).map(signal).collect(),
            response: (0..3).map(|hit| (0..3).map(|axis| signal(10 * hit + axis + 3)).collect()).collect(),
            quantity: MotionQuantity::Velocity,
        }
    }

    #[test]
    fn what_was_exported_comes_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("cell.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let (found, warnings) = read_record_file(&path).expect("read");
        assert_eq!((found, warnings), (records(), Vec::new()));
    }

    #[test]
    fn one_hit_that_two_sensors_heard_fills_two_rows() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("row.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let mut contents = read(&std::fs::read(&path).expect("there"));
        // behind each hit's responses, those of a second sensor that knows its node only
        let mut sets = Vec::new();
        for set in contents.sets.drain(..) {
            let DataSet::Function(function) = set else {
                sets.push(set);
                continue;
            };
            let mut other = function.clone();
            other.response = Dof { entity: String::new(), node: 7, direction: function.response.direction };
            let is_force = function.axes[1].quantity == quantity::FORCE;
            sets.push(DataSet::Function(function));
            if !is_force {
                sets.push(DataSet::Function(other));
            }
        }
        contents.sets = sets;
        assert!(holds_records(&contents));
        let (rows, _) = by_label(&contents).expect("read");
        let names: Vec<_> = rows.iter().map(|row| (&*row.impact, &*row.response)).collect();
        assert_eq!(names, [("AZ1", "A1"), ("AZ1", "7")]);
        assert_eq!((&rows[0].records, &rows[1].records), (&records(), &records()));
    }

    #[test]
    fn axes_are_put_in_order_and_turned_and_what_is_no_record_is_said() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("cell.uff");
        write_records(&path, &records(), "A1", "AZ1").expect("written");
        let mut contents = read(&std::fs::read(&path).expect("there"));
        let change = |contents: &mut Contents, at: usize, change: &dyn Fn(&mut Function)| {
            let functions = contents.sets.iter_mut().filter_map(|set| match set {
                DataSet::Function(f) => Some(f),
                _ => None,
            });
            functions.skip(at).take(1).for_each(|f| change(f));
        };
        // x and z of the first hit change places, one of them looks the other way
        change(&mut contents, 1, &|f| f.response.direction = -3);
        change(&mut contents, 3, &|f| f.response.direction = 1);
        let (found, _) = from_contents(&contents).expect("read");
        let turned: Vec<f64> = records().response[0][0].iter().map(|v| -v).collect();
        assert_eq!((&found.response[0][0], &found.response[0][2]), (&records().response[0][2], &turned));
        assert!(write(&contents.sets).is_ok());
        change(&mut contents, 2, &|f| f.axes[1].quantity = quantity::ACCELERATION);
        assert!(from_contents(&contents).expect_err("two quantities").contains("[11, 12]"));
        change(&mut contents, 2, &|f| f.kind = kind::PSD);
        assert!(from_contents(&contents).expect_err("one response less").contains("hit 1 has 3 responses"));
        change(&mut contents, 0, &|f| f.axes[1].quantity = quantity::VELOCITY);
        assert!(from_contents(&contents).expect_err("no force").contains("before the first force"));
        assert!(from_contents(&Contents::default()).expect_err("nothing").contains("type 13"));
    }
}
