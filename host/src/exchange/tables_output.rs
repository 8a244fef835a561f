//! Writes comma-separated text: FRFs and records with one row per line or sample and one heading
//! per column, and a geometry as a folder of csv tables, in the form of the pyFBS workbook that
//! [`super::read_positions`] reads.

use super::positions::PositionsError;
use crate::advice;
use crate::frf::Frf;
use crate::hysteresis::{HysteresisRecord, RelativeMotion};
use crate::spectra::ImpactRecords;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping, Point};
use std::path::{Path, PathBuf};

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}; {}", path.display(), advice::writing(source))]
pub struct TableError {
    path: PathBuf,
    source: std::io::Error,
}

/// Writes FRFs: `frequency_hz`, and for each pair `OUTPUT/INPUT re`, `… im`, `… coherence`. A
/// missing value is empty.
///
/// # Errors
/// [`TableError`].
pub fn write_frf(path: &Path, frf: &Frf) -> Result<(), TableError> {
    let pairs = || (0..frf.outputs().len()).flat_map(|o| (0..frf.inputs().len()).map(move |i| (o, i)));
    let text = |v: f64| if v.is_finite() { v.to_string() } else { String::new() };
    write(path, |out| {
        let heading = pairs().flat_map(|(o, i)| {
            ["re", "im", "coherence"].map(|part| format!("{}/{} {part}", frf.outputs()[o], frf.inputs()[i]))
        });
        out.write_record(std::iter::once("frequency_hz".to_string()).chain(heading))?;
        for (line, y) in frf.lines().iter().enumerate() {
            let row = pairs().flat_map(|(o, i)| {
                let coherence = frf.coherence().map_or(f64::NAN, |all| all[line][(o, i)]);
                [text(y[(o, i)].re), text(y[(o, i)].im), text(coherence)]
            });
            out.write_record(std::iter::once(frf.frequency_hz()[line].to_string()).chain(row))?;
        }
        Ok(())
    })
}

/// Writes impact records: `hit`, `time_s`, `force_n` and the responses in SI, one hit after
/// another.
///
/// # Errors
/// [`TableError`].
pub fn write_records(path: &Path, records: &ImpactRecords) -> Result<(), TableError> {
    let channels = records.response.first().map_or(0, Vec::len);
    write(path, |out| {
        let heading = ["hit", "time_s", "force_n"].map(String::from);
        out.write_record(heading.into_iter().chain((1..=channels).map(|c| format!("response_{c}"))))?;
        for (hit, (force, responses)) in records.force_n.iter().zip(&records.response).enumerate() {
            for (i, f) in force.iter().enumerate() {
                let row = [hit.to_string(), (i as f64 / records.fs_hz).to_string(), f.to_string()];
                let values = responses.iter().map(|x| x.get(i).map_or(String::new(), ToString::to_string));
                out.write_record(row.into_iter().chain(values))?;
            }
        }
        Ok(())
    })
}

/// Writes a loop: `time_s`, `velocity_a_m_per_s` and `velocity_b_m_per_s` (or `displacement_a_m`
/// and `…_b_m`), `force_n`.
///
/// # Errors
/// [`TableError`].
pub fn write_loop(path: &Path, record: &HysteresisRecord) -> Result<(), TableError> {
    let signals = loop_signals(record);
    write(path, |out| {
        out.write_record(std::iter::once("time_s").chain(signals.map(|(name, _)| name)))?;
        let [a, b, force] = signals.map(|(_, signal)| signal);
        for (i, ((a, b), f)) in a.iter().zip(b).zip(force).enumerate() {
            out.write_record([i as f64 / record.fs_hz, *a, *b, *f].map(|value| value.to_string()))?;
        }
        Ok(())
    })
}

/// The signals of a loop with their column names.
pub fn loop_signals(record: &HysteresisRecord) -> [(&'static str, &[f64]); 3] {
    let [a, b]: [(&str, &[f64]); 2] = match &record.motion {
        RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => {
            [("velocity_a_m_per_s", a_m_per_s), ("velocity_b_m_per_s", b_m_per_s)]
        }
        RelativeMotion::Displacement { a_m, b_m } => [("displacement_a_m", a_m), ("displacement_b_m", b_m)],
    };
    [a, b, ("force_n", &record.force_n)]
}

/// Writes rows unchanged, the heading first.
///
/// # Errors
/// [`TableError`].
pub fn write_rows(path: &Path, rows: &[Vec<String>]) -> Result<(), TableError> {
    write_rows_of(path, rows.iter())
}

/// As [`write_rows`], with rows from an iterator.
///
/// # Errors
/// [`TableError`].
pub fn write_rows_of<R>(path: &Path, mut rows: impl Iterator<Item = R>) -> Result<(), TableError>
where
    R: IntoIterator,
    R::Item: AsRef<[u8]>,
{
    write(path, |out| rows.try_for_each(|row| out.write_record(row)))
}

fn write(
    path: &Path,
    rows: impl FnOnce(&mut csv::Writer<std::fs::File>) -> Result<(), csv::Error>,
) -> Result<(), TableError> {
    csv::Writer::from_path(path)
        .and_then(|mut out| {
            rows(&mut out)?;
            Ok(out.flush()?)
        })
        .map_err(|error| {
            // keep the operating system's error, from which the advice is derived
            let source = match error.into_kind() {
                csv::ErrorKind::Io(source) => source,
                other => std::io::Error::other(format!("{other:?}")),
            };
            TableError { path: path.into(), source }
        })
}

const HEADINGS: [&str; 10] = [
    "Name",
    "Description",
    "Quantity",
    "Grouping",
    "Position_1",
    "Position_2",
    "Position_3",
    "Direction_1",
    "Direction_2",
    "Direction_3",
];

/// Writes the eight tables into `folder`, which must exist.
///
/// # Errors
/// [`PositionsError::Open`] with the table and why it cannot be written.
pub fn write_positions(
    folder: &Path,
    geometry: &Geometry,
    response_quantity: &str,
) -> Result<(), PositionsError> {
    let table = |sheet: &str, quantity: &str, points: &[Point]| {
        let path = folder.join(format!("{sheet}.csv"));
        let written = csv::Writer::from_path(&path).and_then(|mut out| {
            out.write_record(HEADINGS)?;
            for point in points {
                let texts = [point.name.clone(), point.description.clone(), quantity.to_string()];
                let grouping = u8::from(point.grouping).to_string();
                let numbers = point.position_m.iter().chain(&point.direction).map(ToString::to_string);
                out.write_record(texts.into_iter().chain([grouping]).chain(numbers))?;
            }
            Ok(out.flush()?)
        });
        written.map_err(|e| PositionsError::Open { path: path.clone(), reason: e.to_string() })
    };
    for structure in Structure::ALL {
        let (name, points) = (structure.name(), geometry.points(structure));
        table(&format!("Channels_{name}"), response_quantity, &points.channels)?;
        table(&format!("Impacts_{name}"), "Force", &points.impacts)?;
    }
    let virtual_points = |names: [&str; 6]| -> Vec<Point> {
        [
            (Grouping::InterfaceA, geometry.virtual_point_a_m),
            (Grouping::InterfaceB, geometry.virtual_point_b_m),
        ]
        .into_iter()
        .flat_map(|(grouping, position_m)| {
            names.iter().enumerate().map(move |(i, name)| Point {
                name: "VP".into(),
                description: (*name).into(),
                grouping,
                position_m,
                direction: std::array::from_fn(|axis| f64::from(u8::from(axis == i % 3))),
            })
        })
        .collect()
    };
    table("VP_Channels", response_quantity, &virtual_points(["ux", "uy", "uz", "rx", "ry", "rz"]))?;
    table("VP_RefChannels", "Force", &virtual_points(["fx", "fy", "fz", "mx", "my", "mz"]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frf::MotionQuantity;
    use nalgebra::DMatrix;
    use num_complex::Complex;

    #[test]
    fn every_digit_is_kept_and_a_hole_is_empty() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("frf.csv");
        let value = Complex::new(0.1 + 0.2, -1e-12);
        let frf = Frf::new(
            vec![10.5],
            0.0,
            MotionQuantity::Velocity,
            vec!["A1:x".into(), "A1:y".into()],
            vec!["AZ1".into()],
            vec![DMatrix::from_column_slice(2, 1, &[value, Complex::new(f64::NAN, 0.0)])],
        )
        .and_then(|frf| frf.with_coherence(vec![DMatrix::from_column_slice(2, 1, &[0.75, f64::NAN])]))
        .expect("all agree");
        write_frf(&path, &frf).expect("written");
        let mut table = csv::Reader::from_path(&path).expect("readable");
        assert_eq!(table.headers().expect("headings").get(1), Some("A1:x/AZ1 re"));
        let row = table.records().next().expect("a row").expect("readable");
        assert_eq!(row.get(1).expect("re").parse(), Ok(value.re));
        assert_eq!(row.iter().collect::<Vec<_>>()[2..], ["-0.000000000001", "0.75", "", "0", ""]);
    }
}

#[cfg(test)]
mod positions_output_tests {
    use super::super::read_positions;
    use super::*;

    #[test]
    fn the_tables_come_back() {
        let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/positions/csv"));
        let geometry = read_positions(data).expect("test data").geometry;
        let folder = tempfile::tempdir().expect("a temporary folder");
        write_positions(folder.path(), &geometry, "Velocity").expect("writable");
        assert_eq!(read_positions(folder.path()).expect("readable").geometry, geometry);
        let nowhere = folder.path().join("nowhere");
        assert!(write_positions(&nowhere, &geometry, "Velocity").is_err());
    }
}
