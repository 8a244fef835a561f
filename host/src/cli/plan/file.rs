//! Reads a plan's file and writes out a referenced geometry workbook, since a campaign file must be
//! self-contained.

use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use crate::cli::error::CliError;
use crate::exchange::read_positions;
use crate::structure::Structure;
use crate::substructuring::Geometry;
use crate::substructuring::geometry::{Configuration, Point};
use crate::untrusted_text::tell_line;

/// Parts that are read before the text is parsed as a plan.
#[derive(Deserialize)]
struct Peek {
    geometry: Option<PeekGeometry>,
    #[serde(default)]
    configuration: Vec<toml::Value>,
}

#[derive(Deserialize)]
struct PeekGeometry {
    workbook: Option<Spanned<String>>,
}

/// The text of the plan at `path`. `workbook = "positions.xlsx"` under `[geometry]` (path relative
/// to the plan; or a folder of csv tables) is replaced by the workbook's content: the virtual
/// point, the points and, if the plan has none, the configurations.
///
/// # Errors
/// The plan or the workbook cannot be read, or the workbook contains something that a plan cannot
/// represent.
pub fn read(path: &Path) -> Result<String, CliError> {
    let text = crate::untrusted_input::text(path, crate::untrusted_input::SETTINGS)
        .map_err(|source| CliError::Read { path: path.into(), doing: "reading the plan", source })?;
    // errors of the plan itself are reported when it is parsed as a plan
    let Ok(peek) = toml::from_str::<Peek>(&text) else { return Ok(text) };
    let Some(workbook) = peek.geometry.and_then(|geometry| geometry.workbook) else { return Ok(text) };
    let from = text[..workbook.span().start].rfind('\n').map_or(0, |end| end + 1);
    let to = text[from..].find('\n').map_or(text.len(), |length| from + length);
    let line = 1 + text[..from].matches('\n').count();
    let wrong = |what: String| CliError::Bad(format!("{}:{line}: {what}", path.display()));
    if !text[from..to].trim_start().starts_with("workbook") {
        return Err(wrong("geometry: write `workbook = …` on a line of its own under [geometry]".into()));
    }
    let place = path.parent().unwrap_or(Path::new("")).join(workbook.get_ref());
    let positions = read_positions(&place).map_err(|e| wrong(format!("geometry.workbook: {e}")))?;
    for warning in &positions.warnings {
        tell_line!("{}: {warning}", place.display());
    }
    let geometry = positions.geometry;
    if geometry.virtual_point_a_m != geometry.virtual_point_b_m {
        return Err(wrong(format!(
            "geometry.workbook: the virtual points of A and B differ ({:?} and {:?}): a plan has one, at the contact",
            geometry.virtual_point_a_m, geometry.virtual_point_b_m
        )));
    }
    let mut out = format!("{}# from {}\n", &text[..from], workbook.get_ref());
    let _ = write!(out, "virtual_point_m = {:?}{}", geometry.virtual_point_a_m, &text[to..]);
    let described = tables(&geometry, peek.configuration.is_empty()).map_err(wrong)?;
    Ok(format!("{}\n{described}", out.trim_end()))
}

/// The points, and if requested the configurations, as tables of a plan.
fn tables(geometry: &Geometry, configurations: bool) -> Result<String, String> {
    let mut out = String::new();
    let (mut responses, mut impacts) = (Vec::<Point>::new(), Vec::<Point>::new());
    for structure in Structure::ALL {
        let (name, points) = (structure.name(), geometry.points(structure));
        let locations = locations(name, points)?;
        if configurations {
            let names = |points: &[Point]| points.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
            let _ = writeln!(
                out,
                "\n[[configuration]]\nname = \"{name}\"\nimpacts = {:?}\nresponses = {:?}",
                names(&points.impacts),
                names(&locations)
            );
        }
        merge(&mut responses, &locations, name)?;
        merge(&mut impacts, &points.impacts, name)?;
    }
    for point in &responses {
        let _ = writeln!(
            out,
            "\n[[geometry.response]]\nname = {:?}\ngrouping = {}\nposition_m = {:?}",
            point.name,
            u8::from(point.grouping),
            point.position_m
        );
    }
    for point in &impacts {
        let _ = writeln!(
            out,
            "\n[[geometry.impact]]\nname = {:?}\ngrouping = {}\nposition_m = {:?}\ndirection = {:?}",
            point.name,
            u8::from(point.grouping),
            point.position_m,
            point.direction
        );
    }
    Ok(out)
}

/// The response locations of a configuration, each with its three channels along x, y and z.
fn locations(configuration: &str, points: &Configuration) -> Result<Vec<Point>, String> {
    let mut found: Vec<Point> = Vec::new();
    for channel in &points.channels {
        if found.iter().any(|p| p.name == channel.name) {
            continue;
        }
        let own: Vec<&Point> = points.channels.iter().filter(|p| p.name == channel.name).collect();
        let along_axes = own.len() == 3
            && own.iter().enumerate().all(|(axis, p)| {
                p.direction[axis] == 1.0
                    && p.position_m == channel.position_m
                    && p.grouping == channel.grouping
            });
        if !along_axes {
            return Err(format!(
                "geometry.workbook, Channels_{configuration}: `{}` has {} channels, and a plan's location is measured along x, y \
                 and z, in this order and at one place: for other sensors import FRFs or use `jointrig identify`",
                channel.name,
                own.len()
            ));
        }
        found.push(channel.clone());
    }
    Ok(found)
}

/// Adds points by name; a point with another position in another configuration is refused.
fn merge(all: &mut Vec<Point>, points: &[Point], configuration: &str) -> Result<(), String> {
    for point in points {
        match all.iter().find(|p| p.name == point.name) {
            None => all.push(point.clone()),
            Some(p)
                if (p.position_m, p.direction, p.grouping)
                    == (point.position_m, point.direction, point.grouping) => {}
            Some(_) => {
                return Err(format!(
                    "geometry.workbook: `{}` has another position in {configuration} than in another configuration: give it \
                     another name",
                    point.name
                ));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyse::geometry;
    use crate::campaign::plan::Plan;

    const WORKBOOK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/positions/positions.xlsx");

    /// The small plan's settings without its configurations and points.
    fn plan(geometry: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::copy(WORKBOOK, folder.path().join("positions.xlsx")).expect("test data");
        let small = crate::campaign::plan::SMALL;
        let settings = &small[..small.find("[[configuration]]").expect("configurations")];
        let path = folder.path().join("plan.toml");
        std::fs::write(&path, format!("{settings}{geometry}")).expect("written");
        (folder, path)
    }

    #[test]
    fn a_workbook_becomes_the_plans_geometry_and_configurations() {
        let (folder, path) = plan("[geometry]\nworkbook = \"positions.xlsx\"\n");
        let text = read(&path).expect("a plan");
        let read_plan = Plan::parse(&text, "plan.toml").expect("a whole plan");
        let positions = read_positions(&folder.path().join("positions.xlsx")).expect("test data");
        assert_eq!(geometry(&read_plan), positions.geometry);
        assert_eq!(read_plan.cells().len(), 252, "the paper's campaign");
    }

    #[test]
    fn configurations_of_the_plan_stay_and_faults_name_line_and_remedy() {
        let (_folder, path) = plan(
            "[[configuration]]\nname = \"A\"\nimpacts = [\"AZ1\"]\nresponses = [\"A1\"]\n[geometry]\nworkbook = \"positions.xlsx\"\n",
        );
        let read_plan = Plan::parse(&read(&path).expect("a plan"), "plan.toml").expect("a whole plan");
        assert_eq!(read_plan.cells().len(), 1);
        let said = |geometry: &str| {
            let (_folder, path) = plan(geometry);
            read(&path).expect_err("refused").to_string()
        };
        let gone = said("[geometry]\nworkbook = \"gone.xlsx\"\n");
        assert!(gone.contains("plan.toml:") && gone.contains("gone.xlsx"), "{gone}");
        std::fs::write(&path, "geometry = { workbook = \"positions.xlsx\" }\n").expect("written");
        let inline = read(&path).expect_err("refused").to_string();
        assert!(inline.contains("a line of its own"), "{inline}");
    }
}
