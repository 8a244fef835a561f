//! One configuration, prepared for stepping: its matrices, its modes, and its channels' output
//! rows.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::channels::{CHANNELS, Channel, FIRST_SIGNAL};
use super::config::{BodyName, ContactLaw, FixedQuantity, FixedSensor, KnownMass, RigConfig};
use super::modal::StateSpace;
use super::modal::{ModalError, Mode, modes};
use super::probe::{AXES, Probe};
use super::sensors::{Direct, FixedFlaw, FixedRows, Flaws};
use super::sliders::Sliders;
use super::stepper::{Aimed, ExponentialStepper, Joint, ModalStepper, Slipping, Stepper};
use super::structure::Structure;
use super::{Aim, Configuration, JointState, RigError};

/// How the structure is advanced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stepping {
    /// By modes if the modes pass their checks, otherwise by the matrix exponential.
    #[default]
    Fastest,
    /// Always by the matrix exponential: the baseline.
    Exponential,
}

/// A configuration's structure, prepared once.
#[derive(Debug, Clone)]
pub(super) struct Plant {
    structure: Structure,
    /// The bodies that the contact joins.
    joined: [BodyName; 2],
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
        Self::of(Structure::new(config, configuration), config, stepping, period_s)
    }

    /// The same for the free body of known mass beside the rig.
    pub(super) fn of_known_mass(
        mass: &KnownMass,
        config: &RigConfig,
        stepping: Stepping,
        period_s: f64,
    ) -> Result<Self, RigError> {
        Self::of(Structure::of_known_mass(mass), config, stepping, period_s)
    }

    fn of(
        structure: Structure,
        config: &RigConfig,
        stepping: Stepping,
        period_s: f64,
    ) -> Result<Self, RigError> {
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
        Ok(Self { structure, joined: config.joined(), space, way, period_s })
    }

    /// A stepper at rest with the inputs and outputs of `aim` and `flaws`, and the sliders of its
    /// joint if it can slip.
    pub(super) fn aimed(
        &self,
        config: &RigConfig,
        flaws: &Flaws,
        aim: &Aim,
        channels: &[Channel],
    ) -> Result<(Stepper, Option<Slipping>), RigError> {
        let missing = |probe: &Probe| RigError::MissingBody {
            body: probe.body.to_string(),
            configuration: self.structure.configuration(),
        };
        let velocity = |probe: &Probe| self.structure.row(probe).map(|row| self.space.velocity(&row));
        let nothing = || DVector::zeros(self.space.order());
        let [x, y, z] = &aim.response;
        let seen = |probe| velocity(probe).ok_or_else(|| missing(probe));
        let sliding = config.contact.sliding();
        let errors = config.errors.acting();
        let spot =
            |name, spot| velocity(&Probe::at(spot, errors.tilted(name, sliding))).unwrap_or_else(nothing);
        let [spot_a, spot_b] = match &aim.at_mark {
            Some([a, b]) => [a, b],
            None => [&flaws.spots.ldv_a, &flaws.spots.ldv_b],
        };
        // A load cell's signal is its spring force kz · z on the body that it supports, with z
        // relative to the body that it stands on.
        let cells = self.structure.load_cells(config);
        let cell = |index: usize| {
            let it = &config.load_cells[index];
            let probe = |body| Probe { body, position_m: it.position_m, direction: AXES[2] };
            let row = cells.and_then(|(from, to)| {
                let row = self.structure.row(&probe(to))?;
                Some(match from {
                    Some(from) => row - self.structure.row(&probe(from))?,
                    None => row,
                })
            });
            let row = row.map(|row| self.space.displacement(&row));
            row.unwrap_or_else(nothing) * it.stiffness_n_per_m[2]
        };
        let fixed = |(own, flaw): (&FixedSensor, &FixedFlaw)| {
            let velocity = velocity(&flaw.probe).unwrap_or_else(nothing);
            match own.quantity {
                FixedQuantity::Velocity => velocity,
                FixedQuantity::Acceleration => self.space.a.tr_mul(&velocity),
            }
        };
        let hit = self.structure.row(&aim.impact).ok_or_else(|| missing(&aim.impact))?;
        let pushed =
            Probe { body: config.shaker.body, position_m: config.shaker.position_m, direction: sliding };
        let aimed = Aimed {
            rows: [
                seen(x)?,
                seen(y)?,
                seen(z)?,
                spot("ldv_a", spot_a),
                spot("ldv_b", spot_b),
                cell(0),
                cell(1),
                cell(2),
            ],
            hammer: self.space.input(&hit),
            // Without its body the shaker excites nothing.
            shaker: self.structure.row(&pushed).map_or_else(nothing, |row| self.space.input(&row)),
            steps: std::array::from_fn(|signal| channels[FIRST_SIGNAL + signal].step()),
            joint: self.joint(config),
            fixed: FixedRows {
                rows: config.sensors.fixed.iter().zip(&flaws.fixed).map(fixed).collect(),
                steps: channels[CHANNELS..].iter().map(Channel::step).collect(),
            },
        };
        let stepper = match &self.way {
            Way::Modal(modes) => Stepper::Modal(Box::new(ModalStepper::new(modes, &aimed, self.period_s))),
            Way::Exponential { a, turn, .. } => {
                Stepper::Exponential(Box::new(ExponentialStepper::new(a, turn, &aimed, self.period_s)))
            }
        };
        let Some(joint) = &aimed.joint else { return Ok((stepper, None)) };
        let Some(sliders) =
            Sliders::new(&config.contact, config.errors.normal_load_slope_per_m(), joint.step_s)
        else {
            return Ok((stepper, None));
        };
        let slipping = Slipping::new(sliders, joint, &stepper).ok_or_else(|| RigError::Field {
            field: "contact.slip_step_s".to_owned(),
            reason: format!(
                "is too long for this contact stiffness and these masses: try {:.0e}",
                joint.step_s / 4.0
            ),
            line: None,
        })?;
        Ok((stepper, Some(slipping)))
    }

    /// The state of another plant of the same bodies in this one's coordinates.
    pub(super) fn state_of(&self, other: &Self, stepper: &Stepper) -> DVector<f64> {
        self.space.state(&self.structure.mass, &other.space.motion(&stepper.state()))
    }

    /// What the fixed sensors read directly of the forces of the same moment.
    pub(super) fn direct(&self, config: &RigConfig, flaws: &Flaws, aim: &Aim) -> Vec<Direct> {
        let nothing = || DVector::zeros(self.space.order());
        let input = |row: Option<DVector<f64>>| row.map_or_else(nothing, |row| self.space.input(&row));
        let shaker = &config.shaker;
        let pushed =
            Probe { body: shaker.body, position_m: shaker.position_m, direction: config.contact.sliding() };
        let hammer = input(self.structure.row(&aim.impact));
        let shaker = input(self.structure.row(&pushed));
        let joint = self.joint(config).map_or_else(nothing, |joint| joint.column);
        let one = |(own, flaw): (&FixedSensor, &FixedFlaw)| match own.quantity {
            FixedQuantity::Velocity => Direct::default(),
            FixedQuantity::Acceleration => {
                let velocity = input(self.structure.row(&flaw.probe));
                Direct {
                    hammer: velocity.dot(&hammer),
                    shaker: velocity.dot(&shaker),
                    joint: velocity.dot(&joint),
                }
            }
        };
        config.sensors.fixed.iter().zip(&flaws.fixed).map(one).collect()
    }

    /// The joint, if there is one that can slip.
    fn joint(&self, config: &RigConfig) -> Option<Joint> {
        let contact = &config.contact;
        if contact.law == ContactLaw::Linear {
            return None;
        }
        let row = self.relative(config)?;
        // The factor 1 - 1e-9 keeps rounding from increasing an exact integer quotient.
        let steps = (self.period_s / contact.slip_step_s * (1.0 - 1e-9)).ceil().max(1.0);
        Some(Joint {
            row: self.space.displacement(&row) + self.space.velocity(&row) * contact.damping_s[2],
            column: self.space.input(&row),
            steps: steps as u32,
            step_s: self.period_s / steps,
        })
    }

    /// Row of the structure for specimen A's motion minus B's along the sliding direction at the
    /// contact; `None` outside the assembly.
    fn relative(&self, config: &RigConfig) -> Option<DVector<f64>> {
        let (position_m, direction) = (config.contact_m(), config.contact.sliding());
        let at = |body| self.structure.row(&Probe { body, position_m, direction });
        let [a, b] = self.joined;
        Some(at(a)? - at(b)?)
    }

    /// Current state of the joint; `None` outside the assembly.
    pub(super) fn joint_state(
        &self,
        config: &RigConfig,
        stepper: &Stepper,
        slipping: Option<&Slipping>,
    ) -> Option<JointState> {
        let contact = &config.contact;
        let row = self.relative(config)?;
        let x = stepper.state();
        let relative_m = self.space.displacement(&row).dot(&x);
        let Some(sliders) = slipping.map(Slipping::sliders) else {
            let speed = self.space.velocity(&row).dot(&x);
            let force_n = contact.stiffness_n_per_m[2] * (relative_m + contact.damping_s[2] * speed);
            return Some(JointState {
                relative_m,
                force_n,
                limit_n: f64::INFINITY,
                sliding: 0.0,
                slid_m: 0.0,
                friction_j: 0.0,
            });
        };
        Some(JointState {
            relative_m,
            force_n: sliders.force_n(),
            limit_n: sliders.limit_n(),
            sliding: sliders.sliding(),
            slid_m: sliders.slid_m(),
            friction_j: sliders.friction_j(),
        })
    }

    pub(super) fn energy_j(&self, config: &RigConfig, stepper: &Stepper, slipping: Option<&Slipping>) -> f64 {
        let x = stepper.state();
        let stuck_j = self.space.energy_j(&x);
        let (Some(slipping), Some(row)) = (slipping, self.relative(config)) else { return stuck_j };
        let relative_m = self.space.displacement(&row).dot(&x);
        stuck_j - 0.5 * config.contact.stiffness_n_per_m[2] * relative_m * relative_m
            + slipping.sliders().stored_j(relative_m)
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
