//! The structure: rigid bodies joined by bushings, as M, C and K.
//!
//! A body moves by q = (t, θ) at its centre of gravity; a point r of it by u = t + θ × (r − cg),
//! that is D = [I, −skew(r − cg); 0, I]. A bushing between two bodies adds Dᵀ diag(k) D to K and Dᵀ
//! diag(β k) D to C with D = [−D₁, D₂]; ground is a zero row. Six degrees of freedom per body: 18
//! in A, 6 in B, 24 in AJB. With a rigid clamp A the specimen is lumped onto arm A: six fewer in A
//! and AJB. With a compliant clamp B, specimen B is a separate body: six more in B and AJB. Arm B's
//! values include its specimen, so that a very stiff clamp B is equivalent to a rigid one. A rig
//! with a user-defined structure has the bodies and springs that it lists.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6};
use num_complex::Complex;

use super::config::{BodyName, Bushing, OwnStructure, RigConfig, RigidBody};
use super::normalized;
use super::{Configuration, Probe, Quantity, RigError};

/// M, C and K of one configuration, SI, in the bodies' own coordinates (m and rad).
#[derive(Debug, Clone)]
pub struct Structure {
    configuration: Configuration,
    bodies: Vec<(BodyName, [f64; 3])>,
    /// Whether the clamps of A and B are rigid: their specimens are then not separate bodies.
    rigid: [bool; 2],
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

    /// A user-defined structure of any bodies and springs.
    fn of_its_own(config: &RigConfig, own: &OwnStructure, configuration: Configuration) -> Self {
        let bodies: Vec<_> = own.bodies.iter().filter(|body| config.has(configuration, body.name)).collect();
        let mut structure = Self::empty(
            configuration,
            bodies.iter().map(|body| (body.name, body.cg_m)).collect(),
            // nothing is lumped onto another body
            [false, false],
        );
        for (index, body) in bodies.iter().enumerate() {
            let mut block = structure.mass.fixed_view_mut::<6, 6>(6 * index, 6 * index);
            block.copy_from(&body_mass(&body.rigid()));
        }
        for spring in own.springs.iter().filter(|spring| spring.present.contains(&configuration)) {
            let ends = spring.ends();
            let there = |end: &Option<BodyName>| end.is_none_or(|body| config.has(configuration, body));
            if ends.iter().all(there) {
                structure.connect_along(ends[0], ends[1], &spring.bushing(), spring.axes);
            }
        }
        if configuration == Configuration::Ajb {
            let [a, b] = own.joint;
            structure.connect_along(Some(a), Some(b), &config.contact.bushing(), config.contact.axes);
        }
        if let Some(held) = own.load_cells_on.filter(|body| config.has(configuration, *body)) {
            for cell in &config.load_cells {
                structure.connect(None, Some(held), cell);
            }
        }
        structure.carry_sensors(config);
        structure
    }

    /// Bodies without mass, by name and centre, not connected.
    pub(super) fn empty(
        configuration: Configuration,
        bodies: Vec<(BodyName, [f64; 3])>,
        rigid: [bool; 2],
    ) -> Self {
        let n = 6 * bodies.len();
        let zeros = || DMatrix::zeros(n, n);
        Self { configuration, bodies, rigid, mass: zeros(), damping: zeros(), stiffness: zeros() }
    }

    /// The paper's chain of bodies.
    fn of_the_paper(config: &RigConfig, configuration: Configuration) -> Self {
        let bodies = &config.bodies;
        let rigid = [config.clamp.rigid, config.clamp_b.rigid];
        let lumped = |name| match name {
            BodyName::SpecimenA => rigid[0],
            BodyName::SpecimenB => rigid[1],
            _ => false,
        };
        let present: Vec<(BodyName, &RigidBody)> = [
            (BodyName::Mass, &bodies.mass),
            (BodyName::ArmA, &bodies.arm_a),
            (BodyName::SpecimenA, &bodies.specimen_a),
            (BodyName::ArmB, &bodies.arm_b),
            (BodyName::SpecimenB, &bodies.specimen_b),
        ]
        .into_iter()
        .filter(|(name, _)| configuration.has(*name) && !lumped(*name))
        .collect();
        let there = present.iter().map(|(name, body)| (*name, body.cg_m)).collect();
        let mut structure = Self::empty(configuration, there, rigid);
        for (index, (_, body)) in present.iter().enumerate() {
            let mut block = structure.mass.fixed_view_mut::<6, 6>(6 * index, 6 * index);
            block.copy_from(&body_mass(body));
        }
        if rigid[0] {
            structure.add_inertia(BodyName::ArmA, &bodies.specimen_a, 1.0);
        }
        if !rigid[1] {
            structure.add_inertia(BodyName::ArmB, &bodies.specimen_b, -1.0);
        }
        structure.support(config);
        structure.carry_sensors(config);
        structure
    }

    /// Adds the masses of the fixed sensors, as points, to the bodies that are present.
    fn carry_sensors(&mut self, config: &RigConfig) {
        for own in config.sensors.fixed.iter().filter(|own| own.mass_kg > 0.0) {
            let point = config.responses.iter().find(|point| point.name == own.response);
            let Some((point, (at, cg))) = point.and_then(|point| Some((point, self.find(point.body)?)))
            else {
                continue;
            };
            let moved = rigid_motion(point.position_m, cg);
            let moved = moved.fixed_rows::<3>(0);
            let mut block = self.mass.fixed_view_mut::<6, 6>(at, at);
            block += moved.transpose() * moved * own.mass_kg;
        }
    }

    /// Adds `sign` times the inertia of `part` to `body`, if it is present, as if they were one.
    fn add_inertia(&mut self, body: BodyName, part: &RigidBody, sign: f64) {
        if let Some((at, cg)) = self.find(body) {
            let lever = rigid_motion(part.cg_m, cg);
            let mut block = self.mass.fixed_view_mut::<6, 6>(at, at);
            block += lever.transpose() * body_mass(part) * lever * sign;
        }
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
                let clamp = if in_a { &config.clamp.free } else { &config.clamp.loaded };
                self.connect(Some(BodyName::ArmA), Some(BodyName::SpecimenA), clamp);
            }
        }
        if configuration == Configuration::Ajb {
            let (ends, contact) = (config.joined().map(Some), &config.contact);
            self.connect_along(ends[0], ends[1], &contact.bushing(), contact.axes);
        }
        if configuration != Configuration::A {
            if !config.clamp_b.rigid {
                let alone = configuration == Configuration::B;
                let clamp = if alone { &config.clamp_b.free } else { &config.clamp_b.loaded };
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

    fn find(&self, body: BodyName) -> Option<(usize, [f64; 3])> {
        let body = match body {
            BodyName::SpecimenA if self.rigid[0] => BodyName::ArmA,
            BodyName::SpecimenB if self.rigid[1] => BodyName::ArmB,
            other => other,
        };
        let index = self.bodies.iter().position(|(name, _)| *name == body)?;
        Some((6 * index, self.bodies[index].1))
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
        let mut relative = DMatrix::zeros(6, self.order());
        for (body, sign) in [(from, -1.0), (to, 1.0)] {
            if let Some((at, cg)) = body.and_then(|body| self.find(body)) {
                let mut block = relative.fixed_view_mut::<6, 6>(0, at);
                block += sign * turned(axes) * rigid_motion(bushing.position_m, cg);
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
        let (at, cg) = self.find(probe.body)?;
        let motion = rigid_motion(probe.position_m, cg);
        let mut row = DVector::zeros(self.order());
        for column in 0..6 {
            row[at + column] = (0..3).map(|axis| probe.direction[axis] * motion[(axis, column)]).sum();
        }
        Some(row)
    }

    /// Exact FRF at the complex frequency `s` (1/s): rows · (s²M + sC + K)⁻¹ · columns, times s for
    /// mobility and s² for accelerance; shape (outputs, inputs).
    ///
    /// # Errors
    /// [`RigError::MissingBody`] for a probe on a body that is not present; [`RigError::Structure`]
    /// if `s` is a pole.
    pub fn frf(
        &self,
        s: Complex<f64>,
        quantity: Quantity,
        outputs: &[Probe],
        inputs: &[Probe],
    ) -> Result<DMatrix<Complex<f64>>, RigError> {
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

/// Motion of point `at` (translation, rotation) from that of the body's centre of gravity.
fn rigid_motion(at: [f64; 3], cg: [f64; 3]) -> Matrix6<f64> {
    let r = [at[0] - cg[0], at[1] - cg[1], at[2] - cg[2]];
    let skew = Matrix3::new(0.0, -r[2], r[1], r[2], 0.0, -r[0], -r[1], r[0], 0.0);
    let mut motion = Matrix6::identity();
    motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew);
    motion
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
