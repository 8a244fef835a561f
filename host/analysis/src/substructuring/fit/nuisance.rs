//! The errors of geometry as nuisance parameters, and their assignment to cells.

use super::block::ReceptanceBlock;
use super::cell::CellError;
use crate::substructuring::averaged::Priors;
use nalgebra::Vector3;

/// Nuisance parameters for the aim of a cell: three of the sensor, two of the impact.
pub(super) const AIMS: usize = 5;

/// All unknown errors of geometry with their priors: the nuisance parameters.
///
/// A sensor's position (three) and an impact's position and tilt (two each) are common to all
/// configurations; each cell has five more for its aim. An internal point's own error cancels
/// between the substructure and the assembly.
pub(super) struct Nuisances {
    /// Standard deviations, m or rad.
    pub(super) std: Vec<f64>,
    sensors: Vec<(String, usize)>,
    impacts: Vec<(String, usize)>,
    /// Index of the first aim error of each block.
    aims: Vec<usize>,
}

/// Indices of one cell's nuisance parameters: sensor's position (3), impact's position and tilt
/// (4), aim (5).
pub(super) struct CellNuisances {
    pub(super) sensor: Option<usize>,
    pub(super) impact: Option<usize>,
    pub(super) aim: usize,
}

impl Nuisances {
    pub(super) fn of(blocks: &[&ReceptanceBlock], priors: &Priors) -> Nuisances {
        let mut n = Nuisances { std: vec![], sensors: vec![], impacts: vec![], aims: vec![] };
        for block in blocks {
            for sensor in block.sensors.iter().filter(|s| !s.internal()) {
                if !n.sensors.iter().any(|(name, _)| *name == sensor.name) {
                    n.sensors.push((sensor.name.clone(), n.std.len()));
                    n.std.extend([priors.position_m; 3]);
                }
            }
            for impact in block.impacts.iter().filter(|i| !i.internal()) {
                if !n.impacts.iter().any(|(name, _)| *name == impact.name) {
                    n.impacts.push((impact.name.clone(), n.std.len()));
                    n.std.extend([priors.position_m; 2]);
                    n.std.extend([priors.hammer_angle_rad; 2]);
                }
            }
        }
        for block in blocks {
            n.aims.push(n.std.len());
            let cells = block.sensors.len() * block.impacts.len();
            n.std.extend(std::iter::repeat_n(priors.aim_m, AIMS * cells));
        }
        n
    }

    /// Index of the first aim error of the assembly, the last block; all later ones are aims at its
    /// cells.
    pub(super) fn of_assembly(&self) -> usize {
        self.aims.last().copied().unwrap_or_default()
    }

    pub(super) fn of_cell(
        &self,
        block: usize,
        of: &ReceptanceBlock,
        sensor: usize,
        impact: usize,
    ) -> CellNuisances {
        let find =
            |all: &[(String, usize)], name: &str| all.iter().find(|(n, _)| n == name).map(|(_, at)| *at);
        CellNuisances {
            sensor: find(&self.sensors, &of.sensors[sensor].name).filter(|_| !of.sensors[sensor].internal()),
            impact: find(&self.impacts, &of.impacts[impact].name).filter(|_| !of.impacts[impact].internal()),
            aim: self.aims[block] + AIMS * (sensor * of.impacts.len() + impact),
        }
    }

    /// The cell's error for nuisance parameters `eta` in standard deviations.
    pub(super) fn error(&self, at: &CellNuisances, eta: &[f64]) -> CellError {
        let value = |i: usize| eta[i] * self.std[i];
        let mut error = CellError {
            sensor: Vector3::from_fn(|k, _| value(at.aim + k)),
            impact: [value(at.aim + 3), value(at.aim + 4)],
            tilt: [0.0; 2],
        };
        if let Some(sensor) = at.sensor {
            error.sensor += Vector3::from_fn(|k, _| value(sensor + k));
        }
        if let Some(impact) = at.impact {
            for k in 0..2 {
                error.impact[k] += value(impact + k);
                error.tilt[k] = value(impact + 2 + k);
            }
        }
        error
    }
}
