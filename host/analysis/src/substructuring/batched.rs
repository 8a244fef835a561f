//! All methods at several lines simultaneously: shared intermediate results are read and computed
//! once; lines near rank loss are recomputed one by one with pivoted decompositions.

use super::decoupling::{InverseBlock, PrimalBlock};
use super::interface_data::{MeasuredSet, Side};
use super::interface_data::{balance, scaled};
use super::internal_dofs::Rearrangement;
use super::lanes::{
    LaneCell, Matrix, Pool, Reliable, inverse, lines, minus, plus, product, times, to_left_of,
};
use super::reduced::{LineRefusal, Work};
use super::reduced::{Reduced, RefusedReason};
use crate::parallel::prelude::*;
use crate::vectors::wide;
use nalgebra::{Complex, DMatrix};
use pulp::{Simd, WithSimd};
use std::cell::OnceCell;

type Line = DMatrix<Complex<f64>>;

/// Results of all lines.
pub(super) struct LineResults {
    /// Y^A and Y^B, rotations in metres; empty if not requested.
    pub(super) alone: Vec<Vec<Line>>,
    /// Z^J of each work item.
    pub(super) z: Vec<Result<Vec<Line>, RefusedReason>>,
}

/// The requested results.
pub(super) struct Job<'a> {
    pub(super) reduced: &'a Reduced,
    pub(super) measured_set: &'a MeasuredSet<'a>,
    pub(super) works: Vec<&'a Work<'a>>,
    /// Whether Y^A and Y^B are requested too.
    pub(super) alone: bool,
}

impl Job<'_> {
    /// Z^J of every line for every work item.
    ///
    /// # Errors
    /// Y^A or Y^B contains a value that is not finite.
    pub(super) fn found(&self) -> Result<LineResults, RefusedReason> {
        let lines = self.measured_set.a.frf.lines().len();
        let places = |count| vec![vec![Line::zeros(0, 0); lines]; count];
        let (mut alone, mut z) = (places(if self.alone { 2 } else { 0 }), places(self.works.len()));
        let refused = wide(Into { job: self, alone: &mut alone, z: &mut z });
        for side in [Side::A, Side::B] {
            if let Some(l) = refused.iter().flat_map(|refused| &refused.alone[side as usize]).min() {
                self.reduced.alone_at(self.measured_set, side, *l)?;
            }
        }
        let mut z: Vec<Result<Vec<Line>, RefusedReason>> = z.into_iter().map(Ok).collect();
        for (work, z) in z.iter_mut().enumerate() {
            // the first line among those with the earliest stage
            let of_work = refused.iter().flat_map(|refused| &refused.z).filter(|(of, _)| *of == work);
            if let Some((_, refusal)) = of_work.min_by_key(|(_, refusal)| refusal.stage) {
                *z = Err(refusal.reason.clone());
            }
        }
        Ok(LineResults { alone, z })
    }
}

/// Lines without a result: for Y^A and Y^B, and by work item.
#[derive(Default)]
pub(super) struct RefusedLines {
    alone: [Vec<usize>; 2],
    z: Vec<(usize, LineRefusal)>,
}

/// Destination of the results.
struct Into<'a> {
    job: &'a Job<'a>,
    alone: &'a mut [Vec<Line>],
    z: &'a mut [Vec<Line>],
}

/// Vectors per parallel task: enough to be worth the memory that a task allocates, few enough that
/// all cores get some.
const SHARE: usize = 16;

/// The entries of some lines in each of several results.
type Places<'a> = Vec<&'a mut [Line]>;

impl WithSimd for Into<'_> {
    type Output = Vec<RefusedLines>;

    fn with_simd<S: Simd>(self, simd: S) -> Vec<RefusedLines> {
        let lines = SHARE * S::F64_LANES;
        let count = self.job.measured_set.a.frf.lines().len().div_ceil(lines);
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
                // allocate the matrices of a result one after the other, so that later passes read
                // memory sequentially
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

/// A matrix of each line, and the lines at which its rank is beyond doubt.
type Surely<'p, S> = (Matrix<'p, S>, Reliable<S>);

/// The lines of one vector.
struct AtOnce<'a, S: Simd> {
    pool: &'a Pool<S>,
    job: &'a Job<'a>,
    /// The first line, and the number of lines.
    first: usize,
    count: usize,
    /// Y^A and Y^B.
    alone: [Matrix<'a, S>; 2],
    /// Y^AJB_cc and its inverse, shared by five methods.
    assembly: OnceCell<Option<Matrix<'a, S>>>,
    impedance: OnceCell<Option<Surely<'a, S>>>,
}

impl<'a, S: Simd> AtOnce<'a, S> {
    fn of(pool: &'a Pool<S>, job: &'a Job<'a>, first: usize) -> Option<Self> {
        let count = S::F64_LANES.min(job.measured_set.a.frf.lines().len().checked_sub(first)?);
        if count == 0 {
            return None;
        }
        let alone = [Side::A, Side::B].map(|side| {
            let (file, own) = (job.measured_set.alone(side), job.reduced.own(side));
            let lines = lines(pool, file.frf.lines(), first);
            let cells = Matrix::read(pool, &lines, &own.vp.rows.at, &own.vp.columns.at);
            times(&to_left_of(&own.t_u, &cells), &own.t_f)
        });
        Some(AtOnce { pool, job, first, count, alone, assembly: OnceCell::new(), impedance: OnceCell::new() })
    }

    /// Stores the results in the entries from `at` on.
    fn put(&self, at: usize, alone: &mut Places<'_>, z: &mut Places<'_>, refused: &mut RefusedLines) {
        let Job { reduced, measured_set, works, .. } = self.job;
        let mut numbers = Reliable::all(self.pool.simd);
        for (y, refused) in self.alone.iter().zip(&mut refused.alone) {
            let finite = y.finite();
            numbers.and(finite);
            refused.extend((0..self.count).filter(|lane| !finite.at(*lane)).map(|lane| self.first + lane));
        }
        for (y, places) in self.alone.iter().zip(alone) {
            (0..self.count).for_each(|lane| y.line_to(lane, &mut places[at + lane]));
        }
        let d = balance(reduced.idms);
        let order = measured_set.a.frf.quantity().order_of_s();
        let mut factor = LaneCell::all(self.pool.simd, 1.0);
        for lane in 0..self.count {
            let Complex { re, im } = measured_set.a.frf.s(self.first + lane).powi(order);
            (factor.re.each_mut()[lane], factor.im.each_mut()[lane]) = (re, im);
        }
        for (w, (work, places)) in works.iter().zip(z).enumerate() {
            let found = self.by(work).map(|(z, mut reliable)| {
                reliable.and(numbers);
                (z.scaled(&d, factor), reliable)
            });
            for (lane, place) in places[at..at + self.count].iter_mut().enumerate() {
                match &found {
                    Some((z, reliable)) if reliable.at(lane) => z.line_to(lane, place),
                    _ => match reduced.per_line(measured_set, work, self.first + lane) {
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

    /// The result of a method; none if the line-by-line computation has to find the reason of a
    /// refusal.
    fn by(&self, work: &Work<'_>) -> Option<Surely<'a, S>> {
        let n = self.job.reduced.idms.count();
        let [y_a, y_b] = &self.alone;
        match work {
            Work::Internals(internals) => self.by_internals(internals),
            Work::Interface => {
                let y = self.assembly()?;
                let mut reliable = Reliable::all(self.pool.simd);
                let block = |row: usize, column: usize| y.block((row * n, column * n), (n, n));
                let d = minus(minus(block(0, 0), &block(0, 1)), &block(1, 0));
                let d = inverse(plus(d, &block(1, 1)), &mut reliable);
                let w = inverse(plus(y_a.copy(), y_b), &mut reliable);
                Some((minus(d, &w), reliable))
            }
            Work::Primal(block) => {
                let (z, reliable) = self.impedance()?;
                let (at, y) = match block {
                    PrimalBlock::A => (0, y_a),
                    PrimalBlock::B => (n, y_b),
                };
                let mut reliable = *reliable;
                let alone = inverse(y.copy(), &mut reliable);
                Some((minus(z.block((at, at), (n, n)), &alone), reliable))
            }
            Work::Inverse(block) => {
                let (z, reliable) = self.impedance()?;
                let at = match block {
                    InverseBlock::Ab => (0, n),
                    InverseBlock::Ba => (n, 0),
                };
                Some((z.block(at, (n, n)).negated(), *reliable))
            }
        }
    }

    fn by_internals(&self, internals: &Rearrangement<'_>) -> Option<Surely<'a, S>> {
        let n = self.job.reduced.idms.count();
        let [y_a, y_b] = &self.alone;
        let mut reliable = Reliable::all(self.pool.simd);
        let without = |g| minus(minus(g, y_a), y_b);
        if internals.printed {
            let [p, m, q] = internals.batched(self.pool, self.first);
            let g = product(&product(&q, &inverse(m, &mut reliable)), &p);
            return Some((inverse(without(g), &mut reliable), reliable));
        }
        if internals.rows.at.len().min(internals.columns.at.len()) < n {
            return None;
        }
        let [p, m, q] = internals.batched(self.pool, self.first);
        let [p_plus, q_plus] = [p, q].map(|all| inverse(all, &mut reliable));
        let g = inverse(product(&product(&p_plus, &m), &q_plus), &mut reliable);
        Some((inverse(without(g), &mut reliable), reliable))
    }

    /// Y^AJB_cc; none if a virtual point cannot be formed.
    fn assembly(&self) -> Option<&Matrix<'a, S>> {
        let found = self.assembly.get_or_init(|| {
            let Job { reduced, measured_set, .. } = self.job;
            let vp = reduced.assembled().ok()?;
            let lines = lines(self.pool, measured_set.ajb.frf.lines(), self.first);
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
            let mut reliable = Reliable::all(self.pool.simd);
            let z = inverse(self.assembly()?.copy(), &mut reliable);
            Some((z, reliable))
        });
        found.as_ref()
    }
}
