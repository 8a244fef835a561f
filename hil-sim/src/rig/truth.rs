//! What an ideal measurement of the rig would find: the numbers that estimates are held against.

use nalgebra::{Matrix6, Vector6};
use serde::{Deserialize, Serialize};

use super::config::{Bushing, ContactLaw, RigConfig};
use super::structure::rigid_motion;

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
        let clamps: Vec<Matrix6<f64>> = [&self.clamp, &self.clamp_b]
            .into_iter()
            .filter(|clamp| !clamp.rigid)
            .map(|clamp| compliance(&clamp.loaded))
            .collect();
        let of_clamps: Matrix6<f64> = clamps.iter().sum();
        let contact = &self.contact;
        let all = of_clamps + compliance(&contact.bushing());
        Truth {
            contact_k_t_n_per_m: contact.stiffness_n_per_m[2],
            contact_c_t_n_s_per_m: contact.damping_s[2] * contact.stiffness_n_per_m[2],
            between_arms_k_n_per_m: 1.0 / all[(2, 2)],
            clamps_k_n_per_m: (!clamps.is_empty()).then(|| 1.0 / of_clamps[(2, 2)]),
            law: contact.law,
            slip_limit_n: (contact.law != ContactLaw::Linear)
                .then_some(contact.friction_coefficient * contact.normal_load_n),
        }
    }
}

/// Compliance (6 × 6) of a bushing as the virtual point sees it: its own, moved there with its levers. A direction that it does not
/// hold at all has no stiffness.
fn compliance(bushing: &Bushing) -> Matrix6<f64> {
    let [kx, ky, kz] = bushing.stiffness_n_per_m;
    let [krx, kry, krz] = bushing.rotation_nm_per_rad;
    let own = Matrix6::from_diagonal(&Vector6::new(kx, ky, kz, krx, kry, krz).map(|k| 1.0 / k));
    let motion = rigid_motion(VIRTUAL_POINT_M, bushing.position_m);
    // 0 · ∞ would be no number: a lever of nothing adds nothing.
    Matrix6::from_fn(|i, j| {
        let terms = (0..6).map(|m| (motion[(i, m)] * motion[(j, m)], own[(m, m)]));
        terms.filter(|(levers, _)| *levers != 0.0).map(|(levers, c)| levers * c).sum()
    })
}
