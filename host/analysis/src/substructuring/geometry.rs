//! Positions and directions of sensors and hits, and the purpose of each.

use crate::structure::Structure;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Purpose of a row: the number in the workbook's `Grouping` column. It is never derived from
/// names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub enum Grouping {
    /// 1: interface of A (used for A's virtual point).
    InterfaceA,
    /// 2: interface of B.
    InterfaceB,
    /// 3: internal of A (a response here is a spare: it is never part of a virtual point).
    InternalA,
    /// 4: internal of B.
    InternalB,
    /// 5: on specimen A, which may move in its clamp: not a point of arm A, and never part of
    /// substructuring.
    SpecimenA,
    /// 6: on specimen B, likewise.
    SpecimenB,
}

impl Grouping {
    /// Whether the point is on a specimen: such points describe the contact and are left out of
    /// substructuring.
    pub fn is_specimen(self) -> bool {
        matches!(self, Grouping::SpecimenA | Grouping::SpecimenB)
    }
}

impl TryFrom<u8> for Grouping {
    type Error = String;
    fn try_from(number: u8) -> Result<Self, String> {
        match number {
            1 => Ok(Grouping::InterfaceA),
            2 => Ok(Grouping::InterfaceB),
            3 => Ok(Grouping::InternalA),
            4 => Ok(Grouping::InternalB),
            5 => Ok(Grouping::SpecimenA),
            6 => Ok(Grouping::SpecimenB),
            other => Err(format!(
                "there is no grouping {other}: 1 and 2 are the interfaces of A and B, 3 and 4 their internals, 5 and 6 the specimens"
            )),
        }
    }
}

impl From<Grouping> for u8 {
    fn from(grouping: Grouping) -> u8 {
        match grouping {
            Grouping::InterfaceA => 1,
            Grouping::InterfaceB => 2,
            Grouping::InternalA => 3,
            Grouping::InternalB => 4,
            Grouping::SpecimenA => 5,
            Grouping::SpecimenB => 6,
        }
    }
}

/// Upper bound of coordinates, m: no rig is larger, and coordinates given in mm exceed it.
pub const FARTHEST_M: f64 = 5.0;

/// The first coordinate that is not finite or exceeds [`FARTHEST_M`], m.
pub fn too_far(position_m: [f64; 3]) -> Option<f64> {
    position_m.into_iter().find(|x| !x.is_finite() || x.abs() > FARTHEST_M)
}

/// One response channel or one impact: one row of a geometry table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The sensor's or impact's name; the three axes of one sensor share it.
    pub name: String,
    /// A text that is unique to each row, e.g. `A1:x`.
    pub description: String,
    /// Its purpose.
    pub grouping: Grouping,
    /// Position, m.
    pub position_m: [f64; 3],
    /// Unit vector: the positive direction of a response, or the direction of a hit's force.
    pub direction: [f64; 3],
}

impl Point {
    /// Position as a vector, m.
    pub fn position(&self) -> Vector3<f64> {
        Vector3::from(self.position_m)
    }

    /// Direction as a vector.
    pub fn direction(&self) -> Vector3<f64> {
        Vector3::from(self.direction)
    }
}

/// The points of one configuration (A alone, B alone, or the assembly AJB).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Configuration {
    /// Response channels, in the sheet's order.
    pub channels: Vec<Point>,
    /// Impacts, in the sheet's order.
    pub impacts: Vec<Point>,
}

impl Configuration {
    /// Names of the FRF's outputs: the description if the name repeats in the sheet, otherwise the
    /// name.
    pub fn output_names(&self) -> Vec<String> {
        frf_names(&self.channels)
    }

    /// Names of the FRF's inputs, by the same rule (an impact's name does not normally repeat).
    pub fn input_names(&self) -> Vec<String> {
        frf_names(&self.impacts)
    }
}

/// The geometry of the whole experiment. One axis system: x lateral, y vertical, z sliding; metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// Substructure A alone.
    pub a: Configuration,
    /// Substructure B alone.
    pub b: Configuration,
    /// The assembly.
    pub ajb: Configuration,
    /// A's virtual point, m.
    pub virtual_point_a_m: [f64; 3],
    /// B's virtual point, m.
    pub virtual_point_b_m: [f64; 3],
}

impl Geometry {
    /// Name and first coordinate (m) of a point that is further away than any rig is large, which
    /// suggests positions in mm.
    pub fn too_far(&self) -> Option<(&str, f64)> {
        let centres = [self.virtual_point_a_m, self.virtual_point_b_m];
        let centres = centres.into_iter().map(|at| ("the virtual point", at));
        let points = Structure::ALL.into_iter().flat_map(|structure| {
            let own = self.points(structure);
            own.channels.iter().chain(&own.impacts).map(|point| (point.name.as_str(), point.position_m))
        });
        centres.chain(points).find_map(|(name, at)| Some((name, too_far(at)?)))
    }

    /// The points of one structure.
    pub fn points(&self, structure: Structure) -> &Configuration {
        match structure {
            Structure::A => &self.a,
            Structure::B => &self.b,
            Structure::Ajb => &self.ajb,
        }
    }

    /// The points of one structure, mutable.
    pub fn points_mut(&mut self, structure: Structure) -> &mut Configuration {
        match structure {
            Structure::A => &mut self.a,
            Structure::B => &mut self.b,
            Structure::Ajb => &mut self.ajb,
        }
    }
}

fn frf_names(points: &[Point]) -> Vec<String> {
    let mut count: HashMap<&str, usize> = HashMap::new();
    for point in points {
        *count.entry(point.name.as_str()).or_default() += 1;
    }
    points
        .iter()
        .map(|p| if count[p.name.as_str()] > 1 { p.description.clone() } else { p.name.clone() })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(name: &str, description: &str) -> Point {
        Point {
            name: name.into(),
            description: description.into(),
            grouping: Grouping::InterfaceA,
            position_m: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
        }
    }

    #[test]
    fn the_description_names_an_output_only_where_the_name_repeats() {
        let table = Configuration {
            channels: vec![point("A1", "A1:x"), point("A1", "A1:y"), point("L", "laser on A")],
            impacts: vec![point("AZ1", "front")],
        };
        assert_eq!(table.output_names(), ["A1:x", "A1:y", "L"]);
        assert_eq!(table.input_names(), ["AZ1"]);
    }

    #[test]
    fn positions_in_millimetres_are_further_than_any_rig() {
        let at = |position_m| {
            let own = Configuration {
                channels: vec![Point { position_m, ..point("A1", "A1:x") }],
                impacts: vec![],
            };
            let (b, ajb) = (Configuration::default(), Configuration::default());
            Geometry { a: own, b, ajb, virtual_point_a_m: [0.0; 3], virtual_point_b_m: [0.0; 3] }
        };
        assert_eq!(at([0.02, -0.03, 5.0]).too_far(), None);
        assert_eq!(at([20.0, -30.0, 0.0]).too_far(), Some(("A1", 20.0)));
        assert!(at([0.0, f64::NAN, 0.0]).too_far().is_some());
    }

    #[test]
    fn groupings_are_one_to_six() {
        assert!(Grouping::try_from(0).is_err() && Grouping::try_from(7).is_err());
        for n in 1..=6u8 {
            assert_eq!(Grouping::try_from(n).map(u8::from), Ok(n));
        }
    }
}
