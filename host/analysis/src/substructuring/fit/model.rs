//! Eq. (1) as the model of the assembly, with its derivatives by the joint and by the measured Y^A
//! and Y^B.
//!
//! Y^AJB = Y − P G⁻¹ Q with P = Y Bᵀ, Q = B Y and G = B Y Bᵀ + Y^J. A change of Y alone gives L δY
//! R with L = I − P G⁻¹ B and R = I − Bᵀ G⁻¹ Q; a change of the joint gives −P δ(G⁻¹) Q.

use super::block::Ports;
use super::chart::At;
use crate::substructuring::product::product;
use crate::substructuring::pseudo_inverse::full_rank_inverse;
use crate::{C, Line};

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
        (0..joint.len()).map(|l| self.predict_line(&joint[l], parts.map(|part| &part[l]), wanted)).collect()
    }

    /// The model at one line; none for a singular G.
    fn predict_line(&self, joint: &At, parts: [&Line; 2], wanted: Wanted) -> Option<Predicted> {
        let n = self.n;
        let (rows, columns) = self.shape();
        let (mut p, mut q) = (Line::zeros(rows, n), Line::zeros(n, columns));
        for (side, part) in parts.into_iter().enumerate() {
            let (row, column) = self.corner(side);
            let pushed = part.columns(self.columns[side].first[0], n);
            let moved = part.rows(self.rows[side].first[0], n);
            p.rows_mut(row, part.nrows()).copy_from(&(pushed * sign(side)));
            q.columns_mut(column, part.ncols()).copy_from(&(moved * sign(side)));
        }
        let w = self.interface(parts);
        // G⁻¹ = H D with H = (D W + E)⁻¹, which also exists for a rigid joint
        let h =
            full_rank_inverse(&(product(&joint.d, &w) + &joint.e), "the interface with the joint").ok()?;
        let g = product(&h, &joint.d);
        let gq = product(&g, &q);
        let empty = || Line::zeros(0, 0);
        let y = if wanted.y {
            let mut y = -product(&p, &gq);
            for (side, part) in parts.into_iter().enumerate() {
                let mut alone = y.view_mut(self.corner(side), part.shape());
                alone += part;
            }
            y
        } else {
            empty()
        };
        let slopes = match &joint.slopes {
            Some(by_joint) if wanted.slopes => {
                // δ(G⁻¹) = H (δD (I − W G⁻¹) − δE G⁻¹), δD = left dᵀ
                let rest = &q - product(&w, &gq);
                Slopes {
                    moved: -product(&product(&p, &h), &by_joint.left),
                    by: product(&rest.transpose(), &by_joint.d) - product(&gq.transpose(), &by_joint.e),
                }
            }
            _ => Slopes { moved: empty(), by: empty() },
        };
        let (pg, gq) = if wanted.gains { (product(&p, &g), gq) } else { (empty(), empty()) };
        Some(Predicted { y, pg, gq, slopes })
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
