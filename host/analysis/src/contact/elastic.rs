//! How a specimen bends and shears under the contact's force.
//!
//! A specimen is a beam along y from the contact (y = 0) to its clamp, loaded at the contact by a
//! force F along z. Its sections stay plane (Timoshenko): with the shear compliance per length
//! a = 1/(κGA) and the bending compliance b = 1/(EI), its section at y moves, relative to a rigid
//! body that moves as the section at the contact, by
//!
//! ```text
//! z(y) = F (a y − b y³/6),   θ_x(y) = −F b y²/2
//! ```
//!
//! up to the clamp, and as a rigid body beyond it (with a gradual transition). F is the force on B,
//! so that the same formula holds for A (y > 0, loaded by −F) and for B (y < 0, loaded by F). The
//! specimen's own inertia between contact and clamp is neglected: its force is about a hundredth of
//! F.
//!
//! k_T is thus the stiffness between the two surfaces at y = 0: the bulk between the sensors and
//! the contact is not part of it.

/// Number of parameters of one specimen: shear, the ratio of bending to it, distance of the clamp.
pub const TERMS: usize = 3;

/// Shear compliance per length, 1/N: an aluminium section of 8 × 8 mm has 7e-7, a steel one of
/// 18 × 14 mm 6e-8. A rigid body has none.
const SHEAR_PER_N: f64 = 5e-7;
/// Bending compliance over shear compliance per length, 1/m², of rectangular sections 8 to 20 mm
/// deep along z: 12 κG/(E d²), with the standard deviation.
const BENDING_PER_M2: [f64; 2] = [3e4, 2e4];
/// Distance of the clamp from the contact relative to that of the farthest point: points are placed
/// on the visible part of a specimen. It is not fitted, because the search does not settle with it;
/// shear and bending absorb most of an error, of which little is left at the spots next to the
/// contact.
const CLAMP: f64 = 0.8;

/// Exponent of the corner: 6 leaves 99.7 % of the height at half the clamp's distance, and 89 % at
/// the clamp. A sharp corner would keep the search from settling when it crosses a point.
const CORNER: i32 = 6;

/// Shear coefficient of a rectangular section.
const KAPPA: f64 = 5.0 / 6.0;

/// What is known of a specimen's bulk: values with their standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Specimen {
    /// 1/(κGA), 1/N.
    pub shear_per_n: [f64; 2],
    /// 1/(EI), for bending by a force along z, over 1/(κGA), 1/m².
    pub bending_per_m2: [f64; 2],
    /// Distance of the clamp from the contact, m, taken as exact.
    pub clamp_m: f64,
}

impl Specimen {
    /// A body that does not bend.
    pub const RIGID: Self = Specimen { shear_per_n: [0.0; 2], bending_per_m2: [0.0; 2], clamp_m: 1.0 };

    /// A beam of a rectangular section with edges along x and z (m), of a material with Young's
    /// modulus (Pa) and Poisson's ratio, clamped at this distance (m); `uncertainty` is the
    /// relative standard deviation of its compliances.
    pub fn beam(
        [along_x, along_z]: [f64; 2],
        young_pa: f64,
        poisson: f64,
        clamp_m: f64,
        uncertainty: f64,
    ) -> Self {
        let shear_modulus = young_pa / (2.0 * (1.0 + poisson));
        let known = |value: f64| [value, uncertainty * value];
        Specimen {
            shear_per_n: known((KAPPA * shear_modulus * along_x * along_z).recip()),
            bending_per_m2: known(12.0 * KAPPA * shear_modulus / (young_pa * along_z * along_z)),
            clamp_m,
        }
    }

    /// A specimen of which nothing is stated; `farthest_m` is the height of its farthest point over
    /// the contact.
    pub fn unstated(farthest_m: f64) -> Self {
        Specimen {
            shear_per_n: [0.0, SHEAR_PER_N],
            bending_per_m2: BENDING_PER_M2,
            clamp_m: CLAMP * farthest_m,
        }
    }
}

/// A specimen's elastic shape.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    shear: f64,
    ratio: f64,
    clamp_m: f64,
}

/// Motion of a section per newton, relative to the rigid body: displacement along z (m/N), rotation
/// about x (rad/N).
pub type Deflection = [f64; 2];

/// A deflection with its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Deflected {
    /// The deflection.
    pub value: Deflection,
    /// Its derivatives by shear and the ratio of bending to it.
    pub by: [Deflection; 2],
    /// Its derivative by the height.
    pub along: Deflection,
}

impl Shape {
    /// From a specimen's parameters.
    pub fn new(p: &[f64]) -> Self {
        Shape { shear: p[0], ratio: p[1], clamp_m: p[2] }
    }

    /// Deflection at the height y, m: positive on A, negative on B.
    pub fn at(&self, y: f64, side: f64) -> Deflected {
        let Shape { shear: a, ratio, clamp_m } = *self;
        let b = ratio * a;
        let height = side * y;
        if height <= 0.0 {
            // sections beyond the contact are not loaded
            return Deflected { value: [0.0; 2], by: [[0.0; 2]; 2], along: [0.0; 2] };
        }
        // the clamp takes the load over some length: the smaller of height and clamp_m, with a round
        // corner
        let loaded = (height.powi(-CORNER) + clamp_m.powi(-CORNER)).powf(-1.0 / f64::from(CORNER));
        let h = side * loaded;
        let by_height = (loaded / height).powi(CORNER + 1);
        let beyond = y - h;
        let z_of_bending = -h.powi(3) / 6.0 - 0.5 * h * h * beyond;
        let turn = -0.5 * h * h;
        // derivatives by h
        let of_h = [a - b * h * beyond, -b * h];
        Deflected {
            value: [a * h + b * z_of_bending, b * turn],
            by: [[h + ratio * z_of_bending, ratio * turn], [a * z_of_bending, a * turn]],
            along: [by_height * of_h[0] + b * turn, by_height * of_h[1]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Shape;

    #[test]
    fn the_tip_deflects_as_a_cantilever_with_shear() {
        let (a, b, length) = (2e-7, 0.01, 0.012);
        // the clamped section stands still: move the rigid body against its deflection
        for side in [1.0, -1.0] {
            // a clamp so far away that its corner takes 1e-12 of the load
            let at = Shape::new(&[a, b / a, 1.0]).at(side * length, side).value;
            let (turn, z) = (-at[1], -at[0]);
            let tip = z - turn * side * length;
            // A is pushed by −F, B by F
            let expected = -side * (a * length + b * length.powi(3) / 3.0);
            assert!((tip / expected - 1.0).abs() < 1e-9, "{tip} {expected}");
            assert!((turn / (0.5 * b * length * length) - 1.0).abs() < 1e-9, "{turn}");
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let p = [2e-7, 4e4, 0.010];
        for side in [1.0, -1.0] {
            for height in [0.0005, 0.006, 0.014] {
                let y = side * height;
                let exact = Shape::new(&p).at(y, side);
                for k in 0..2 {
                    for n in 0..2 {
                        let of = |by: f64| {
                            let mut q = p;
                            q[n] += by;
                            Shape::new(&q).at(y, side).value[k]
                        };
                        let step = 1e-4 * p[n];
                        let slope = (of(step) - of(-step)) / (2.0 * step);
                        assert!((slope - exact.by[n][k]).abs() <= 1e-6 * exact.by[n][k].abs() + 1e-18);
                    }
                    let of = |by: f64| Shape::new(&p).at(y + by, side).value[k];
                    let slope = (of(1e-7) - of(-1e-7)) / 2e-7;
                    assert!((slope - exact.along[k]).abs() <= 1e-5 * exact.along[k].abs() + 1e-18);
                }
            }
        }
    }
}
