//! Corrections applied to a loop in gross slip before its figures are computed: a delay of the
//! force, a dashpot parallel to the friction.
//!
//! Decomposes a slipping loop into friction, a parallel dashpot, and a delay of the force.
//!
//! Friction of any kind depends on position and on the last reversals, not on velocity. The
//! averaged loop is therefore written as a sum of Jenkins elements of all reaches with non-negative
//! weights (Iwan's model), plus c Δẋ, for a force delayed by τ. A delay shifts the corners and
//! tilts the flanks, a dashpot bends the plateaus, and friction can produce neither. If the loop
//! has both flanks and plateaus, τ and c can be separated from each other and from any law of
//! friction.

use super::LoopFinding;
use super::loops::Cycle;
use nalgebra::{DMatrix, DVector};

/// A shorter delay is not corrected, s: channels are never aligned better than this.
const LATE_S: f64 = 8e-6;

/// A delay below this many samples does not show in a loop of few samples and is not corrected
/// either.
const LATE_SAMPLES: f64 = 0.4;

/// A dashpot whose force stays below this fraction of the loop's force is not corrected.
const VISCOUS: f64 = 0.02;

/// Both must exceed this many of their standard deviations,
const SIGNIFICANT: f64 = 5.0;

/// and the sum of squares without them must be larger by this factor.
const BETTER: f64 = 1.5;

/// Corrections to the force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Repair {
    /// Delay of the force, in points of the cycle.
    late_points: f64,
    /// Viscous damping coefficient, N s/m.
    viscous: f64,
    /// Relative uncertainty of the correction.
    unsure: f64,
}

/// The delay found must leave less than this fraction of the sum of squares,
const EXPLAINS: f64 = 0.25;

/// be at least this fraction of the cycle (a small delay preserves the loop's shape, and is fitted
/// together with the dashpot),
const SHORTEST: f64 = 0.01;

/// and be no longer than this fraction: beyond it, the force may equally have the wrong sign.
const LONGEST: f64 = 0.25;

/// Friction alone explains a loop if it leaves at most this fraction of the force (rms). It may
/// take a delay for friction of short reach, and then leaves little.
const ALONE: f64 = 0.003;

/// Result of a search for a delay over the whole cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Delay {
    /// The loop is not delayed.
    None,
    /// This delay explains it, s (and its standard deviation).
    Found(f64, f64),
    /// It looks delayed by this much, s (and its standard deviation), but the delay does not
    /// explain it.
    NotExplained(f64, f64),
    /// A dashpot parallel to the friction explains the loop about as well as a delay of the force
    /// by this much, s (negative if the force leads, as for any dashpot that dissipates; and its
    /// standard deviation).
    OrDamped(f64, f64),
}

/// Whether a loop that bends is a friction loop whose force is shifted so far in time that its
/// figures are invalid.
pub(super) fn delay(mean: &Cycle, dt_s: f64, play_m: f64) -> Delay {
    let Some(fit) = LawFit::far(mean, dt_s, play_m) else { return Delay::None };
    let [left, without_delay, _] = fit.residuals;
    let [by_s, std_s] = fit.late_s;
    let explains = |than: f64| left <= EXPLAINS * than && unexplained(than, &mean.force_n);
    let part = |late_s: f64| late_s.abs() / (dt_s * mean.force_n.len() as f64);
    if explains(without_delay) && part(by_s) >= SHORTEST {
        return if unexplained(left, &mean.force_n) || part(by_s) > LONGEST {
            Delay::NotExplained(by_s, std_s)
        } else {
            Delay::Found(by_s, std_s)
        };
    }
    // friction and a dashpot may explain it as well
    let alone_s = fit.undamped_s;
    let squares: f64 = mean.force_n.iter().map(|t| t * t).sum();
    let alone_explains = fit.friction_alone < ALONE.powi(2) * squares || left > EXPLAINS * fit.friction_alone;
    if alone_explains || part(alone_s) < 0.5 * SHORTEST || unexplained(left, &mean.force_n) {
        Delay::None
    } else {
        Delay::OrDamped(alone_s, std_s)
    }
}

impl Repair {
    /// The correction for the averaged loop of a contact in gross slip, and the findings to report.
    /// `late_s` has already been removed from `mean`; it is included in the reported delay.
    pub fn of(mean: &Cycle, dt_s: f64, play_m: f64, late_s: f64) -> (Self, Vec<LoopFinding>) {
        let (mut repair, mut said) = (Self { late_points: late_s / dt_s, ..Self::default() }, Vec::new());
        let Some(fit) = LawFit::of(mean, dt_s, play_m) else { return (repair, said) };
        let [left, without_delay, without_dashpot] = fit.residuals;
        let [more_s, std_s] = fit.late_s;
        let needed = more_s.abs() > LATE_S.max(SIGNIFICANT * std_s).max(LATE_SAMPLES * dt_s)
            && without_delay > BETTER * left;
        if needed || late_s != 0.0 {
            let by_s = late_s + more_s;
            repair.late_points = by_s / dt_s;
            repair.unsure = std_s / by_s.abs();
            said.push(LoopFinding::LateForce { by_s, std_s, at_least: false, corrected: true });
        }
        let [viscous_n_s_per_m, std_n_s_per_m] = fit.viscous_n_s_per_m;
        let fastest = mean.velocity_m_per_s.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let force_n = viscous_n_s_per_m * fastest;
        let most = mean.force_n.iter().map(|t| t.abs()).fold(0.0, f64::max);
        if force_n > VISCOUS * most
            && viscous_n_s_per_m > SIGNIFICANT * std_n_s_per_m
            && without_dashpot > BETTER * left
        {
            repair.viscous = viscous_n_s_per_m;
            repair.unsure = repair.unsure.max(std_n_s_per_m / viscous_n_s_per_m);
            said.push(LoopFinding::Viscous { viscous_n_s_per_m, std_n_s_per_m, force_n });
        }
        (repair, said)
    }

    /// A delay of the force only, with its standard deviation.
    pub fn in_step_by(late_s: f64, std_s: f64, dt_s: f64) -> Self {
        let unsure = if late_s == 0.0 { 0.0 } else { std_s / late_s.abs() };
        Self { late_points: late_s / dt_s, unsure, ..Self::default() }
    }

    /// Whether there is anything to correct.
    pub fn is_some(&self) -> bool {
        self.late_points != 0.0 || self.viscous != 0.0
    }

    /// Whether the force is delayed.
    pub fn is_late(&self) -> bool {
        self.late_points != 0.0
    }

    /// Relative uncertainty of the correction.
    pub fn unsure(&self) -> f64 {
        self.unsure
    }

    /// The cycle with its force aligned in time.
    pub fn in_step(&self, cycle: &Cycle) -> Cycle {
        Cycle { force_n: earlier(&cycle.force_n, self.late_points), ..cycle.clone() }
    }

    /// The cycle with its friction force only.
    pub fn friction(&self, cycle: &Cycle) -> Cycle {
        let mut cycle = self.in_step(cycle);
        for (t, v) in cycle.force_n.iter_mut().zip(&cycle.velocity_m_per_s) {
            *t -= self.viscous * v;
        }
        cycle
    }
}

/// Number of reaches of elements over the whole stroke, and around the one that carries most.
const COARSE: usize = 16;
const FINE: usize = 24;

/// Refinement around the element that carries most: relative spread of the reaches, and the number
/// of elements for each.
const CLOSER: [f64; 2] = [0.06, 0.015];
const FINER: usize = 11;

/// Range of small delays that is searched, s.
const DELAY_S: [f64; 2] = [-2e-4, 3e-4];

/// Steps of the first search.
const STEPS: usize = 21;

/// Number of delays tried over a whole cycle.
const AROUND: usize = 64;

/// The delay's standard deviation is at least this fraction of the time between points, however low
/// the noise.
const BETWEEN_POINTS: f64 = 0.05;

/// Step for the second differences of the residual: this fraction of a cycle, or this time (s),
/// whichever is longer.
const PROBE_CYCLES: f64 = 1e-4;
const PROBE_S: f64 = 1e-5;

/// Maximum number of columns that may join the active set: a straight flank needs three, a bent one
/// a dozen.
const ROUNDS: usize = 60;

/// Residuals of neighbouring points are correlated, so the plain formula underestimates the
/// standard deviation by this factor.
const TOGETHER: f64 = 3.0;

/// Result of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LawFit {
    /// τ, s, and its standard deviation.
    pub late_s: [f64; 2],
    /// c, N s/m, and its standard deviation.
    pub viscous_n_s_per_m: [f64; 2],
    /// Sums of squared residuals: with both, without the delay, without the dashpot.
    pub residuals: [f64; 3],
    /// The delay found with friction but no dashpot, s.
    pub undamped_s: f64,
    /// Sum of squared residuals of friction alone, without delay and dashpot.
    pub friction_alone: f64,
}

/// Least squares with non-negative weights, except for the last column.
struct LeastSquares {
    columns: DMatrix<f64>,
    gram: DMatrix<f64>,
    /// Divisors that normalised the columns to unit length.
    scale: Vec<f64>,
}

impl LeastSquares {
    fn new(cycle: &Cycle, reaches: &[f64], play_m: f64) -> Self {
        let points = cycle.displacement_m.len();
        let mut columns = DMatrix::zeros(points, reaches.len() + 2);
        for (j, reach) in reaches.iter().enumerate() {
            columns.set_column(j, &element(&cycle.displacement_m, *reach, play_m));
        }
        columns.set_column(reaches.len(), &DVector::from_column_slice(&cycle.displacement_m));
        columns.set_column(reaches.len() + 1, &DVector::from_column_slice(&cycle.velocity_m_per_s));
        let mut scale = Vec::new();
        for mut column in columns.column_iter_mut() {
            column.add_scalar_mut(-column.mean());
            let norm = column.norm();
            scale.push(norm);
            if norm > 0.0 {
                column /= norm;
            }
        }
        let gram = columns.tr_mul(&columns);
        Self { columns, gram, scale }
    }

    /// Weights of the normalised columns and the sum of squared residuals, with or without the
    /// dashpot: the active-set method of Lawson and Hanson, in which the dashpot may have either
    /// sign.
    fn solved(&self, force: &DVector<f64>, dashpot: bool) -> (DVector<f64>, f64) {
        let right = self.columns.tr_mul(force);
        let (count, free) = (right.len(), right.len() - 1);
        let mut weights = DVector::zeros(count);
        let mut active: Vec<usize> = if dashpot { vec![free] } else { Vec::new() };
        let least = 1e-9 * right.amax();
        for _ in 0..ROUNDS {
            let slopes = &right - &self.gram * &weights;
            let next = (0..free)
                .filter(|j| !active.contains(j) && self.scale[*j] > 0.0)
                .max_by(|&a, &b| slopes[a].total_cmp(&slopes[b]));
            match next {
                Some(j) if slopes[j] > least => active.push(j),
                _ => break,
            }
            // columns whose weight would turn negative leave the active set, the first to reach
            // zero first
            loop {
                let Some(wanted) = self.least_squares(&right, &active) else {
                    active.pop();
                    break;
                };
                let part = |i: usize| {
                    let (j, to) = (active[i], wanted[i]);
                    if j == free || to > 0.0 { 1.0 } else { weights[j] / (weights[j] - to) }
                };
                let step = (0..active.len()).map(part).fold(1.0, f64::min);
                for (i, &j) in active.iter().enumerate() {
                    weights[j] += step * (wanted[i] - weights[j]);
                }
                if step >= 1.0 {
                    break;
                }
                active.retain(|&j| j == free || weights[j] > 1e-12 * right.amax());
                (0..free).filter(|j| !active.contains(j)).for_each(|j| weights[j] = 0.0);
            }
        }
        let left = (force - &self.columns * &weights).norm_squared();
        (weights, left)
    }

    /// Weights of these columns alone; `None` if they are linearly dependent.
    fn least_squares(&self, right: &DVector<f64>, active: &[usize]) -> Option<DVector<f64>> {
        let ridge = |i, j| if i == j { 1e-11 } else { 0.0 };
        let gram = DMatrix::from_fn(active.len(), active.len(), |i, j| {
            self.gram[(active[i], active[j])] + ridge(i, j)
        });
        let own = DVector::from_fn(active.len(), |i, _| right[active[i]]);
        Some(gram.cholesky()?.solve(&own))
    }
}

/// Force per stiffness of a Jenkins element of this reach (m) with this play (m) over the cycle;
/// from the second pass on it is periodic.
fn element(x: &[f64], reach: f64, play_m: f64) -> DVector<f64> {
    let mut slider = 0.0;
    let mut carried = DVector::zeros(x.len());
    for _ in 0..2 {
        for (x, carried) in x.iter().zip(carried.iter_mut()) {
            let apart = x - slider;
            let taken_up = apart.clamp(-0.5 * play_m, 0.5 * play_m);
            *carried = (apart - taken_up).clamp(-reach, reach);
            // the slider moves by the amount that exceeds play and reach
            slider += apart - taken_up - *carried;
        }
    }
    carried
}

impl LawFit {
    /// Decomposes the averaged loop of a contact in gross slip, with `dt_s` between its points and
    /// `play_m` of play in it. `None` for a loop that does not move.
    ///
    /// Small delays are searched first. A larger delay of either sign is searched over the whole
    /// cycle; it is preferred if it leaves less than half of the sum of squares and a negligible
    /// part of the loop.
    pub fn of(cycle: &Cycle, dt_s: f64, play_m: f64) -> Option<Self> {
        let near = Self::within(cycle, dt_s, play_m, 0.0, DELAY_S)?;
        let [low, high] = DELAY_S;
        match Self::far(cycle, dt_s, play_m) {
            Some(far)
                if !(low..high).contains(&far.late_s[0])
                    && far.residuals[0] < 0.5 * near.residuals[0]
                    && !unexplained(far.residuals[0], &cycle.force_n) =>
            {
                Some(far)
            }
            _ => Some(near),
        }
    }

    /// The same for a delay of any fraction of the cycle.
    pub fn far(cycle: &Cycle, dt_s: f64, play_m: f64) -> Option<Self> {
        let half = 0.5 * super::loops::swing(&cycle.displacement_m);
        if half.is_nan() || half <= 0.0 {
            return None;
        }
        let problem = LeastSquares::new(cycle, &spread(0.01 * half, half, COARSE), play_m);
        let period_s = dt_s * cycle.force_n.len() as f64;
        let step_s = period_s / AROUND as f64;
        let left = |late_s: f64| problem.solved(&shifted(&cycle.force_n, late_s / dt_s), true).1;
        let delays = (0..AROUND).map(|i| (i as f64 + 1.0) * step_s - 0.5 * period_s);
        let (first, _) = delays.map(|late_s| (late_s, left(late_s))).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let centre_s = closest(&problem, cycle, dt_s, true, first, step_s);
        // the coarse elements may imitate a delay of about one step
        let around = DELAY_S.map(|end| centre_s + end.signum() * end.abs().max(1.5 * step_s));
        Self::within(cycle, dt_s, play_m, centre_s, around)
    }

    /// The same for a delay within this range, s, starting at `first_s`.
    fn within(cycle: &Cycle, dt_s: f64, play_m: f64, first_s: f64, range_s: [f64; 2]) -> Option<Self> {
        let points = cycle.force_n.len();
        let half = 0.5 * super::loops::swing(&cycle.displacement_m);
        if half.is_nan() || half <= 0.0 {
            return None;
        }
        let step_s = (range_s[1] - range_s[0]) / (STEPS - 1) as f64;
        let mut reaches = spread(0.01 * half, half, COARSE);
        let coarse = LeastSquares::new(cycle, &reaches, play_m);
        let (weights, _) = coarse.solved(&shifted(&cycle.force_n, first_s / dt_s), true);
        let most = centre(&coarse, &weights, &reaches)?;
        reaches.extend(spread(0.7 * most, 1.4 * most, FINE));
        // each pass refines the elements around the one that carries most, at the delay found by
        // the last pass: otherwise a corner between two reaches would look like a delay
        let mut late = 0.0;
        for width in CLOSER {
            let problem = LeastSquares::new(cycle, &reaches, play_m);
            late = earliest(&problem, cycle, dt_s, true, range_s);
            let (weights, _) = problem.solved(&shifted(&cycle.force_n, late / dt_s), true);
            let about = centre(&problem, &weights, &reaches)?;
            reaches.extend(spread(about * (1.0 - width), about * (1.0 + width), FINER));
        }
        let problem = LeastSquares::new(cycle, &reaches, play_m);
        let free = reaches.len() + 1;
        let at = |late_s: f64, dashpot: bool| {
            let (weights, left) = problem.solved(&shifted(&cycle.force_n, late_s / dt_s), dashpot);
            (left, weights[free] / problem.scale[free])
        };
        late = closest(&problem, cycle, dt_s, true, late, step_s);
        let (left, viscous) = at(late, true);
        let without_delay = at(0.0, true).0;
        let undamped = closest(&problem, cycle, dt_s, false, late, step_s);
        let without_dashpot = at(undamped, false).0;
        let variance = TOGETHER * left / points.saturating_sub(8).max(1) as f64;
        let probe = PROBE_S.max(PROBE_CYCLES * points as f64 * dt_s);
        let bend = (at(late - probe, true).0 - 2.0 * left + at(late + probe, true).0) / (probe * probe);
        let std_s = if bend > 0.0 { (2.0 * variance / bend).sqrt() } else { f64::INFINITY };
        // corners lie between points, and interpolation rounds them
        let std_s = std_s.hypot(BETWEEN_POINTS * dt_s);
        // part of the velocity that the other columns do not explain: at least half in a loop with
        // flanks and plateaus
        let std_n_s_per_m = variance.sqrt() / (0.5 * problem.scale[free]);
        Some(Self {
            late_s: [late, std_s],
            viscous_n_s_per_m: [viscous, std_n_s_per_m],
            residuals: [left, without_delay, without_dashpot],
            undamped_s: undamped,
            friction_alone: at(0.0, false).0,
        })
    }
}

/// A friction law that leaves more than this fraction of the force (rms) does not explain a loop.
const UNEXPLAINED: f64 = 0.02;

/// Whether a sum of squared residuals is larger than a friction law may leave of this force.
pub(super) fn unexplained(left: f64, force_n: &[f64]) -> bool {
    left > UNEXPLAINED.powi(2) * force_n.iter().map(|t| t * t).sum::<f64>()
}

/// Reaches between two limits, evenly spaced in their logarithm.
fn spread(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| from * (to / from).powf(i as f64 / (count - 1) as f64)).collect()
}

/// Reach of the element that carries most, averaged with its neighbours.
fn centre(problem: &LeastSquares, weights: &DVector<f64>, reaches: &[f64]) -> Option<f64> {
    let carries = |j: usize| {
        if problem.scale[j] > 0.0 { weights[j] / problem.scale[j] * reaches[j] } else { 0.0 }
    };
    let most = (0..reaches.len()).max_by(|&a, &b| carries(a).total_cmp(&carries(b)))?;
    let near = |j: &usize| (reaches[*j] / reaches[most]).ln().abs() < 0.1;
    let (sum, weight) = (0..reaches.len())
        .filter(near)
        .fold((0.0, 0.0), |(sum, weight), j| (sum + carries(j) * reaches[j], weight + carries(j)));
    (weight > 0.0).then(|| sum / weight)
}

/// The delay (s) within a range that leaves the smallest sum of squares.
fn earliest(problem: &LeastSquares, cycle: &Cycle, dt_s: f64, dashpot: bool, [from, to]: [f64; 2]) -> f64 {
    let step = (to - from) / (STEPS - 1) as f64;
    let left = |late_s: &f64| problem.solved(&shifted(&cycle.force_n, late_s / dt_s), dashpot).1;
    let all: Vec<(f64, f64)> =
        (0..STEPS).map(|i| from + step * i as f64).map(|late_s| (late_s, left(&late_s))).collect();
    let first = all.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(from, |(late_s, _)| *late_s);
    closest(problem, cycle, dt_s, dashpot, first, step)
}

/// The same near `centre`, by successive parabolas through three delays that are `width` apart,
/// with decreasing width.
fn closest(
    problem: &LeastSquares,
    cycle: &Cycle,
    dt_s: f64,
    dashpot: bool,
    mut centre: f64,
    mut width: f64,
) -> f64 {
    let left = |late_s: f64| problem.solved(&shifted(&cycle.force_n, late_s / dt_s), dashpot).1;
    for _ in 0..6 {
        let [l, m, r] = [-1.0, 0.0, 1.0].map(|o| left(centre + o * width));
        let bend = l - 2.0 * m + r;
        if bend > 0.0 {
            centre += (0.5 * (l - r) / bend).clamp(-1.0, 1.0) * width;
        }
        width *= 0.5;
    }
    centre
}

/// The force of the closed cycle, advanced by `points` points, with cubic interpolation.
fn shifted(force: &[f64], points: f64) -> DVector<f64> {
    DVector::from_vec(earlier(force, points))
}

/// A closed cycle advanced by `points` points.
pub(super) fn earlier(x: &[f64], points: f64) -> Vec<f64> {
    let n = x.len().cast_signed();
    let (whole, t) = (points.floor() as isize, points - points.floor());
    (0..n)
        .map(|i| {
            let [p0, p1, p2, p3] = [-1, 0, 1, 2].map(|o| x[(i + whole + o).rem_euclid(n).unsigned_abs()]);
            p1 + 0.5
                * t
                * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)))
        })
        .collect()
}
