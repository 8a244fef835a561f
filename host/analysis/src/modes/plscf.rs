//! Poles of rising model orders by the poly-reference least-squares complex frequency-domain method
//! (pLSCF), and which of them are stable over the orders.
//!
//! Per order p, H = B(z) A(z)⁻¹ with matrix polynomials of the degree p is fitted by linear least
//! squares (Guillaume et al., IMAC 2003; Peeters et al., Shock and Vibration 11, 2004). The band is
//! mapped to the whole unit circle, z = e^(i2π(ω − ω_low)/W), with complex coefficients: the powers
//! of z are orthogonal on equal lines, whatever the order, and the normal equations are block
//! Toeplitz. The numerators of each output are eliminated first. With the coefficient of z⁰ in A
//! fixed to the identity, poles that describe noise lie outside the unit circle, as a negative
//! damping; those of the structure lie inside.
//!
//! The lines s = σ + iω of an exponential window shift the circle's poles by σ, which is added
//! back.

use super::data::Data;
use super::{Chart, ChartPole, Settings, mac};
use crate::C;
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, DVector, Schur};
use std::f64::consts::TAU;

/// Virtual inputs, at most: the strongest combinations of the inputs. More would give matrix
/// polynomials of many poles at low degree; starts do not need them.
const INPUTS: usize = 4;

/// Poles of the highest order, at most: some four times the modes of a band of a rig.
const POLES: usize = 96;

/// Highest degree of the polynomials.
const DEGREE: usize = 48;

/// One pole of one order; free of units, window damping removed.
pub(super) struct Found {
    pub(super) pole: C,
    pub(super) shape: Vec<C>,
}

/// The poles of each order, from low to high, within the limits of frequency and damping.
pub(super) fn poles(data: &Data, settings: &Settings) -> Vec<(usize, Vec<Found>)> {
    let virtual_inputs = virtual_inputs(data);
    let inputs = virtual_inputs.ncols();
    // half the lines as coefficients of one cell at most
    let degree = (POLES / inputs).min(DEGREE).min(data.lines() / 4).max(2);
    let lines = data.lines();
    let width = (data.s[lines - 1].im - data.s[0].im) * lines as f64 / (lines - 1) as f64;
    let angle: Vec<f64> = data.s.iter().map(|s| TAU * (s.im - data.s[0].im) / width).collect();
    let of_output = |o: usize| Output::new(data, o, &virtual_inputs, &angle, degree);
    let outputs: Vec<Output> = (0..data.outputs).into_par_iter().map(of_output).collect();
    let of_degree = |p: usize| {
        let found = poles_of_degree(&outputs, inputs, p).unwrap_or_default();
        let found = found.into_iter().filter_map(|(z, shape)| {
            let turns = z.arg().rem_euclid(TAU) / TAU;
            // the line of measurement is the imaginary axis of the fit
            let pole = C::new(z.norm().ln() * width / TAU + data.sigma, data.s[0].im + turns * width);
            let damping = -pole.re / pole.norm();
            // a mode of little damping may lie a little beyond the axis by its noise
            (z.norm() < 1.0 && damping < settings.damping_limit).then_some(Found { pole, shape })
        });
        let mut found: Vec<Found> = found.collect();
        found.sort_by(|a, b| a.pole.im.total_cmp(&b.pole.im));
        (p * inputs, found)
    };
    (1..=degree).into_par_iter().map(of_degree).collect()
}

/// Orthonormal combinations of the inputs, strongest first, weighted by their noise.
fn virtual_inputs(data: &Data) -> DMatrix<C> {
    let (lines, inputs) = (data.lines(), data.inputs);
    let mut square = DMatrix::<C>::zeros(inputs, inputs);
    for o in 0..data.outputs {
        let mut whitened = DMatrix::<C>::zeros(lines, inputs);
        for i in 0..inputs {
            let cell = o * inputs + i;
            for l in 0..lines {
                let value = C::new(data.y[(l, cell)], data.y[(lines + l, cell)]);
                whitened[(l, i)] = value * data.weight[(l, cell)].sqrt();
            }
        }
        square += whitened.ad_mul(&whitened);
    }
    let eigen = square.symmetric_eigen();
    let mut order: Vec<usize> = (0..inputs).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order.truncate(INPUTS);
    DMatrix::from_fn(inputs, order.len(), |i, k| eigen.eigenvectors[(i, order[k])])
}

/// The sums over the lines for one output, by lag from −degree to degree.
struct Output {
    degree: usize,
    /// Σ w z^lag.
    unit: Vec<C>,
    /// Σ w z^lag h, h the row of this output.
    row: Vec<DMatrix<C>>,
    /// Σ w z^lag hᴴh.
    square: Vec<DMatrix<C>>,
}

impl Output {
    fn new(data: &Data, o: usize, virtual_inputs: &DMatrix<C>, angle: &[f64], degree: usize) -> Output {
        let (lines, inputs) = (data.lines(), virtual_inputs.ncols());
        let lags = 2 * degree + 1;
        let mut output = Output {
            degree,
            unit: vec![C::from(0.0); lags],
            row: vec![DMatrix::zeros(1, inputs); lags],
            square: vec![DMatrix::zeros(inputs, inputs); lags],
        };
        let mut h = vec![C::from(0.0); inputs];
        for (l, angle) in angle.iter().enumerate() {
            h.fill(C::from(0.0));
            let mut variance = 0.0;
            // accelerances: rigid bodies are constant in them and need no poles
            let accelerance = data.s[l].powi(2 - data.order);
            for i in 0..data.inputs {
                let cell = o * data.inputs + i;
                let value = C::new(data.y[(l, cell)], data.y[(lines + l, cell)]) * accelerance;
                variance += accelerance.norm_sqr() / data.weight[(l, cell)];
                for (k, h) in h.iter_mut().enumerate() {
                    *h += value * virtual_inputs[(i, k)];
                }
            }
            let weight = data.inputs as f64 / variance;
            let z = C::from_polar(1.0, *angle);
            let mut power = C::from_polar(weight, -angle * degree as f64);
            for lag in 0..lags {
                output.unit[lag] += power;
                for (k, h_k) in h.iter().enumerate() {
                    output.row[lag][(0, k)] += power * h_k;
                    for (m, h_m) in h.iter().enumerate() {
                        output.square[lag][(m, k)] += power * h_m.conj() * h_k;
                    }
                }
                power *= z;
            }
        }
        output
    }

    /// R: the numerator's own block, Toeplitz.
    fn numerator(&self, p: usize) -> DMatrix<C> {
        DMatrix::from_fn(p + 1, p + 1, |k, l| self.unit[self.degree + l - k])
    }

    /// S: numerator against denominator.
    fn mixed(&self, p: usize, inputs: usize) -> DMatrix<C> {
        DMatrix::from_fn(p + 1, (p + 1) * inputs, |k, column| {
            let (l, input) = (column / inputs, column % inputs);
            -self.row[self.degree + l - k][(0, input)]
        })
    }

    /// T: the denominator's own block.
    fn denominator(&self, p: usize, inputs: usize) -> DMatrix<C> {
        DMatrix::from_fn((p + 1) * inputs, (p + 1) * inputs, |row, column| {
            let (k, l) = (row / inputs, column / inputs);
            self.square[self.degree + l - k][(row % inputs, column % inputs)]
        })
    }
}

/// The poles z of the degree p with their shapes; none if the equations are singular.
fn poles_of_degree(outputs: &[Output], inputs: usize, p: usize) -> Option<Vec<(C, Vec<C>)>> {
    let size = (p + 1) * inputs;
    let mut reduced = DMatrix::<C>::zeros(size, size);
    let mut numerators = Vec::with_capacity(outputs.len());
    for output in outputs {
        let mixed = output.mixed(p, inputs);
        let solved = output.numerator(p).cholesky()?.solve(&mixed);
        reduced += output.denominator(p, inputs) - mixed.ad_mul(&solved);
        numerators.push(solved);
    }
    let free = size - inputs;
    let matrix = reduced.view((inputs, inputs), (free, free)).into_owned();
    let right = -reduced.view((inputs, 0), (free, inputs));
    let mut matrix = matrix;
    for k in 0..free {
        // exact data make it singular as soon as the degree exceeds that of the structure
        matrix[(k, k)] *= C::from(1.0 + 1e-12);
    }
    let solution = matrix.cholesky()?.solve(&right);
    let mut coefficients = DMatrix::zeros(size, inputs);
    coefficients.view_mut((0, 0), (inputs, inputs)).fill_with_identity();
    coefficients.view_mut((inputs, 0), (free, inputs)).copy_from(&solution);
    // Σ_k A_k z^k with A_0 = 1: in 1/z the polynomial is monic
    let mut companion = DMatrix::<C>::zeros(free, free);
    for k in 1..=p {
        let block = -coefficients.view((k * inputs, 0), (inputs, inputs));
        companion.view_mut((0, (k - 1) * inputs), (inputs, inputs)).copy_from(&block);
    }
    for k in 0..free - inputs {
        companion[(inputs + k, k)] = C::from(1.0);
    }
    let (_, triangle) = Schur::try_new(companion, f64::EPSILON, 100 * free)?.unpack();
    let betas: Vec<DMatrix<C>> = numerators.iter().map(|solved| -(solved * &coefficients)).collect();
    let mut found = Vec::new();
    for inverse in triangle.diagonal().iter() {
        // the unit circle is where the data are: poles far inside describe no peak of the band
        if inverse.norm() <= 1.0 || inverse.norm() > 1e3 {
            continue;
        }
        let z = inverse.inv();
        let mut value = DMatrix::<C>::zeros(inputs, inputs);
        let mut power = C::from(1.0);
        for k in 0..=p {
            value += coefficients.view((k * inputs, 0), (inputs, inputs)) * power;
            power *= z;
        }
        let null = null_vector(&value)?;
        let shape = betas.iter().map(|beta| {
            let mut sum = C::from(0.0);
            let mut power = C::from(1.0);
            for k in 0..=p {
                sum += (beta.row(k) * &null)[0] * power;
                power *= z;
            }
            sum
        });
        found.push((z, shape.collect()));
    }
    Some(found)
}

/// The vector that a singular matrix maps to zero.
fn null_vector(matrix: &DMatrix<C>) -> Option<DVector<C>> {
    let svd = matrix.clone().svd(false, true);
    let v = svd.v_t?;
    let smallest = svd.singular_values.imin();
    Some(v.row(smallest).adjoint())
}

/// A pole is stable in frequency if the nearest pole of the order below differs by less than this
/// fraction; 1 % is the field's usual value.
pub const STABLE_FREQUENCY: f64 = 0.01;

/// As [`STABLE_FREQUENCY`] for the damping; 5 % is the field's usual value.
pub const STABLE_DAMPING: f64 = 0.05;

/// A pole is stable in shape if the MAC with the nearest pole of the order below exceeds this.
pub const STABLE_MAC: f64 = 0.95;

/// The stabilisation chart.
pub(super) fn chart(data: &Data, orders: &[(usize, Vec<Found>)]) -> Chart {
    let damping = |pole: C| -pole.re / pole.norm();
    let mut poles = Vec::new();
    let mut below: &[Found] = &[];
    for (order, found) in orders {
        for one in found {
            let nearest =
                below.iter().min_by(|a, b| (a.pole - one.pole).norm().total_cmp(&(b.pole - one.pole).norm()));
            let close = |limit: f64, a: f64, b: f64| (a - b).abs() < limit * b.abs();
            let stable_in_frequency =
                nearest.is_some_and(|other| close(STABLE_FREQUENCY, one.pole.norm(), other.pole.norm()));
            let stable_in_damping = stable_in_frequency
                && nearest.is_some_and(|other| close(STABLE_DAMPING, damping(one.pole), damping(other.pole)));
            let stable_in_shape = stable_in_frequency
                && nearest.is_some_and(|other| mac(&one.shape, &other.shape) > STABLE_MAC);
            poles.push(ChartPole {
                order: *order,
                frequency_hz: data.frequency_hz(one.pole),
                damping_ratio: damping(one.pole),
                stable_in_frequency,
                stable_in_damping,
                stable_in_shape,
            });
        }
        below = found;
    }
    Chart { poles }
}

/// Two poles of different orders are of one group if they differ by less than this fraction of
/// their distance from the line of measurement, the half width of the peak: frequencies alone
/// cannot tell close modes apart.
const SAME: f64 = 0.5;

/// A group of poles is a start if it has this fraction of the orders.
const PRESENT: f64 = 0.25;

/// Starts for the fit: one pole per group that many orders agree on, the most frequent first.
pub(super) fn starts(data: &Data, orders: &[(usize, Vec<Found>)]) -> Vec<C> {
    struct Group {
        members: Vec<C>,
        last: usize,
    }
    let mut groups: Vec<Group> = Vec::new();
    // from the highest order down, so that a group begins with its most accurate pole
    for (at, (_, found)) in orders.iter().enumerate().rev() {
        for one in found {
            let distance = |group: &Group| {
                let pole = group.members[group.members.len() - 1];
                (pole - one.pole).norm() / data.half_width(pole).min(data.half_width(one.pole))
            };
            let free = groups.iter_mut().filter(|group| group.last != at);
            let nearest = free
                .map(|group| (distance(group), group))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|(distance, _)| *distance < SAME);
            match nearest {
                Some((_, group)) => {
                    group.members.push(one.pole);
                    group.last = at;
                }
                None => groups.push(Group { members: vec![one.pole], last: at }),
            }
        }
    }
    let least = ((PRESENT * orders.len() as f64).ceil() as usize).max(2);
    groups.retain(|group| group.members.len() >= least);
    groups.sort_by_key(|group| std::cmp::Reverse(group.members.len()));
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let centre = |group: &Group| {
        C::new(
            median(&mut group.members.iter().map(|pole| pole.re).collect()),
            median(&mut group.members.iter().map(|pole| pole.im).collect()),
        )
    };
    groups.iter().map(centre).collect()
}
