//! Reads a geometry in any of its file formats, among them its tables: the pyFBS workbook (xlsx),
//! or the same tables as csv files in one folder.
//!
//! Eight sheets (`Channels_A`, `Impacts_A`, …, `VP_Channels`, `VP_RefChannels`) whose columns are
//! found by their headings; positions are in metres. Every error names sheet, row and column; the
//! row is numbered as in a spreadsheet program.

use super::tables::{SheetCell, Tables, csv_tables, workbook_tables};
use crate::substructuring::geometry::{Configuration, FARTHEST_M, Geometry, Grouping, Point};
use crate::{advice, untrusted_input};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Why the geometry cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PositionsError {
    /// The workbook or folder cannot be opened.
    #[error("{}: cannot be opened as geometry ({reason}): give the .xlsx workbook or the folder of its .csv tables", path.display())]
    Open {
        /// The path given.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
    /// A sheet is missing.
    #[error("{}: there is no sheet `{sheet}`; it has: {available}", path.display())]
    MissingSheet {
        /// The workbook.
        path: PathBuf,
        /// The sheet.
        sheet: String,
        /// The sheets that exist.
        available: String,
    },
    /// A heading is missing.
    #[error("{}, sheet `{sheet}`: there is no column `{column}` in the first row", path.display())]
    MissingColumn {
        /// The workbook.
        path: PathBuf,
        /// The sheet.
        sheet: String,
        /// The column.
        column: String,
    },
    /// A cell is wrong.
    #[error("{}, sheet `{sheet}`, row {row}, column `{column}`: {reason}", path.display())]
    SheetCell {
        /// The workbook.
        path: PathBuf,
        /// The sheet.
        sheet: String,
        /// The row number in the spreadsheet: the headings are row 1.
        row: usize,
        /// The column.
        column: String,
        /// What is wrong and what is needed.
        reason: String,
    },
    /// The virtual points are inconsistent or missing.
    #[error("{}: {reason}", path.display())]
    VirtualPoint {
        /// The workbook.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// The geometry, and warnings for the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Positions {
    /// The geometry.
    pub geometry: Geometry,
    /// For example directions that were not unit vectors.
    pub warnings: Vec<String>,
}

/// The sheets of a geometry.
const SHEETS: [&str; 8] = [
    "Channels_A",
    "Impacts_A",
    "Channels_B",
    "Impacts_B",
    "Channels_AJB",
    "Impacts_AJB",
    "VP_Channels",
    "VP_RefChannels",
];

/// Reads the workbook at `path`, or the csv tables when `path` is a folder.
///
/// # Errors
/// [`PositionsError`] naming sheet, row and column.
pub fn read_positions(path: &Path) -> Result<Positions, PositionsError> {
    let tables = if path.is_dir() { csv_tables(path, &SHEETS) } else { workbook_tables(path, &SHEETS) };
    let tables = tables.map_err(|reason| PositionsError::Open { path: path.into(), reason })?;
    let mut reading = PositionsReader { path, tables, warnings: Vec::new() };
    let a = reading.configuration("A")?;
    let b = reading.configuration("B")?;
    let ajb = reading.configuration("AJB")?;
    let virtual_points = reading.virtual_points()?;
    Ok(Positions {
        geometry: Geometry {
            a,
            b,
            ajb,
            virtual_point_a_m: virtual_points[0],
            virtual_point_b_m: virtual_points[1],
        },
        warnings: reading.warnings,
    })
}

struct PositionsReader<'a> {
    path: &'a Path,
    tables: Tables,
    warnings: Vec<String>,
}

/// One sheet with the columns of its headings.
struct Sheet<'a> {
    path: &'a Path,
    name: &'a str,
    headings: BTreeMap<String, usize>,
}

impl Sheet<'_> {
    fn fail(&self, row: usize, column: &str, reason: impl Into<String>) -> PositionsError {
        PositionsError::SheetCell {
            path: self.path.into(),
            sheet: self.name.into(),
            row,
            column: column.into(),
            reason: reason.into(),
        }
    }

    fn at<'c>(&self, cells: &'c [SheetCell], column: &str) -> Result<&'c SheetCell, PositionsError> {
        let place =
            self.headings.get(&column.to_lowercase()).ok_or_else(|| PositionsError::MissingColumn {
                path: self.path.into(),
                sheet: self.name.into(),
                column: column.into(),
            })?;
        Ok(cells.get(*place).unwrap_or(&SheetCell::Empty))
    }

    fn text(&self, row: usize, cells: &[SheetCell], column: &str) -> Result<String, PositionsError> {
        match self.at(cells, column)? {
            SheetCell::Empty => Err(self.fail(row, column, "is empty, but a text is needed")),
            SheetCell::Text(text) => Ok(text.trim().to_string()),
            SheetCell::Number(v) => Ok(v.to_string()),
        }
    }

    fn number(&self, row: usize, cells: &[SheetCell], column: &str) -> Result<f64, PositionsError> {
        let value = match self.at(cells, column)? {
            SheetCell::Empty => return Err(self.fail(row, column, "is empty, but a number is needed")),
            SheetCell::Number(v) => *v,
            SheetCell::Text(text) => text.trim().parse().map_err(|_| {
                self.fail(row, column, format!("`{text}` is not a number (decimal point, no unit)"))
            })?,
        };
        if value.is_finite() { Ok(value) } else { Err(self.fail(row, column, format!("is {value}"))) }
    }

    fn vector(&self, row: usize, cells: &[SheetCell], stem: &str) -> Result<[f64; 3], PositionsError> {
        let mut vector = [0.0; 3];
        for (i, v) in vector.iter_mut().enumerate() {
            *v = self.number(row, cells, &format!("{stem}_{}", i + 1))?;
        }
        Ok(vector)
    }
}

impl PositionsReader<'_> {
    fn configuration(&mut self, name: &str) -> Result<Configuration, PositionsError> {
        Ok(Configuration {
            channels: self.points(&format!("Channels_{name}"))?,
            impacts: self.points(&format!("Impacts_{name}"))?,
        })
    }

    fn points(&mut self, sheet_name: &str) -> Result<Vec<Point>, PositionsError> {
        let table = self.tables.named.get(sheet_name).ok_or_else(|| PositionsError::MissingSheet {
            path: self.path.into(),
            sheet: sheet_name.into(),
            available: self.tables.available.join(", "),
        })?;
        let mut rows = table.iter().filter(|(_, cells)| cells.iter().any(|c| *c != SheetCell::Empty));
        let headings = rows.next().map(|(_, cells)| cells.as_slice()).unwrap_or_default();
        let headings = headings
            .iter()
            .enumerate()
            .filter_map(|(i, c)| match c {
                SheetCell::Text(text) => Some((text.trim().to_lowercase(), i)),
                _ => None,
            })
            .collect();
        let sheet = Sheet { path: self.path, name: sheet_name, headings };
        let mut points = Vec::new();
        let mut warnings = Vec::new();
        for (row, cells) in rows {
            let (point, warning) = point(&sheet, *row, cells)?;
            points.push(point);
            warnings.extend(warning);
        }
        self.warnings.extend(warnings);
        Ok(points)
    }

    /// Positions of both virtual points, on which the sheets of motions and forces must agree.
    fn virtual_points(&mut self) -> Result<[[f64; 3]; 2], PositionsError> {
        let fail = |path: &Path, reason: String| PositionsError::VirtualPoint { path: path.into(), reason };
        let mut found: [Option<[f64; 3]>; 2] = [None, None];
        for sheet in ["VP_Channels", "VP_RefChannels"] {
            for point in self.points(sheet)? {
                let (which, name) = match point.grouping {
                    Grouping::InterfaceA => (0, "A"),
                    Grouping::InterfaceB => (1, "B"),
                    other => {
                        let number = u8::from(other);
                        return Err(fail(
                            self.path,
                            format!(
                                "sheet `{sheet}`: a virtual point belongs to grouping 1 or 2, not {number}"
                            ),
                        ));
                    }
                };
                let along_axis = point.direction.iter().filter(|d| **d == 1.0).count() == 1
                    && point.direction.iter().filter(|d| **d == 0.0).count() == 2;
                if !along_axis {
                    return Err(fail(
                        self.path,
                        format!(
                            "sheet `{sheet}`: virtual point {name} has the direction {:?}; only the axes x, y, z are supported",
                            point.direction
                        ),
                    ));
                }
                match found[which] {
                    None => found[which] = Some(point.position_m),
                    Some(position) if position == point.position_m => {}
                    Some(position) => {
                        return Err(fail(
                            self.path,
                            format!(
                                "sheet `{sheet}`: virtual point {name} is at {position:?} m and at {:?} m; it needs one position",
                                point.position_m
                            ),
                        ));
                    }
                }
            }
        }
        let missing = |name| {
            fail(
                self.path,
                format!(
                    "no virtual point of {name} in VP_Channels (grouping {})",
                    if name == "A" { 1 } else { 2 }
                ),
            )
        };
        Ok([found[0].ok_or_else(|| missing("A"))?, found[1].ok_or_else(|| missing("B"))?])
    }
}

fn point(
    sheet: &Sheet<'_>,
    row: usize,
    cells: &[SheetCell],
) -> Result<(Point, Option<String>), PositionsError> {
    let name = sheet.text(row, cells, "Name")?;
    let description = match sheet.at(cells, "Description")? {
        SheetCell::Empty => name.clone(),
        _ => sheet.text(row, cells, "Description")?,
    };
    let number = sheet.number(row, cells, "Grouping")?;
    let whole = if number.fract() == 0.0 && (0.0..=255.0).contains(&number) { number as u8 } else { 0 };
    let grouping = Grouping::try_from(whole)
        .map_err(|reason| sheet.fail(row, "Grouping", format!("{number}: {reason}")))?;
    let position_m = sheet.vector(row, cells, "Position")?;
    let mut direction = sheet.vector(row, cells, "Direction")?;
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    if length < 1e-9 {
        return Err(sheet.fail(
            row,
            "Direction_1",
            "the direction is zero: give the axis of motion or force",
        ));
    }
    let mut warning = None;
    // A direction typed with three decimals may be off by 1e-3 and is still meant as a unit vector;
    // warn only beyond that.
    if (length - 1.0).abs() > 1e-3 {
        warning = Some(format!(
            "sheet `{}`, row {row}: the direction of {description} has length {length:.4} and was normalised",
            sheet.name
        ));
    }
    if (length - 1.0).abs() > f64::EPSILON {
        direction = direction.map(|d| d / length);
    }
    Ok((Point { name, description, grouping, position_m, direction }, warning))
}

/// Why a geometry could not be read.
#[derive(Debug, thiserror::Error)]
pub enum GeometryFileError {
    /// The file cannot be read.
    #[error("{}: reading the geometry: {source}; {}", path.display(), advice::reading(source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The TOML file is not a valid geometry.
    #[error(
        "{}, line {line}: {what}; a geometry has `a`, `b` and `ajb`, each with `channels` and `impacts`, and both virtual points \
         (docs/coming-from-pyfbs.md)", path.display()
    )]
    Toml {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// A position beyond the size of any rig.
    #[error(
        "{}: `{name}` is at {coordinate} m, and no position may be further than {FARTHEST_M} m from the origin: positions are \
         in m, not in mm",
        path.display()
    )]
    TooFar {
        /// The file.
        path: PathBuf,
        /// The point.
        name: String,
        /// The coordinate, m.
        coordinate: f64,
    },
    /// The workbook or its tables are invalid.
    #[error(transparent)]
    Positions(#[from] PositionsError),
}

/// Reads a geometry from a workbook (.xlsx), a folder of its tables as .csv, or a .toml file; also
/// returns warnings for the user.
///
/// # Errors
/// [`GeometryFileError`] naming the place in the file.
pub fn read_geometry(path: &Path) -> Result<(Geometry, Vec<String>), GeometryFileError> {
    let (geometry, warnings) = of_any_size(path)?;
    match geometry.too_far() {
        None => Ok((geometry, warnings)),
        Some((name, coordinate)) => {
            Err(GeometryFileError::TooFar { path: path.into(), name: name.into(), coordinate })
        }
    }
}

fn of_any_size(path: &Path) -> Result<(Geometry, Vec<String>), GeometryFileError> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let positions = read_positions(path)?;
        return Ok((positions.geometry, positions.warnings));
    }
    let text = untrusted_input::text(path, untrusted_input::SETTINGS)
        .map_err(|source| GeometryFileError::Read { path: path.into(), source })?;
    let geometry = toml::from_str(&text).map_err(|error| GeometryFileError::Toml {
        path: path.into(),
        line: error.span().map_or(1, |at| 1 + text[..at.start].matches('\n').count()),
        what: error.message().into(),
    })?;
    Ok((geometry, Vec::new()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/positions");

    #[test]
    fn workbook_and_csv_are_the_same_geometry() {
        let xlsx = read_positions(&Path::new(DATA).join("positions.xlsx")).expect("workbook");
        let csv = read_positions(&Path::new(DATA).join("csv")).expect("tables");
        assert_eq!(xlsx, csv);
        assert!(xlsx.warnings.is_empty());
        assert_eq!(xlsx.geometry.ajb.channels.len(), 24);
        assert_eq!(xlsx.geometry.ajb.impacts.len(), 21);
        assert_eq!(xlsx.geometry.a.impacts[9].grouping, Grouping::InternalA);
        assert_eq!(xlsx.geometry.a.impacts[0].direction, [0.0, 0.0, -1.0]);
        assert_eq!(xlsx.geometry.virtual_point_b_m, [0.0; 3]);
        assert_eq!(xlsx.geometry.a.output_names()[2], "A1:z");
    }

    /// The valid csv tables in a temporary folder, with one table edited.
    fn edited(table: &str, edit: impl Fn(&str) -> String) -> tempfile::TempDir {
        let dir = tempfile::tempdir().expect("a temporary folder");
        for entry in fs::read_dir(Path::new(DATA).join("csv")).expect("test data") {
            let from = entry.expect("entry").path();
            let name = from.file_name().expect("a file").to_owned();
            let mut text = fs::read_to_string(&from).expect("text");
            if name.to_str() == Some(&format!("{table}.csv")) {
                text = edit(&text);
            }
            fs::write(dir.path().join(name), text).expect("written");
        }
        dir
    }

    #[test]
    fn errors_name_sheet_row_and_column() {
        let cases = [
            ("Impacts_A", "0.015,0.028", "0.015,28 mm", vec!["Impacts_A", "row 2", "Position_2", "28 mm"]),
            ("Channels_B", "Velocity,4", "Velocity,7", vec!["Channels_B", "row 11", "Grouping", "7"]),
            ("Channels_B", "Position_3", "Position_Z", vec!["Channels_B", "Position_3"]),
            ("Impacts_B", "0.0,0.0,-1.0", "0.0,0.0,0.0", vec!["Impacts_B", "row 2", "Direction_1", "zero"]),
            ("VP_Channels", "ux,Velocity,1,0.0", "ux,Velocity,1,0.1", vec!["VP_Channels", "one position"]),
        ];
        for (table, from, to, wanted) in cases {
            let dir = edited(table, |text| text.replacen(from, to, 1));
            let text = read_positions(dir.path()).expect_err(table).to_string();
            for part in wanted {
                assert!(text.contains(part), "{text} lacks {part}");
            }
        }
        let dir = edited("Channels_AJB", str::to_string);
        fs::remove_file(dir.path().join("Channels_AJB.csv")).expect("removed");
        assert!(read_positions(dir.path()).expect_err("no sheet").to_string().contains("`Channels_AJB`"));
    }

    #[test]
    fn long_directions_are_normalised_with_a_warning() {
        let dir = edited("Impacts_A", |text| text.replacen("0.0,0.0,-1.0", "0.0,-3.0,-4.0", 1));
        let read = read_positions(dir.path()).expect("readable");
        assert_eq!(read.geometry.a.impacts[0].direction, [0.0, -0.6, -0.8]);
        assert!(read.warnings.len() == 1 && read.warnings[0].contains("AZ1"), "{:?}", read.warnings);
    }
}

#[cfg(test)]
mod geometry_file_tests {
    use super::*;

    /// The test tables in a temporary folder, each text changed.
    fn changed(change: impl Fn(&str) -> String) -> tempfile::TempDir {
        let data = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/positions/csv");
        let dir = tempfile::tempdir().expect("a temporary folder");
        for entry in std::fs::read_dir(data).expect("test data") {
            let from = entry.expect("entry").path();
            let text = change(&std::fs::read_to_string(&from).expect("text"));
            std::fs::write(dir.path().join(from.file_name().expect("a name")), text).expect("written");
        }
        dir
    }

    #[test]
    fn positions_in_millimetres_are_refused_as_in_a_plan() {
        let millimetres = |text: &str| {
            let rows = text.lines().enumerate().map(|(row, line)| {
                let cells = line.split(',').enumerate().map(|(column, cell)| {
                    let position = row > 0 && (4..7).contains(&column);
                    if position {
                        format!("{}", 1e3 * cell.parse::<f64>().expect("a number"))
                    } else {
                        cell.into()
                    }
                });
                cells.collect::<Vec<_>>().join(",")
            });
            rows.collect::<Vec<_>>().join("\n")
        };
        assert!(read_geometry(changed(str::to_owned).path()).is_ok());
        let said = read_geometry(changed(millimetres).path()).expect_err("in mm").to_string();
        assert!(said.contains("in m, not in mm") && said.contains('`'), "{said}");
    }

    #[test]
    fn tables_with_semicolons_and_decimal_commas_are_the_same_geometry() {
        let (plain, _) = read_geometry(changed(str::to_owned).path()).expect("tables");
        for change in [
            |text: &str| text.replace(',', ";").replace('.', ","),
            |text: &str| text.replace(',', ";"),
            |text: &str| format!("\u{feff}sep=;\r\n{}", text.replace(',', ";").replace('.', ",")),
            |text: &str| text.replace(',', "\t").replace('.', ","),
        ] {
            let (read, warnings) = read_geometry(changed(change).path()).expect("tables");
            assert_eq!((read, warnings), (plain.clone(), vec![]));
        }
    }
}
