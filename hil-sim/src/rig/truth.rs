//! What only the simulator knows: the result of an ideal measurement of the rig, the reference
//! values for estimates, and the true state of the joint along z.

use super::config::{BodyName, Bushing, ContactLaw, OwnStructure, RigConfig};
use super::structure::{Body, Structure, turned};
use super::{Configuration, Probe};
use nalgebra::{DMatrix, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// A stiffness smaller than this fraction of the largest counts as zero: metres and radians differ
/// by 1e8 at most.
const SMALLEST_OF_LARGEST: f64 = 1e-14;

/// Both virtual points (m): the rig's origin.
const VIRTUAL_POINT_M: [f64; 3] = [0.0; 3];

/// The stiffnesses along z that follow from a rig's parameters; of a contact that drifts or
/// wears, at the start. Paths beside the contact are not part of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Tangential stiffness k_T of the fully stuck contact alone (N/m).
    pub contact_k_t_n_per_m: f64,
    /// Tangential damping c_T of the contact alone (N s/m).
    pub contact_c_t_n_s_per_m: f64,
    /// Between the arms, 1 / C_zz at the virtual points with C the compliance of the contact, both
    /// clamps, and of specimens that bend between clamp and contact, in series (N/m). The arms
    /// themselves count as rigid: their bending is part of the substructures that are decoupled.
    pub between_arms_k_n_per_m: f64,
    /// Of the clamps and of specimens that bend alone, the same way (N/m); `None` when all are
    /// rigid.
    pub clamps_k_n_per_m: Option<f64>,
    /// `linear`, `jenkins` or `iwan`.
    pub law: ContactLaw,
    /// μN, beyond which the contact is in gross slip (N); `None` for the linear law. An Iwan
    /// contact slips in part below it.
    pub slip_limit_n: Option<f64>,
}

impl RigConfig {
    /// The values that an ideal measurement would find. The clamps are those of the assembly, under
    /// load.
    pub fn truth(&self) -> Truth {
        let contact = self.contact_compliance();
        if let Some(own) = &self.structure {
            let all = self.between_arms(own);
            // in series with the contact; a parallel path stiffens the result, and then no
            // compliance is left for clamps
            let left = all - contact;
            return self.found(all, (left > 1e-9 * all).then_some(left));
        }
        if self.bodies.specimen_a.beam.is_some() || self.bodies.specimen_b.beam.is_some() {
            let all = self.between_papers_arms();
            return self.found(all, Some(all - contact));
        }
        let soft = [&self.clamp, &self.clamp_b].into_iter().filter(|clamp| !clamp.rigid);
        let clamps = soft.map(|clamp| self.compliance(&clamp.loaded, None)).reduce(|a, b| a + b);
        self.found(clamps.unwrap_or(0.0) + contact, clamps)
    }

    /// The same after the contact's friction has dissipated the energy `worn_j` (J), for a contact
    /// that wears.
    pub fn truth_after(&self, worn_j: f64) -> Truth {
        Self { contact: self.contact.worn(worn_j), ..self.clone() }.truth()
    }

    /// Compliance along the sliding direction between the arms, at the virtual points: of all
    /// springs and massless bodies that lie between them.
    fn between_arms(&self, own: &OwnStructure) -> f64 {
        let [arm, base] = own.arms;
        // the base is fixed like the ground; bodies attached to the arms' far sides follow them and
        // carry no force
        let free = own.bodies.iter().map(|body| body.name).filter(|name| *name != base);
        let at_virtual_points = free.map(|name| {
            let body = own.body(name).filter(|body| body.name != arm);
            let beam = body.and_then(|body| Some((body.beam.as_ref()?, body.mass_kg)));
            let mass_kg = beam.map_or(1.0, |(_, mass_kg)| mass_kg);
            Body::new(name, VIRTUAL_POINT_M).bending(beam.map(|(beam, _)| beam), mass_kg, &[])
        });
        let mut inner = Structure::empty(Configuration::Ajb, at_virtual_points.collect(), [false, false]);
        for spring in own.springs.iter().filter(|spring| spring.present.contains(&Configuration::Ajb)) {
            // springs to the ground are not part of the joint
            if let [Some(from), Some(to)] = spring.ends() {
                inner.connect_along(Some(from), Some(to), &spring.bushing(), spring.axes);
            }
        }
        inner.join(self);
        self.pulled(&inner, arm)
    }

    /// The same between the arms of the paper's rig, whose specimens bend.
    fn between_papers_arms(&self) -> f64 {
        let lumped = self.lumped();
        let specimens =
            [(BodyName::SpecimenA, &self.bodies.specimen_a), (BodyName::SpecimenB, &self.bodies.specimen_b)];
        let mut bodies = vec![Body::new(BodyName::ArmA, VIRTUAL_POINT_M)];
        for ((name, specimen), lumped) in specimens.into_iter().zip(lumped) {
            if !lumped {
                let (beam, mass_kg) = (specimen.beam.as_ref(), specimen.mass_kg);
                let body = Body::new(name, VIRTUAL_POINT_M);
                bodies.push(body.of_the_paper(self, Configuration::Ajb, beam, mass_kg));
            }
        }
        let mut inner = Structure::empty(Configuration::Ajb, bodies, lumped);
        let arms = [BodyName::ArmA, BodyName::ArmB].map(Some);
        let clamps = [(&self.clamp, arms[0], specimens[0].0), (&self.clamp_b, arms[1], specimens[1].0)];
        for (clamp, arm, specimen) in clamps {
            if !clamp.rigid {
                inner.connect_along(arm, Some(specimen), &clamp.loaded, None);
            }
        }
        inner.join(self);
        self.pulled(&inner, BodyName::ArmA)
    }

    /// Displacement along the sliding direction per force at the virtual point of `arm`.
    fn pulled(&self, inner: &Structure, arm: BodyName) -> f64 {
        let pull = Probe { body: arm, position_m: VIRTUAL_POINT_M, direction: self.contact.sliding() };
        let Some(pull) = inner.row(&pull).filter(|_| inner.complete().is_ok()) else { return f64::NAN };
        let mut stiffness = inner.stiffness.clone();
        let mut pull = pull;
        if inner.bends() {
            // Elastic modes are stiffer than metres by orders of magnitude: each coordinate is
            // scaled to unit stiffness, so that only an unconstrained motion is singular.
            let scale = stiffness.diagonal().map(|k| if k > 0.0 { 1.0 / k.sqrt() } else { 1.0 });
            stiffness =
                DMatrix::from_fn(scale.len(), scale.len(), |i, j| scale[i] * stiffness[(i, j)] * scale[j]);
            pull.component_mul_assign(&scale);
        }
        // an unconstrained motion does not contribute to the response to this force, if there is
        // one
        let parts = stiffness.svd(true, true);
        let largest = parts.singular_values.max();
        let answer = parts.solve(&pull, largest * SMALLEST_OF_LARGEST);
        answer.map_or(f64::NAN, |motion| motion.dot(&pull))
    }

    /// Compliance of the contact at the virtual point along the sliding direction.
    fn contact_compliance(&self) -> f64 {
        if let [one] = self.contact_bushings().as_slice() {
            return self.compliance(one, self.contact.axes);
        }
        // patches in parallel: one massless body on them
        let [a, _] = self.joined();
        let body = vec![Body::new(a, VIRTUAL_POINT_M)];
        let mut patches = Structure::empty(Configuration::Ajb, body, [false, false]);
        patches.join(self);
        self.pulled(&patches, a)
    }

    /// Compliance of a bushing at the virtual point along the sliding direction: the sum over its
    /// springs of their response to a unit force there. A direction without any constraint has no
    /// stiffness.
    fn compliance(&self, bushing: &Bushing, axes: Option<[[f64; 3]; 3]>) -> f64 {
        let lever = Vector3::from(VIRTUAL_POINT_M) - Vector3::from(bushing.position_m);
        let force = Vector3::from(self.contact.sliding());
        let moment = lever.cross(&force);
        let load = turned(axes) * Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        let springs = bushing.stiffness_n_per_m.into_iter().chain(bushing.rotation_nm_per_rad);
        // 0 · ∞ would be NaN: an unloaded spring contributes nothing
        let loaded = load.iter().zip(springs).filter(|(load, _)| **load != 0.0);
        loaded.map(|(load, k)| load * load / k).sum()
    }

    /// The truth from these compliances along the sliding direction, m/N: between the arms, and of
    /// the clamps in series with the contact.
    fn found(&self, between_arms: f64, clamps: Option<f64>) -> Truth {
        let contact = &self.contact;
        Truth {
            contact_k_t_n_per_m: contact.stiffness_n_per_m[2],
            contact_c_t_n_s_per_m: contact.damping_s[2] * contact.stiffness_n_per_m[2],
            between_arms_k_n_per_m: 1.0 / between_arms,
            clamps_k_n_per_m: clamps.map(|compliance| 1.0 / compliance),
            law: contact.law,
            slip_limit_n: (contact.law != ContactLaw::Linear)
                .then_some(contact.friction_coefficient * contact.normal_load_n),
        }
    }
}

/// Current state of the joint. Forces and displacements are along z; the totals count from the last
/// staging.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Displacement of specimen A minus that of B at the contact's centre (m).
    pub relative_m: f64,
    /// The force that A exerts on B (N): friction and the stuck contact's dashpot.
    pub force_n: f64,
    /// The largest force that the contact can carry, μN (N); infinite for the linear law.
    pub limit_n: f64,
    /// Fraction of the contact's elements that slip, 0…1: 1 is gross slip.
    pub sliding: f64,
    /// Mean of the distances that the elements have slid (m).
    pub slid_m: f64,
    /// Energy dissipated by friction (J); over a cycle of a steady loop, the loop's area without
    /// the part of the stuck elements' dashpots.
    pub friction_j: f64,
}
