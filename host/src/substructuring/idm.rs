//! Interface deformation modes: which rigid-body motions of the interface a virtual point carries.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// One degree of freedom of a virtual point. Declared in the house's order: x, y, z, rx, ry, rz.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Dof {
    /// Lateral translation, m.
    X,
    /// Vertical translation (along the normal load), m.
    Y,
    /// Horizontal translation (the sliding direction of k_T), m.
    Z,
    /// Rotation about x, rad.
    Rx,
    /// Rotation about y, rad.
    Ry,
    /// Rotation about z, rad.
    Rz,
}

impl Dof {
    /// All six, in order.
    pub const ALL: [Dof; 6] = [Dof::X, Dof::Y, Dof::Z, Dof::Rx, Dof::Ry, Dof::Rz];

    /// Whether this is a rotation.
    pub fn is_rotation(self) -> bool {
        self >= Dof::Rx
    }

    /// The name used in results: `x` … `rz`.
    pub fn name(self) -> &'static str {
        ["x", "y", "z", "rx", "ry", "rz"][self as usize]
    }
}

impl fmt::Display for Dof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The paper's sets of interface deformation modes (its Sec. 2.4): 2 = {z, y}, 4 = {z, y, rx, ry}, 6 = all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum IdmSet {
    /// Two translations: y and z.
    Two,
    /// y, z and the rotations about x and y.
    Four,
    /// The whole rigid body.
    Six,
}

impl IdmSet {
    /// All three.
    pub const ALL: [IdmSet; 3] = [IdmSet::Two, IdmSet::Four, IdmSet::Six];

    /// The set of this size, if there is one.
    pub fn from_count(count: usize) -> Option<Self> {
        IdmSet::ALL.into_iter().find(|set| set.count() == count)
    }

    /// Its degrees of freedom, in the house's order.
    pub fn dofs(self) -> &'static [Dof] {
        match self {
            IdmSet::Two => &[Dof::Y, Dof::Z],
            IdmSet::Four => &[Dof::Y, Dof::Z, Dof::Rx, Dof::Ry],
            IdmSet::Six => &Dof::ALL,
        }
    }

    /// n_c: the number of degrees of freedom of one virtual point.
    pub fn count(self) -> usize {
        self.dofs().len()
    }

    /// Where `dof` stands in this set.
    pub fn position(self, dof: Dof) -> Option<usize> {
        self.dofs().iter().position(|&d| d == dof)
    }
}

impl fmt::Display for IdmSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} IDMs", self.count())
    }
}

/// Motion along `direction` (unit vector) at `offset_m` from the virtual point, per unit of each degree of
/// freedom: eᵀ \[I, −skew(r)\], that is e for the translations and r × e for the rotations.
///
/// The same row, read as a column, gives the virtual point's forces and moments per newton of an impact.
pub fn rigid_row(direction: Vector3<f64>, offset_m: Vector3<f64>) -> [f64; 6] {
    let rotation = offset_m.cross(&direction);
    [direction.x, direction.y, direction.z, rotation.x, rotation.y, rotation.z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

        /// The row times a rigid motion is that motion's velocity at the point, along the direction.
        #[test]
        fn row_agrees_with_rigid_body_kinematics(v in prop::array::uniform12(-1.0..1.0f64)) {
            let e = Vector3::new(v[0], v[1], v[2]);
            let r = Vector3::new(v[3], v[4], v[5]);
            let t = Vector3::new(v[6], v[7], v[8]);
            let theta = Vector3::new(v[9], v[10], v[11]);
            let row = rigid_row(e, r);
            let from_row: f64 = row.iter().zip(&v[6..]).map(|(a, b)| a * b).sum();
            // rounding of a dozen products of size one
            prop_assert!((from_row - e.dot(&(t + theta.cross(&r)))).abs() < 1e-13);
        }
    }

    #[test]
    fn sets_hold_what_the_paper_says() {
        assert_eq!(IdmSet::from_count(4).map(IdmSet::dofs), Some(&[Dof::Y, Dof::Z, Dof::Rx, Dof::Ry][..]));
        assert_eq!(IdmSet::from_count(3), None);
        assert_eq!(IdmSet::Two.position(Dof::Z), Some(1));
        assert_eq!(IdmSet::Two.position(Dof::X), None);
    }
}
