//! The signals of one line as a linear map of the unobserved motion, and the derivatives of that
//! map by every parameter; the motion is then eliminated, and the residual determines the
//! parameters.
//!
//! The motion is that of rigid bodies: arm B (t, θ), specimen A (t, θ) and, if it has points of its
//! own, specimen B. Motion of a specimen is that of its surface at the contact; the rest of it
//! deviates from that by its bending and shear, which are proportional to F (`elastic`). Without
//! points of its own, specimen B's surface deviates from arm B in proportion to F. The contact
//! couples the surfaces: z_A − z_B = F/(k_T + s c_T) at the contact itself, with
//! F = (a₀ + a₁ s) T + Σ (b₀ + b₁ s + b₂ s²) (z_B, θ_x, θ_y). So z_A is not an independent
//! coordinate but follows from T and B's motion; on B alone, where F is the hammer's, T follows
//! from B's motion.

use super::block::{Axis, Block, BlockCell, BlockLine, ChannelRow, Group, POINT};
use super::elastic::{Compliance, Deflected, Shape};
use super::parameters::{
    CENTRE, COMPLIANCE, DELAYS, ELASTIC, FORM, FORM_TERMS, GAINS, INERTIA_B, INERTIA_TERMS, LATERAL,
    RETARDATION, SPOTS, TIP_B,
};
use crate::C;
use nalgebra::{DMatrix, DVector, Vector3};
use num_complex::Complex;

/// Largest number of coordinates of the motion.
const MOST: usize = 18;
/// Coefficients of a quantity that is linear in the motion.
type Linear = [C; MOST];
/// Index of T among the assembly's coordinates.
pub const T: usize = 6;
/// Index of the first of specimen A's coordinates: x, y and rotations.
pub const A: usize = 7;

/// Derivatives of one row: (parameter within the block, value).
pub type Sparse = Vec<(usize, C)>;

/// The map of one block at one line.
pub struct LineModel<'a> {
    block: &'a Block,
    p: &'a [f64],
    s: C,
    z_b: Linear,
    /// The contact's force on B.
    force: [Linear; 3],
    z_a: Linear,
    t: Linear,
    t_offset: C,
    a_t: C,
    /// Unit force of the hammer on B alone; 0 if only the effect of motion is wanted.
    hammer: f64,
}

fn unit(at: usize) -> Linear {
    let mut one = [C::default(); MOST];
    one[at] = C::new(1.0, 0.0);
    one
}

fn sum(terms: &[(C, &Linear)]) -> Linear {
    std::array::from_fn(|i| terms.iter().map(|(factor, of)| factor * of[i]).sum())
}

fn dot(of: &Linear, x: &DVector<C>) -> C {
    of.iter().zip(x.iter()).map(|(a, b)| a * b).sum()
}

/// Displacement along `direction` by the contact's force.
fn along(direction: [f64; 3], of: &Compliance, force: &[C; 3]) -> C {
    let part = |axis: usize| (0..3).map(|row| direction[row] * of[(row, axis)]).sum::<f64>();
    (0..3).map(|axis| force[axis] * part(axis)).sum()
}

/// Displacement along `axis` of a point of a body: t + θ × r, with the body's rotation θ.
fn turned(translation: &Linear, theta: [usize; 3], r: [f64; 3], axis: usize) -> Linear {
    let mut moved = *translation;
    // (θ × r): x = θ_y z − θ_z y, y = θ_z x − θ_x z, z = θ_x y − θ_y x
    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
    moved[theta[next]] += r[last];
    moved[theta[last]] -= r[next];
    moved
}

/// Displacement of spot A or B per newton of the contact's force, beyond that of its surface at the
/// contact. If specimen B has no points of its own, its surface turns relative to arm B.
pub fn bulk_of_spot(p: &[f64], of_a: bool, points_on_b: bool) -> Deflected {
    let own = &p[ELASTIC..];
    if of_a {
        return Shape::of_a(own).at([p[SPOTS], p[SPOTS + 1], 0.0], ELASTIC);
    }
    let (x, y) = (p[SPOTS + 2], p[SPOTS + 3]);
    if points_on_b {
        return Shape::of_b(own).at([x, y, 0.0], ELASTIC);
    }
    let (tip, turn) = (p[TIP_B], p[TIP_B + 1]);
    let along_z = |value: f64| Compliance::from_diagonal(&[0.0, 0.0, value].into());
    Deflected {
        value: along_z(tip * turn * y),
        by: vec![(TIP_B, along_z(turn * y)), (TIP_B + 1, along_z(tip * y))],
        by_place: [Compliance::zeros(), along_z(tip * turn), Compliance::zeros()],
    }
}

impl<'a> LineModel<'a> {
    /// The map with the parameters `p` at s.
    pub fn new(block: &'a Block, p: &'a [f64], s: C) -> Self {
        let z_arm = unit(2);
        let mut z_b = block.specimen_b().map_or(z_arm, |at| unit(at + 2));
        let coefficient = |n: usize| C::from(p[FORM + n]);
        let a_t = coefficient(0) + coefficient(1) * s;
        let of_motion = |n: usize| coefficient(n) + coefficient(n + 1) * s + coefficient(n + 2) * s * s;
        let b = block.specimen_b().unwrap_or(0);
        let carried: [C; INERTIA_TERMS] = std::array::from_fn(|n| p[INERTIA_B + n] * s * s);
        let rest = sum(&[
            (of_motion(2), &z_arm),
            (of_motion(5), &unit(3)),
            (of_motion(8), &unit(4)),
            (carried[0], &z_b),
            (-carried[0], &z_arm),
            (carried[1], &unit(b + 3)),
            (-carried[1], &unit(3)),
            (-carried[2], &unit(b + 4)),
            (carried[2], &unit(4)),
        ]);
        let (t, t_offset, force, z_a) = if let Some(along_z) = block.along_z {
            let t = sum(&[(-a_t.inv(), &rest)]);
            (t, p[along_z] / a_t, [[C::default(); MOST]; 3], [C::default(); MOST])
        } else {
            let t = unit(T);
            let one = C::new(1.0, 0.0);
            let force = sum(&[(a_t, &t), (one, &rest)]);
            if block.specimen_b().is_none() {
                z_b = sum(&[(one, &z_b), (C::from(p[TIP_B]), &force)]);
            }
            let compliance = p[COMPLIANCE] / (1.0 + s * p[RETARDATION]);
            // both surfaces as rigid planes: at the contact's centre they are apart by F/k
            let [x, y] = [p[CENTRE], p[CENTRE + 1]].map(C::from);
            let turn = [(y, b + 3), (-y, A + 2), (-x, b + 4), (x, A + 3)];
            let turn = turn.map(|(lever, of)| (lever, unit(of)));
            let mut terms = vec![(one, &z_b), (compliance, &force)];
            terms.extend(turn.iter().map(|(lever, of)| (*lever, of)));
            let z_a = sum(&terms);
            // the contact as a spring along x and y
            let [x, y] = [0, 1].map(|axis| {
                let stiffness = C::from(p[LATERAL + axis].exp());
                sum(&[(stiffness, &unit(A + axis)), (-stiffness, &unit(b + axis))])
            });
            (t, C::default(), [x, y, force], z_a)
        };
        LineModel { block, p, s, z_b, force, z_a, t, t_offset, a_t, hammer: 1.0 }
    }

    /// The map without the hammer's force: the effect of motion alone.
    pub fn of_motion(self) -> Self {
        LineModel { t_offset: C::default(), hammer: 0.0, ..self }
    }

    /// Effect of the gain and the delay with these indices.
    fn sensor(&self, gain: usize, delay: usize) -> C {
        (1.0 + self.p[gain]) * (-self.s * self.p[delay]).exp()
    }

    /// The same for a spot: A is 0, B is 1.
    fn of_spot(&self, spot: usize) -> C {
        self.sensor(GAINS + spot, DELAYS + spot)
    }

    /// The actual direction of an axis, including its sensitivity across it.
    fn direction(&self, axis: &Axis) -> [f64; 3] {
        let mut d = axis.direction;
        if let Some((at, across)) = &axis.across {
            for (k, across) in across.iter().enumerate() {
                for (d, part) in d.iter_mut().zip(across) {
                    *d += self.p[at + k] * part;
                }
            }
        }
        d
    }

    /// Displacement of a cell's point along x, y and z, and the indices of its body's rotations.
    fn point(&self, cell: &BlockCell) -> ([Linear; 3], [usize; 3]) {
        let r = self.position(cell);
        let of = |axis: usize| {
            let (translation, theta) = self.body(cell.group, axis);
            turned(&translation, theta, r, axis)
        };
        ([of(0), of(1), of(2)], self.body(cell.group, 0).1)
    }

    /// Derivative of a row by specimen A's z at the contact.
    pub fn of_z_a(&self, row: &ChannelRow) -> C {
        let cell = &self.block.cells[row.cell];
        match row.channel {
            2 => self.of_spot(0),
            channel if channel >= POINT && cell.group == Group::SpecimenA => {
                let axis = &cell.axes[channel - POINT];
                self.sensor(axis.gain, axis.delay) * self.direction(axis)[2]
            }
            _ => C::default(),
        }
    }

    fn position(&self, cell: &BlockCell) -> [f64; 3] {
        std::array::from_fn(|axis| self.p[cell.point + axis] + cell.aim.map_or(0.0, |aim| self.p[aim + axis]))
    }

    /// Translation along `axis` of the body under a cell's point, and the indices of its rotations.
    fn body(&self, group: Group, axis: usize) -> (Linear, [usize; 3]) {
        match group {
            Group::ArmB => (unit(axis), [3, 4, 5]),
            Group::SpecimenB => {
                let at = self.block.specimen_b().unwrap_or(0);
                (unit(at + axis), [at + 3, at + 4, at + 5])
            }
            Group::SpecimenA => (if axis == 2 { self.z_a } else { unit(A + axis) }, [A + 2, A + 3, A + 4]),
        }
    }

    /// What the vibrometer of spot A or B measures along z, without its sensor: the body's z at the
    /// contact, its rotations, the place on it.
    fn spot(&self, cell: &BlockCell, of_a: bool) -> (Linear, [usize; 3], [f64; 3]) {
        if let Some(aim) = cell.lasers {
            let aim = aim + if of_a { 0 } else { 2 };
            let at = |axis: usize| self.p[cell.point + axis] + self.p[aim + axis];
            return (unit(2), [3, 4, 5], [at(0), at(1), 0.0]);
        }
        let at = SPOTS + if of_a { 0 } else { 2 };
        let place = [self.p[at], self.p[at + 1], 0.0];
        if of_a {
            (self.z_a, [A + 2, A + 3, A + 4], place)
        } else {
            let base = self.block.specimen_b().unwrap_or(0);
            (self.z_b, [base + 3, base + 4, base + 5], place)
        }
    }

    /// Displacement of a cell's point per newton of the contact's force, beyond that of the surface
    /// at the contact; none on arm B.
    fn bulk(&self, cell: &BlockCell) -> Option<Deflected> {
        let own = &self.p[ELASTIC..];
        let shape = match cell.group {
            Group::ArmB => return None,
            Group::SpecimenA => Shape::of_a(own),
            Group::SpecimenB => Shape::of_b(own),
        };
        Some(shape.at(self.position(cell), ELASTIC))
    }

    fn bulk_of_spot(&self, of_a: bool) -> Deflected {
        bulk_of_spot(self.p, of_a, self.block.specimen_b().is_some())
    }

    /// The map, with one row for each of the block's rows, and the rows' values without any motion.
    pub fn map(&self) -> (DMatrix<C>, Vec<C>) {
        let rows: Vec<Linear> = self.block.rows.iter().map(|row| self.row(row.cell, row.channel)).collect();
        let map = DMatrix::from_fn(rows.len(), self.block.latent(), |r, c| rows[r][c]);
        let offsets =
            self.block.rows.iter().map(|row| if row.channel == 0 { self.t_offset } else { C::default() });
        (map, offsets.collect())
    }

    fn row(&self, cell: usize, channel: usize) -> Linear {
        match channel {
            0 => self.t,
            1 | 2 => {
                let (z, theta, place) = self.spot(&self.block.cells[cell], channel == 2);
                let factor = self.of_spot(2 - channel);
                let bulk = factor * self.bulk_of_spot(channel == 2).value[(2, 2)];
                sum(&[(factor, &turned(&z, theta, place, 2)), (bulk, &self.force[2])])
            }
            _ => {
                let cell = &self.block.cells[cell];
                let axis = &cell.axes[channel - POINT];
                let (moved, _) = self.point(cell);
                let factor = self.sensor(axis.gain, axis.delay);
                let parts = self.direction(axis).map(|part| factor * part);
                let mut terms: Vec<(C, &Linear)> =
                    parts.into_iter().zip(&moved).filter(|(part, _)| *part != C::default()).collect();
                if let Some(bulk) = self.bulk(cell) {
                    let per_newton = Vector3::from(self.direction(axis)).transpose() * bulk.value;
                    terms.extend(per_newton.iter().map(|part| factor * part).zip(&self.force));
                }
                sum(&terms)
            }
        }
    }

    /// Derivatives of every row by the block's parameters, at the motion `x`; `shifts` is the
    /// motion added by moving the impact by one metre along each of two axes across it.
    pub fn derivatives(
        &self,
        x: &DVector<C>,
        shifts: Option<&[DVector<C>; 2]>,
        map: &DMatrix<C>,
    ) -> Vec<Sparse> {
        let local = |parameter: usize| self.block.local(parameter);
        let terms = self.form_terms(x);
        let forces = [0, 1, 2].map(|axis| dot(&self.force[axis], x));
        let force = forces[2];
        let damped = 1.0 + self.s * self.p[RETARDATION];
        let compliance = self.p[COMPLIANCE] / damped;
        // without points on B, its surface at the contact deviates from arm B
        let tip = if self.block.specimen_b().is_none() { self.p[TIP_B] } else { 0.0 };
        // derivatives of a specimen's z at the contact by the contact itself, and of everything
        // that follows the force by the form, with the factor of F
        let of_z = |of_a: bool, factor: C, bulk: C, row: &mut Sparse| {
            let mut of_force = bulk + factor * tip;
            if of_a {
                let b = self.block.specimen_b().unwrap_or(0);
                row.push((local(CENTRE), factor * (x[A + 3] - x[b + 4])));
                row.push((local(CENTRE + 1), factor * (x[b + 3] - x[A + 2])));
                row.push((local(COMPLIANCE), factor * force / damped));
                row.push((local(RETARDATION), -factor * compliance * self.s / damped * force));
                of_force += factor * compliance;
            }
            if self.block.specimen_b().is_none() {
                row.push((local(TIP_B), factor * force));
            }
            for (n, term) in terms.iter().enumerate() {
                row.push((local(FORM + n), of_force * term));
            }
        };
        let assembled = self.block.along_z.is_none();
        let mut all = Vec::with_capacity(self.block.rows.len());
        for (r, row) in self.block.rows.iter().enumerate() {
            let mut own = Sparse::with_capacity(24);
            let cell = &self.block.cells[row.cell];
            let seen: C = map.row(r).iter().zip(x.iter()).map(|(a, b)| a * b).sum();
            let sensor = |gain: usize, delay: usize, own: &mut Sparse| {
                own.push((local(gain), seen / (1.0 + self.p[gain])));
                own.push((local(delay), -self.s * seen));
            };
            match row.channel {
                0 => {
                    if let Some(along_z) = self.block.along_z {
                        own.push((local(along_z), self.hammer / self.a_t));
                        for (n, term) in terms.iter().enumerate() {
                            own.push((local(FORM + n), -term / self.a_t));
                        }
                    }
                }
                1 | 2 => {
                    let of_a = row.channel == 2;
                    let spot = 2 - row.channel;
                    sensor(GAINS + spot, DELAYS + spot, &mut own);
                    let factor = self.of_spot(spot);
                    let (_, theta, _) = self.spot(cell, of_a);
                    let laser = if of_a { 0 } else { 2 };
                    let bulk = self.bulk_of_spot(of_a);
                    let by_x = -factor * x[theta[1]];
                    let by_y = factor * (x[theta[0]] + force * bulk.by_place[1][(2, 2)]);
                    for at in cell
                        .lasers
                        .map_or([None, Some(SPOTS + laser)], |aim| [Some(cell.point), Some(aim + laser)])
                    {
                        own.extend(at.map(|at| (local(at), by_x)));
                        own.extend(at.map(|at| (local(at + 1), by_y)));
                    }
                    if assembled {
                        let by = bulk.by.iter();
                        own.extend(by.map(|(at, by)| (local(*at), factor * force * by[(2, 2)])));
                        of_z(of_a, factor, factor * bulk.value[(2, 2)], &mut own);
                    }
                }
                channel => {
                    let axis = &cell.axes[channel - POINT];
                    sensor(axis.gain, axis.delay, &mut own);
                    let factor = self.sensor(axis.gain, axis.delay);
                    let d = self.direction(axis);
                    let (moved, theta) = self.point(cell);
                    let bulk = self.bulk(cell).filter(|_| assembled);
                    // d · (θ × r) = r · (d × θ)
                    for place in 0..3 {
                        let (next, last) = ((place + 1) % 3, (place + 2) % 3);
                        let mut by = d[next] * x[theta[last]] - d[last] * x[theta[next]];
                        if let Some(bulk) = &bulk {
                            by += along(d, &bulk.by_place[place], &forces);
                        }
                        let by = factor * by;
                        if by != C::default() {
                            for base in std::iter::once(cell.point).chain(cell.aim) {
                                own.push((local(base + place), by));
                            }
                        }
                    }
                    if let Some((at, across)) = &axis.across {
                        for (k, across) in across.iter().enumerate() {
                            let mut seen: C =
                                across.iter().zip(&moved).map(|(part, of)| part * dot(of, x)).sum();
                            if let Some(bulk) = &bulk {
                                seen += along(*across, &bulk.value, &forces);
                            }
                            own.push((local(at + k), factor * seen));
                        }
                    }
                    if let Some(bulk) = &bulk {
                        let by = bulk.by.iter();
                        own.extend(by.map(|(at, by)| (local(*at), factor * along(d, by, &forces))));
                        // forces along x and y are proportional to the stiffness
                        for axis in 0..2 {
                            let mut own_force = [C::default(); 3];
                            own_force[axis] = forces[axis];
                            own.push((local(LATERAL + axis), factor * along(d, &bulk.value, &own_force)));
                        }
                        let of_a = cell.group == Group::SpecimenA;
                        let of_surface = if of_a { factor * d[2] } else { C::default() };
                        let per_newton: f64 = (0..3).map(|row| d[row] * bulk.value[(row, 2)]).sum();
                        of_z(of_a, of_surface, factor * per_newton, &mut own);
                    }
                }
            }
            if let (Some(at), Some(shifts)) = (cell.shift, shifts) {
                for (k, shift) in shifts.iter().enumerate() {
                    let moved: C = map.row(r).iter().zip(shift.iter()).map(|(a, b)| a * b).sum();
                    own.push((local(at + k), moved));
                }
            }
            all.push(own);
        }
        all
    }

    /// The factor of each coefficient of the form, and of specimen B's inertia.
    fn form_terms(&self, x: &DVector<C>) -> [C; FORM_TERMS + INERTIA_TERMS] {
        let (s, t) = (self.s, dot(&self.t, x) + self.t_offset);
        let (z, turn_x, turn_y) = (x[2], x[3], x[4]);
        // without points of its own specimen B has the inertia of its arm
        let against_the_arm = self.block.specimen_b().map_or([C::default(); 3], |b| {
            [dot(&self.z_b, x) - z, x[b + 3] - turn_x, turn_y - x[b + 4]].map(|moved| s * s * moved)
        });
        [
            t,
            s * t,
            z,
            s * z,
            s * s * z,
            turn_x,
            s * turn_x,
            s * s * turn_x,
            turn_y,
            s * turn_y,
            s * s * turn_y,
            against_the_arm[0],
            against_the_arm[1],
            against_the_arm[2],
        ]
    }
}

/// Kinds of rows whose residuals are summed separately.
pub const KINDS: usize = 6;

/// Normal equations of some lines of one block: r is the residual of the best-fitting motion, J its
/// derivative by the block's parameters, all divided by the noise's standard deviation.
#[derive(Debug, Clone)]
pub struct Normal {
    /// Re(Jᴴ J), over the block's parameters.
    pub information: DMatrix<f64>,
    /// Re(Jᴴ r).
    pub gradient: DVector<f64>,
    /// Σ |r|².
    pub chi_square: f64,
    /// Number of complex degrees of freedom in r.
    pub freedom: f64,
    /// Σ |r|², its expected value, and Σ |signal|², by kind of row: T, spot B, spot A, arm B,
    /// specimen A, specimen B.
    pub kinds: [[f64; 3]; KINDS],
}

/// The residual at one line.
#[derive(Debug, Clone)]
pub struct Residual {
    /// Index of the block's line.
    pub line: usize,
    /// r divided by the noise's standard deviation, and the expected value of |r|², by row.
    pub rows: Vec<(Complex<f64>, f64)>,
}

/// One line with the motion eliminated, divided by the noise.
pub struct Eliminated {
    /// Q of the weighted map.
    pub q: DMatrix<Complex<f64>>,
    /// R of the weighted map.
    pub r: DMatrix<Complex<f64>>,
    /// The best-fitting motion.
    pub motion: DVector<Complex<f64>>,
    /// Its residual.
    pub residual: DVector<Complex<f64>>,
}

/// Eliminates the motion described by `map` after removing the effect of the hammer's shifts; none
/// if the rows do not determine the motion.
pub fn eliminated(
    block: &Block,
    line: &BlockLine,
    map: &DMatrix<Complex<f64>>,
    offsets: &[Complex<f64>],
    p: &[f64],
    shifts: Option<&[DVector<Complex<f64>>; 2]>,
) -> Option<Eliminated> {
    let mut seen = DVector::from_fn(map.nrows(), |r, _| line.value[r] - offsets[r]);
    if let Some(shifts) = shifts {
        let moved = shifts.each_ref().map(|shift| map * shift);
        for (r, row) in block.rows.iter().enumerate() {
            if let Some(at) = block.cells[row.cell].shift {
                seen[r] -= moved[0][r] * p[at] + moved[1][r] * p[at + 1];
            }
        }
    }
    for (r, weight) in line.weight.iter().enumerate() {
        seen[r] *= *weight;
    }
    let (q, r) = factors(map, line);
    let projected = q.ad_mul(&seen);
    let motion = r.solve_upper_triangular(&projected)?;
    let residual = seen - &q * projected;
    Some(Eliminated { q, r, motion, residual })
}

/// Q and R of the map divided by the noise.
fn factors(map: &DMatrix<Complex<f64>>, line: &BlockLine) -> (DMatrix<Complex<f64>>, DMatrix<Complex<f64>>) {
    let weighed = DMatrix::from_fn(map.nrows(), map.ncols(), |r, c| map[(r, c)] * line.weight[r]);
    let factors = weighed.qr();
    (factors.q(), factors.unpack_r())
}

impl Normal {
    /// Zero sums for this many `parameters`.
    pub fn none(parameters: usize) -> Self {
        Normal {
            information: DMatrix::zeros(parameters, parameters),
            gradient: DVector::zeros(parameters),
            chi_square: 0.0,
            freedom: 0.0,
            kinds: [[0.0; 3]; KINDS],
        }
    }

    /// Adds one line of a block that counts; returns the best-fitting motion and its residual. None
    /// if the rows do not determine the motion.
    pub fn add(
        &mut self,
        block: &Block,
        line: usize,
        p: &[f64],
        shifts: Option<&[DVector<Complex<f64>>; 2]>,
    ) -> Option<(DVector<Complex<f64>>, Residual)> {
        let (index, line) = (line, &block.lines[line]);
        let model = LineModel::new(block, p, line.s);
        let (map, offsets) = model.map();
        let rows = map.nrows();
        let Eliminated { q, motion, residual, .. } = eliminated(block, line, &map, &offsets, p, shifts)?;

        let left_of_rows: Vec<(C, f64)> =
            (0..rows).map(|r| (residual[r], 1.0 - q.row(r).norm_squared())).collect();
        if !block.counts {
            return Some((motion, Residual { line: index, rows: left_of_rows }));
        }
        self.chi_square += residual.norm_squared();
        self.freedom += (rows - map.ncols()) as f64;
        for (r, row) in block.rows.iter().enumerate() {
            let kind = if row.channel < 3 { row.channel } else { 3 + block.cells[row.cell].group as usize };
            let (left, free) = left_of_rows[r];
            // compared with the noise alone, without the allowance for unexplained signal
            self.kinds[kind][0] += left.norm_sqr() * (line.weight[r] * line.sigma[r]).powi(-2);
            self.kinds[kind][1] += free;
            self.kinds[kind][2] += (line.value[r] / line.sigma[r]).norm_sqr();
        }
        self.add_derivatives(&model.derivatives(&motion, shifts, &map), &line.weight, &q, &residual);
        Some((motion, Residual { line: index, rows: left_of_rows }))
    }

    /// Adds what noise alone contributes to the information of one line: the motion is estimated
    /// from noisy signals, which enlarges products with it. Adds nothing if the rows do not
    /// determine the motion.
    pub fn add_of_noise(&mut self, block: &Block, line: usize, p: &[f64]) {
        if !block.counts {
            return;
        }
        let line = &block.lines[line];
        let model = LineModel::new(block, p, line.s).of_motion();
        let (map, _) = model.map();
        let (rows, latent) = (map.nrows(), map.ncols());
        let (q, r) = factors(&map, line);
        // the motion's covariance is R⁻¹ R⁻ᴴ: each column of R⁻¹ is a motion due to noise
        let identity = DMatrix::identity(latent, latent);
        let Some(made) = r.solve_upper_triangular(&identity) else { return };
        let nothing = DVector::zeros(rows);
        for motion in made.column_iter() {
            let derivatives = model.derivatives(&motion.into_owned(), None, &map);
            self.add_derivatives(&derivatives, &line.weight, &q, &nothing);
        }
    }

    /// J = −(1 − Q Qᴴ) D with D sparse: Jᴴ J = Dᴴ D − (Qᴴ D)ᴴ (Qᴴ D), and Jᴴ r = −Dᴴ r.
    fn add_derivatives(
        &mut self,
        derivatives: &[Sparse],
        weight: &[f64],
        q: &DMatrix<Complex<f64>>,
        residual: &DVector<Complex<f64>>,
    ) {
        let parameters = self.gradient.len();
        let mut seen = DMatrix::<Complex<f64>>::zeros(q.ncols(), parameters);
        // columns lie together in memory, so that every inner loop runs along one
        let conjugate = q.adjoint();
        for (r, row) in derivatives.iter().enumerate() {
            for (i, value) in row {
                let value = value * weight[r];
                self.gradient[*i] -= (value.conj() * residual[r]).re;
                seen.column_mut(*i).axpy(value, &conjugate.column(r), Complex::from(1.0));
                let value = value * weight[r];
                let mut column = self.information.column_mut(*i);
                for (j, other) in row {
                    column[*j] += value.re * other.re + value.im * other.im;
                }
            }
        }
        // real parts stacked above imaginary parts, so that a single real matrix product suffices,
        // which is fast
        let height = seen.nrows();
        let stacked = DMatrix::from_fn(2 * height, parameters, |r, c| {
            if r < height { seen[(r, c)].re } else { seen[(r - height, c)].im }
        });
        self.information.gemm(-1.0, &stacked.transpose(), &stacked, 1.0);
    }
}
