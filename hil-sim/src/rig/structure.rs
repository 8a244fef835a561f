//! The structure: bodies joined by bushings, as M, C and K.
//!
//! A rigid body moves by q = (t, θ) at its centre of gravity; a point r of it by
//! u = t + θ × (r − cg), that is D = [I, −skew(r − cg); 0, I]. A body that bends (`beam`) also has
//! elastic modes, of which D then has further columns. A bushing between two bodies adds Dᵀ diag(k) D to K
//! and Dᵀ diag(β k) D to C with D = [−D₁, D₂]; ground is a zero row. Rigid bodies have six degrees
//! of freedom: 18 in A, 6 in B, 24 in AJB. With a rigid clamp A the specimen is lumped onto arm A:
//! six fewer in A and AJB. With a compliant clamp B, specimen B is a separate body: six more in B
//! and AJB. Arm B's values include its specimen, so that a very stiff clamp B is equivalent to a
//! rigid one. A specimen that bends and whose clamp is rigid is held by its arm at the clamp: there
//! both sections move as one, and only its elastic modes are coordinates. A rig with a user-defined
//! structure has the bodies and springs that it lists.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Matrix6xX};
use num_complex::Complex;

use super::beam::{Shapes, rigid_motion};
use super::config::{Beam, BodyName, Bushing, Clamp, KnownMass, OwnStructure, RigConfig, RigidBody};
use super::normalized;
use super::{Configuration, Probe, Quantity, RigError};

/// M, C and K of one configuration, SI, in the bodies' own coordinates (m and rad).
#[derive(Debug, Clone)]
pub struct Structure {
    configuration: Configuration,
    bodies: Vec<Body>,
    /// Whether the specimens of A and B are part of their arms.
    lumped: [bool; 2],
    /// Mass (kg, kg m²), symmetric positive definite, n × n.
    pub mass: DMatrix<f64>,
    /// Damping (N s/m, N m s/rad), n × n.
    pub damping: DMatrix<f64>,
    /// Stiffness (N/m, N m/rad), n × n.
    pub stiffness: DMatrix<f64>,
}

impl Structure {
    /// Assembles `configuration` of the rig.
    pub fn new(config: &RigConfig, configuration: Configuration) -> Self {
        match &config.structure {
            Some(own) => Self::of_its_own(config, own, configuration),
            None => Self::of_the_paper(config, configuration),
        }
    }

    /// Whether a body of it bends.
    pub fn bends(&self) -> bool {
        self.bodies.iter().any(|body| body.elastic.is_some())
    }

    /// The free body of known mass alone.
    pub(super) fn of_known_mass(mass: &KnownMass) -> Self {
        let body = Body::new(BodyName::KnownMass, mass.body.cg_m);
        let mut structure = Self::empty(Configuration::B, vec![body], [false, false]);
        structure.carry(BodyName::KnownMass, &body_mass(&mass.body));
        structure.connect(None, Some(BodyName::KnownMass), &mass.foam);
        structure
    }

    /// Checks that all bodies that should bend do.
    ///
    /// # Errors
    /// [`RigError::Structure`] if the modes of a beam could not be found: a beam that
    /// [`RigConfig::check`] refuses.
    pub fn complete(&self) -> Result<(), RigError> {
        if self.bodies.iter().any(|body| body.lacks_modes) {
            let what = "a beam has no modes: its length, section, material or mass is not possible";
            return Err(RigError::Structure { configuration: self.configuration, what });
        }
        Ok(())
    }

    /// A user-defined structure of any bodies and springs.
    fn of_its_own(config: &RigConfig, own: &OwnStructure, configuration: Configuration) -> Self {
        let bodies: Vec<_> = own.bodies.iter().filter(|body| config.has(configuration, body.name)).collect();
        let there = bodies.iter().map(|body| {
            let rigid = body.rigid();
            Body::new(body.name, rigid.cg_m).bending(rigid.beam.as_ref(), rigid.mass_kg, &[])
        });
        // nothing is lumped onto another body
        let mut structure = Self::empty(configuration, there.collect(), [false, false]);
        for body in bodies {
            structure.carry(body.name, &body_mass(&body.rigid()));
        }
        for spring in own.springs.iter().filter(|spring| spring.present.contains(&configuration)) {
            let ends = spring.ends();
            let there = |end: &Option<BodyName>| end.is_none_or(|body| config.has(configuration, body));
            if ends.iter().all(there) {
                structure.connect_along(ends[0], ends[1], &spring.bushing(), spring.axes);
            }
        }
        if configuration == Configuration::Ajb {
            structure.join(config);
        }
        if let Some((from, to)) = structure.load_cells(config) {
            for cell in &config.load_cells {
                structure.connect(from, Some(to), cell);
            }
        }
        structure.add_paths(config);
        structure.carry_sensors(config);
        structure
    }

    /// Bodies without mass except that of elastic modes, with the stiffness of these modes, not
    /// connected.
    pub(super) fn empty(configuration: Configuration, mut bodies: Vec<Body>, lumped: [bool; 2]) -> Self {
        let mut n = 0;
        for body in &mut bodies {
            body.at = n;
            n += body.coordinates();
        }
        let zeros = || DMatrix::zeros(n, n);
        let (mut mass, mut damping, mut stiffness) = (zeros(), zeros(), zeros());
        for body in &bodies {
            let Some(elastic) = &body.elastic else { continue };
            for (mode, square) in elastic.squares.iter().enumerate() {
                let at = body.modes_at() + mode;
                mass[(at, at)] = 1.0;
                stiffness[(at, at)] = *square;
                damping[(at, at)] = elastic.damping_s * square;
            }
        }
        Self { configuration, bodies, lumped, mass, damping, stiffness }
    }

    /// The paper's chain of bodies.
    fn of_the_paper(config: &RigConfig, configuration: Configuration) -> Self {
        let bodies = &config.bodies;
        let lumped = config.lumped();
        let mut arm_b_kg = bodies.arm_b.mass_kg;
        if !lumped[1] {
            arm_b_kg -= bodies.specimen_b.mass_kg;
        }
        let all = [
            (BodyName::Mass, &bodies.mass, bodies.mass.mass_kg),
            (BodyName::ArmA, &bodies.arm_a, bodies.arm_a.mass_kg),
            (BodyName::SpecimenA, &bodies.specimen_a, bodies.specimen_a.mass_kg),
            (BodyName::ArmB, &bodies.arm_b, arm_b_kg),
            (BodyName::SpecimenB, &bodies.specimen_b, bodies.specimen_b.mass_kg),
        ];
        let present: Vec<_> = all
            .into_iter()
            .filter(|(name, ..)| {
                configuration.has(*name)
                    && !(*name == BodyName::SpecimenA && lumped[0])
                    && !(*name == BodyName::SpecimenB && lumped[1])
            })
            .collect();
        let body = |(name, body, mass_kg): &(BodyName, &RigidBody, f64)| {
            Body::new(*name, body.cg_m).of_the_paper(config, configuration, body.beam.as_ref(), *mass_kg)
        };
        let there = present.iter().map(body).collect();
        let mut structure = Self::empty(configuration, there, lumped);
        for (name, body, _) in &present {
            let mut mass = body_mass(body);
            if *name == BodyName::ArmB && !lumped[1] {
                let specimen = &bodies.specimen_b;
                let lever = rigid_motion(specimen.cg_m, body.cg_m);
                mass += lever.transpose() * body_mass(specimen) * lever * -1.0;
            }
            structure.carry(*name, &mass);
        }
        if lumped[0]
            && let Some(lever) = structure.motion(BodyName::ArmA, bodies.specimen_a.cg_m)
        {
            structure.mass += lever.transpose() * body_mass(&bodies.specimen_a) * lever;
        }
        structure.support(config);
        structure.add_paths(config);
        structure.carry_sensors(config);
        structure
    }

    /// Adds the mass of `body` about its centre of gravity, as far as it moves rigidly.
    fn carry(&mut self, body: BodyName, mass: &Matrix6<f64>) {
        if let Some(rigid) = self.find(body).map(|body| self.rigid(body)) {
            self.mass += rigid.transpose() * mass * rigid;
        }
    }

    /// Adds the masses of the fixed sensors, as points, to the bodies that are present.
    fn carry_sensors(&mut self, config: &RigConfig) {
        for own in config.sensors.fixed.iter().filter(|own| own.mass_kg > 0.0) {
            let point = config.responses.iter().find(|point| point.name == own.response);
            let moved = point.and_then(|point| self.motion(point.body, point.position_m));
            if let Some(moved) = moved {
                let moved = moved.rows(0, 3);
                self.mass += moved.transpose() * moved * own.mass_kg;
            }
        }
    }

    /// Adds the contact.
    pub(super) fn join(&mut self, config: &RigConfig) {
        let [a, b] = config.joined().map(Some);
        for bushing in config.contact_bushings() {
            self.connect_along(a, b, &bushing, config.contact.axes);
        }
    }

    /// Adds the paths whose bodies are all present.
    fn add_paths(&mut self, config: &RigConfig) {
        let configuration = self.configuration;
        for path in config.paths.iter().filter(|path| path.present.contains(&configuration)) {
            let ends = path.ends();
            if ends.iter().flatten().all(|body| self.find(*body).is_some()) {
                self.connect_along(ends[0], ends[1], &path.bushing(), path.axes);
            }
        }
    }

    /// The load cells' ends, of which the first may be the ground (`None`), if this configuration
    /// has them.
    pub(super) fn load_cells(&self, config: &RigConfig) -> Option<(Option<BodyName>, BodyName)> {
        let [from, to] = config.load_cells_join()?;
        let from = (from != BodyName::GROUND).then_some(from);
        let there = from.into_iter().chain([to]).all(|body| self.find(body).is_some());
        there.then_some((from, to))
    }

    fn support(&mut self, config: &RigConfig) {
        let configuration = self.configuration;
        let in_a = configuration == Configuration::A;
        if configuration != Configuration::B {
            for spring in &config.leaf_springs {
                self.connect(None, Some(BodyName::Mass), spring);
            }
            self.connect(Some(BodyName::Mass), Some(BodyName::ArmA), &config.knife_edge);
            for tether in [&config.wire, &config.push_rod_a] {
                if if in_a { tether.in_a } else { tether.in_ajb } {
                    self.connect(None, Some(BodyName::ArmA), &tether.bushing);
                }
            }
            if !config.clamp.rigid {
                let clamp = clamp_of(&config.clamp, configuration);
                self.connect(Some(BodyName::ArmA), Some(BodyName::SpecimenA), clamp);
            }
        }
        if configuration == Configuration::Ajb {
            self.join(config);
        }
        if configuration != Configuration::A {
            if !config.clamp_b.rigid {
                let clamp = clamp_of(&config.clamp_b, configuration);
                self.connect(Some(BodyName::ArmB), Some(BodyName::SpecimenB), clamp);
            }
            for cell in &config.load_cells {
                self.connect(None, Some(BodyName::ArmB), cell);
            }
            self.connect(None, Some(BodyName::ArmB), &config.lower_push_rod);
        }
    }

    /// Degrees of freedom.
    pub fn order(&self) -> usize {
        self.mass.nrows()
    }

    /// Which configuration this is.
    pub fn configuration(&self) -> Configuration {
        self.configuration
    }

    fn find(&self, body: BodyName) -> Option<&Body> {
        let body = match body {
            BodyName::SpecimenA if self.lumped[0] => BodyName::ArmA,
            BodyName::SpecimenB if self.lumped[1] => BodyName::ArmB,
            other => other,
        };
        self.bodies.iter().find(|it| it.name == body)
    }

    /// Motion of a body's material at `position_m` (translation, rotation), 6 × n; `None` if the
    /// body is not present.
    fn motion(&self, body: BodyName, position_m: [f64; 3]) -> Option<Matrix6xX<f64>> {
        let body = self.find(body)?;
        let mut motion = match body.held {
            None => {
                let mut motion = Matrix6xX::zeros(self.order());
                motion.fixed_view_mut::<6, 6>(0, body.at).copy_from(&rigid_motion(position_m, body.cg));
                motion
            }
            Some((by, held_m)) => rigid_motion(position_m, held_m) * self.held_motion(by, held_m),
        };
        if let Some(elastic) = &body.elastic {
            let mut shapes = elastic.at(position_m);
            if let Some((_, held_m)) = body.held {
                shapes -= rigid_motion(position_m, held_m) * elastic.at(held_m);
            }
            motion.view_mut((0, body.modes_at()), (6, elastic.modes())).copy_from(&shapes);
        }
        Some(motion)
    }

    /// Motion of what holds a body; zero if it is not present and counts as ground.
    fn held_motion(&self, by: BodyName, held_m: [f64; 3]) -> Matrix6xX<f64> {
        self.motion(by, held_m).unwrap_or_else(|| Matrix6xX::zeros(self.order()))
    }

    /// Rigid part of a body's motion at its centre of gravity, 6 × n.
    fn rigid(&self, body: &Body) -> Matrix6xX<f64> {
        let Some((by, held_m)) = body.held else {
            let mut rigid = Matrix6xX::zeros(self.order());
            rigid.fixed_view_mut::<6, 6>(0, body.at).fill_with_identity();
            return rigid;
        };
        let mut motion = self.held_motion(by, held_m);
        if let Some(elastic) = &body.elastic {
            motion.view_mut((0, body.modes_at()), (6, elastic.modes())).copy_from(&-elastic.at(held_m));
        }
        rigid_motion(body.cg, held_m) * motion
    }

    fn connect(&mut self, from: Option<BodyName>, to: Option<BodyName>, bushing: &Bushing) {
        self.connect_along(from, to, bushing, None);
    }

    /// The same for a bushing with its own axes. A body that is not present counts as ground.
    pub(super) fn connect_along(
        &mut self,
        from: Option<BodyName>,
        to: Option<BodyName>,
        bushing: &Bushing,
        axes: Option<[[f64; 3]; 3]>,
    ) {
        let mut relative = Matrix6xX::zeros(self.order());
        for (body, sign) in [(from, -1.0), (to, 1.0)] {
            if let Some(motion) = body.and_then(|body| self.motion(body, bushing.position_m)) {
                relative += turned(axes) * motion * sign;
            }
        }
        let [kx, ky, kz] = bushing.stiffness_n_per_m;
        let [krx, kry, krz] = bushing.rotation_nm_per_rad;
        let k = [kx, ky, kz, krx, kry, krz];
        for (row, (k, beta)) in k.iter().zip(bushing.damping_s).enumerate() {
            let d = relative.row(row);
            let outer = d.transpose() * d;
            self.stiffness += &outer * *k;
            self.damping += &outer * (*k * beta);
        }
    }

    /// Row of generalised coordinates (length n) of a probe, as output or input; `None` if its body
    /// is not present.
    pub fn row(&self, probe: &Probe) -> Option<DVector<f64>> {
        let motion = self.motion(probe.body, probe.position_m)?;
        let row = |column: usize| (0..3).map(|axis| probe.direction[axis] * motion[(axis, column)]).sum();
        Some(DVector::from_fn(self.order(), |column, _| row(column)))
    }

    /// Exact FRF at the complex frequency `s` (1/s): rows · (s²M + sC + K)⁻¹ · columns, times s for
    /// mobility and s² for accelerance; shape (outputs, inputs).
    ///
    /// # Errors
    /// [`RigError::MissingBody`] for a probe on a body that is not present; [`RigError::Structure`]
    /// if `s` is a pole, and as for [`Structure::complete`].
    pub fn frf(
        &self,
        s: Complex<f64>,
        quantity: Quantity,
        outputs: &[Probe],
        inputs: &[Probe],
    ) -> Result<DMatrix<Complex<f64>>, RigError> {
        self.complete()?;
        let rows = self.rows(outputs)?;
        let columns = self.rows(inputs)?;
        let scale = self.scale();
        let n = self.order();
        let dynamic = DMatrix::from_fn(n, n, |i, j| {
            (s * s * self.mass[(i, j)] + s * self.damping[(i, j)] + self.stiffness[(i, j)])
                * scale[i]
                * scale[j]
        });
        let forces = DMatrix::from_fn(n, inputs.len(), |i, j| Complex::from(columns[j][i] * scale[i]));
        let motion = dynamic.lu().solve(&forces).ok_or(RigError::Structure {
            configuration: self.configuration,
            what: "the dynamic stiffness is singular at this frequency",
        })?;
        let factor = match quantity {
            Quantity::Receptance => Complex::from(1.0),
            Quantity::Mobility => s,
            Quantity::Accelerance => s * s,
        };
        let seen = DMatrix::from_fn(outputs.len(), n, |i, j| factor * (rows[i][j] * scale[j]));
        Ok(seen * motion)
    }

    fn rows(&self, probes: &[Probe]) -> Result<Vec<DVector<f64>>, RigError> {
        let missing = |probe: &Probe| RigError::MissingBody {
            body: probe.body.to_string(),
            configuration: self.configuration,
        };
        probes.iter().map(|probe| self.row(probe).ok_or_else(|| missing(probe))).collect()
    }

    /// Scales metres and radians to coordinates of unit mass: their stiffnesses differ by 1e6,
    /// which would cost the factorisation digits.
    fn scale(&self) -> DVector<f64> {
        self.mass.diagonal().map(|m| 1.0 / m.sqrt())
    }
}

/// A body of a structure.
#[derive(Debug, Clone)]
pub(super) struct Body {
    name: BodyName,
    cg: [f64; 3],
    /// Its first coordinate: six of rigid motion unless it is held, then one for each mode.
    at: usize,
    elastic: Option<Shapes>,
    /// Whether it should bend, but its modes could not be found.
    lacks_modes: bool,
    /// The body that holds it rigidly, and where.
    held: Option<(BodyName, [f64; 3])>,
}

impl Body {
    /// A rigid body whose six coordinates are its motion at `cg`.
    pub(super) fn new(name: BodyName, cg: [f64; 3]) -> Self {
        Self { name, cg, at: 0, elastic: None, lacks_modes: false, held: None }
    }

    /// The same as a beam of this mass, if one is given, with nodes at the points `loaded`.
    pub(super) fn bending(self, beam: Option<&Beam>, mass_kg: f64, loaded: &[[f64; 3]]) -> Self {
        let elastic = beam.and_then(|beam| Shapes::new(beam, mass_kg, loaded));
        Self { lacks_modes: beam.is_some() && elastic.is_none(), elastic, ..self }
    }

    /// The same for a body of the paper's rig. A specimen has nodes at its clamp and at the
    /// contact, and is held by its arm if the clamp is rigid.
    pub(super) fn of_the_paper(
        self,
        config: &RigConfig,
        configuration: Configuration,
        beam: Option<&Beam>,
        mass_kg: f64,
    ) -> Self {
        let (arm, clamp) = match self.name {
            BodyName::SpecimenA => (BodyName::ArmA, &config.clamp),
            BodyName::SpecimenB => (BodyName::ArmB, &config.clamp_b),
            _ => return self.bending(beam, mass_kg, &[]),
        };
        let clamp_m = clamp_of(clamp, configuration).position_m;
        let bending = self.bending(beam, mass_kg, &[clamp_m, config.contact_m()]);
        Self { held: clamp.rigid.then_some((arm, clamp_m)), ..bending }
    }

    fn coordinates(&self) -> usize {
        let modes = self.elastic.as_ref().map_or(0, Shapes::modes);
        if self.held.is_some() { modes } else { 6 + modes }
    }

    fn modes_at(&self) -> usize {
        if self.held.is_some() { self.at } else { self.at + 6 }
    }
}

/// The bushing of a clamp in `configuration`: with the normal load in the assembly, without it in A
/// or B alone.
fn clamp_of(clamp: &Clamp, configuration: Configuration) -> &Bushing {
    if configuration == Configuration::Ajb { &clamp.loaded } else { &clamp.free }
}

/// Exact FRFs of `configuration` at each complex frequency of `s` (1/s): one (outputs, inputs)
/// matrix per frequency.
///
/// The probes define the positions: nominal ones come from [`RigConfig::response`] and
/// [`RigConfig::impact`], those of a rig with its position errors from [`super::Rig::aim`].
///
/// # Errors
/// As [`Structure::frf`].
pub fn exact_frf(
    config: &RigConfig,
    configuration: Configuration,
    quantity: Quantity,
    s: &[Complex<f64>],
    outputs: &[Probe],
    inputs: &[Probe],
) -> Result<Vec<DMatrix<Complex<f64>>>, RigError> {
    let structure = Structure::new(config, configuration);
    s.iter().map(|s| structure.frf(*s, quantity, outputs, inputs)).collect()
}

/// Rotates translations and rotations into these axes.
pub(super) fn turned(axes: Option<[[f64; 3]; 3]>) -> Matrix6<f64> {
    let mut turn = Matrix6::identity();
    if let Some(axes) = axes {
        // normalised because users write about four digits
        let unit = axes.map(normalized);
        let rows = Matrix3::from_fn(|row, column| unit[row][column]);
        turn.fixed_view_mut::<3, 3>(0, 0).copy_from(&rows);
        turn.fixed_view_mut::<3, 3>(3, 3).copy_from(&rows);
    }
    turn
}

fn body_mass(body: &RigidBody) -> Matrix6<f64> {
    let m = body.mass_kg;
    let [a, b, c] = body.box_m.unwrap_or([0.0; 3]);
    let of_box = [b * b + c * c, a * a + c * c, a * a + b * b].map(|sum| m / 12.0 * sum);
    let [ixx, iyy, izz] = body.inertia_kg_m2.unwrap_or(of_box);
    Matrix6::from_diagonal(&[m, m, m, ixx, iyy, izz].into())
}
