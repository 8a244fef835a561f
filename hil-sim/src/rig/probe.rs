//! A direction at a point of a body, for measurement or excitation.

use super::config::{BodyName, ImpactPoint, ResponsePoint, RigConfig, Spot};
use super::normalized;
use super::{Configuration, RigError};

/// Unit vectors of the axes.
pub const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// One scalar output (motion along `direction`) or input (force along it).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// The body it sits on.
    pub body: BodyName,
    /// Position (m).
    pub position_m: [f64; 3],
    /// Unit vector.
    pub direction: [f64; 3],
}

impl Probe {
    /// Probe of a single-point vibrometer that measures along `direction`.
    pub fn at(spot: &Spot, direction: [f64; 3]) -> Self {
        Self { body: spot.body, position_m: spot.position_m, direction }
    }

    /// The same for a contact that slides along z.
    pub fn along_z(spot: &Spot) -> Self {
        Self::at(spot, AXES[2])
    }
}

impl ResponsePoint {
    /// x, y and z at the nominal position.
    pub fn probes(&self) -> [Probe; 3] {
        AXES.map(|direction| Probe { body: self.body, position_m: self.position_m, direction })
    }
}

impl ImpactPoint {
    /// Along the impact's direction at the nominal position.
    pub fn probe(&self) -> Probe {
        Probe { body: self.body, position_m: self.position_m, direction: normalized(self.direction) }
    }
}

impl RigConfig {
    /// The response point `name`, if `configuration` has it.
    ///
    /// # Errors
    /// [`RigError::UnknownPoint`] listing the valid names.
    pub fn response(&self, configuration: Configuration, name: &str) -> Result<&ResponsePoint, RigError> {
        let there = || self.responses.iter().filter(|point| self.has(configuration, point.body));
        there().find(|point| point.name == name).ok_or_else(|| RigError::UnknownPoint {
            kind: "response",
            name: name.to_owned(),
            configuration,
            valid: there().map(|point| point.name.clone()).collect(),
        })
    }

    /// The impact point `name`, if `configuration` has it.
    ///
    /// # Errors
    /// [`RigError::UnknownPoint`] listing the valid names.
    pub fn impact(&self, configuration: Configuration, name: &str) -> Result<&ImpactPoint, RigError> {
        let there = || self.impacts.iter().filter(|point| self.has(configuration, point.body));
        there().find(|point| point.name == name).ok_or_else(|| RigError::UnknownPoint {
            kind: "impact",
            name: name.to_owned(),
            configuration,
            valid: there().map(|point| point.name.clone()).collect(),
        })
    }
}
