//! Eq. (1) as the model of the assembly, with its derivatives by the joint and by the measured Y^A
//! and Y^B.
//!
//! Y^AJB = Y − P G⁻¹ Q with P = Y Bᵀ, Q = B Y and G = B Y Bᵀ + Y^J. A change of Y alone gives L δY
//! R with L = I − P G⁻¹ B and R = I − Bᵀ G⁻¹ Q; a change of the joint gives −P δ(G⁻¹) Q.

use super::block::{Line, Ports};
use super::chart;
use super::chart::At;
use crate::substructuring::lanes::{Matrix, Pool, Reliable, inverse, lines, minus, plus, product};
use crate::substructuring::pseudo_inverse::full_rank_inverse;
use crate::vectors::wide;
use nalgebra::Complex;
use pulp::{Simd, WithSimd};

type C = Complex<f64>;

/// The assembly's ports: A's first, then B's.
pub(super) struct Layout {
    /// Interface degrees of freedom of one side.
    pub(super) n: usize,
    pub(super) rows: [Ports; 2],
    pub(super) columns: [Ports; 2],
}

/// The parts of the model to be computed.
#[derive(Clone, Copy, Default)]
pub(super) struct Wanted {
    /// Y^AJB.
    pub(super) y: bool,
    /// P G⁻¹ and G⁻¹ Q.
    pub(super) gains: bool,
    /// The derivatives by the joint.
    pub(super) slopes: bool,
}

/// The model at one line; parts that were not requested are empty.
pub(super) struct Predicted {
    /// All output ports × all input ports.
    pub(super) y: Line,
    /// P G⁻¹ and G⁻¹ Q.
    pg: Line,
    gq: Line,
    pub(super) slopes: Slopes,
}

/// The derivatives of Y^AJB by the parameters of the joint, as sums of dyads: a column of `moved`
/// times the transpose of that of `by`.
///
/// Every parameter has the same number of dyads, in contiguous columns.
pub(super) struct Slopes {
    /// All output ports × dyads.
    pub(super) moved: Line,
    /// All input ports × dyads.
    pub(super) by: Line,
}

impl Layout {
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.rows[0].count + self.rows[1].count, self.columns[0].count + self.columns[1].count)
    }

    /// First row and column of a side's ports.
    pub(super) fn corner(&self, side: usize) -> (usize, usize) {
        if side == 0 { (0, 0) } else { (self.rows[0].count, self.columns[0].count) }
    }

    /// W = B Y Bᵀ of the interface.
    pub(super) fn interface(&self, parts: [&Line; 2]) -> Line {
        let mut w = Line::zeros(self.n, self.n);
        for (side, part) in parts.into_iter().enumerate() {
            let at = (self.rows[side].first[0], self.columns[side].first[0]);
            w += part.view(at, (self.n, self.n));
        }
        w
    }

    /// The model at some lines, given the joint, Y^A and Y^B at each; none for lines with a
    /// singular G.
    pub(super) fn predict(
        &self,
        joint: &[At],
        parts: [&[Line]; 2],
        wanted: Wanted,
    ) -> Vec<Option<Predicted>> {
        assert!(parts.iter().all(|part| part.len() == joint.len()), "A, B and the joint have the same lines");
        wide(Predictions { layout: self, joint, parts, wanted })
    }

    /// The columns of L for a side's output ports: all output ports × the side's.
    pub(super) fn left(&self, at: &Predicted, side: usize) -> Line {
        let (ports, row) = (&self.rows[side], self.corner(side).0);
        let mut left = Line::zeros(self.shape().0, ports.count);
        left.view_mut((row, 0), (ports.count, ports.count)).fill_with_identity();
        let mut own = left.columns_mut(ports.first[0], self.n);
        own -= &at.pg * sign(side);
        left
    }

    /// The rows of R for a side's input ports: the side's input ports × all.
    pub(super) fn right(&self, at: &Predicted, side: usize) -> Line {
        let (ports, column) = (&self.columns[side], self.corner(side).1);
        let mut right = Line::zeros(ports.count, self.shape().1);
        right.view_mut((0, column), (ports.count, ports.count)).fill_with_identity();
        let mut own = right.rows_mut(ports.first[0], self.n);
        own -= &at.gq * sign(side);
        right
    }
}

/// The sign of a side in B: A's interface motion minus B's.
fn sign(side: usize) -> C {
    C::from(if side == 0 { 1.0 } else { -1.0 })
}

/// The model at as many lines simultaneously as the processor's vectors hold.
struct Predictions<'a> {
    layout: &'a Layout,
    joint: &'a [At],
    parts: [&'a [Line]; 2],
    wanted: Wanted,
}

impl WithSimd for Predictions<'_> {
    type Output = Vec<Option<Predicted>>;

    fn with_simd<S: Simd>(self, simd: S) -> Vec<Option<Predicted>> {
        let pool = Pool::new(simd);
        let firsts = (0..self.joint.len()).step_by(S::F64_LANES);
        firsts.flat_map(|first| self.from(&pool, first)).collect()
    }
}

impl Predictions<'_> {
    /// The lines of a vector from `first` on.
    fn from<S: Simd>(&self, pool: &Pool<S>, first: usize) -> Vec<Option<Predicted>> {
        let Predictions { layout, joint, parts, wanted } = *self;
        let n = layout.n;
        let lanes = S::F64_LANES.min(joint.len() - first);
        let (rows, columns) = layout.shape();
        let own = [0, 1].map(|side| Matrix::whole(pool, &lines(pool, parts[side], first)));
        let (mut p, mut q) = (Matrix::any(pool, rows, n), Matrix::any(pool, n, columns));
        for (side, own) in own.iter().enumerate() {
            let (row, column) = layout.corner(side);
            let pushed = own.block((0, layout.columns[side].first[0]), (own.rows(), n));
            let moved = own.block((layout.rows[side].first[0], 0), (n, own.columns()));
            let [pushed, moved] =
                if side == 0 { [pushed, moved] } else { [pushed.negated(), moved.negated()] };
            p.put((row, 0), &pushed);
            q.put((0, column), &moved);
        }
        let [of_a, of_b] = [0, 1].map(|side| {
            let at = (layout.rows[side].first[0], layout.columns[side].first[0]);
            own[side].block(at, (n, n))
        });
        let w = plus(of_a, &of_b);
        let joint = lines(pool, joint, first);
        let of_joint = |of: fn(&At) -> &Line| {
            Matrix::whole(pool, &joint.iter().map(|at| of(at)).collect::<Vec<&Line>>())
        };
        let d = of_joint(|at| &at.d);
        let (h, regular) = held(pool, &plus(product(&d, &w), &of_joint(|at| &at.e)), lanes);
        let g = product(&h, &d);
        let gq = product(&g, &q);
        let y = wanted.y.then(|| {
            let mut y = product(&p, &gq).negated();
            for (side, own) in own.iter().enumerate() {
                let at = layout.corner(side);
                let alone = y.block(at, (own.rows(), own.columns()));
                y.put(at, &plus(alone, own));
            }
            y
        });
        let pg = wanted.gains.then(|| product(&p, &g));
        let slopes = wanted.slopes.then(|| {
            let of = |of: fn(&chart::Slopes) -> &Line| {
                let lines: Vec<&Line> = joint.iter().filter_map(|at| at.slopes.as_ref()).map(of).collect();
                Matrix::whole(pool, &lines)
            };
            // δ(G⁻¹) = H (δD (I − W G⁻¹) − δE G⁻¹), δD = left dᵀ
            let rest = minus(q, &product(&w, &gq));
            let moved = product(&product(&p, &h), &of(|s| &s.left)).negated();
            let by =
                minus(product(&rest.transpose(), &of(|s| &s.d)), &product(&gq.transpose(), &of(|s| &s.e)));
            (moved, by)
        });
        let line = |matrix: Option<&Matrix<'_, S>>, lane: usize| {
            matrix.map_or_else(|| Line::zeros(0, 0), |matrix| matrix.line(lane))
        };
        (0..lanes)
            .map(|lane| {
                regular[lane].then(|| Predicted {
                    y: line(y.as_ref(), lane),
                    pg: line(pg.as_ref(), lane),
                    gq: line(pg.as_ref().map(|_| &gq), lane),
                    slopes: Slopes {
                        moved: line(slopes.as_ref().map(|s| &s.0), lane),
                        by: line(slopes.as_ref().map(|s| &s.1), lane),
                    },
                })
            })
            .collect()
    }
}

/// H = (D W + E)⁻¹, and the lines at which it exists.
fn held<'p, S: Simd>(pool: &Pool<S>, interface: &Matrix<'p, S>, lanes: usize) -> (Matrix<'p, S>, Vec<bool>) {
    let mut reliable = Reliable::all(pool.simd);
    let mut h = inverse(interface.copy(), &mut reliable);
    let regular = (0..lanes).map(|lane| {
        reliable.at(lane) || {
            let careful = full_rank_inverse(&interface.line(lane), "the interface with the joint");
            careful.map(|own| h.put_line(lane, &own)).is_ok()
        }
    });
    let regular = regular.collect();
    (h, regular)
}
