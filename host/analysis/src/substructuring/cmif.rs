//! The CMIF of the paper's Eq. (B.1): which motions the joint adds, and so which interface
//! deformation modes it needs.
//!
//! The singular values of Y^AJB − blkdiag(Y^A, Y^B) show per line how many independent motions the
//! coupling changes; the projection of each left vector onto the rigid motions of both virtual
//! points shows which.

use super::geometry::{Geometry, Grouping};
use super::idm::{Dof, IdmSet, rigid_row};
use super::vpt::ROTATION_LENGTH_M;
use crate::band::Band;
use crate::frf::{Frf, FrfError, block};
use crate::parallel::prelude::*;
use nalgebra::{Complex, DMatrix, DVector, Vector3};
use serde::Serialize;
use std::collections::BTreeMap;

/// A set is sufficient if it explains this fraction of what all six motions explain.
const ENOUGH: f64 = 0.95;

/// Singular values and participation of the motions, line by line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cmif {
    /// Lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// Singular values per line, m/N, largest first.
    pub singular_values: Vec<Vec<f64>>,
    /// Participation \[line\]\[vector\]\[motion x, y, z, rx, ry, rz\] of each left vector: the
    /// decrease of its squared projection if both virtual points lose that motion; 0…1.
    pub participation: Vec<Vec<[f64; 6]>>,
    /// Fraction of the whole that sets of size 2, 4, 6 explain, weighted with the squares of the
    /// singular values; 0…1.
    pub explained: BTreeMap<usize, f64>,
    /// Number of modes suggested.
    pub suggested: usize,
    /// The reason, as a sentence.
    pub reason: String,
}

impl Cmif {
    /// Mean participation of each vector over the lines of `band`, or over all lines if it contains
    /// none.
    pub fn participation_over(&self, band: Band) -> Vec<[f64; 6]> {
        let inside: Vec<&Vec<[f64; 6]>> = (self.frequency_hz.iter().zip(&self.participation))
            .filter(|(f, _)| band.contains(**f))
            .map(|(_, line)| line)
            .collect();
        let lines = if inside.is_empty() { self.participation.iter().collect() } else { inside };
        let vectors = lines.iter().map(|line| line.len()).min().unwrap_or(0);
        let mean =
            |v: usize, dof: usize| lines.iter().map(|line| line[v][dof]).sum::<f64>() / lines.len() as f64;
        (0..vectors).map(|v| std::array::from_fn(|dof| mean(v, dof))).collect()
    }
}

/// Singular values, participation of their left vectors, and the power explained by the three sets
/// and in total.
type OneLine = (Vec<f64>, Vec<[f64; 6]>, [f64; 4]);

/// Left vectors evaluated per line: there are at most twelve interface motions.
const VECTORS: usize = 12;

/// The CMIF of the assembly minus its parts; rows and columns are matched by name, and the
/// substructures' internals count too. Left out are responses that only the assembly has, spare
/// responses (Grouping 3), which no virtual point uses, and points on specimens (5 and 6).
///
/// Implements Eq. (B.1).
///
/// # Errors
/// A value that is not a number, a duplicate name, or a different number of lines.
pub fn cmif(a: &Frf, b: &Frf, ajb: &Frf, geometry: &Geometry) -> Result<Cmif, FrfError> {
    let difference = difference(a, b, ajb)?;
    let rigid = rigid_motions(difference.outputs(), geometry);
    let all = rigid.basis(&Dof::RIGID);
    let sets = IdmSet::ALL.map(|set| rigid.basis(&set.dofs()));
    let without = Dof::RIGID.map(|dof| {
        let others: Vec<Dof> = Dof::RIGID.into_iter().filter(|d| *d != dof).collect();
        rigid.basis(&others)
    });
    let lines: Vec<OneLine> = difference
        .lines()
        .par_iter()
        .map(|line| {
            let svd = line.clone().svd(true, false);
            let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
            order.sort_by(|i, j| svd.singular_values[*j].total_cmp(&svd.singular_values[*i]));
            let values: Vec<f64> = order.iter().map(|&i| svd.singular_values[i]).collect();
            let mut explained = [0.0; 4];
            let mut participation = Vec::new();
            if let Some(left) = &svd.u {
                for &i in order.iter().take(VECTORS) {
                    let vector = left.column(i).clone_owned();
                    let power = svd.singular_values[i].powi(2);
                    let all = kept(&all, &vector);
                    for (sum, set) in explained.iter_mut().zip(&sets) {
                        *sum += power * kept(set, &vector);
                    }
                    explained[3] += power;
                    participation
                        .push(without.each_ref().map(|others| (all - kept(others, &vector)).max(0.0)));
                }
            }
            (values, participation, explained)
        })
        .collect();
    let mut total = [0.0; 4];
    for (_, _, explained) in &lines {
        // every line has the same weight, otherwise resonances would dominate
        if explained[3] > 0.0 {
            total
                .iter_mut()
                .zip(explained)
                .for_each(|(sum, e)| *sum += e / explained[3] / lines.len() as f64);
        }
    }
    let explained: BTreeMap<usize, f64> =
        IdmSet::ALL.iter().zip(total).map(|(set, e)| (set.count(), e)).collect();
    let suggested = IdmSet::ALL
        .into_iter()
        .find(|set| explained[&set.count()] >= ENOUGH * total[2])
        .unwrap_or(IdmSet::Six);
    let percent = |n: usize| format!("{n} explain {:.0} %", 100.0 * explained[&n]);
    let reason = format!(
        "of the motion that coupling adds, {}, {} and {}: {} modes are the fewest that explain {:.0} % of what all six explain",
        percent(2),
        percent(4),
        percent(6),
        suggested.count(),
        100.0 * ENOUGH
    );
    let (singular_values, participation) = lines.into_iter().map(|(v, p, _)| (v, p)).unzip();
    Ok(Cmif {
        frequency_hz: difference.frequency_hz().to_vec(),
        singular_values,
        participation,
        explained,
        suggested: suggested.count(),
        reason,
    })
}

/// Y^AJB − blkdiag(Y^A, Y^B) in receptance, in the assembly's order.
fn difference(a: &Frf, b: &Frf, ajb: &Frf) -> Result<Frf, FrfError> {
    let (a, b, whole) = (a.to_receptance()?, b.to_receptance()?, ajb.to_receptance()?);
    let mut lines = whole.lines().to_vec();
    for part in [&a, &b] {
        if part.lines().len() != whole.lines().len() {
            return Err(FrfError::LineCount {
                frequencies: part.lines().len(),
                matrices: whole.lines().len(),
            });
        }
        let place = |names: &[String], all: &[String]| -> Vec<(usize, usize)> {
            names
                .iter()
                .enumerate()
                .filter_map(|(i, name)| Some((i, all.iter().position(|n| n == name)?)))
                .collect()
        };
        let (rows, columns) = (place(part.outputs(), whole.outputs()), place(part.inputs(), whole.inputs()));
        for (line, own) in lines.iter_mut().zip(part.lines()) {
            for &(r, row) in &rows {
                for &(c, column) in &columns {
                    line[(row, column)] -= own[(r, c)];
                }
            }
        }
    }
    let difference = whole.with_values(lines)?;
    difference.check_finite()?;
    Ok(difference)
}

/// Rigid motions of both virtual points at the assembly's channels: one column per point and
/// motion.
struct Rigid {
    columns: DMatrix<f64>,
}

fn rigid_motions(outputs: &[String], geometry: &Geometry) -> Rigid {
    let names = geometry.ajb.output_names();
    let mut columns = DMatrix::zeros(outputs.len(), 12);
    for (row, output) in outputs.iter().enumerate() {
        let Some(at) = names.iter().position(|n| n == output) else { continue };
        let point = &geometry.ajb.channels[at];
        let (side, origin) = match point.grouping {
            Grouping::InterfaceA | Grouping::InternalA => (0, geometry.virtual_point_a_m),
            Grouping::InterfaceB | Grouping::InternalB => (6, geometry.virtual_point_b_m),
            // belongs to no virtual point
            Grouping::SpecimenA | Grouping::SpecimenB => continue,
        };
        let motion = rigid_row(point.direction(), point.position() - Vector3::from(origin));
        for (d, value) in motion.into_iter().enumerate() {
            columns[(row, side + d)] = if d < 3 { value } else { value / ROTATION_LENGTH_M };
        }
    }
    Rigid { columns }
}

impl Rigid {
    /// Orthonormal basis of these motions of both virtual points, adjoint: motion × channel.
    fn basis(&self, dofs: &[Dof]) -> DMatrix<Complex<f64>> {
        let chosen: Vec<usize> =
            [0, 6].iter().flat_map(|side| dofs.iter().map(move |d| side + *d as usize)).collect();
        let all: Vec<usize> = (0..self.columns.nrows()).collect();
        block(&self.columns.map(Complex::from), &all, &chosen).qr().q().adjoint()
    }
}

/// Squared length of a unit vector's projection onto the motions of a basis.
fn kept(basis: &DMatrix<Complex<f64>>, vector: &DVector<Complex<f64>>) -> f64 {
    (basis * vector).norm_squared()
}
