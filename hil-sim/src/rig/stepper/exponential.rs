//! Advances the whole state by e^{AT}: needs no modes, and is the baseline for the modal stepper.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector2};

use super::{Aimed, Joint, SIGNALS, ScanForces, Span};

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
    /// Effect of a sine over a whole scan, keyed by the bits of Ω, as returned by [`forced`].
    whole_scans: Vec<(u64, DMatrix<f64>)>,
    joint: Option<Jointed>,
    fixed: Vec<DVector<f64>>,
    kept: DVector<f64>,
}

/// Additional matrices for the joint.
#[derive(Debug, Clone)]
struct Jointed {
    row: DVector<f64>,
    /// Gain over a scan and over a step from a force that falls from 1 N to zero, and from one that
    /// rises from zero to 1 N (2n × 2).
    scan: DMatrix<f64>,
    step: DMatrix<f64>,
    /// e^{Ah} of a step, and the effect of 1 N of the shaker during it.
    turn: DMatrix<f64>,
    shaker: DVector<f64>,
}

impl Jointed {
    fn new(a: &DMatrix<f64>, joint: &Joint, shaker: &DVector<f64>, period_s: f64) -> Self {
        Self {
            row: joint.row.clone(),
            scan: ramps(a, &joint.column, period_s),
            step: ramps(a, &joint.column, joint.step_s),
            turn: ExponentialStepper::turn(a, joint.step_s),
            shaker: forced(a, shaker, 0.0, joint.step_s).column(0).into_owned(),
        }
    }
}

impl ExponentialStepper {
    /// At rest, with the scan period `period_s`; `turn` is [`ExponentialStepper::turn`] of the same
    /// `a` and period.
    pub fn new(a: &Arc<DMatrix<f64>>, turn: &Arc<DMatrix<f64>>, aimed: &Aimed, period_s: f64) -> Self {
        let order = a.nrows();
        // A constant force is a sine held at its crest: Ω = 0, phase π/2.
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
            joint: aimed.joint.as_ref().map(|joint| Jointed::new(a, joint, &aimed.shaker, period_s)),
            fixed: aimed.fixed.rows.clone(),
            kept: DVector::zeros(order),
        }
    }

    /// e^{AT}.
    pub fn turn(a: &DMatrix<f64>, period_s: f64) -> DMatrix<f64> {
        (a * period_s).exp()
    }

    /// Advances one scan period, or one of its steps.
    pub fn advance(&mut self, span: Span, forces: &ScanForces<'_>) {
        let (turn, shaker) = match (&self.joint, span) {
            (Some(joint), Span::Step) => (&joint.turn, &joint.shaker),
            _ => (&*self.turn, &self.shaker),
        };
        turn.mul_to(&self.x, &mut self.next);
        std::mem::swap(&mut self.x, &mut self.next);
        if forces.shaker_n != 0.0 {
            self.x.axpy(forces.shaker_n, shaker, 1.0);
        }
        for segment in forces.hammer {
            let Some((a, b)) = segment.overlap(forces.from_s, forces.to_s) else { continue };
            let angle = segment.angle(a);
            let sine = Vector2::new(angle.sin(), angle.cos()) * segment.amplitude_n;
            if span == Span::Scan && a == forces.from_s && b == forces.to_s {
                let gained = self.whole_scan(segment.omega) * sine;
                self.x += gained;
            } else {
                let gained = forced(&self.a, &self.hammer, segment.omega, b - a) * sine;
                self.x += (&*self.a * (forces.to_s - b)).exp() * gained;
            }
        }
    }

    /// As [`super::ModalStepper::push`].
    pub fn push(&mut self, span: Span, from_n: f64, to_n: f64) {
        let Some(joint) = &self.joint else { return };
        let ramps = if span == Span::Scan { &joint.scan } else { &joint.step };
        self.x += ramps * Vector2::new(from_n, to_n);
    }

    /// Current y of the joint (m).
    pub fn joint(&self) -> f64 {
        self.joint.as_ref().map_or(0.0, |joint| joint.row.dot(&self.x))
    }

    /// As [`super::ModalStepper::receptance`].
    pub fn receptance(&self) -> f64 {
        self.joint.as_ref().map_or(0.0, |joint| joint.row.dot(&joint.step.column(1)))
    }

    /// Saves the state.
    pub fn keep(&mut self) {
        self.kept.copy_from(&self.x);
    }

    /// Restores the saved state.
    pub fn go_back(&mut self) {
        self.x.copy_from(&self.kept);
    }

    /// The current signals.
    pub fn signals(&self) -> [f64; SIGNALS] {
        let seen = &self.rows * &self.x;
        std::array::from_fn(|signal| seen[signal])
    }

    /// The current signals of the fixed vibrometers.
    pub fn fixed(&self, into: &mut [f64]) {
        for (signal, row) in into.iter_mut().zip(&self.fixed) {
            *signal = row.dot(&self.x);
        }
    }

    /// The state x (2n).
    pub fn state(&self) -> DVector<f64> {
        self.x.clone()
    }

    /// As [`super::Stepper::set_state`].
    pub fn set_state(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
    }

    fn whole_scan(&mut self, omega: f64) -> &DMatrix<f64> {
        let key = omega.to_bits();
        let at = self.whole_scans.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
            // Each contact has a different Ω; no more than the last few can be active.
            if self.whole_scans.len() == 8 {
                self.whole_scans.remove(0);
            }
            self.whole_scans.push((key, forced(&self.a, &self.hammer, omega, self.period_s)));
            self.whole_scans.len() - 1
        });
        &self.whole_scans[at].1
    }
}

/// Gain of the state after `h` from b · s(t) with s' = Ω c, c' = −Ω s: 2n × 2, to be applied to (s,
/// c) at the start.
///
/// It is contained exactly in the exponential of the augmented matrix [A, b, 0; 0, 0, Ω; 0, −Ω, 0]
/// h.
fn forced(a: &DMatrix<f64>, b: &DVector<f64>, omega: f64, h: f64) -> DMatrix<f64> {
    let order = a.nrows();
    let mut augmented = DMatrix::zeros(order + 2, order + 2);
    augmented.view_mut((0, 0), (order, order)).copy_from(a);
    augmented.view_mut((0, order), (order, 1)).copy_from(b);
    augmented[(order, order + 1)] = omega;
    augmented[(order + 1, order)] = -omega;
    (augmented * h).exp().view((0, order), (order, 2)).into_owned()
}

/// Gain of the state after `h` from b f with f falling from one to zero, and rising from zero to
/// one: 2n × 2.
fn ramps(a: &DMatrix<f64>, b: &DVector<f64>, h: f64) -> DMatrix<f64> {
    let order = a.nrows();
    // The exponential of [A h, b h, 0; 0, 0, 1; 0, 0, 0] contains the effects of a constant and of
    // a rising unit force.
    let mut augmented = DMatrix::zeros(order + 2, order + 2);
    augmented.view_mut((0, 0), (order, order)).copy_from(&(a * h));
    augmented.view_mut((0, order), (order, 1)).copy_from(&(b * h));
    augmented[(order, order + 1)] = 1.0;
    let mut gained = augmented.exp().view((0, order), (order, 2)).into_owned();
    let rising = gained.column(1).into_owned();
    let mut falling = gained.column_mut(0);
    falling -= rising;
    gained
}
