//! A body that bends: a straight beam of rectangular section, as Timoshenko elements.
//!
//! The beam's motion is the body's rigid motion (6 coordinates at its centre of gravity, as for a
//! rigid body) plus its elastic free modes (6 for each element). An element has 6 degrees of
//! freedom at each end; between them it moves by its exact static shapes, so that static stiffness
//! is exact with one element: bending in two planes with shear (Cowper's coefficient), axial,
//! torsion (the rectangle's torsion constant). Its mass matrix is consistent with these shapes.
//!
//! **Mass.** The body's mass is spread evenly along the beam; this distribution gives the elastic
//! modes' shapes and frequencies. A free mode contains no rigid motion with respect to it, so the
//! two parts of the kinetic energy separate, and the rigid part uses mass, centre of gravity and
//! inertia as the rig file states them: the 6 × 6 matrix of rigid motion is the rigid body's,
//! whatever the beam is. A centre of gravity beside the beam's middle, or an inertia that is not
//! the beam's own, therefore acts on the rigid motion and not on the modes.
//!
//! **Points.** A point moves with the plane section at its axial coordinate, at a rigid offset from
//! the axis; beyond the beam's ends, with the end section.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Matrix6xX, SMatrix, SymmetricEigen, Vector3};
use std::f64::consts::PI;

use super::config::Beam;
use super::normalized;

/// Motion of a point (translation, rotation) per coordinate of an element's two ends.
type Ends = SMatrix<f64, 6, 12>;

/// Abscissae and weights of Gauss's formula with four points on 0…1, exact for the products of two
/// cubics.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A beam's elastic free modes. Their modal masses are 1.
#[derive(Debug, Clone)]
pub(super) struct Shapes {
    elements: Vec<Element>,
    from: Vector3<f64>,
    /// Nodes' motions in the rig's axes, 6 for each node, one column for each mode.
    nodes: DMatrix<f64>,
    /// Squares of the circular frequencies (1/s²).
    pub squares: DVector<f64>,
    /// β (s) of C = β K.
    pub damping_s: f64,
}

impl Shapes {
    /// With nodes where forces at the points `loaded` act, between which the static shapes are
    /// exact. `None` for a beam without length or section, which [`super::RigConfig::check`]
    /// refuses.
    pub(super) fn new(beam: &Beam, mass_kg: f64, loaded: &[[f64; 3]]) -> Option<Self> {
        let elements: Vec<Element> = nodes(beam, loaded)
            .windows(2)
            .map(|ends| Element::new(beam, mass_kg, [ends[0], ends[1]]))
            .collect();
        let order = 6 * (elements.len() + 1);
        let (mut mass, mut stiffness) = (DMatrix::zeros(order, order), DMatrix::zeros(order, order));
        let mut rigid = DMatrix::zeros(order, 6);
        rigid.view_mut((0, 0), (6, 6)).fill_with_identity();
        for (index, element) in elements.iter().enumerate() {
            let at = 6 * index;
            let mut block = mass.fixed_view_mut::<12, 12>(at, at);
            block += element.mass;
            let mut block = stiffness.fixed_view_mut::<12, 12>(at, at);
            block += element.stiffness;
            let end = element.along() * (element.start_m + element.length_m);
            rigid.fixed_view_mut::<6, 6>(at + 6, 0).copy_from(&rigid_motion(end.into(), [0.0; 3]));
        }
        // deformations relative to the first node, from which their mean rigid motion is subtracted
        let free = order - 6;
        let mut relative = DMatrix::zeros(order, free);
        relative.view_mut((6, 0), (free, free)).fill_with_identity();
        let carried = &mass * &rigid;
        let mean = (rigid.transpose() * &carried).cholesky()?.solve(&(carried.transpose() * &relative));
        relative -= &rigid * mean;
        let kinetic = relative.transpose() * &mass * &relative;
        // A rigid motion adds no strain, so this is the stiffness with the first node held. The
        // eigenvalues are the modes' flexibilities: the softest mode is the most accurate one.
        let held = stiffness.view((6, 6), (free, free)).into_owned().cholesky()?;
        let inverse = held.l().solve_lower_triangular(&DMatrix::identity(free, free))?;
        let reduced = &inverse * kinetic * inverse.transpose();
        let eigen = SymmetricEigen::try_new((&reduced + reduced.transpose()) * 0.5, f64::EPSILON, 10_000)?;
        if eigen.eigenvalues.iter().any(|value| value.is_nan() || *value <= 0.0) {
            return None;
        }
        let unit = DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| 1.0 / value.sqrt()));
        Some(Self {
            nodes: relative * inverse.transpose() * eigen.eigenvectors * unit,
            squares: eigen.eigenvalues.map(|value| 1.0 / value),
            damping_s: beam.damping_s,
            elements,
            from: Vector3::from(beam.from_m),
        })
    }

    /// Number of modes.
    pub(super) fn modes(&self) -> usize {
        self.squares.len()
    }

    /// Motion of the material at `position_m` (translation, rotation) per mode, 6 × modes.
    pub(super) fn at(&self, position_m: [f64; 3]) -> Matrix6xX<f64> {
        let offset = Vector3::from(position_m) - self.from;
        let along_m = offset.dot(&self.elements[0].along());
        let index = self.elements.iter().rposition(|element| element.start_m <= along_m).unwrap_or(0);
        let element = &self.elements[index];
        let within = ((along_m - element.start_m) / element.length_m).clamp(0.0, 1.0);
        let lever = offset - element.along() * (element.start_m + element.length_m * within);
        rigid_motion(lever.into(), [0.0; 3]) * element.shapes(within) * self.nodes.rows(6 * index, 12)
    }
}

/// A node is moved to a loaded point that is nearer than this part of an element; for another point
/// a node is added.
const MOVED: f64 = 0.3;

/// Nodes of a beam along its axis (m): evenly spaced, except at loaded points between its ends.
fn nodes(beam: &Beam, loaded: &[[f64; 3]]) -> Vec<f64> {
    let axis = Vector3::from(beam.to_m) - Vector3::from(beam.from_m);
    let (length_m, count) = (axis.norm(), f64::from(beam.elements));
    let mut nodes: Vec<f64> = (0..=beam.elements).map(|node| length_m * f64::from(node) / count).collect();
    for point in loaded {
        let at = (Vector3::from(*point) - Vector3::from(beam.from_m)).dot(&axis) / length_m;
        let margin = 0.01 * length_m / count;
        if at < margin || at > length_m - margin {
            continue;
        }
        let inner = 1..nodes.len() - 1;
        let nearest = inner.min_by(|a, b| (nodes[*a] - at).abs().total_cmp(&(nodes[*b] - at).abs()));
        match nearest.filter(|nearest| (nodes[*nearest] - at).abs() < MOVED * length_m / count) {
            Some(nearest) => nodes[nearest] = at,
            None => nodes.push(at),
        }
        nodes.sort_by(f64::total_cmp);
    }
    nodes
}

/// One element in the rig's axes.
#[derive(Debug, Clone)]
struct Element {
    /// From the beam's first end (m).
    start_m: f64,
    length_m: f64,
    /// Columns: along the axis, along the section's first edge, along its second.
    axes: Matrix3<f64>,
    /// Ratio of the deflection by shear to that by bending, for deflection along each edge.
    shear: [f64; 2],
    mass: SMatrix<f64, 12, 12>,
    stiffness: SMatrix<f64, 12, 12>,
}

impl Element {
    /// The part of the beam between `ends` (m, from its first end).
    fn new(beam: &Beam, mass_kg: f64, ends: [f64; 2]) -> Self {
        let axis = Vector3::from(beam.to_m) - Vector3::from(beam.from_m);
        let length_m = ends[1] - ends[0];
        let along = Vector3::from(normalized(axis.into()));
        let first = beam.first_edge(along.into());
        let first = Vector3::from(normalized((first - along * first.dot(&along)).into()));
        let [a, b] = beam.section_m;
        let area = a * b;
        // for deflection along each edge
        let moments = [b * a * a * a / 12.0, a * b * b * b / 12.0];
        let young = beam.young_pa;
        let modulus = young / (2.0 * (1.0 + beam.poisson));
        let cowper = 10.0 * (1.0 + beam.poisson) / (12.0 + 11.0 * beam.poisson);
        let shear =
            moments.map(|moment| 12.0 * young * moment / (cowper * modulus * area * length_m * length_m));
        let mut element = Self {
            start_m: ends[0],
            length_m,
            axes: Matrix3::from_columns(&[along, first, along.cross(&first)]),
            shear,
            mass: SMatrix::zeros(),
            stiffness: SMatrix::zeros(),
        };
        let density = mass_kg / (area * axis.norm());
        let [of_first, of_second] = moments;
        // rotation about the second edge's axis deflects along the first
        let section =
            [area, area, area, of_first + of_second, of_second, of_first].map(|part| part * density);
        let turned = element.turned();
        let mut mass = SMatrix::<f64, 12, 12>::zeros();
        for (within, weight) in GAUSS {
            let shapes = element.local(within);
            mass +=
                shapes.transpose() * Matrix6::from_diagonal(&section.into()) * shapes * (weight * length_m);
        }
        element.mass = turned.transpose() * mass * turned;

        let mut stiffness = SMatrix::<f64, 12, 12>::zeros();
        let mut spring = |at: usize, k: f64| {
            stiffness[(at, at)] += k;
            stiffness[(at + 6, at + 6)] += k;
            stiffness[(at, at + 6)] -= k;
            stiffness[(at + 6, at)] -= k;
        };
        spring(0, young * area / length_m);
        spring(3, modulus * torsion_constant(a, b) / length_m);
        for (plane, (places, signs)) in PLANES.into_iter().enumerate() {
            let (l, phi) = (length_m, shear[plane]);
            let k = young * moments[plane] / (l * l * l * (1.0 + phi));
            let (same, other) = ((4.0 + phi) * l * l, (2.0 - phi) * l * l);
            let block = [
                [12.0, 6.0 * l, -12.0, 6.0 * l],
                [6.0 * l, same, -6.0 * l, other],
                [-12.0, -6.0 * l, 12.0, -6.0 * l],
                [6.0 * l, other, -6.0 * l, same],
            ];
            for i in 0..4 {
                for j in 0..4 {
                    stiffness[(places[i], places[j])] += signs[i] * signs[j] * k * block[i][j];
                }
            }
        }
        element.stiffness = turned.transpose() * stiffness * turned;
        element
    }

    fn along(&self) -> Vector3<f64> {
        self.axes.column(0).into_owned()
    }

    /// From the rig's axes to the element's.
    fn turned(&self) -> SMatrix<f64, 12, 12> {
        let mut turned = SMatrix::<f64, 12, 12>::zeros();
        for at in [0, 3, 6, 9] {
            turned.fixed_view_mut::<3, 3>(at, at).copy_from(&self.axes.transpose());
        }
        turned
    }

    /// Motion of the axis at the fraction `within` of the length, in the rig's axes.
    fn shapes(&self, within: f64) -> Ends {
        let mut back = Matrix6::zeros();
        for at in [0, 3] {
            back.fixed_view_mut::<3, 3>(at, at).copy_from(&self.axes);
        }
        back * self.local(within) * self.turned()
    }

    /// The same in the element's axes.
    fn local(&self, x: f64) -> Ends {
        let l = self.length_m;
        let mut shapes = Ends::zeros();
        for at in [0, 3] {
            shapes[(at, at)] = 1.0 - x;
            shapes[(at, at + 6)] = x;
        }
        for ((places, signs), phi) in PLANES.into_iter().zip(self.shear) {
            let (xx, xxx) = (x * x, x * x * x);
            let deflection = [
                1.0 - 3.0 * xx + 2.0 * xxx + phi * (1.0 - x),
                l * (x - 2.0 * xx + xxx + phi / 2.0 * (x - xx)),
                3.0 * xx - 2.0 * xxx + phi * x,
                l * (xxx - xx + phi / 2.0 * (xx - x)),
            ];
            let rotation = [
                6.0 / l * (xx - x),
                1.0 - 4.0 * x + 3.0 * xx + phi * (1.0 - x),
                6.0 / l * (x - xx),
                3.0 * xx - 2.0 * x + phi * x,
            ];
            for i in 0..4 {
                shapes[(places[0], places[i])] = signs[i] * deflection[i] / (1.0 + phi);
                shapes[(places[1], places[i])] = signs[1] * signs[i] * rotation[i] / (1.0 + phi);
            }
        }
        shapes
    }
}

/// For deflection along each edge: the places of deflection and rotation of both ends among the
/// element's coordinates, and their signs. A deflection along the second edge that grows along the
/// axis is a negative rotation about the first.
const PLANES: [([usize; 4], [f64; 4]); 2] =
    [([1, 5, 7, 11], [1.0; 4]), ([2, 4, 8, 10], [1.0, -1.0, 1.0, -1.0])];

/// Torsion constant (m⁴) of a rectangle: Saint-Venant's series.
fn torsion_constant(a: f64, b: f64) -> f64 {
    let (long, short) = if a > b { (a, b) } else { (b, a) };
    let odd = (0..30).map(|index| f64::from(2 * index + 1));
    let sum: f64 = odd.map(|n| (n * PI * long / (2.0 * short)).tanh() / n.powi(5)).sum();
    long * short.powi(3) / 3.0 * (1.0 - 192.0 * short / (PI.powi(5) * long) * sum)
}

/// Motion of point `at` (translation, rotation) from that of a body's point `from` if the body is
/// rigid between them.
pub(super) fn rigid_motion(at: [f64; 3], from: [f64; 3]) -> Matrix6<f64> {
    let r = [at[0] - from[0], at[1] - from[1], at[2] - from[2]];
    let skew = Matrix3::new(0.0, -r[2], r[1], r[2], 0.0, -r[0], -r[1], r[0], 0.0);
    let mut motion = Matrix6::identity();
    motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew);
    motion
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::{Matrix4, Vector6};

    use super::*;

    const YOUNG: f64 = 2.1e11;
    const POISSON: f64 = 0.29;
    /// Mass of each beam below (kg).
    const MASS_KG: f64 = 0.7;

    /// A beam of this length and section, along an axis that is not aligned with the rig's.
    fn skew(length_m: f64, section_m: [f64; 2], elements: u32) -> Beam {
        let along = normalized([0.3, -0.5, 0.8]);
        let from_m = [0.01, -0.02, 0.03];
        let to_m = std::array::from_fn(|axis| from_m[axis] + length_m * along[axis]);
        let first_edge = Some([0.2, 1.0, 0.1]);
        Beam {
            from_m,
            to_m,
            section_m,
            first_edge,
            young_pa: YOUNG,
            poisson: POISSON,
            damping_s: 0.0,
            elements,
        }
    }

    fn shapes(beam: &Beam) -> Shapes {
        Shapes::new(beam, MASS_KG, &[]).expect("a beam")
    }

    /// Motion of the end `to_m` per mode, in the beam's axes, with the end `from_m` held.
    fn tip(beam: &Beam) -> Matrix6xX<f64> {
        let shapes = shapes(beam);
        let held = shapes.at(beam.from_m);
        let motion = shapes.at(beam.to_m) - rigid_motion(beam.to_m, beam.from_m) * held;
        let mut turned = Matrix6::zeros();
        for at in [0, 3] {
            turned.fixed_view_mut::<3, 3>(at, at).copy_from(&shapes.elements[0].axes.transpose());
        }
        turned * motion
    }

    /// Area, second moments for deflection along each edge, shear stiffness κGA, torsion stiffness.
    fn section(a: f64, b: f64) -> (f64, [f64; 2], f64, f64) {
        let modulus = YOUNG / (2.0 * (1.0 + POISSON));
        let cowper = 10.0 * (1.0 + POISSON) / (12.0 + 11.0 * POISSON);
        let moments = [b * a.powi(3) / 12.0, a * b.powi(3) / 12.0];
        (a * b, moments, cowper * modulus * a * b, modulus * torsion_constant(a, b))
    }

    #[test]
    fn the_torsion_constant_is_the_text_books() {
        // Timoshenko and Goodier, Theory of Elasticity, table of k₁ for a/b of 1, 2 and 10
        for (ratio, expected) in [(1.0, 0.1406), (2.0, 0.229), (10.0, 0.312)] {
            let constant = torsion_constant(ratio, 1.0);
            // the table has three or four digits
            assert!((constant / ratio - expected).abs() < 5.1e-4, "{ratio}: {constant}");
            assert!((torsion_constant(1.0, ratio) / constant - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_cantilever_gives_what_theory_says() {
        for (length, [a, b], elements) in [
            (0.2, [0.05, 0.044], 1),
            (0.2, [0.05, 0.044], 3),
            (0.014, [0.018, 0.014], 1),
            (0.3, [0.004, 0.012], 2),
        ] {
            let beam = skew(length, [a, b], elements);
            let tip = tip(&beam);
            let flexibility = DMatrix::from_diagonal(&shapes(&beam).squares.map(|square| 1.0 / square));
            let found = &tip * flexibility * tip.transpose();
            let (area, moments, shear, twist) = section(a, b);
            let mut expected = Matrix6::zeros();
            expected[(0, 0)] = length / (YOUNG * area);
            expected[(3, 3)] = length / twist;
            for (deflects, turns, sign, moment) in [(1, 5, 1.0, moments[0]), (2, 4, -1.0, moments[1])] {
                let bending = YOUNG * moment;
                expected[(deflects, deflects)] = length.powi(3) / (3.0 * bending) + length / shear;
                expected[(turns, turns)] = length / bending;
                expected[(deflects, turns)] = sign * length * length / (2.0 * bending);
                expected[(turns, deflects)] = expected[(deflects, turns)];
            }
            // relative to the two diagonal entries, which have different units
            for i in 0..6 {
                for j in 0..6 {
                    let unit = (expected[(i, i)] * expected[(j, j)]).sqrt();
                    let off = (found[(i, j)] - expected[(i, j)]).abs() / unit;
                    assert!(off < 1e-9, "{length} {a} {b} ({i}, {j}): {off:e}");
                }
            }
        }
    }

    #[test]
    fn a_node_at_a_load_makes_its_deflection_exact() {
        // held at one end, loaded at 0.7 of the length: the part beyond the load remains straight
        let (length, a, b) = (0.1, 0.02, 0.012);
        let beam = skew(length, [a, b], 1);
        let load_m =
            std::array::from_fn(|axis| beam.from_m[axis] + 0.7 * (beam.to_m[axis] - beam.from_m[axis]));
        let shapes = Shapes::new(&beam, MASS_KG, &[load_m, beam.to_m]).expect("a beam");
        assert_eq!(shapes.elements.len(), 2);
        let at =
            |place: [f64; 3]| shapes.at(place) - rigid_motion(place, beam.from_m) * shapes.at(beam.from_m);
        let flexibility = DMatrix::from_diagonal(&shapes.squares.map(|square| 1.0 / square));
        let edge: Vector3<f64> = shapes.elements[0].axes.column(1).into_owned();
        let force = Vector6::new(edge.x, edge.y, edge.z, 0.0, 0.0, 0.0);
        let motion = at(beam.to_m) * flexibility * at(load_m).transpose() * force;
        let (_, [moment, _], shear, _) = section(a, b);
        let (load, bending) = (0.7 * length, YOUNG * moment);
        let expected = load * load * (3.0 * length - load) / (6.0 * bending) + load / shear;
        let found = motion.fixed_rows::<3>(0).dot(&edge);
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} for {expected}");
    }

    #[test]
    fn points_move_with_their_sections_and_with_the_ends_beyond_them() {
        let beam = skew(0.1, [0.02, 0.012], 2);
        let shapes = shapes(&beam);
        let along = shapes.elements[0].along();
        let place = |along_m: f64, off: Vector3<f64>| -> [f64; 3] {
            (Vector3::from(beam.from_m) + along * along_m + off).into()
        };
        let off = along.cross(&Vector3::new(0.003, 0.001, -0.002));
        for along_m in [0.0, 0.031, 0.05, 0.1] {
            let (axis, beside) = (place(along_m, Vector3::zeros()), place(along_m, off));
            let expected = rigid_motion(beside, axis) * shapes.at(axis);
            assert!((shapes.at(beside) - expected).norm() < 1e-9 * shapes.at(axis).norm());
        }
        for (end, beyond) in [(0.0, -0.02), (0.1, 0.13)] {
            let (end, beyond) = (place(end, Vector3::zeros()), place(beyond, off));
            let expected = rigid_motion(beyond, end) * shapes.at(end);
            assert!((shapes.at(beyond) - expected).norm() < 1e-9 * shapes.at(end).norm());
        }
    }

    /// Frequencies (Hz) of the beam with its first end held, lowest first.
    fn cantilever_hz(beam: &Beam) -> Vec<f64> {
        let shapes = shapes(beam);
        let [a, b] = beam.section_m;
        let axis = Vector3::from(beam.to_m) - Vector3::from(beam.from_m);
        let length = axis.norm();
        // rigid motion of a homogeneous box about its end, in the beam's axes
        let centre = rigid_motion([length / 2.0, 0.0, 0.0], [0.0; 3]);
        let inertia = [a * a + b * b, length * length + b * b, length * length + a * a];
        let inertia = inertia.map(|sum| MASS_KG / 12.0 * sum);
        let diagonal = [MASS_KG, MASS_KG, MASS_KG, inertia[0], inertia[1], inertia[2]];
        let rigid = centre.transpose() * Matrix6::from_diagonal(&diagonal.into()) * centre;
        let mut turned = Matrix6::zeros();
        for at in [0, 3] {
            turned.fixed_view_mut::<3, 3>(at, at).copy_from(&shapes.elements[0].axes.transpose());
        }
        let held = turned * shapes.at(beam.from_m);
        let modes = shapes.modes();
        let mass = DMatrix::identity(modes, modes) + held.transpose() * rigid * &held;
        let root = shapes.squares.map(|square| 1.0 / square.sqrt());
        let reduced = DMatrix::from_fn(modes, modes, |i, j| root[i] * mass[(i, j)] * root[j]);
        let mut hz: Vec<f64> =
            SymmetricEigen::new(reduced).eigenvalues.iter().map(|value| 1.0 / value.sqrt() / TAU).collect();
        hz.sort_by(f64::total_cmp);
        hz
    }

    fn free_hz(beam: &Beam) -> Vec<f64> {
        let mut hz: Vec<f64> = shapes(beam).squares.iter().map(|square| square.sqrt() / TAU).collect();
        hz.sort_by(f64::total_cmp);
        hz
    }

    #[test]
    fn a_slender_beam_has_eulers_frequencies() {
        let (length, a, b) = (0.5, 0.006, 0.005);
        let beam = skew(length, [a, b], 4);
        let line_kg_per_m = MASS_KG / length;
        let (_, moments, ..) = section(a, b);
        let euler = |wave: f64, moment: f64| {
            wave * wave / (TAU * length * length) * (YOUNG * moment / line_kg_per_m).sqrt()
        };
        // softer along the second edge; slender: shear and rotary inertia lower them by (h/L)² or
        // so
        for (found, moment) in cantilever_hz(&beam).iter().zip([moments[1], moments[0]]) {
            let expected = euler(1.875_104_07, moment);
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} Hz for {expected}");
        }
        for (found, moment) in free_hz(&beam).iter().zip([moments[1], moments[0]]) {
            let expected = euler(4.730_040_74, moment);
            assert!((found / expected - 1.0).abs() < 2e-3, "{found} Hz for {expected}");
        }
    }

    /// First bending frequency (Hz) of a free Timoshenko beam: where the transfer matrix over its
    /// length leaves deflection and rotation of a free end possible.
    fn timoshenko_free_hz(length: f64, a: f64, b: f64) -> f64 {
        let (area, [moment, _], shear, _) = section(a, b);
        let density = MASS_KG / (area * length);
        let shut = |hz: f64| -> f64 {
            let square = (TAU * hz) * (TAU * hz);
            // deflection v, rotation θ, moment EI θ', shear force κGA (v' − θ)
            let step = Matrix4::new(
                0.0,
                1.0,
                0.0,
                1.0 / shear,
                0.0,
                0.0,
                1.0 / (YOUNG * moment),
                0.0,
                0.0,
                -density * moment * square,
                0.0,
                -1.0,
                -density * area * square,
                0.0,
                0.0,
                0.0,
            );
            // scaled so that all entries are near one
            let scale = Matrix4::from_diagonal(&nalgebra::Vector4::new(
                length,
                1.0,
                YOUNG * moment / length,
                YOUNG * moment / length / length,
            ));
            let inverse = scale.try_inverse().expect("a diagonal without zeros");
            let over = (inverse * step * scale * length).exp();
            over[(2, 0)] * over[(3, 1)] - over[(2, 1)] * over[(3, 0)]
        };
        let euler = 4.73 * 4.73 / (TAU * length * length) * (YOUNG * moment / (density * area)).sqrt();
        let (mut low, mut high) = (0.05 * euler, 1.05 * euler);
        assert!(shut(low) * shut(high) < 0.0, "one root between");
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if shut(low) * shut(middle) <= 0.0 { high = middle } else { low = middle }
        }
        low
    }

    #[test]
    fn a_stout_beam_has_timoshenkos_frequency() {
        for (length, [a, b]) in [(0.2, [0.05, 0.044]), (0.06, [0.02, 0.015])] {
            let expected = timoshenko_free_hz(length, b, a);
            for (elements, most) in [(2, 0.05), (5, 0.01), (10, 3e-3)] {
                let found = free_hz(&skew(length, [a, b], elements))[0];
                // exact static shapes are stiffer than the vibrating ones: from above
                let off = found / expected - 1.0;
                assert!((0.0..most).contains(&off), "{elements}: {found} Hz for {expected}");
            }
        }
    }

    #[test]
    fn it_twists_and_stretches_as_a_rod() {
        let (length, a, b) = (0.2, 0.05, 0.01);
        let beam = skew(length, [a, b], 12);
        let (area, [first, second], _, twist) = section(a, b);
        let density = MASS_KG / (area * length);
        let torsion = (twist / (density * (first + second))).sqrt() / (2.0 * length);
        let axial = (YOUNG / density).sqrt() / (2.0 * length);
        let shapes = shapes(&beam);
        let along = shapes.elements[0].along();
        let ends = shapes.at(beam.to_m);
        // the lowest mode in which an end's motion is almost entirely of this kind
        let lowest = |turns: bool| {
            let of_kind = (0..shapes.modes()).filter(|mode| {
                let motion = ends.column(*mode);
                let (moved, turned) = (motion.fixed_rows::<3>(0), motion.fixed_rows::<3>(3));
                let along =
                    if turns { turned.dot(&along) / turned.norm() } else { moved.dot(&along) / moved.norm() };
                along.abs() > 0.99
            });
            of_kind.map(|mode| shapes.squares[mode].sqrt() / TAU).fold(f64::INFINITY, f64::min)
        };
        // linear shapes on twelve elements: (π/12)²/24
        assert!((lowest(true) / torsion - 1.0).abs() < 3e-3, "{} for {torsion}", lowest(true));
        assert!((lowest(false) / axial - 1.0).abs() < 3e-3, "{} for {axial}", lowest(false));
    }
}
