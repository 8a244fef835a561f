//! One configuration, ready to be stepped: its matrices, its modes, and what its channels see.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::config::RigConfig;
use super::modal::{ModalError, Mode, modes};
use super::probe::{AXES, Probe};
use super::sensors::{CHANNELS, Channel, FIRST_SIGNAL};
use super::state_space::StateSpace;
use super::stepper::{Aimed, ExponentialStepper, ModalStepper, Stepper};
use super::structure::Structure;
use super::{Aim, Configuration, RigError};

/// How the structure is advanced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stepping {
    /// By modes where the modes are good, else by the matrix exponential.
    #[default]
    Fastest,
    /// By the matrix exponential always: the baseline.
    Exponential,
}

/// A configuration's structure, prepared once.
#[derive(Debug, Clone)]
pub(super) struct Plant {
    structure: Structure,
    space: StateSpace,
    way: Way,
    period_s: f64,
}

#[derive(Debug, Clone)]
enum Way {
    Modal(Arc<Vec<Mode>>),
    Exponential { a: Arc<DMatrix<f64>>, turn: Arc<DMatrix<f64>>, reason: Option<ModalError> },
}

impl Plant {
    pub(super) fn new(
        config: &RigConfig,
        configuration: Configuration,
        stepping: Stepping,
        period_s: f64,
    ) -> Result<Self, RigError> {
        let structure = Structure::new(config, configuration);
        let space = StateSpace::new(&structure)?;
        let exponential = |reason| Way::Exponential {
            a: Arc::new(space.a.clone()),
            turn: Arc::new(ExponentialStepper::turn(&space.a, period_s)),
            reason,
        };
        let way = match stepping {
            Stepping::Exponential => exponential(None),
            Stepping::Fastest => match modes(&space) {
                Ok(modes) => Way::Modal(Arc::new(modes)),
                Err(reason) => exponential(Some(reason)),
            },
        };
        Ok(Self { structure, space, way, period_s })
    }

    /// A stepper at rest that sees and pushes where `aim` says.
    pub(super) fn aimed(
        &self,
        config: &RigConfig,
        aim: &Aim,
        channels: &[Channel; CHANNELS],
    ) -> Result<Stepper, RigError> {
        let missing = |probe: &Probe| RigError::MissingBody {
            body: probe.body.as_str(),
            configuration: self.structure.configuration(),
        };
        let velocity = |probe: &Probe| self.structure.row(probe).map(|row| self.space.velocity(&row));
        let nothing = || DVector::zeros(self.space.order());
        let [x, y, z] = &aim.response;
        let seen = |probe| velocity(probe).ok_or_else(|| missing(probe));
        let spot = |spot| velocity(&Probe::along_z(spot)).unwrap_or_else(nothing);
        // A load cell's signal is its spring force kz · z on arm B.
        let cell = |index: usize| {
            let it = &config.load_cells[index];
            let probe =
                Probe { body: super::config::BodyName::ArmB, position_m: it.position_m, direction: AXES[2] };
            let row = self.structure.row(&probe).map(|row| self.space.displacement(&row));
            row.unwrap_or_else(nothing) * it.stiffness_n_per_m[2]
        };
        let hit = self.structure.row(&aim.impact).ok_or_else(|| missing(&aim.impact))?;
        let pushed =
            Probe { body: config.shaker.body, position_m: config.shaker.position_m, direction: AXES[2] };
        let aimed = Aimed {
            rows: [
                seen(x)?,
                seen(y)?,
                seen(z)?,
                spot(&config.spots.ldv_a),
                spot(&config.spots.ldv_b),
                cell(0),
                cell(1),
                cell(2),
            ],
            hammer: self.space.input(&hit),
            // Without its body the shaker pushes nothing.
            shaker: self.structure.row(&pushed).map_or_else(nothing, |row| self.space.input(&row)),
            steps: std::array::from_fn(|signal| channels[FIRST_SIGNAL + signal].step()),
        };
        Ok(match &self.way {
            Way::Modal(modes) => Stepper::Modal(ModalStepper::new(modes, &aimed, self.period_s)),
            Way::Exponential { a, turn, .. } => {
                Stepper::Exponential(ExponentialStepper::new(a, turn, &aimed, self.period_s))
            }
        })
    }

    pub(super) fn energy_j(&self, stepper: &Stepper) -> f64 {
        self.space.energy_j(&stepper.state())
    }

    pub(super) fn motion(&self, stepper: &Stepper, probe: &Probe) -> Option<(f64, f64)> {
        let row = self.structure.row(probe)?;
        let x = stepper.state();
        Some((self.space.displacement(&row).dot(&x), self.space.velocity(&row).dot(&x)))
    }

    pub(super) fn fallback(&self) -> Option<ModalError> {
        match &self.way {
            Way::Modal(_) => None,
            Way::Exponential { reason, .. } => *reason,
        }
    }
}
