//! All methods at several lines at once: what they share is read and computed once, and what is near rank loss is left to the
//! careful way, line by line.

use super::decoupling::{InverseBlock, PrimalBlock};
use super::interface_data::{balance, scaled};
use super::internal_dofs::Rearrangement;
use super::lanes::{Cell, Matrix, Pool, Sure, inverse, lines, minus, plus, product, times, to_left_of};
use super::reduced::{Reduced, RefusedReason};
use super::rooms::{Rooms, Side};
use super::with_care::{Refusal, Work};
use crate::parallel::prelude::*;
use crate::vectors::wide;
use nalgebra::{Complex, DMatrix};
use pulp::{Simd, WithSimd};
use std::cell::OnceCell;

type Line = DMatrix<Complex<f64>>;

/// What was found at all lines.
pub(super) struct Found {
    /// Y^A and Y^B, rotations in metres; nothing where they were not asked for.
    pub(super) alone: Vec<Vec<Line>>,
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
        let lines = self.rooms.a.frf.lines().len();
        let places = |count| vec![vec![Line::zeros(0, 0); lines]; count];
        let (mut alone, mut z) = (places(if self.alone { 2 } else { 0 }), places(self.works.len()));
        let refused = wide(Into { job: self, alone: &mut alone, z: &mut z });
        for side in [Side::A, Side::B] {
            if let Some(l) = refused.iter().flat_map(|refused| &refused.alone[side as usize]).min() {
                self.reduced.alone_at(self.rooms, side, *l)?;
            }
        }
        let mut z: Vec<Result<Vec<Line>, RefusedReason>> = z.into_iter().map(Ok).collect();
        for (work, z) in z.iter_mut().enumerate() {
            // the first line of those that have the earliest stage
            let of_work = refused.iter().flat_map(|refused| &refused.z).filter(|(of, _)| *of == work);
            if let Some((_, refusal)) = of_work.min_by_key(|(_, refusal)| refusal.stage) {
                *z = Err(refusal.reason.clone());
            }
        }
        Ok(Found { alone, z })
    }
}

/// What could not be found at some lines: which of Y^A and Y^B, and by which work.
#[derive(Default)]
pub(super) struct RefusedLines {
    alone: [Vec<usize>; 2],
    z: Vec<(usize, Refusal)>,
}

/// Where to put what is found.
struct Into<'a> {
    job: &'a Job<'a>,
    alone: &'a mut [Vec<Line>],
    z: &'a mut [Vec<Line>],
}

/// So many vectors are one share of the work: enough for the memory that it asks for to pay, few enough for all cores to have some.
const SHARE: usize = 16;

/// The places of some lines in each of several results.
type Places<'a> = Vec<&'a mut [Line]>;

impl WithSimd for Into<'_> {
    type Output = Vec<RefusedLines>;

    fn with_simd<S: Simd>(self, simd: S) -> Vec<RefusedLines> {
        let lines = SHARE * S::F64_LANES;
        let count = self.job.rooms.a.frf.lines().len().div_ceil(lines);
        let shares = |results| -> Vec<Places<'_>> {
            let mut shares: Vec<Places<'_>> = (0..count).map(|_| Vec::new()).collect();
            for result in results {
                let result: &mut Vec<Line> = result;
                shares.iter_mut().zip(result.chunks_mut(lines)).for_each(|(share, part)| share.push(part));
            }
            shares
        };
        let shares: Vec<[Places<'_>; 2]> =
            shares(self.alone).into_iter().zip(shares(self.z)).map(|(alone, z)| [alone, z]).collect();
        shares
            .into_par_iter()
            .enumerate()
            .map(|(share, [mut alone, mut z])| {
                let (pool, mut refused) = (Pool::new(simd), RefusedLines::default());
                // what is one after the other in a result is so in memory, too: whoever goes through it later need not jump
                let n = self.job.reduced.idms.count();
                for place in alone.iter_mut().chain(&mut z).flat_map(|places| places.iter_mut()) {
                    *place = Line::zeros(n, n);
                }
                for vector in 0..SHARE {
                    let at = vector * S::F64_LANES;
                    if let Some(vector) = AtOnce::of(&pool, self.job, share * lines + at) {
                        vector.put(at, &mut alone, &mut z, &mut refused);
                    }
                }
                refused
            })
            .collect()
    }
}

/// A matrix of each line, and where it is beyond doubt.
type Surely<'p, S> = (Matrix<'p, S>, Sure<S>);

/// The lines of one vector.
struct AtOnce<'a, S: Simd> {
    pool: &'a Pool<S>,
    job: &'a Job<'a>,
    /// The first line, and how many there are.
    first: usize,
    count: usize,
    /// Y^A and Y^B.
    alone: [Matrix<'a, S>; 2],
    /// Y^AJB_cc and its inverse: five methods share them.
    assembly: OnceCell<Option<Matrix<'a, S>>>,
    impedance: OnceCell<Option<Surely<'a, S>>>,
}

impl<'a, S: Simd> AtOnce<'a, S> {
    fn of(pool: &'a Pool<S>, job: &'a Job<'a>, first: usize) -> Option<Self> {
        let count = S::F64_LANES.min(job.rooms.a.frf.lines().len().checked_sub(first)?);
        if count == 0 {
            return None;
        }
        let alone = [Side::A, Side::B].map(|side| {
            let (file, own) = (job.rooms.alone(side), job.reduced.own(side));
            let lines = lines(pool, file.frf.lines(), first);
            let cells = Matrix::read(pool, &lines, &own.vp.rows.at, &own.vp.columns.at);
            times(&to_left_of(&own.t_u, &cells), &own.t_f)
        });
        Some(AtOnce { pool, job, first, count, alone, assembly: OnceCell::new(), impedance: OnceCell::new() })
    }

    /// Puts what is found at the places from `at` on.
    fn put(&self, at: usize, alone: &mut Places<'_>, z: &mut Places<'_>, refused: &mut RefusedLines) {
        let Job { reduced, rooms, works, .. } = self.job;
        let mut numbers = Sure::all(self.pool.simd);
        for (y, refused) in self.alone.iter().zip(&mut refused.alone) {
            let finite = y.finite();
            numbers.and(finite);
            refused.extend((0..self.count).filter(|lane| !finite.at(*lane)).map(|lane| self.first + lane));
        }
        for (y, places) in self.alone.iter().zip(alone) {
            (0..self.count).for_each(|lane| y.line_to(lane, &mut places[at + lane]));
        }
        let d = balance(reduced.idms);
        let order = rooms.a.frf.quantity().order_of_s();
        let mut factor = Cell::all(self.pool.simd, 1.0);
        for lane in 0..self.count {
            let Complex { re, im } = rooms.a.frf.s(self.first + lane).powi(order);
            (factor.re.each_mut()[lane], factor.im.each_mut()[lane]) = (re, im);
        }
        for (w, (work, places)) in works.iter().zip(z).enumerate() {
            let found = self.by(work).map(|(z, mut sure)| {
                sure.and(numbers);
                (z.scaled(&d, factor), sure)
            });
            for (lane, place) in places[at..at + self.count].iter_mut().enumerate() {
                match &found {
                    Some((z, sure)) if sure.at(lane) => z.line_to(lane, place),
                    _ => match reduced.with_care(rooms, work, self.first + lane) {
                        Ok(z) => {
                            let factor = Complex::new(factor.re.each()[lane], factor.im.each()[lane]);
                            *place = scaled(z, &d, factor);
                        }
                        Err(refusal) => refused.z.push((w, refusal)),
                    },
                }
            }
        }
    }

    /// What a method finds; nothing where the careful way shall say why.
    fn by(&self, work: &Work<'_>) -> Option<Surely<'a, S>> {
        let n = self.job.reduced.idms.count();
        let [y_a, y_b] = &self.alone;
        match work {
            Work::Internals(internals) => self.by_internals(internals),
            Work::Interface => {
                let y = self.assembly()?;
                let mut sure = Sure::all(self.pool.simd);
                let block = |row: usize, column: usize| y.block((row * n, column * n), (n, n));
                let d = minus(minus(block(0, 0), &block(0, 1)), &block(1, 0));
                let d = inverse(plus(d, &block(1, 1)), &mut sure);
                let w = inverse(plus(y_a.copy(), y_b), &mut sure);
                Some((minus(d, &w), sure))
            }
            Work::Primal(block) => {
                let (z, sure) = self.impedance()?;
                let (at, y) = match block {
                    PrimalBlock::A => (0, y_a),
                    PrimalBlock::B => (n, y_b),
                };
                let mut sure = *sure;
                let alone = inverse(y.copy(), &mut sure);
                Some((minus(z.block((at, at), (n, n)), &alone), sure))
            }
            Work::Inverse(block) => {
                let (z, sure) = self.impedance()?;
                let at = match block {
                    InverseBlock::Ab => (0, n),
                    InverseBlock::Ba => (n, 0),
                };
                Some((z.block(at, (n, n)).negated(), *sure))
            }
        }
    }

    fn by_internals(&self, internals: &Rearrangement<'_>) -> Option<Surely<'a, S>> {
        let n = self.job.reduced.idms.count();
        let [y_a, y_b] = &self.alone;
        let mut sure = Sure::all(self.pool.simd);
        let without = |g| minus(minus(g, y_a), y_b);
        if internals.printed {
            let [p, m, q] = internals.at_once(self.pool, self.first);
            let g = product(&product(&q, &inverse(m, &mut sure)), &p);
            return Some((inverse(without(g), &mut sure), sure));
        }
        if internals.rows.at.len().min(internals.columns.at.len()) < n {
            return None;
        }
        let [p, m, q] = internals.at_once(self.pool, self.first);
        let [p_plus, q_plus] = [p, q].map(|all| inverse(all, &mut sure));
        let g = inverse(product(&product(&p_plus, &m), &q_plus), &mut sure);
        Some((inverse(without(g), &mut sure), sure))
    }

    /// Y^AJB_cc; nothing where a virtual point cannot be formed.
    fn assembly(&self) -> Option<&Matrix<'a, S>> {
        let found = self.assembly.get_or_init(|| {
            let Job { reduced, rooms, .. } = self.job;
            let vp = reduced.assembled().ok()?;
            let lines = lines(self.pool, rooms.ajb.frf.lines(), self.first);
            let n = reduced.idms.count();
            let mut y = Matrix::any(self.pool, 2 * n, 2 * n);
            for (r, out) in vp.iter().enumerate() {
                for (c, input) in vp.iter().enumerate() {
                    let cells = Matrix::read(self.pool, &lines, &out.vp.rows.at, &input.vp.columns.at);
                    y.put((r * n, c * n), &times(&to_left_of(&out.t_u, &cells), &input.t_f));
                }
            }
            Some(y)
        });
        found.as_ref()
    }

    /// (Y^AJB_cc)⁻¹.
    fn impedance(&self) -> Option<&Surely<'a, S>> {
        let found = self.impedance.get_or_init(|| {
            let mut sure = Sure::all(self.pool.simd);
            let z = inverse(self.assembly()?.copy(), &mut sure);
            Some((z, sure))
        });
        found.as_ref()
    }
}
