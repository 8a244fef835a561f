//! Where impacts, responses and fixed sensors of a plan are.

use serde::Deserialize;
use toml::Spanned;

/// Where everything is: x lateral, y vertical, z sliding (or as `[structure]` says); origin at the contact centre.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeometryPlan {
    /// Both virtual points, m.
    pub virtual_point_m: [f64; 3],
    /// Response points, each measured along x, y and z or along axes of its own.
    pub response: Vec<Spanned<ResponsePoint>>,
    /// Impact points.
    pub impact: Vec<Spanned<ImpactPoint>>,
    /// Sensors that stay where they are.
    #[serde(default)]
    pub sensor: Vec<Spanned<SensorPoint>>,
}

/// A response point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponsePoint {
    /// Its name.
    pub name: String,
    /// 1 interface of A, 2 interface of B, 3 internal of A, 4 internal of B, 5 on specimen A, 6 on specimen B.
    pub grouping: u8,
    /// Where it is, m.
    pub position_m: [f64; 3],
    /// How well that is known, standard deviation along each axis, m; without it, as `[priors]` says of its kind.
    pub sigma_m: Option<f64>,
    /// What each channel of the sensor feels, one to three unit vectors; along x, y and z without it. Records hold the channels in this
    /// order.
    pub axes: Option<Vec<[f64; 3]>>,
    /// Names of the device's channels on which a sensor that stays here is, one for each axis: every hit is measured by all such sensors
    /// at once. Without it, the vibrometer comes here.
    pub channels: Option<Vec<String>>,
}

impl ResponsePoint {
    /// The channels' names and directions: `A1:x`, `A1:y`, `A1:z`; with axes of its own `A1` where it is one, else `A1:1`, `A1:2`, …
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
    /// 1 interface of A, 2 interface of B, 3 internal of A, 4 internal of B, 5 on specimen A, 6 on specimen B.
    pub grouping: u8,
    /// Where it is, m.
    pub position_m: [f64; 3],
    /// Where the hammer pushes, a unit vector.
    pub direction: [f64; 3],
}

/// A sensor that stays where it is.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorPoint {
    /// Its name.
    pub name: String,
    /// Where it is, m.
    pub position_m: [f64; 3],
    /// What it feels, a unit vector.
    pub direction: [f64; 3],
}
