//! What an ideal measurement of the rig would find: the numbers that estimates are held against.

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::Configuration;
use super::config::{BodyName, Bushing, ContactLaw, OwnStructure, RigConfig};
use super::structure::{rigid_motion, turned};

/// A stiffness that is so small beside the largest holds nothing: metres and radians differ by 1e8 at most.
const SMALLEST_OF_LARGEST: f64 = 1e-14;

/// Both virtual points (m): the rig's origin.
const VIRTUAL_POINT_M: [f64; 3] = [0.0; 3];

/// The stiffnesses along z that a rig's parameters make.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// The contact's own tangential stiffness k_T, all of it stuck (N/m).
    pub contact_k_t_n_per_m: f64,
    /// The contact's own tangential damping c_T (N s/m).
    pub contact_c_t_n_s_per_m: f64,
    /// Between the arms, 1 / C_zz at the virtual points with C the compliance of the contact and both clamps in series (N/m).
    pub between_arms_k_n_per_m: f64,
    /// Of the clamps alone, the same way (N/m); none when both are rigid.
    pub clamps_k_n_per_m: Option<f64>,
    /// `linear`, `jenkins` or `iwan`.
    pub law: ContactLaw,
    /// μN, beyond which the contact is in gross slip (N); none for the linear law. An Iwan contact slips in part below it.
    pub slip_limit_n: Option<f64>,
}

impl RigConfig {
    /// What an ideal measurement would find. The clamps are those of the assembly, under load.
    pub fn truth(&self) -> Truth {
        match &self.structure {
            Some(own) => {
                let all = self.between_arms(own);
                // in series with the contact; a path beside it stiffens what is found, and then nothing is left for clamps
                let contact = along(&self.contact.bushing(), self.contact.axes, self.contact.sliding());
                let left = all - contact;
                self.found(all, (left > 1e-9 * all).then_some(left))
            }
            None => self.of_the_paper(),
        }
    }

    /// Compliance along the sliding direction between the arms, at the virtual points: all springs and bodies that lie between them, without their masses.
    fn between_arms(&self, own: &OwnStructure) -> f64 {
        let [arm, base] = own.arms;
        let contact = (own.joint.map(Some), self.contact.bushing(), self.contact.axes);
        let springs = own.springs.iter().filter(|spring| spring.present.contains(&Configuration::Ajb));
        let inner: Vec<_> = springs
            .map(|spring| (spring.ends(), spring.bushing(), spring.axes))
            .chain([contact])
            // what holds a body to the ground is no part of the joint
            .filter(|(ends, ..)| ends.iter().all(Option::is_some))
            .collect();
        // bodies that hang on the arms' far sides follow them, and carry nothing
        let bodies: Vec<BodyName> =
            own.bodies.iter().map(|body| body.name).filter(|name| *name != base).collect();
        let place = |body: Option<BodyName>| bodies.iter().position(|name| Some(*name) == body);
        let mut stiffness = DMatrix::zeros(6 * bodies.len(), 6 * bodies.len());
        for (ends, bushing, axes) in &inner {
            let motion = turned(*axes) * rigid_motion(bushing.position_m, VIRTUAL_POINT_M);
            let own = motion.transpose() * Matrix6::from_diagonal(&diagonal(bushing)) * motion;
            for (row, row_sign) in [(place(ends[0]), -1.0), (place(ends[1]), 1.0)] {
                for (column, column_sign) in [(place(ends[0]), -1.0), (place(ends[1]), 1.0)] {
                    if let (Some(row), Some(column)) = (row, column) {
                        let mut block = stiffness.fixed_view_mut::<6, 6>(6 * row, 6 * column);
                        block += own * (row_sign * column_sign);
                    }
                }
            }
        }
        let Some(at) = place(Some(arm)) else { return f64::NAN };
        let mut pull = DVector::zeros(6 * bodies.len());
        let sliding = Vector3::from(self.contact.sliding());
        pull.fixed_rows_mut::<3>(6 * at).copy_from(&sliding);
        // a motion that nothing holds has no part in this force's answer, if there is one
        let parts = stiffness.svd(true, true);
        let largest = parts.singular_values.max();
        let answer = parts.solve(&pull, largest * SMALLEST_OF_LARGEST);
        answer.map_or(f64::NAN, |motion| motion.fixed_rows::<3>(6 * at).dot(&sliding))
    }

    fn of_the_paper(&self) -> Truth {
        let clamps: Vec<Matrix6<f64>> = [&self.clamp, &self.clamp_b]
            .into_iter()
            .filter(|clamp| !clamp.rigid)
            .map(|clamp| compliance(&clamp.loaded))
            .collect();
        let of_clamps: Matrix6<f64> = clamps.iter().sum();
        let all = of_clamps + compliance(&self.contact.bushing());
        self.found(all[(2, 2)], (!clamps.is_empty()).then(|| of_clamps[(2, 2)]))
    }

    /// Of these compliances along z, m/N: between the arms, and of what lies there beside the contact.
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

/// Compliance of a bushing at the virtual point along a direction: what a unit force there does to each of its springs.
fn along(bushing: &Bushing, axes: Option<[[f64; 3]; 3]>, direction: [f64; 3]) -> f64 {
    let lever = Vector3::from(VIRTUAL_POINT_M) - Vector3::from(bushing.position_m);
    let force = Vector3::from(direction);
    let moment = lever.cross(&force);
    let load = turned(axes) * Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
    // 0 · ∞ would be no number: what is not loaded does not give
    load.iter()
        .zip(&diagonal(bushing))
        .filter(|(load, _)| **load != 0.0)
        .map(|(load, k)| load * load / k)
        .sum()
}

/// kx, ky, kz, krx, kry, krz.
fn diagonal(bushing: &Bushing) -> Vector6<f64> {
    let [kx, ky, kz] = bushing.stiffness_n_per_m;
    let [krx, kry, krz] = bushing.rotation_nm_per_rad;
    Vector6::new(kx, ky, kz, krx, kry, krz)
}

/// Compliance (6 × 6) of a bushing as the virtual point sees it: its own, moved there with its levers. A direction that it does not
/// hold at all has no stiffness.
fn compliance(bushing: &Bushing) -> Matrix6<f64> {
    let own = Matrix6::from_diagonal(&diagonal(bushing).map(|k| 1.0 / k));
    let motion = rigid_motion(VIRTUAL_POINT_M, bushing.position_m);
    // 0 · ∞ would be no number: a lever of nothing adds nothing.
    Matrix6::from_fn(|i, j| {
        let terms = (0..6).map(|m| (motion[(i, m)] * motion[(j, m)], own[(m, m)]));
        terms.filter(|(levers, _)| *levers != 0.0).map(|(levers, c)| levers * c).sum()
    })
}
