//! Positions of the impacts, responses and fixed sensors of a plan.

use serde::Deserialize;
use toml::Spanned;

/// The geometry: x lateral, y vertical, z sliding (unless `[structure]` states otherwise); origin
/// at the contact centre.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeometryPlan {
    /// Position of both virtual points, m.
    pub virtual_point_m: [f64; 3],
    /// Response points, each measured along x, y and z or along the axes it lists.
    pub response: Vec<Spanned<ResponsePoint>>,
    /// Impact points.
    pub impact: Vec<Spanned<ImpactPoint>>,
    /// Fixed sensors.
    #[serde(default)]
    pub sensor: Vec<Spanned<SensorPoint>>,
}

/// A response point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponsePoint {
    /// Its name.
    pub name: String,
    /// 1 interface of A, 2 interface of B, 3 internal of A, 4 internal of B, 5 on specimen A, 6 on
    /// specimen B.
    pub grouping: u8,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Standard deviation of the position along each axis, m; if absent, the value in `[priors]`
    /// for its kind of point applies.
    pub sigma_m: Option<f64>,
    /// Measurement direction of each channel of the sensor, one to three unit vectors; x, y and z
    /// if absent. Records hold the channels in this order.
    pub axes: Option<Vec<[f64; 3]>>,
    /// Names of the device's channels, one for each axis, to which a fixed sensor at this point is
    /// connected: all such sensors measure every hit simultaneously. If absent, the vibrometer is
    /// aimed at this point.
    pub channels: Option<Vec<String>>,
}

impl ResponsePoint {
    /// The channels' names and directions: `A1:x`, `A1:y`, `A1:z`; with listed axes `A1` if there
    /// is one, else `A1:1`, `A1:2`, …
    pub fn axes(&self) -> Vec<(String, [f64; 3])> {
        let name = &self.name;
        match &self.axes {
            None => [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])]
                .map(|(axis, direction)| (format!("{name}:{axis}"), direction))
                .to_vec(),
            Some(axes) if axes.len() == 1 => vec![(name.clone(), axes[0])],
            Some(axes) => (1..).zip(axes).map(|(number, axis)| (format!("{name}:{number}"), *axis)).collect(),
        }
    }
}

/// An impact point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImpactPoint {
    /// Its name.
    pub name: String,
    /// 1 interface of A, 2 interface of B, 3 internal of A, 4 internal of B, 5 on specimen A, 6 on
    /// specimen B.
    pub grouping: u8,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Direction in which the hammer pushes, a unit vector.
    pub direction: [f64; 3],
}

/// A fixed sensor.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorPoint {
    /// Its name.
    pub name: String,
    /// Its position, m.
    pub position_m: [f64; 3],
    /// Its measurement direction, a unit vector.
    pub direction: [f64; 3],
}
