//! Interface deformation modes: which motions of the interface a virtual point carries.
//!
//! Six rigid ones, and the eighteen simple flexible ones that the pyFBS workbook names: extension,
//! torsion, skewing and bending.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// One degree of freedom of a virtual point. They are ordered x, y, z, rx, ry, rz, then the
/// flexible ones in pyFBS's order.
///
/// With r = (x, y, z) from the virtual point to a place on the interface, a flexible mode of unit
/// size moves that place by the vector given next to its name.
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
    /// Extension along x: (x, 0, 0), m/m.
    Ex,
    /// Extension along y: (0, y, 0), m/m.
    Ey,
    /// Extension along z: (0, 0, z), m/m.
    Ez,
    /// Torsion about x: (0, −xz, xy), rad/m.
    Tx,
    /// Torsion about y: (yz, 0, −xy), rad/m.
    Ty,
    /// Torsion about z: (−yz, xz, 0), rad/m.
    Tz,
    /// Skewing: (xy, 0, 0), 1/m.
    Sxy,
    /// Skewing: (xz, 0, 0), 1/m.
    Sxz,
    /// Skewing: (0, yz, 0), 1/m.
    Syz,
    /// Skewing: (0, xy, 0), 1/m.
    Syx,
    /// Skewing: (0, 0, xz), 1/m.
    Szx,
    /// Skewing: (0, 0, yz), 1/m.
    Szy,
    /// Bending: (−xy, x²/2, 0), 1/m.
    Bxy,
    /// Bending: (−xz, 0, x²/2), 1/m.
    Bxz,
    /// Bending: (0, −yz, y²/2), 1/m.
    Byz,
    /// Bending: (y²/2, −xy, 0), 1/m.
    Byx,
    /// Bending: (z²/2, 0, −xz), 1/m.
    Bzx,
    /// Bending: (0, z²/2, −yz), 1/m.
    Bzy,
}

impl Dof {
    /// The six rigid ones, in order.
    pub const RIGID: [Dof; 6] = [Dof::X, Dof::Y, Dof::Z, Dof::Rx, Dof::Ry, Dof::Rz];

    /// All twenty-four, in order.
    pub const ALL: [Dof; 24] = [
        Dof::X,
        Dof::Y,
        Dof::Z,
        Dof::Rx,
        Dof::Ry,
        Dof::Rz,
        Dof::Ex,
        Dof::Ey,
        Dof::Ez,
        Dof::Tx,
        Dof::Ty,
        Dof::Tz,
        Dof::Sxy,
        Dof::Sxz,
        Dof::Syz,
        Dof::Syx,
        Dof::Szx,
        Dof::Szy,
        Dof::Bxy,
        Dof::Bxz,
        Dof::Byz,
        Dof::Byx,
        Dof::Bzx,
        Dof::Bzy,
    ];

    /// Whether this is a translation of the whole interface.
    pub fn is_translation(self) -> bool {
        self < Dof::Rx
    }

    /// Whether this is a rotation of the whole interface.
    pub fn is_rotation(self) -> bool {
        (Dof::Rx..=Dof::Rz).contains(&self)
    }

    /// Whether the interface changes its shape.
    pub fn is_flexible(self) -> bool {
        self > Dof::Rz
    }

    /// Power of the distance from the virtual point with which its motion grows: 0, 1 or 2.
    pub fn power_of_length(self) -> i32 {
        if self.is_translation() {
            0
        } else if self <= Dof::Ez {
            1
        } else {
            2
        }
    }

    /// The name used in results: `x` … `rz`, `ex` … `bzy`.
    pub fn name(self) -> &'static str {
        [
            "x", "y", "z", "rx", "ry", "rz", "ex", "ey", "ez", "tx", "ty", "tz", "sxy", "sxz", "syz", "syx",
            "szx", "szy", "bxy", "bxz", "byz", "byx", "bzx", "bzy",
        ][self as usize]
    }

    /// Displacement of a place at `offset_m` from the virtual point for unit size of this mode.
    pub fn displacement(self, offset_m: Vector3<f64>) -> Vector3<f64> {
        let [x, y, z] = offset_m.into();
        let (xx, yy, zz) = (x * x / 2.0, y * y / 2.0, z * z / 2.0);
        Vector3::from(match self {
            Dof::X => [1.0, 0.0, 0.0],
            Dof::Y => [0.0, 1.0, 0.0],
            Dof::Z => [0.0, 0.0, 1.0],
            Dof::Rx => [0.0, -z, y],
            Dof::Ry => [z, 0.0, -x],
            Dof::Rz => [-y, x, 0.0],
            Dof::Ex => [x, 0.0, 0.0],
            Dof::Ey => [0.0, y, 0.0],
            Dof::Ez => [0.0, 0.0, z],
            Dof::Tx => [0.0, -x * z, x * y],
            Dof::Ty => [y * z, 0.0, -y * x],
            Dof::Tz => [-z * y, z * x, 0.0],
            Dof::Sxy => [x * y, 0.0, 0.0],
            Dof::Sxz => [x * z, 0.0, 0.0],
            Dof::Syz => [0.0, y * z, 0.0],
            Dof::Syx => [0.0, y * x, 0.0],
            Dof::Szx => [0.0, 0.0, z * x],
            Dof::Szy => [0.0, 0.0, z * y],
            Dof::Bxy => [-x * y, xx, 0.0],
            Dof::Bxz => [-x * z, 0.0, xx],
            Dof::Byz => [0.0, -y * z, yy],
            Dof::Byx => [yy, -y * x, 0.0],
            Dof::Bzx => [zz, 0.0, -z * x],
            Dof::Bzy => [0.0, zz, -z * y],
        })
    }
}

impl fmt::Display for Dof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Dof {
    type Err = String;
    /// The names used here, and the workbook's for translations and for forces (`ux`, `fx`, `mx`).
    fn from_str(text: &str) -> Result<Self, String> {
        let plain = text.trim().to_lowercase();
        let ours = match plain.split_at_checked(1) {
            Some(("u" | "f", axis @ ("x" | "y" | "z"))) => axis.to_owned(),
            Some(("m", axis @ ("x" | "y" | "z"))) => format!("r{axis}"),
            _ => plain,
        };
        Dof::ALL.into_iter().find(|d| d.name() == ours).ok_or_else(|| {
            format!("there is no interface mode `{text}`: {}", Dof::ALL.map(Dof::name).join(", "))
        })
    }
}

/// Modes of one virtual point: the paper's sets (Sec. 2.4; 2 = {z, y}, 4 = {z, y, rx, ry}, 6 = all
/// rigid ones), or any other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum IdmSet {
    /// Two translations: y and z.
    Two,
    /// y, z and the rotations about x and y.
    Four,
    /// All six rigid modes.
    Six,
    /// Another choice, made by [`IdmSet::of`].
    Chosen(Modes),
}

/// A choice of modes that is not one of the paper's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Modes(u32);

impl IdmSet {
    /// The paper's three.
    pub const ALL: [IdmSet; 3] = [IdmSet::Two, IdmSet::Four, IdmSet::Six];

    /// The paper's set of this size, if there is one.
    pub fn from_count(count: usize) -> Option<Self> {
        IdmSet::ALL.into_iter().find(|set| set.count() == count)
    }

    /// The set of these modes, in any order; none if it is empty or a mode occurs twice.
    pub fn of(modes: &[Dof]) -> Option<Self> {
        let bits = modes.iter().fold(0u32, |bits, mode| bits | 1 << *mode as u32);
        if modes.is_empty() || bits.count_ones() as usize != modes.len() {
            return None;
        }
        let chosen = IdmSet::Chosen(Modes(bits));
        Some(IdmSet::ALL.into_iter().find(|set| set.dofs() == chosen.dofs()).unwrap_or(chosen))
    }

    /// Its degrees of freedom, in the order of [`Dof::ALL`].
    pub fn dofs(self) -> Vec<Dof> {
        match self {
            IdmSet::Two => vec![Dof::Y, Dof::Z],
            IdmSet::Four => vec![Dof::Y, Dof::Z, Dof::Rx, Dof::Ry],
            IdmSet::Six => Dof::RIGID.to_vec(),
            IdmSet::Chosen(Modes(bits)) => {
                Dof::ALL.into_iter().filter(|mode| bits & (1 << *mode as u32) != 0).collect()
            }
        }
    }

    /// n_c: the number of degrees of freedom of one virtual point.
    pub fn count(self) -> usize {
        match self {
            IdmSet::Two => 2,
            IdmSet::Four => 4,
            IdmSet::Six => 6,
            IdmSet::Chosen(Modes(bits)) => bits.count_ones() as usize,
        }
    }

    /// Index of `dof` in this set.
    pub fn position(self, dof: Dof) -> Option<usize> {
        self.dofs().iter().position(|&d| d == dof)
    }
}

impl fmt::Display for IdmSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            IdmSet::Chosen(_) => {
                write!(f, "IDMs {}", self.dofs().iter().map(|d| d.name()).collect::<Vec<_>>().join(","))
            }
            _ => write!(f, "{} IDMs", self.count()),
        }
    }
}

/// Motion along `direction` (unit vector) at `offset_m` from the virtual point, per unit of each
/// rigid degree of freedom: eᵀ \[I, −skew(r)\], that is e for the translations and r × e for the
/// rotations.
///
/// The same row, read as a column, gives the virtual point's forces and moments per newton of an
/// impact.
pub fn rigid_row(direction: Vector3<f64>, offset_m: Vector3<f64>) -> [f64; 6] {
    Dof::RIGID.map(|dof| dof.displacement(offset_m).dot(&direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

        /// The row times a rigid motion is the velocity of the point along the direction.
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
        assert_eq!(IdmSet::from_count(4).map(IdmSet::dofs), Some(vec![Dof::Y, Dof::Z, Dof::Rx, Dof::Ry]));
        assert_eq!(IdmSet::from_count(3), None);
        assert_eq!(IdmSet::Two.position(Dof::Z), Some(1));
        assert_eq!(IdmSet::Two.position(Dof::X), None);
    }

    #[test]
    fn any_choice_is_a_set_and_the_papers_are_recognised() {
        assert_eq!(IdmSet::of(&[Dof::Z, Dof::Y]), Some(IdmSet::Two));
        assert_eq!(IdmSet::of(&Dof::RIGID), Some(IdmSet::Six));
        let set = IdmSet::of(&[Dof::Ry, Dof::X, Dof::Z]).expect("three modes");
        assert_eq!((set.count(), set.dofs()), (3, vec![Dof::X, Dof::Z, Dof::Ry]));
        assert_eq!(set.to_string(), "IDMs x,z,ry");
        assert_eq!(IdmSet::of(&[]), None);
        assert_eq!(IdmSet::of(&[Dof::X, Dof::X]), None);
    }

    #[test]
    fn names_are_ours_or_the_workbooks() {
        for dof in Dof::ALL {
            assert_eq!(dof.name().parse(), Ok(dof));
            assert_eq!(
                usize::from(dof.is_translation())
                    + usize::from(dof.is_rotation())
                    + usize::from(dof.is_flexible()),
                1
            );
        }
        assert_eq!("uz".parse(), Ok(Dof::Z));
        assert_eq!("MX".parse(), Ok(Dof::Rx));
        assert!("q".parse::<Dof>().is_err_and(|e| e.contains("`q`") && e.contains("bzy")));
    }

    #[test]
    fn a_mode_grows_with_its_power_of_the_distance() {
        let r = Vector3::new(0.01, -0.02, 0.03);
        for dof in Dof::ALL {
            let (near, far) = (dof.displacement(r), dof.displacement(2.0 * r));
            assert!((far - near * 2f64.powi(dof.power_of_length())).norm() < 1e-15, "{dof}");
        }
    }
}
