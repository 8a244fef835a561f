//! The curve of a law whose hysteretic force depends, on one stroke, only on the force itself.
//!
//! With the force over its limit in the direction of motion, v = s y / Y (s = ±1), and the travel
//! ζ = k |Δx| / Y, each of these laws is dv/dζ = g(v) with g(0) = 1 and g(1) = 0. One stroke is a
//! part of the one curve ζ(v) through v = 0, from v = −1 to v = 1: a reversal changes the sign of
//! v.

/// Distance between the nodes of a tabulated curve.
const STEP: f64 = 0.02;

/// Most nodes on one side of a tabulated curve.
const MOST_NODES: usize = 4000;

/// A force this close to its limit no longer changes.
const AT_LIMIT: f64 = 1e-12;

/// ζ(v) and its inverse, for v from −1 to 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TravelCurve {
    /// dv/dζ = (1 − v)^i, i > 0.
    Power {
        /// i.
        exponent: f64,
    },
    /// dv/dζ = (1 − v) / (1 − q v), q < 1.
    Rational {
        /// q.
        q: f64,
    },
    /// Any other, integrated numerically.
    Tabulated(Box<CurveTable>),
}

/// Nodes of a curve at equal distances [`STEP`] of ζ, cubic between them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurveTable {
    /// ζ of the first node.
    first: f64,
    /// v and dv/dζ at each node; v ascends.
    nodes: Vec<(f64, f64)>,
}

impl TravelCurve {
    /// Integrates dv/dζ = g(v) from v = 0 to both sides by the classical Runge–Kutta method of
    /// fourth order, to v = −1 on one side and to `reach` of ζ or the limit on the other.
    pub(super) fn integrated(g: impl Fn(f64) -> f64, reach: f64) -> Self {
        let side = |sign: f64, most: usize| {
            let mut v = 0.0;
            let mut nodes = Vec::new();
            // the nodes beyond ±1 are only reached by the last step
            while nodes.len() < most && 1.0 - f64::abs(v) > AT_LIMIT {
                let h = sign * STEP;
                let slopes_1 = g(v);
                let slopes_2 = g(v + 0.5 * h * slopes_1);
                let slopes_3 = g(v + 0.5 * h * slopes_2);
                let slopes_4 = g(v + h * slopes_3);
                v += h / 6.0 * (slopes_1 + 2.0 * (slopes_2 + slopes_3) + slopes_4);
                nodes.push((v, g(v)));
            }
            nodes
        };
        let mut nodes = side(-1.0, MOST_NODES);
        let first = -(nodes.len() as f64) * STEP;
        nodes.reverse();
        nodes.push((0.0, g(0.0)));
        nodes.extend(side(1.0, ((reach / STEP).ceil().max(1.0) as usize + 1).min(MOST_NODES)));
        Self::Tabulated(Box::new(CurveTable { first, nodes }))
    }

    /// v after a travel of `by` ≥ 0 from `v`.
    pub(super) fn after(&self, v: f64, by: f64) -> f64 {
        if 1.0 - v <= AT_LIMIT {
            return v;
        }
        match self {
            Self::Power { exponent } => {
                let e = exponent - 1.0;
                if e.abs() < 1e-9 {
                    return 1.0 - (1.0 - v) * (-by).exp();
                }
                // (1 − v)^−e grows by e·ζ
                let grown = (-e * (1.0 - v).ln()).exp() + e * by;
                // below zero (only for i < 1) the limit was reached on the way
                if grown <= 0.0 { 1.0 } else { 1.0 - (-grown.ln() / e).exp() }
            }
            Self::Rational { q } => {
                // with p = −ln(1 − v): ζ = q (1 − e^−p) + (1 − q) p, increasing; for q > 0 concave,
                // so that Newton's method started to the left of the root stays there
                let zeta = |p: f64| q * (1.0 - (-p).exp()) + (1.0 - q) * p;
                let from = -(1.0 - v).ln();
                let to = zeta(from) + by;
                let mut p = from;
                for _ in 0..60 {
                    let step = (to - zeta(p)) / (q * (-p).exp() + 1.0 - q);
                    p += step;
                    if step.abs() < 1e-13 * (1.0 + p.abs()) {
                        break;
                    }
                }
                1.0 - (-p).exp()
            }
            Self::Tabulated(table) => table.at(table.place(v) + by),
        }
    }
}

impl CurveTable {
    fn at(&self, zeta: f64) -> f64 {
        let place = (zeta - self.first) / STEP;
        let cell = (place.floor().max(0.0) as usize).min(self.nodes.len() - 2);
        let t = place - cell as f64;
        if t > 1.0 {
            // beyond the last node the force is at its limit
            return self.nodes[self.nodes.len() - 1].0.min(1.0);
        }
        self.cubic(cell, t).min(1.0)
    }

    /// Hermite's cubic at the fraction `t` of a cell.
    fn cubic(&self, cell: usize, t: f64) -> f64 {
        let ((from, slope), (to, end)) = (self.nodes[cell], self.nodes[cell + 1]);
        let (square, cube) = (t * t, t * t * t);
        (2.0 * cube - 3.0 * square + 1.0) * from
            + (cube - 2.0 * square + t) * STEP * slope
            + (3.0 * square - 2.0 * cube) * to
            + (cube - square) * STEP * end
    }

    /// ζ of a v.
    fn place(&self, v: f64) -> f64 {
        let cell = self.nodes.partition_point(|(node, _)| *node <= v).clamp(1, self.nodes.len() - 1) - 1;
        let (from, to) = (self.nodes[cell].0, self.nodes[cell + 1].0);
        // the cell is almost straight, and ascends
        let (mut low, mut high) = (0.0, 1.0);
        let mut t = ((v - from) / (to - from)).clamp(0.0, 1.0);
        for _ in 0..60 {
            let off = self.cubic(cell, t) - v;
            if off > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let slope = (self.cubic(cell, t + 1e-6) - self.cubic(cell, t - 1e-6)) / 2e-6;
            let next = t - off / slope;
            let next = if next >= low && next <= high { next } else { 0.5 * (low + high) };
            if (next - t).abs() < 1e-13 {
                break;
            }
            t = next;
        }
        self.first + (cell as f64 + t) * STEP
    }
}
