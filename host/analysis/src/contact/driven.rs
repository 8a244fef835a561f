//! How arm B and the specimens move per newton of T at one frequency when driven from where the
//! shaker pushes: read from the hits there.
//!
//! A hit is evaluated at s = σ + iω, a steady level at s = iω. The ratio of two motions of one hit
//! is an analytic function of s, so a polynomial in s through the lines around a frequency gives it
//! at iω as well. The lines come from a lightly damped window: from σ = 50 /s, where k_T is read, a
//! mode of the specimen 10 Hz away is too near for that.
//!
//! The motion at each line is the one that fits its signals best, as in `line`. Here, however,
//! specimen A's z is an independent coordinate and does not follow from T and the contact: the
//! result must depend on the contact as measured, not on the contact that the hits found.

use super::block::Block;
use super::model::{A, LineModel, Sparse, T};
use super::model::{Eliminated, eliminated};
use super::parameters::{COMPLIANCE, RETARDATION};
use crate::C;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// The motions used: z, θ_x, θ_y of arm B, then of specimen B (the same if it has no points of its
/// own), then θ_x, θ_y of A.
pub const MOTIONS: usize = 8;

/// Lines within this distance of the frequency are used, Hz. About twelve of them determine the
/// middle of a quartic with half the noise of a single line, and the polynomial misses a thirtieth
/// of the contribution of a mode twice as far away.
pub const REACH_HZ: f64 = 6.0;
/// Order of the polynomial. The next odd order would not change the value in the middle of lines
/// that are symmetric about it.
const ORDER: usize = 4;
/// The next order that does change it.
const HIGHER: usize = ORDER + 2;

/// One line of one impact: its motion, and the quantities for its derivatives.
struct DrivenLine {
    s: C,
    x: DVector<C>,
    q: DMatrix<C>,
    r: DMatrix<C>,
    derivatives: Vec<Sparse>,
    weight: Vec<f64>,
    /// The motion that a shift of the impact by one metre along each of two axes adds.
    shifts: Option<[DVector<C>; 2]>,
}

/// An impact that takes part in driving the contact.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// Index of its block.
    pub block: usize,
    /// Its weight.
    pub weight: f64,
    /// Variance of the position of its line of action, m² along each axis across it.
    pub place_m2: f64,
}

/// Motion per newton of T at one frequency.
pub struct Driven<'a> {
    blocks: &'a [Block],
    parts: &'a [Part],
    /// By line and part.
    lines: Vec<Vec<DrivenLine>>,
    /// The combined motion of the parts, by line.
    motion: Vec<DVector<C>>,
    /// Complex weight of each line's ratio in the ratio at the frequency.
    weights: Vec<C>,
    /// The same for the higher-order polynomial.
    higher: Vec<C>,
    /// Factor by which the variance of a sum over neighbouring lines exceeds that of independent
    /// lines.
    shared: f64,
    /// The motions per newton of T.
    pub per_t: [C; MOTIONS],
}

/// Uncertainty of a quantity formed from the motions: δ = Σ g_k δ(motion_k).
pub struct Known {
    /// Derivatives by the block's parameters: (index among all parameters, value).
    pub by_parameter: Vec<(usize, C)>,
    /// Variance E|δ|² due to the lines' noise, including the polynomial's misfit.
    pub noise: f64,
    /// |δ|² of what the polynomial may miss: twice the difference from the higher-order one.
    pub bend: f64,
    /// E|δ|² due to the position of the impacts' lines of action; none if no other impacts
    /// determine that effect.
    pub place: Option<f64>,
}

/// Coordinates of the motion that [`MOTIONS`] refers to.
fn places(block: &Block) -> [usize; MOTIONS] {
    let base = block.specimen_b().unwrap_or(0);
    [2, 3, 4, base + 2, base + 3, base + 4, A + 2, A + 3]
}

impl<'a> Driven<'a> {
    /// Combined motion of the parts' impacts at `frequency_hz`, from lines of a lightly damped
    /// window; none if the lines do not lie on both sides of it or do not determine the motion.
    pub fn of(
        blocks: &'a [Block],
        parts: &'a [Part],
        p: &[f64],
        frequency_hz: f64,
        shared: impl Fn(f64) -> f64,
    ) -> Option<Self> {
        let block = &blocks[parts.first()?.block];
        let near: Vec<usize> = (0..block.lines.len())
            .filter(|l| (block.lines[*l].frequency_hz - frequency_hz).abs() <= REACH_HZ)
            .collect();
        let at = |l: usize| block.lines[l].frequency_hz;
        let (first, last) = (*near.first()?, *near.last()?);
        // interpolate only, even if lines at the ends of the band were lost
        let spans = at(first) < frequency_hz && frequency_hz < at(last);
        // enough lines that degrees of freedom remain for the polynomial's misfit
        if near.len() < HIGHER + 4 || !spans {
            return None;
        }
        let of_parts = |l: &usize| parts.iter().map(|part| line(blocks, part.block, *l, p)).collect();
        let lines: Vec<Vec<DrivenLine>> = near.iter().map(of_parts).collect::<Option<_>>()?;
        let together = |own: &Vec<DrivenLine>| {
            let mut sum = DVector::zeros(own[0].x.len());
            for (line, part) in own.iter().zip(parts) {
                sum += &line.x * C::from(part.weight);
            }
            sum
        };
        let motion: Vec<DVector<C>> = lines.iter().map(together).collect();
        let s = C::new(0.0, std::f64::consts::TAU * frequency_hz);
        let nodes: Vec<C> = lines.iter().map(|own| own[0].s - s).collect();
        let (weights, higher) = (extrapolating(&nodes, ORDER)?, extrapolating(&nodes, HIGHER)?);
        let coordinates = places(block);
        let per_t = std::array::from_fn(|k| {
            motion.iter().zip(&weights).map(|(x, w)| w * x[coordinates[k]] / x[T]).sum()
        });
        let step_hz = (at(last) - at(first)) / (near.len() - 1) as f64;
        Some(Driven { blocks, parts, lines, motion, weights, higher, shared: shared(step_hz), per_t })
    }

    /// Whether specimen B has points of its own.
    pub fn specimen_b(&self) -> bool {
        self.blocks[self.parts[0].block].specimen_b().is_some()
    }

    /// The uncertainty of Σ g_k motion_k.
    pub fn known(&self, g: &[C; MOTIONS]) -> Known {
        let coordinates = places(&self.blocks[self.parts[0].block]);
        let (mut noise, mut expected, mut bend) = (0.0, 0.0, C::default());
        let mut place = vec![[C::default(); 2]; self.parts.len()];
        let mut tells_place = true;
        let mut by_parameter: BTreeMap<usize, C> = BTreeMap::new();
        let mut values = Vec::with_capacity(self.lines.len());
        for ((own, x), weight) in self.lines.iter().zip(&self.motion).zip(&self.weights) {
            let mut v = DVector::<C>::zeros(x.len());
            let mut value = C::default();
            for (k, g) in g.iter().enumerate() {
                let u = x[coordinates[k]] / x[T];
                value += g * u;
                v[coordinates[k]] += g / x[T];
                v[T] -= g * u / x[T];
            }
            values.push(value);
            for (n, (line, part)) in own.iter().zip(self.parts).enumerate() {
                let counts = weight * part.weight;
                // vᵀ R⁻¹, then vᵀ R⁻¹ Qᴴ
                let Some(z) = line.r.transpose().solve_lower_triangular(&v) else { continue };
                noise += counts.norm_sqr() * z.norm_squared();
                expected += part.weight.powi(2) * z.norm_squared();
                let a = line.q.map(|q| q.conj()) * z;
                let parameters = &self.blocks[part.block].parameters;
                for (r, row) in line.derivatives.iter().enumerate() {
                    for (i, value) in row {
                        *by_parameter.entry(parameters[*i]).or_default() -=
                            counts * a[r] * value * line.weight[r];
                    }
                }
                match &line.shifts {
                    Some(shifts) => {
                        for (sum, shift) in place[n].iter_mut().zip(shifts) {
                            *sum += counts * v.iter().zip(shift.iter()).map(|(v, x)| v * x).sum::<C>();
                        }
                    }
                    None => tells_place = false,
                }
            }
        }
        // residual of the polynomial over the lines, compared with their noise
        let nodes: Vec<C> = self.lines.iter().map(|own| own[0].s).collect();
        let left = residual(&nodes, &values, ORDER) / (values.len() - ORDER - 1) as f64;
        expected /= values.len() as f64;
        for ((value, low), high) in values.iter().zip(&self.weights).zip(&self.higher) {
            bend += (high - low) * value;
        }
        let misfit = if expected > 0.0 { (left / expected).max(1.0) } else { 1.0 };
        Known {
            by_parameter: by_parameter.into_iter().collect(),
            noise: noise * self.shared * misfit,
            // two more orders are taken to halve the error at least; otherwise their difference
            // would be larger
            bend: 4.0 * bend.norm_sqr(),
            place: tells_place.then(|| {
                let of = |(axes, part): (&[C; 2], &Part)| {
                    part.place_m2 * axes.iter().map(C::norm_sqr).sum::<f64>()
                };
                place.iter().zip(self.parts).map(of).sum()
            }),
        }
    }
}

/// Powers of the nodes up to `order`, the nodes divided by the largest of them.
fn powers(nodes: &[C], order: usize) -> DMatrix<C> {
    let mean = nodes.iter().sum::<C>() / nodes.len() as f64;
    let largest = nodes.iter().map(|x| (x - mean).norm()).fold(f64::MIN_POSITIVE, f64::max);
    DMatrix::from_fn(nodes.len(), order + 1, |l, m| (nodes[l] / largest).powu(m as u32))
}

/// Weight of each node's value in the least-squares polynomial's value at 0.
fn extrapolating(nodes: &[C], order: usize) -> Option<Vec<C>> {
    let factors = powers(nodes, order).qr();
    let mut unit = DVector::<C>::zeros(order + 1);
    unit[0] = C::new(1.0, 0.0);
    let z = factors.r().transpose().solve_lower_triangular(&unit)?;
    Some((factors.q().map(|q| q.conj()) * z).iter().copied().collect())
}

/// Σ |value − polynomial|².
fn residual(nodes: &[C], values: &[C], order: usize) -> f64 {
    let mean = nodes.iter().sum::<C>() / nodes.len() as f64;
    let centred: Vec<C> = nodes.iter().map(|x| x - mean).collect();
    let q = powers(&centred, order).qr().q();
    let values = DVector::from_column_slice(values);
    let found = &q * q.ad_mul(&values);
    (values - found).norm_squared()
}

/// The motion of one line, with the hammer's shifts removed as far as the fit determined them.
fn line(blocks: &[Block], which: usize, line: usize, p: &[f64]) -> Option<DrivenLine> {
    let block = &blocks[which];
    let shifts = if block.shifted_by.is_empty() {
        None
    } else {
        let others: Vec<(DVector<C>, [f64; 2])> = block
            .shifted_by
            .iter()
            .map(|(other, weights)| Some((solved(&blocks[*other], line, p, None)?.x, *weights)))
            .collect::<Option<_>>()?;
        let mut all = [0, 1].map(|_| DVector::<C>::zeros(others[0].0.len()));
        for (moved, weights) in &others {
            for (shift, weight) in all.iter_mut().zip(weights) {
                *shift += moved * C::from(*weight);
            }
        }
        Some(all)
    };
    solved(block, line, p, shifts)
}

/// Eliminates the motion of one line with specimen A's z as a free coordinate.
fn solved(block: &Block, line: usize, p: &[f64], shifts: Option<[DVector<C>; 2]>) -> Option<DrivenLine> {
    let line = &block.lines[line];
    let mut free = p.to_vec();
    (free[COMPLIANCE], free[RETARDATION]) = (0.0, 0.0);
    let model = LineModel::new(block, &free, line.s);
    let (map, offsets) = model.map();
    let last = map.ncols();
    let mut map = map.insert_column(last, C::default());
    for (r, row) in block.rows.iter().enumerate() {
        map[(r, last)] = model.of_z_a(row);
    }
    let Eliminated { q, r, motion: x, .. } = eliminated(block, line, &map, &offsets, p, shifts.as_ref())?;
    let mut derivatives = model.derivatives(&x, shifts.as_ref(), &map);
    // specimen A's z is free: its dependence on the contact does not count
    let freed = block.local(COMPLIANCE);
    for row in &mut derivatives {
        row.retain(|(i, _)| *i != freed);
    }
    x[T].is_finite().then(|| DrivenLine {
        s: line.s,
        x,
        q,
        r,
        derivatives,
        weight: line.weight.clone(),
        shifts,
    })
}
