//! The whole state by e^{AT}: no modes needed, and the baseline the modal stepper is measured against.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector2};

use super::{Aimed, SIGNALS, ScanForces};

/// Steps x' = A x + b f exactly.
#[derive(Debug, Clone)]
pub struct ExponentialStepper {
    a: Arc<DMatrix<f64>>,
    period_s: f64,
    turn: Arc<DMatrix<f64>>,
    x: DVector<f64>,
    next: DVector<f64>,
    rows: DMatrix<f64>,
    hammer: DVector<f64>,
    shaker: DVector<f64>,
    /// Effect of a whole scan of a sine of the keyed Ω (its bits), as [`forced`] gives it.
    whole_scans: Vec<(u64, DMatrix<f64>)>,
}

impl ExponentialStepper {
    /// At rest, with the scan period `period_s`; `turn` is [`ExponentialStepper::turn`] of the same `a` and period.
    pub fn new(a: &Arc<DMatrix<f64>>, turn: &Arc<DMatrix<f64>>, aimed: &Aimed, period_s: f64) -> Self {
        let order = a.nrows();
        // A steady force is a sine held at its crest: Ω = 0, phase π/2.
        let shaker = forced(a, &aimed.shaker, 0.0, period_s).column(0).into_owned();
        Self {
            a: Arc::clone(a),
            period_s,
            turn: Arc::clone(turn),
            x: DVector::zeros(order),
            next: DVector::zeros(order),
            rows: DMatrix::from_fn(SIGNALS, order, |i, j| aimed.rows[i][j]),
            hammer: aimed.hammer.clone(),
            shaker,
            whole_scans: Vec::new(),
        }
    }

    /// e^{AT}.
    pub fn turn(a: &DMatrix<f64>, period_s: f64) -> DMatrix<f64> {
        (a * period_s).exp()
    }

    /// Advances one scan period.
    pub fn advance(&mut self, forces: &ScanForces<'_>) {
        self.turn.mul_to(&self.x, &mut self.next);
        std::mem::swap(&mut self.x, &mut self.next);
        if forces.shaker_n != 0.0 {
            self.x.axpy(forces.shaker_n, &self.shaker, 1.0);
        }
        for segment in forces.hammer {
            let Some((a, b)) = segment.overlap(forces.from_s, forces.to_s) else { continue };
            let angle = segment.angle(a);
            let sine = Vector2::new(angle.sin(), angle.cos()) * segment.amplitude_n;
            if a == forces.from_s && b == forces.to_s {
                let gained = self.whole_scan(segment.omega) * sine;
                self.x += gained;
            } else {
                let gained = forced(&self.a, &self.hammer, segment.omega, b - a) * sine;
                self.x += (&*self.a * (forces.to_s - b)).exp() * gained;
            }
        }
    }

    /// The signals now.
    pub fn signals(&self) -> [f64; SIGNALS] {
        let seen = &self.rows * &self.x;
        std::array::from_fn(|signal| seen[signal])
    }

    /// The state x (2n).
    pub fn state(&self) -> DVector<f64> {
        self.x.clone()
    }

    fn whole_scan(&mut self, omega: f64) -> &DMatrix<f64> {
        let key = omega.to_bits();
        let at = self.whole_scans.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
            // A contact's Ω is its own; the last few are all that can be in flight.
            if self.whole_scans.len() == 8 {
                self.whole_scans.remove(0);
            }
            self.whole_scans.push((key, forced(&self.a, &self.hammer, omega, self.period_s)));
            self.whole_scans.len() - 1
        });
        &self.whole_scans[at].1
    }
}

/// What the state has gained after `h` from b · (s(t)) with s' = Ω c, c' = −Ω s: 2n × 2, to be applied to (s, c) at the start.
///
/// The exponential of the augmented matrix [A, b, 0; 0, 0, Ω; 0, −Ω, 0] h holds it exactly.
fn forced(a: &DMatrix<f64>, b: &DVector<f64>, omega: f64, h: f64) -> DMatrix<f64> {
    let order = a.nrows();
    let mut augmented = DMatrix::zeros(order + 2, order + 2);
    augmented.view_mut((0, 0), (order, order)).copy_from(a);
    augmented.view_mut((0, order), (order, 1)).copy_from(b);
    augmented[(order, order + 1)] = omega;
    augmented[(order + 1, order)] = -omega;
    (augmented * h).exp().view((0, order), (order, 2)).into_owned()
}
