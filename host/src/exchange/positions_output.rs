//! Writes a geometry as a folder of csv tables, in the form of the pyFBS workbook that
//! [`super::read_positions`] reads.

use super::positions::PositionsError;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping, Point};
use std::path::Path;

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
