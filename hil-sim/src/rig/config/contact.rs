//! The joint under test.

use serde::{Deserialize, Serialize};

use super::Bushing;
use crate::rig::unit_vector::normalized;

/// The law of the contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ContactLaw {
    /// Stuck: a bushing, at any amplitude.
    Linear,
    /// Along z a slider in series with the spring and dashpot: stuck up to μN, gross slip beyond.
    Jenkins,
    /// Along z many such sliders in parallel with different limits: microslip, then gross slip at
    /// μN.
    Iwan,
}

/// Distribution of the limits of an Iwan contact's elements. The stiffness is shared evenly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Iwan {
    /// Number of elements.
    pub elements: u32,
    /// The limits are spread evenly over 1 ± this times their mean.
    pub spread: f64,
}

impl Iwan {
    /// Each element's fraction of μN, the weakest first: the distribution is divided into
    /// `elements` equal parts, and each value is the mean of one part.
    pub fn shares(&self) -> Vec<f64> {
        let count = f64::from(self.elements);
        let share = |i: u32| (1.0 + self.spread * ((2.0 * f64::from(i) + 1.0) / count - 1.0)) / count;
        (0..self.elements).map(share).collect()
    }
}

/// The joint under test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The contact law.
    pub law: ContactLaw,
    /// Position (m).
    pub position_m: [f64; 3],
    /// kx, ky, kz (N/m); kz is the tangential contact stiffness.
    pub stiffness_n_per_m: [f64; 3],
    /// krx, kry, krz (N m/rad).
    pub rotation_nm_per_rad: [f64; 3],
    /// β (s) of c = β k for x, y, z, rx, ry, rz.
    pub damping_s: [f64; 6],
    /// μ: the contact carries at most μN along z. The linear law has no limit.
    pub friction_coefficient: f64,
    /// N (N), at the start; [`crate::rig::Rig::set_normal_load`] changes it.
    pub normal_load_n: f64,
    /// Longest step while something slips (s).
    pub slip_step_s: f64,
    /// The distribution of an Iwan contact.
    pub iwan: Iwan,
    /// Axes x, y and z of the contact, of which z slides: orthogonal unit vectors; the rig's axes
    /// if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<[[f64; 3]; 3]>,
}

impl Contact {
    /// Each slider's fraction of μN, the weakest first; empty for the linear law. They share the
    /// stiffness evenly.
    pub fn shares(&self) -> Vec<f64> {
        match self.law {
            ContactLaw::Linear => Vec::new(),
            ContactLaw::Jenkins => vec![1.0],
            ContactLaw::Iwan => self.iwan.shares(),
        }
    }

    /// Unit vector of the sliding direction.
    pub fn sliding(&self) -> [f64; 3] {
        self.axes.map_or([0.0, 0.0, 1.0], |axes| normalized(axes[2]))
    }

    /// The stuck contact's spring and dashpot.
    pub fn bushing(&self) -> Bushing {
        Bushing {
            position_m: self.position_m,
            stiffness_n_per_m: self.stiffness_n_per_m,
            rotation_nm_per_rad: self.rotation_nm_per_rad,
            damping_s: self.damping_s,
        }
    }
}
