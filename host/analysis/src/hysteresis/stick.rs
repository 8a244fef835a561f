//! The stick part of a slipping loop, and its plateau.
//!
//! After each reversal the whole contact sticks again. The part used for k_T is chosen by *force*,
//! as a fraction of the swing from one reversal to the next. Which part depends on how the contact
//! starts to slip:
//!
//! - If the whole contact slips at the same force, the flank is straight up to the plateau, and 10
//!   to 90 % of it are used. When such a contact sticks again the structure rings, with a period of
//!   3 ms where the whole flank takes 4 to 8 ms, and the ringing accelerates the static arm, whose
//!   inertia acts on the load cells. A shorter part covers only half a period: 20 to 40 % gives
//!   errors from −6 to +4 % of the stiffness.
//! - If microslip bends the flank, the first 20 % are used, extrapolated to the reversal from the
//!   slopes of its halves: later parts underestimate it (half the swing gives 132 for 143.7 N/µm on
//!   an Iwan contact).
//! - Without a plateau there is no ringing: 20 to 40 % are used, clear of the reversal where Δx
//!   hardly moves; or the first 20 % if the flank has bent by then.
//!
//! The flat parts of a loop: the plateaus of gross slip (the friction limit at the middle of the
//! stroke, and its dependence on position), and play, where the contact moves at constant force.

use super::loops::Cycle;
use super::loops::{slope, swing};

/// A part of the force's swing after a reversal, from the first to the second fraction.
pub(super) type SwingPart = [f64; 2];

/// Part used of a straight flank up to a plateau.
const FLANK: SwingPart = [0.10, 0.90];

/// Its halves, used to check that it is straight.
const HALVES: [SwingPart; 2] = [[0.10, 0.50], [0.50, 0.90]];

/// Part used of a flank with play: the play occurs where the force is zero, half the swing after
/// the reversal.
pub(super) const BEFORE_PLAY: SwingPart = [0.10, 0.40];

/// A flank counts as straight if the slope of its later half is at least this fraction of that of
/// the earlier half: ringing alone leaves 0.95 or more, whereas the halves of an Iwan contact
/// differ by a third.
const STRAIGHT_FLANK: f64 = 0.9;

/// Part used of a straight contact without a plateau.
const LATE: SwingPart = [0.20, 0.40];

/// Part used of a bending one. The first samples after a reversal are excluded: they hardly move,
/// and their displacement is noise of the integration.
const EARLY: SwingPart = [0.02, 0.20];

/// The flank counts as straight if the later part has at least this fraction of the earlier one's
/// slope.
const STRAIGHT: f64 = 0.95;

/// Fewest samples on both branches needed for a slope.
const FEWEST_SAMPLES: usize = 6;

/// The plateau begins where the force first reaches this fraction of its swing.
const PLATEAU_START: f64 = 0.98;

/// Fraction of each stroke, at its end and measured by displacement, in which the final tangent is
/// taken.
const STROKE_END: f64 = 0.15;

/// One stroke from a reversal to the next: indices into the cycle, in order, wrapping around.
type Stroke = Vec<usize>;

/// The two strokes of a loop, split at the extremes of `guide`'s displacement. `guide` is the
/// averaged loop, so that all cycles are split alike and their noise does not shift the reversal.
pub(super) fn strokes(guide: &Cycle) -> [Stroke; 2] {
    let x = &guide.displacement_m;
    let extreme =
        |sign: f64| (0..x.len()).max_by(|&a, &b| (sign * x[a]).total_cmp(&(sign * x[b]))).unwrap_or(0);
    let (top, bottom) = (extreme(1.0), extreme(-1.0));
    let run = |from: usize, to: usize| {
        let n = x.len();
        (0..=(to + n - from) % n).map(|i| (from + i) % n).collect()
    };
    [run(top, bottom), run(bottom, top)]
}

/// Progress of the force through its swing over the stroke, 0…1, for each of the stroke's samples.
fn progress(cycle: &Cycle, stroke: &Stroke) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (stroke.first(), stroke.last()) else { return vec![] };
    let (from, to) = (cycle.force_n[first], cycle.force_n[last]);
    stroke.iter().map(|&i| (cycle.force_n[i] - from) / (to - from)).collect()
}

/// The part to use for a contact without a plateau, chosen from the averaged loop.
pub(super) fn first_part(guide: &Cycle, strokes: &[Stroke; 2]) -> SwingPart {
    match (slope_over(guide, strokes, EARLY), slope_over(guide, strokes, LATE)) {
        (Some(early), Some(late)) if late < STRAIGHT * early => EARLY,
        (_, Some(_)) => LATE,
        _ => EARLY,
    }
}

/// The part to use for a contact with a plateau, chosen from the averaged loop.
pub(super) fn flank_part(guide: &Cycle, strokes: &[Stroke; 2]) -> SwingPart {
    match HALVES.map(|half| slope_over(guide, strokes, half)) {
        [Some(early), Some(late)] if late < STRAIGHT_FLANK * early => EARLY,
        _ => FLANK,
    }
}

/// k_T: pooled least-squares slope of T on Δx over this part of both strokes, N/m. `None` with too
/// few samples in it.
pub(super) fn slope_over(cycle: &Cycle, strokes: &[Stroke; 2], [start, end]: SwingPart) -> Option<f64> {
    let (mut xs, mut ts) = (Vec::new(), Vec::new());
    for stroke in strokes {
        let (mut x, mut t): (Vec<f64>, Vec<f64>) = stroke
            .iter()
            .zip(progress(cycle, stroke))
            .take_while(|(_, p)| *p < end)
            .filter(|(_, p)| *p >= start)
            .map(|(&i, _)| (cycle.displacement_m[i], cycle.force_n[i]))
            .unzip();
        // each stroke has a separate intercept
        for values in [&mut x, &mut t] {
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            for v in values.iter_mut() {
                *v -= mean;
            }
        }
        xs.extend(x);
        ts.extend(t);
    }
    (xs.len() >= FEWEST_SAMPLES).then(|| slope(&xs, &ts))
}

/// k_T if the flank bends: the slopes of both halves of the first part, extrapolated linearly to
/// the reversal. For an Iwan contact whose weakest sliders slip at zero force, the slope of the
/// part as a whole is 6 % too low, for a Dahl contact 11 %. If a half has too few samples, the
/// slope of the whole part is returned.
pub(super) fn tangent_at_reversal(cycle: &Cycle, strokes: &[Stroke; 2]) -> Option<f64> {
    let [start, end] = EARLY;
    let middle = 0.5 * (start + end);
    match (slope_over(cycle, strokes, [start, middle]), slope_over(cycle, strokes, [middle, end])) {
        // from the middle of the first half to the reversal, relative to the distance between both
        // middles
        (Some(first), Some(second)) => {
            Some(first + (first - second) * 0.5 * (start + middle) / (middle - start))
        }
        _ => slope_over(cycle, strokes, EARLY),
    }
}

/// Whether this is the part used for a bending flank.
pub(super) fn bends(part: SwingPart) -> bool {
    part == EARLY
}

/// The tangent at the end of the strokes over `stiffness`: 0 on a plateau, 1 on a straight line.
pub(super) fn final_tangent(cycle: &Cycle, strokes: &[Stroke; 2], stiffness: f64) -> f64 {
    let tangents = strokes.iter().filter_map(|stroke| {
        let (first, last) = (*stroke.first()?, *stroke.last()?);
        let (from, to) = (cycle.displacement_m[first], cycle.displacement_m[last]);
        let (x, t): (Vec<f64>, Vec<f64>) = stroke
            .iter()
            .filter(|&&i| (cycle.displacement_m[i] - from) / (to - from) > 1.0 - STROKE_END)
            .map(|&i| (cycle.displacement_m[i], cycle.force_n[i]))
            .unzip();
        (x.len() >= 3).then(|| slope(&x, &t))
    });
    let tangents: Vec<f64> = tangents.collect();
    tangents.iter().sum::<f64>() / tangents.len().max(1) as f64 / stiffness
}

/// The friction limit μN, N: half the distance between the plateaus' medians. The median is used
/// rather than the peak because load cells ring when a contact starts to slip (241 N for 180 N).
pub(super) fn friction_limit(cycle: &Cycle, strokes: &[Stroke; 2]) -> Option<f64> {
    let mut levels = strokes.iter().map(|stroke| {
        let progress = progress(cycle, stroke);
        let start = progress.iter().position(|p| *p >= PLATEAU_START)?;
        let mut plateau: Vec<f64> = stroke[start..].iter().map(|&i| cycle.force_n[i]).collect();
        plateau.sort_by(f64::total_cmp);
        plateau.get(plateau.len() / 2).copied()
    });
    let (down, up) = (levels.next()??, levels.next()??);
    Some(0.5 * (up - down).abs())
}

/// The plateau begins this many flank lengths after the reversal: the structure rings when the
/// contact starts to slip.
const BEYOND_FLANK: f64 = 1.25;

/// It ends at this fraction of the stroke, before the motion stops.
const UNTIL: f64 = 0.97;

/// Both plateaus as straight lines T = ±μN (1 + a x/X).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plateaus {
    /// μN at the middle, N.
    pub limit_n: f64,
    /// a.
    pub change: f64,
    /// Standard deviation of a.
    pub std: f64,
}

/// A smaller change along the stroke is not reported,
const UNEVEN: f64 = 0.05;

/// nor one below this many standard deviations: ringing is correlated from point to point.
const SIGNIFICANT: f64 = 8.0;

impl Plateaus {
    /// Whether the limit depends on position.
    pub fn is_uneven(&self) -> bool {
        self.change.abs() > UNEVEN.max(SIGNIFICANT * self.std)
    }

    /// From the averaged loop, whose flanks have the stiffness k (N/m), contain `play_m` of play
    /// and end near ± `limit_n`; `None` if the plateaus are too short.
    pub fn of(
        cycle: &Cycle,
        strokes: &[Vec<usize>; 2],
        stiffness: f64,
        limit_n: f64,
        play_m: f64,
    ) -> Option<Self> {
        let x = &cycle.displacement_m;
        let (low, high) =
            x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let (middle, half) = (0.5 * (low + high), 0.5 * swing(x));
        let flank = BEYOND_FLANK * (2.0 * limit_n / stiffness + play_m);
        let mut lines = strokes.iter().map(|stroke| {
            let from = x[*stroke.first()?];
            let inside = |i: &&usize| ((flank)..(UNTIL * 2.0 * half)).contains(&(x[**i] - from).abs());
            let (places, forces): (Vec<f64>, Vec<f64>) =
                stroke.iter().filter(inside).map(|&i| ((x[i] - middle) / half, cycle.force_n[i])).unzip();
            (places.len() >= FEWEST_SAMPLES).then(|| line(&places, &forces))
        });
        let ([down, down_slope, down_var], [up, up_slope, up_var]) = (lines.next()??, lines.next()??);
        let limit = 0.5 * (up - down);
        Some(Self {
            limit_n: limit,
            change: 0.5 * (up_slope - down_slope) / limit,
            std: 0.5 * (down_var + up_var).sqrt() / limit.abs(),
        })
    }
}

/// Value at 0, slope, and the slope's variance.
fn line(x: &[f64], y: &[f64]) -> [f64; 3] {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let steep = slope(x, y);
    let apart: f64 = x.iter().zip(y).map(|(x, y)| (y - my - steep * (x - mx)).powi(2)).sum();
    let spread: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
    [my - steep * mx, steep, apart / (n - 2.0) / spread]
}

/// Half-width of the window of the force's swing in which a flat part is searched, and the step
/// between windows.
const HALF_WINDOW: f64 = 0.05;
const WINDOW_STEP: f64 = 0.025;

/// Width of the windows of the swing before and after it that give the motion without play,
const BESIDE: f64 = 0.12;

/// and the limits for the first and last of them: nearer to the reversal Δx hardly moves, and
/// beyond the second limit a plateau follows.
const ENDS: [f64; 2] = [0.03, 0.92];

/// The flat part needs this many times the motion per force of either neighbouring window,
const FLAT: f64 = 3.0;

/// and this fraction of the motion from reversal to reversal; otherwise it may be noise or ringing.
const LEAST_PLAY: f64 = 0.02;

/// Both strokes must show the same play within this fraction.
const ALIKE: f64 = 0.35;

/// Fewest samples between the ends of a flank needed to find a flat part.
const FEWEST_ON_FLANK: usize = 12;

/// Play between the parts of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Play {
    /// Motion of the contact at constant force, m.
    pub size_m: f64,
    /// Half the difference between both strokes, m.
    pub std_m: f64,
}

impl Play {
    /// From the averaged loop. A contact with play is stiff after the reversal, then moves without
    /// force, and is stiff again; a flank that only bends softens towards its end and has no such
    /// part.
    pub fn of(cycle: &Cycle, strokes: &[Vec<usize>; 2]) -> Option<Self> {
        let least = LEAST_PLAY * swing(&cycle.displacement_m);
        let [one, other] = strokes.each_ref().map(|stroke| flat_part(cycle, stroke));
        let (one, other) = (one.filter(|size| *size > least)?, other.filter(|size| *size > least)?);
        let size_m = 0.5 * (one + other);
        ((one - other).abs() < ALIKE * size_m).then(|| Self { size_m, std_m: 0.5 * (one - other).abs() })
    }
}

/// Motion of the flattest part within one flank in excess of that of the adjacent flank, m.
fn flat_part(cycle: &Cycle, stroke: &[usize]) -> Option<f64> {
    let (first, last) = (*stroke.first()?, *stroke.last()?);
    let (x, t) = (&cycle.displacement_m, &cycle.force_n);
    // fraction of the force's swing, and the motion since the reversal
    let course: Vec<[f64; 2]> =
        stroke.iter().map(|&i| [(t[i] - t[first]) / (t[last] - t[first]), (x[i] - x[first]).abs()]).collect();
    let on_flank = course.iter().filter(|[part, _]| (ENDS[0]..ENDS[1]).contains(part)).count();
    if on_flank < FEWEST_ON_FLANK {
        return None;
    }
    // where the force first reaches a fraction of its swing, by linear interpolation between
    // samples
    let passes = |level: f64| {
        let at = course.iter().position(|[part, _]| *part >= level)?;
        let ([before, from], [after, to]) = (course[at.checked_sub(1)?], course[at]);
        Some(from + (to - from) * (level - before) / (after - before))
    };
    let steps = ((ENDS[1] - ENDS[0] - 2.0 * (BESIDE + HALF_WINDOW)) / WINDOW_STEP) as usize;
    let window = |step: usize| {
        let middle = ENDS[0] + BESIDE + HALF_WINDOW + WINDOW_STEP * step as f64;
        let (from, to) = (middle - HALF_WINDOW, middle + HALF_WINDOW);
        let [begin, low, high, end] = [from - BESIDE, from, to, to + BESIDE].map(passes);
        let (begin, low, high, end) = (begin?, low?, high?, end?);
        let own = (high - low) / (to - from);
        let (before, after) = ((low - begin) / BESIDE, (end - high) / BESIDE);
        (own > FLAT * before.max(after)).then_some((own - 0.5 * (before + after)) * (to - from))
    };
    (0..=steps).filter_map(window).max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::strokes;
    use super::*;
    use std::f64::consts::TAU;

    /// One spring with a slider under a sine of this amplitude (m), with play.
    fn cycle(amplitude: f64, reach: f64, play: f64) -> Cycle {
        let displacement_m: Vec<f64> =
            (0..1_000).map(|i| amplitude * (TAU * f64::from(i) / 1_000.0).sin()).collect();
        let mut slider = 0.0;
        let mut force_n = vec![0.0; 1_000];
        for i in 0..2_000 {
            let apart = displacement_m[i % 1_000] - slider;
            let free = apart.clamp(-0.5 * play, 0.5 * play);
            let carried = (apart - free).clamp(-reach, reach);
            slider += apart - free - carried;
            force_n[i % 1_000] = 1e7 * carried;
        }
        Cycle { velocity_m_per_s: vec![0.0; 1_000], displacement_m, force_n }
    }

    #[test]
    fn play_is_measured_at_any_size_and_a_flank_without_it_has_none() {
        for scale in [1e-9, 1e-6, 1.0] {
            for (reach, play) in [(1.1, 3.0), (1.1, 1.5), (4.0, 8.0)] {
                let cycle = cycle(25.0 * scale, reach * scale, play * scale);
                let found = Play::of(&cycle, &strokes(&cycle)).expect("play");
                assert!((found.size_m / (play * scale) - 1.0).abs() < 0.1, "{found:?} for {play}");
            }
            // in gross slip, and without slip
            for reach in [1.1, 100.0] {
                let cycle = cycle(25.0 * scale, reach * scale, 0.0);
                assert_eq!(Play::of(&cycle, &strokes(&cycle)), None);
            }
        }
    }
}
