//! Eq. (1) as the model of the assembly, with its derivatives by the joint and by what A and B were measured as.
//!
//! Y^AJB = Y − P G⁻¹ Q with P = Y Bᵀ, Q = B Y and G = B Y Bᵀ + Y^J. A change of Y alone gives L δY R with L = I − P G⁻¹ B and
//! R = I − Bᵀ G⁻¹ Q; a change of the joint −P δ(G⁻¹) Q.

use super::block::{Line, Ports};
use super::chart::{At, Dyad};
use crate::substructuring::product::product;
use crate::substructuring::pseudo_inverse::full_rank_inverse;
use nalgebra::Complex;

type C = Complex<f64>;

/// The assembly's ports: A's first, then B's.
pub(super) struct Layout {
    /// Interface degrees of freedom of one side.
    pub(super) n: usize,
    pub(super) rows: [Ports; 2],
    pub(super) columns: [Ports; 2],
}

/// The model at one line.
pub(super) struct Predicted {
    /// All output ports × all input ports.
    pub(super) y: Line,
    /// P G⁻¹ and G⁻¹ Q.
    pg: Line,
    gq: Line,
    /// Derivative of `y` by each parameter of the joint, as sums of products.
    pub(super) slopes: Vec<Vec<Product>>,
}

/// A column for all output ports times a row for all input ports.
pub(super) struct Product {
    pub(super) moved: Vec<C>,
    pub(super) by: Vec<C>,
}

impl Layout {
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.rows[0].count + self.rows[1].count, self.columns[0].count + self.columns[1].count)
    }

    /// First row and column of a side's ports.
    pub(super) fn corner(&self, side: usize) -> (usize, usize) {
        if side == 0 { (0, 0) } else { (self.rows[0].count, self.columns[0].count) }
    }

    /// Y of both parts, block-diagonal.
    fn apart(&self, parts: [&Line; 2]) -> Line {
        let (rows, columns) = self.shape();
        let mut y = Line::zeros(rows, columns);
        for (side, part) in parts.into_iter().enumerate() {
            y.view_mut(self.corner(side), part.shape()).copy_from(part);
        }
        y
    }

    /// P = Y Bᵀ and Q = B Y.
    fn edges(&self, parts: [&Line; 2]) -> (Line, Line) {
        let (rows, columns) = self.shape();
        let (mut p, mut q) = (Line::zeros(rows, self.n), Line::zeros(self.n, columns));
        for (side, part) in parts.into_iter().enumerate() {
            let (row, column) = self.corner(side);
            let pushed = part.columns(self.columns[side].first[0], self.n) * sign(side);
            p.view_mut((row, 0), pushed.shape()).copy_from(&pushed);
            let moved = part.rows(self.rows[side].first[0], self.n) * sign(side);
            q.view_mut((0, column), moved.shape()).copy_from(&moved);
        }
        (p, q)
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

    /// Only the assembly's admittance; none where G is singular.
    pub(super) fn assembly(&self, joint: &At, parts: [&Line; 2]) -> Option<Line> {
        let g = product(&held(joint, &self.interface(parts))?, &joint.d);
        let (p, q) = self.edges(parts);
        Some(self.apart(parts) - product(&p, &product(&g, &q)))
    }

    /// The model with its derivatives; none where G is singular.
    pub(super) fn predict(&self, joint: &At, parts: [&Line; 2]) -> Option<Predicted> {
        let w = self.interface(parts);
        let h = held(joint, &w)?;
        let g = product(&h, &joint.d);
        let (p, q) = self.edges(parts);
        let (pg, gq) = (product(&p, &g), product(&g, &q));
        let (rows, columns) = self.shape();
        // δ(G⁻¹) = H (δD (I − W G⁻¹) − δE G⁻¹)
        let ph = product(&p, &h);
        let rest = &q - product(&w, &gq);
        let product_of = |dyad: &Dyad| {
            let mut moved = vec![C::default(); rows];
            for (i, v) in &dyad.left {
                moved.iter_mut().zip(ph.column(*i).iter()).for_each(|(to, p)| *to -= p * v);
            }
            let by = (0..columns).map(|c| {
                let pushed: C = dyad.d.iter().map(|(i, v)| rest[(*i, c)] * v).sum();
                let eased: C = dyad.e.iter().map(|(i, v)| gq[(*i, c)] * v).sum();
                pushed - eased
            });
            Product { moved, by: by.collect() }
        };
        let slopes = joint.slopes.iter().map(|dyads| dyads.iter().map(product_of).collect()).collect();
        Some(Predicted { y: self.apart(parts) - product(&p, &gq), pg, gq, slopes })
    }

    /// The columns of L that a side's output ports pass through: all output ports × the side's.
    pub(super) fn left(&self, at: &Predicted, side: usize) -> Line {
        let (ports, row) = (&self.rows[side], self.corner(side).0);
        let mut left = Line::zeros(at.y.nrows(), ports.count);
        left.view_mut((row, 0), (ports.count, ports.count)).fill_with_identity();
        let mut own = left.columns_mut(ports.first[0], self.n);
        own -= &at.pg * sign(side);
        left
    }

    /// The rows of R that its input ports pass through: the side's input ports × all.
    pub(super) fn right(&self, at: &Predicted, side: usize) -> Line {
        let (ports, column) = (&self.columns[side], self.corner(side).1);
        let mut right = Line::zeros(ports.count, at.y.ncols());
        right.view_mut((0, column), (ports.count, ports.count)).fill_with_identity();
        let mut own = right.rows_mut(ports.first[0], self.n);
        own -= &at.gq * sign(side);
        right
    }
}

/// B's entry of a side: what A's interface moves less B's.
fn sign(side: usize) -> C {
    C::from(if side == 0 { 1.0 } else { -1.0 })
}

/// H = (D W + E)⁻¹; none where it is singular.
fn held(joint: &At, w: &Line) -> Option<Line> {
    full_rank_inverse(&(product(&joint.d, w) + &joint.e), "the interface with the joint").ok()
}
