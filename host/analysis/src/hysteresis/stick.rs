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

use super::cycle::Cycle;
use super::loops::slope;

/// A part of the force's swing after a reversal, from the first to the second fraction.
pub(super) type Part = [f64; 2];

/// Part used of a straight flank up to a plateau.
const FLANK: Part = [0.10, 0.90];

/// Its halves, used to check that it is straight.
const HALVES: [Part; 2] = [[0.10, 0.50], [0.50, 0.90]];

/// Part used of a flank with play: the play occurs where the force is zero, half the swing after
/// the reversal.
pub(super) const BEFORE_PLAY: Part = [0.10, 0.40];

/// A flank counts as straight if the slope of its later half is at least this fraction of that of
/// the earlier half: ringing alone leaves 0.95 or more, whereas the halves of an Iwan contact
/// differ by a third.
const STRAIGHT_FLANK: f64 = 0.9;

/// Part used of a straight contact without a plateau.
const LATE: Part = [0.20, 0.40];

/// Part used of a bending one. The first samples after a reversal are excluded: they hardly move,
/// and their displacement is noise of the integration.
const EARLY: Part = [0.02, 0.20];

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
pub(super) fn first_part(guide: &Cycle, strokes: &[Stroke; 2]) -> Part {
    match (slope_over(guide, strokes, EARLY), slope_over(guide, strokes, LATE)) {
        (Some(early), Some(late)) if late < STRAIGHT * early => EARLY,
        (_, Some(_)) => LATE,
        _ => EARLY,
    }
}

/// The part to use for a contact with a plateau, chosen from the averaged loop.
pub(super) fn flank_part(guide: &Cycle, strokes: &[Stroke; 2]) -> Part {
    match HALVES.map(|half| slope_over(guide, strokes, half)) {
        [Some(early), Some(late)] if late < STRAIGHT_FLANK * early => EARLY,
        _ => FLANK,
    }
}

/// k_T: pooled least-squares slope of T on Δx over this part of both strokes, N/m. `None` with too
/// few samples in it.
pub(super) fn slope_over(cycle: &Cycle, strokes: &[Stroke; 2], [start, end]: Part) -> Option<f64> {
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
pub(super) fn bends(part: Part) -> bool {
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
