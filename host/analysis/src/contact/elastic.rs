//! How a specimen bends, shears and shortens under the contact's force.
//!
//! A specimen is a beam along y from the contact (y = 0) to its clamp, loaded at the contact by the
//! contact's force (F_x, F_y, F_z). Its sections stay plane (Timoshenko): with the shear compliance
//! per length a = 1/(κGA) and the bending compliance b = 1/(EI), its section at y moves, relative
//! to a rigid body that moves as the section at the contact, by
//!
//! ```text
//! z(y) = F_z (a y − b y³/6),   θ_x(y) = −F_z b y²/2,   y(y) = F_y y/(EA)
//! ```
//!
//! up to the clamp, and as a rigid body beyond it (with a gradual transition); along x as along z,
//! with the bending compliance of that direction. The force is that on B, so that the same formula
//! holds for A (y > 0, loaded by the opposite force) and for B (y < 0). The specimen's own inertia
//! between contact and clamp is neglected: its force is about a hundredth of F.
//!
//! F_z follows from the load cells. Along x and y the contact is a spring, whose stiffnesses are
//! unknowns too. These forces do not move the spots along z. But strong signals determine the
//! positions of the points to some hundredths of a millimetre, and k_T depends on them: without
//! these forces the positions would be fitted to the specimen's deformation.
//!
//! k_T is thus the stiffness between the two surfaces at y = 0: the bulk between the sensors and
//! the contact is not part of it.

use nalgebra::Matrix3;

/// Number of parameters of one specimen. A has its shear compliance (1/N), the logarithms of the
/// ratios of bending compliance to it for forces along z and x (1/m²), and of the distance of the
/// clamp (m); B has the logarithms of the ratios of its own quantities to those of A, because the
/// two specimens of a joint are usually alike.
pub const TERMS: usize = 4;

/// Shear compliance per length, 1/N, with the standard deviation: a rigid body has none, a steel
/// section of 18 × 14 mm has 6e-8, an aluminium one of 8 × 8 mm 7e-7.
const SHEAR_PER_N: [f64; 2] = [1e-7, 3e-7];
/// Bending compliance over shear compliance per length, 1/m², of rectangular sections 8 to 20 mm
/// deep along the force: 12 κG/(E d²); and the standard deviation of its logarithm.
const BENDING_PER_M2: [f64; 2] = [2.5e4, 0.6];
/// Distance of the clamp from the contact relative to that of the farthest point: points are placed
/// on the visible part of a specimen. Standard deviation of its logarithm.
const CLAMP: [f64; 2] = [0.75, 0.2];
/// The same at least, m: points may be on the free end alone.
const NEAREST_CLAMP_M: f64 = 0.009;

/// Exponent of the corner: 6 leaves 99.7 % of the height at half the clamp's distance, and 89 % at
/// the clamp. A sharp corner would keep the search from settling when it crosses a point.
const CORNER: i32 = 6;

/// Shear coefficient of a rectangular section.
const KAPPA: f64 = 5.0 / 6.0;

/// 1/(EA) over 1/(κGA): κG/E, with Poisson's ratio 0.3.
const AXIAL: f64 = KAPPA / 2.6;

/// What is known of a specimen's bulk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bulk {
    /// 1/(κGA), 1/N; and its standard deviation.
    pub shear_per_n: [f64; 2],
    /// 1/(EI) over 1/(κGA), 1/m², for bending by forces along z and along x; and the standard
    /// deviations of their logarithms.
    pub bending_per_m2: [[f64; 2]; 2],
    /// Distance of the clamp from the contact, m; and the standard deviation of its logarithm.
    pub clamp_m: [f64; 2],
}

impl Bulk {
    /// A body that does not bend.
    pub const RIGID: Self =
        Bulk { shear_per_n: [0.0; 2], bending_per_m2: [[1.0, 0.0]; 2], clamp_m: [1.0, 0.0] };

    /// A beam of a rectangular section with edges along x and z (m), of a material with Young's
    /// modulus (Pa) and Poisson's ratio, clamped at this distance (m); `uncertainty` is the
    /// relative standard deviation of its compliances, half of it that of the clamp's distance.
    pub fn beam(
        [along_x, along_z]: [f64; 2],
        young_pa: f64,
        poisson: f64,
        clamp_m: f64,
        uncertainty: f64,
    ) -> Self {
        let shear_modulus = young_pa / (2.0 * (1.0 + poisson));
        let shear = (KAPPA * shear_modulus * along_x * along_z).recip();
        let bending = |depth: f64| [12.0 * KAPPA * shear_modulus / (young_pa * depth * depth), uncertainty];
        Bulk {
            shear_per_n: [shear, uncertainty * shear],
            bending_per_m2: [bending(along_z), bending(along_x)],
            clamp_m: [clamp_m, 0.5 * uncertainty],
        }
    }

    /// A specimen of which nothing is stated; `farthest_m` is the height of its farthest point over
    /// the contact.
    pub fn unstated(farthest_m: f64) -> Self {
        let [part, sigma] = CLAMP;
        Bulk {
            shear_per_n: SHEAR_PER_N,
            bending_per_m2: [BENDING_PER_M2; 2],
            clamp_m: [(part * farthest_m).max(NEAREST_CLAMP_M), sigma],
        }
    }
}

/// Standard deviation of the logarithm of a ratio of specimen B to A, unless both are stated.
const UNLIKE: f64 = 0.4;

/// What is known of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Start value.
    pub start: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Whether the plan states it; otherwise it is a guess.
    pub stated: bool,
}

/// What is known of the parameters of both specimens, from what is stated of A and B; `farthest_m`
/// is the height of the farthest point on either.
pub fn priors([a, b]: [Option<Bulk>; 2], farthest_m: f64) -> [Prior; 2 * TERMS] {
    let logarithm = |[value, sigma]: [f64; 2]| [value.ln(), sigma];
    let own = a.or(b).unwrap_or_else(|| Bulk::unstated(farthest_m));
    let [along_z, along_x] = own.bending_per_m2;
    let of_a = [own.shear_per_n, logarithm(along_z), logarithm(along_x), logarithm(own.clamp_m)];
    let of_b = match (a, b) {
        (Some(a), Some(b)) if a.shear_per_n[0] > 0.0 => {
            let relative = |[value, sigma]: [f64; 2]| [value, sigma / value];
            let ratio = |[a, of_a]: [f64; 2], [b, of_b]: [f64; 2]| [(b / a).ln(), of_a.hypot(of_b)];
            [
                ratio(relative(a.shear_per_n), relative(b.shear_per_n)),
                ratio(a.bending_per_m2[0], b.bending_per_m2[0]),
                ratio(a.bending_per_m2[1], b.bending_per_m2[1]),
                ratio(a.clamp_m, b.clamp_m),
            ]
        }
        (Some(_), Some(_)) => [[0.0; 2]; TERMS],
        _ => [[0.0, UNLIKE]; TERMS],
    };
    std::array::from_fn(|n| {
        let ([start, sigma], stated) =
            if n < TERMS { (of_a[n], a.or(b).is_some()) } else { (of_b[n - TERMS], a.and(b).is_some()) };
        Prior { start, sigma, stated }
    })
}

/// A specimen's elastic shape.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    shear: f64,
    /// For forces along z and x.
    ratios: [f64; 2],
    clamp_m: f64,
    /// On B: its shear compliance over that of A.
    of_b: Option<f64>,
}

/// Displacement of a point beyond the rigid body's along x, y and z (rows) per newton of the
/// contact's force along x, y and z (columns), m/N.
pub type Compliance = Matrix3<f64>;

/// A displacement with its derivatives.
#[derive(Debug, Clone)]
pub struct Deflected {
    /// The displacement.
    pub value: Compliance,
    /// Its derivatives by parameters: (index, value).
    pub by: Vec<(usize, Compliance)>,
    /// Its derivatives by the point's coordinates.
    pub by_place: [Compliance; 3],
}

/// Displacement of a section along the force and its rotation, with the sign of that about x by a
/// force along z.
type Section = [f64; 2];

impl Shape {
    /// That of A from the parameters of both.
    pub fn of_a(p: &[f64]) -> Self {
        Shape { shear: p[0], ratios: [p[1].exp(), p[2].exp()], clamp_m: p[3].exp(), of_b: None }
    }

    /// That of B from the parameters of both.
    pub fn of_b(p: &[f64]) -> Self {
        let Shape { shear, ratios, clamp_m, .. } = Shape::of_a(p);
        let own = &p[TERMS..];
        let ratio = own[0].exp();
        Shape {
            shear: shear * ratio,
            ratios: [ratios[0] * own[1].exp(), ratios[1] * own[2].exp()],
            clamp_m: clamp_m * own[3].exp(),
            of_b: Some(ratio),
        }
    }

    /// At a point whose coordinates are relative to the contact, m. The parameters of both
    /// specimens are counted from `first`.
    pub fn at(&self, r: [f64; 3], first: usize) -> Deflected {
        let Shape { shear: a, ratios, clamp_m, of_b } = *self;
        let side = if of_b.is_some() { -1.0 } else { 1.0 };
        let [_, y, _] = r;
        let height = side * y;
        if height <= 0.0 {
            // sections beyond the contact are not loaded
            let none = Compliance::zeros();
            return Deflected { value: none, by: Vec::new(), by_place: [none; 3] };
        }
        // the clamp takes the load over some length: the smaller of height and clamp_m, with a
        // round corner
        let loaded = (height.powi(-CORNER) + clamp_m.powi(-CORNER)).powf(-1.0 / f64::from(CORNER));
        let h = side * loaded;
        let by_height = (loaded / height).powi(CORNER + 1);
        let by_clamp = side * (loaded / clamp_m).powi(CORNER + 1) * clamp_m;
        let beyond = y - h;
        let bent = [-h.powi(3) / 6.0 - 0.5 * h * h * beyond, -0.5 * h * h];
        let section = |of: &dyn Fn(f64) -> Section| ratios.map(|ratio| of(ratio * a));
        let value = section(&|b| [a * h + b * bent[0], b * bent[1]]);
        let by_shear = ratios.map(|ratio| [h + ratio * bent[0], ratio * bent[1]]);
        let by_ratio = section(&|b| [b * bent[0], b * bent[1]]);
        let by_h = section(&|b| [a - b * h * beyond, -b * h]);
        let by_y = section(&|b| [by_height * (a - b * h * beyond) + b * bent[1], by_height * -b * h]);
        let scaled = |of: [Section; 2], factor: f64| of.map(|own| own.map(|v| factor * v));
        let none = [[0.0; 2]; 2];
        let axial = AXIAL * a;
        let turn = value.map(|[_, turn]| turn);
        let by_shear = displacement(r, by_shear, AXIAL * h);
        let by_logarithms = [
            displacement(r, [by_ratio[0], none[1]], 0.0),
            displacement(r, [none[0], by_ratio[1]], 0.0),
            displacement(r, scaled(by_h, by_clamp), axial * by_clamp),
        ];
        let numbered = |from: usize, by_first: Compliance| {
            std::iter::once(by_first).chain(by_logarithms).enumerate().map(move |(n, by)| (from + n, by))
        };
        let by = match of_b {
            None => numbered(first, by_shear).collect(),
            // by the parameters of A, then by the logarithms of its ratios to them
            Some(ratio) => {
                numbered(first, by_shear * ratio).chain(numbered(first + TERMS, by_shear * a)).collect()
            }
        };
        Deflected {
            value: displacement(r, value, axial * h),
            by,
            by_place: [
                Compliance::new(0.0, 0.0, 0.0, -turn[1], 0.0, 0.0, 0.0, 0.0, 0.0),
                displacement(r, by_y, axial * by_height),
                Compliance::new(0.0, 0.0, 0.0, 0.0, 0.0, -turn[0], 0.0, 0.0, 0.0),
            ],
        }
    }
}

/// The displacement of a point by the motion of its section for forces along z and x, and by its
/// axial displacement: a rotation of the section moves a point beside the axis along y.
fn displacement(r: [f64; 3], [[z, turn_z], [x, turn_x]]: [Section; 2], axial: f64) -> Compliance {
    Compliance::new(x, 0.0, 0.0, -turn_x * r[0], axial, -turn_z * r[2], 0.0, 0.0, z)
}

#[cfg(test)]
mod tests {
    use super::{Compliance, Shape, TERMS};

    #[test]
    fn the_tip_deflects_as_a_cantilever_with_shear() {
        let (a, b, length) = (2e-7_f64, 0.01, 0.012);
        // a clamp so far away that its corner takes 1e-12 of the load
        let p = [a, (b / a).ln(), (b / a).ln(), 0.0, 0.0, 0.0, 0.0, 0.0];
        for (shape, side) in [(Shape::of_a(&p), 1.0), (Shape::of_b(&p), -1.0)] {
            let y = side * length;
            for force in [0, 2] {
                // the clamped section stands still: move the rigid body against its deflection
                let mut r = [0.0, y, 0.0];
                let along = -shape.at(r, 0).value[(force, force)];
                r[force] = 0.005;
                let turn = shape.at(r, 0).value[(1, force)] / 0.005;
                let tip = along - turn * y;
                // A is pushed by −F, B by F
                let expected = -side * (a * length + b * length.powi(3) / 3.0);
                assert!((tip / expected - 1.0).abs() < 1e-9, "{tip} {expected}");
                assert!((turn / (0.5 * b * length * length) - 1.0).abs() < 1e-9, "{turn}");
            }
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let p = [2e-7, 4e4_f64.ln(), 1e4_f64.ln(), 0.010_f64.ln(), 0.3, -0.2, 0.1, 0.05];
        let near = |slope: Compliance, exact: Compliance| {
            assert!((slope - exact).amax() <= 1e-5 * exact.amax() + 1e-18, "{slope} {exact}");
        };
        for (shape, side) in [(Shape::of_a as fn(&[f64]) -> Shape, 1.0), (Shape::of_b, -1.0)] {
            for height in [0.0005, 0.006, 0.014] {
                let r = [0.004, side * height, -0.003];
                let exact = shape(&p).at(r, 0);
                let mut by = [Compliance::zeros(); 2 * TERMS];
                for (n, own) in &exact.by {
                    by[*n] = *own;
                }
                for (n, by) in by.into_iter().enumerate() {
                    let of = |step: f64| {
                        let mut q = p;
                        q[n] += step;
                        shape(&q).at(r, 0).value
                    };
                    let step = if n == 0 { 1e-11 } else { 1e-4 };
                    near((of(step) - of(-step)) / (2.0 * step), by);
                }
                for n in 0..3 {
                    let of = |by: f64| {
                        let mut q = r;
                        q[n] += by;
                        shape(&p).at(q, 0).value
                    };
                    near((of(1e-7) - of(-1e-7)) / 2e-7, exact.by_place[n]);
                }
            }
        }
    }
}
