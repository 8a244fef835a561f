//! All methods at several lines at once: what they share is read and computed once, and what is near rank loss is left to the
//! careful way, line by line.

use super::decoupling::{InverseBlock, PrimalBlock};
use super::interface_data::{InterfaceError, balance, scaled};
use super::internal_dofs::Rearrangement;
use super::lanes::{Cell, Matrix, Sure, inverse, lines, minus, plus, product, times, to_left_of};
use super::reduced::{Reduced, RefusedReason};
use super::rooms::{Balanced, Rooms, Side};
use super::solve::{Refusal, Work};
use crate::parallel::prelude::*;
use crate::vectors::wide;
use nalgebra::{Complex, DMatrix};
use pulp::{Simd, WithSimd};
use std::cell::OnceCell;

type Line = DMatrix<Complex<f64>>;

/// What was found at all lines.
pub(super) struct Found {
    /// Y^A and Y^B, rotations in metres; nothing where they were not asked for.
    pub(super) alone: [Vec<Line>; 2],
    /// Z^J by each work.
    pub(super) z: Vec<Result<Vec<Line>, RefusedReason>>,
}

/// What is to be found.
pub(super) struct Job<'a> {
    pub(super) reduced: &'a Reduced,
    pub(super) rooms: &'a Rooms<'a>,
    pub(super) works: Vec<&'a Work<'a>>,
    /// Whether Y^A and Y^B are wanted too.
    pub(super) alone: bool,
}

impl Job<'_> {
    /// Z^J of every line by every work.
    ///
    /// # Errors
    /// Y^A or Y^B has a value that is no number.
    pub(super) fn found(&self) -> Result<Found, RefusedReason> {
        let mut vectors = wide(self);
        let mut of = |side: Side| -> Result<Vec<Line>, InterfaceError> {
            vectors.iter_mut().flat_map(|vector| vector.alone[side as usize].drain(..)).collect()
        };
        let alone = [of(Side::A)?, of(Side::B)?];
        let z = (0..self.works.len())
            .map(|work| {
                in_order(vectors.iter_mut().flat_map(|vector| vector.z[work].drain(..)), self.lines())
            })
            .collect();
        Ok(Found { alone, z })
    }

    fn lines(&self) -> usize {
        self.rooms.a.frf.lines().len()
    }
}

/// All lines, or the refusal that comes first.
fn in_order(
    lines: impl Iterator<Item = Result<Line, Box<Refusal>>>,
    count: usize,
) -> Result<Vec<Line>, RefusedReason> {
    let (mut all, mut first) = (Vec::with_capacity(count), None::<Box<Refusal>>);
    for line in lines {
        match line {
            Ok(line) => all.push(line),
            Err(refusal) if first.as_ref().is_none_or(|first| refusal.stage < first.stage) => {
                first = Some(refusal);
            }
            Err(_) => {}
        }
    }
    first.map_or(Ok(all), |refusal| Err(refusal.reason))
}

/// What was found at the lines of one vector.
pub(super) struct Vector {
    alone: [Vec<Result<Line, InterfaceError>>; 2],
    z: Vec<Vec<Result<Line, Box<Refusal>>>>,
}

impl WithSimd for &Job<'_> {
    type Output = Vec<Vector>;

    fn with_simd<S: Simd>(self, simd: S) -> Vec<Vector> {
        (0..self.lines().div_ceil(S::F64_LANES))
            .into_par_iter()
            .with_min_len(2)
            .map(|vector| AtOnce::of(simd, self, vector * S::F64_LANES).vector())
            .collect()
    }
}

/// A matrix of each line, and where it is beyond doubt.
type Surely<S> = (Matrix<S>, Sure<S>);

/// The lines of one vector.
struct AtOnce<'a, S: Simd> {
    simd: S,
    job: &'a Job<'a>,
    /// The first line, and how many there are.
    first: usize,
    count: usize,
    /// Y^A and Y^B.
    alone: [Matrix<S>; 2],
    /// Y^AJB_cc and its inverse: five methods share them.
    assembly: OnceCell<Option<Matrix<S>>>,
    impedance: OnceCell<Option<Surely<S>>>,
}

impl<'a, S: Simd> AtOnce<'a, S> {
    fn of(simd: S, job: &'a Job<'a>, first: usize) -> Self {
        let alone = [Side::A, Side::B].map(|side| {
            let (file, own) = (job.rooms.alone(side), job.reduced.own(side));
            let lines = lines(simd, file.frf.lines(), first);
            let cells = Matrix::read(simd, &lines, &own.vp.rows.at, &own.vp.columns.at);
            times(simd, &to_left_of(simd, &own.t_u, &cells), &own.t_f)
        });
        let count = S::F64_LANES.min(job.lines() - first);
        AtOnce { simd, job, first, count, alone, assembly: OnceCell::new(), impedance: OnceCell::new() }
    }

    fn vector(&self) -> Vector {
        let Job { reduced, rooms, works, .. } = self.job;
        let mut numbers = Sure::all(self.simd);
        let alone = [Side::A, Side::B].map(|side| {
            let y = &self.alone[side as usize];
            let finite = y.finite(self.simd);
            numbers.and(finite);
            let line = |lane: usize| {
                if !finite.at(lane) {
                    reduced.alone_at(rooms, side, self.first + lane)
                } else if self.job.alone {
                    Ok(y.line(lane))
                } else {
                    Ok(Line::zeros(0, 0))
                }
            };
            (0..self.count).map(line).collect()
        });
        let d = balance(reduced.idms);
        let order = rooms.a.frf.quantity().order_of_s();
        let factors: Vec<Complex<f64>> =
            (0..self.count).map(|lane| rooms.a.frf.s(self.first + lane).powi(order)).collect();
        let mut factor = Cell::all(self.simd, 1.0);
        for (lane, Complex { re, im }) in factors.iter().enumerate() {
            factor.re.each_mut()[lane] = *re;
            factor.im.each_mut()[lane] = *im;
        }
        let z = works
            .iter()
            .map(|work| {
                let found = self.by(work).map(|(mut z, mut sure)| {
                    z.scaled(self.simd, &d, factor);
                    sure.and(numbers);
                    (z, sure)
                });
                let line = |lane: usize| match &found {
                    Some((z, sure)) if sure.at(lane) => Ok(z.line(lane)),
                    _ => {
                        let z = reduced.with_care(rooms, work, self.first + lane)?;
                        Ok(scaled(z, &d, factors[lane]))
                    }
                };
                (0..self.count).map(line).collect()
            })
            .collect();
        Vector { alone, z }
    }

    /// What a method finds; nothing where the careful way shall say why.
    fn by(&self, work: &Work<'_>) -> Option<Surely<S>> {
        let (simd, n) = (self.simd, self.job.reduced.idms.count());
        let [y_a, y_b] = &self.alone;
        match work {
            Work::Internals(internals) => self.by_internals(internals),
            Work::Interface => {
                let y = self.assembly()?;
                let mut sure = Sure::all(simd);
                let block = |row: usize, column: usize| y.block((row * n, column * n), (n, n));
                let d = minus(simd, minus(simd, block(0, 0), &block(0, 1)), &block(1, 0));
                let d = inverse(simd, plus(simd, d, &block(1, 1)), &mut sure);
                let w = inverse(simd, plus(simd, y_a.clone(), y_b), &mut sure);
                Some((minus(simd, d, &w), sure))
            }
            Work::Primal(block) => {
                let (z, sure) = self.impedance()?;
                let (at, y) = match block {
                    PrimalBlock::A => (0, y_a),
                    PrimalBlock::B => (n, y_b),
                };
                let mut sure = *sure;
                let alone = inverse(simd, y.clone(), &mut sure);
                Some((minus(simd, z.block((at, at), (n, n)), &alone), sure))
            }
            Work::Inverse(block) => {
                let (z, sure) = self.impedance()?;
                let at = match block {
                    InverseBlock::Ab => (0, n),
                    InverseBlock::Ba => (n, 0),
                };
                let mut z = z.block(at, (n, n));
                z.negate(simd);
                Some((z, *sure))
            }
        }
    }

    fn by_internals(&self, internals: &Rearrangement<'_>) -> Option<Surely<S>> {
        let (simd, n) = (self.simd, self.job.reduced.idms.count());
        let [y_a, y_b] = &self.alone;
        let mut sure = Sure::all(simd);
        let without = |g| minus(simd, minus(simd, g, y_a), y_b);
        if internals.printed {
            let [p, m, q] = internals.at_once(simd, self.first);
            let g = product(simd, &product(simd, &q, &inverse(simd, m, &mut sure)), &p);
            return Some((inverse(simd, without(g), &mut sure), sure));
        }
        if internals.rows.at.len().min(internals.columns.at.len()) < n {
            return None;
        }
        let [p, m, q] = internals.at_once(simd, self.first);
        let [p_plus, q_plus] = [p, q].map(|all| inverse(simd, all, &mut sure));
        let g = inverse(simd, product(simd, &product(simd, &p_plus, &m), &q_plus), &mut sure);
        Some((inverse(simd, without(g), &mut sure), sure))
    }

    /// Y^AJB_cc; nothing where a virtual point cannot be formed.
    fn assembly(&self) -> Option<&Matrix<S>> {
        let found = self.assembly.get_or_init(|| {
            let Job { reduced, rooms, .. } = self.job;
            let vp = reduced.assembled().ok()?;
            let lines = lines(self.simd, rooms.ajb.frf.lines(), self.first);
            Some(Matrix::beside(vp.each_ref().map(|input| {
                Matrix::above(vp.each_ref().map(|out: &Balanced| {
                    let cells = Matrix::read(self.simd, &lines, &out.vp.rows.at, &input.vp.columns.at);
                    times(self.simd, &to_left_of(self.simd, &out.t_u, &cells), &input.t_f)
                }))
            })))
        });
        found.as_ref()
    }

    /// (Y^AJB_cc)⁻¹.
    fn impedance(&self) -> Option<&Surely<S>> {
        let found = self.impedance.get_or_init(|| {
            let mut sure = Sure::all(self.simd);
            let z = inverse(self.simd, self.assembly()?.clone(), &mut sure);
            Some((z, sure))
        });
        found.as_ref()
    }
}
