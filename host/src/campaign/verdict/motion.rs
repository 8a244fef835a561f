//! Decides whether a jump in a response is motion of the structure or an artefact of the
//! vibrometer.
//!
//! A contact that starts or stops sliding changes the force, and with it the acceleration,
//! abruptly: the velocity has a kink, or bends. A lost beam changes the reading itself, for a few
//! samples or from then on. Both models are fitted to the samples around the jump, together with a
//! smooth motion; the one with the smaller residual decides.

use nalgebra::{DMatrix, DVector};

/// Number of samples evaluated, with the jump in the middle.
pub(super) const LOOKED_AT: usize = 12;
/// The jump is searched for up to this far from the middle, samples.
const REACH: usize = 3;

/// Whether the jump in the middle of these samples is motion of the structure.
pub(super) fn is_motion(x: &[f64]) -> bool {
    if x.len() != LOOKED_AT {
        return false;
    }
    let x = DVector::from_column_slice(x);
    let middle = (LOOKED_AT - 1) as f64 / 2.0;
    let places = || (LOOKED_AT / 2 - REACH)..(LOOKED_AT / 2 + REACH);
    let least = |left: &mut dyn Iterator<Item = f64>| left.fold(f64::INFINITY, f64::min);
    // a kink and a bend, also between two samples
    let after = |i: usize, start: f64| (i as f64 - start).max(0.0);
    let mut own = (0..=4 * REACH - 2).map(|half| {
        let start = middle - (REACH as f64 - 0.5) + 0.5 * half as f64;
        left(&x, 2, |i, n| power(after(i, start), 1 + n))
    });
    // a single-sample spike that the filter before the converter has spread over its neighbours
    let mut spikes = places().map(|at| left(&x, 3, |i, n| f64::from(u8::from(i + 1 == at + n))));
    // a step, within one sample
    let mut steps =
        places().map(|at| left(&x, 2, |i, n| f64::from(u8::from(if n == 0 { i >= at } else { i == at }))));
    least(&mut own) <= least(&mut spikes).min(least(&mut steps))
}

fn power(x: f64, n: usize) -> f64 {
    (0..n).map(|_| x).product()
}

/// Residual of a fit with a cubic and `count` functions of the sample, as a variance per degree of
/// freedom.
fn left(x: &DVector<f64>, count: usize, function: impl Fn(usize, usize) -> f64) -> f64 {
    const CUBIC: usize = 4;
    let half = (LOOKED_AT - 1) as f64 / 2.0;
    let columns = CUBIC + count;
    let model = DMatrix::from_fn(LOOKED_AT, columns, |i, n| {
        if n < CUBIC { power((i as f64 - half) / half, n) } else { function(i, n - CUBIC) }
    });
    let q = model.qr().q();
    let residual = x - &q * q.tr_mul(x);
    residual.norm_squared() / (LOOKED_AT - columns) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// How many of 200 are classified as motion: a jump of size 1 on a slow motion, with noise of a
    /// thirtieth.
    fn taken(jump: impl Fn(f64) -> f64) -> usize {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let mut one = || {
            let (size, phase) = (2.0 * draw(), 3.0 * draw());
            let x: Vec<f64> = (0..LOOKED_AT)
                .map(|i| {
                    let t = i as f64;
                    size * (0.15 * t + phase).sin() + draw() / 30.0 + jump(t - 6.0)
                })
                .collect();
            is_motion(&x)
        };
        (0..200).filter(|_| one()).count()
    }

    #[test]
    fn what_a_contact_does_is_motion_and_what_a_beam_does_is_not() {
        // three in a hundred may be misclassified this close to the limit
        for motion in
            [taken(|t| t.max(0.0)), taken(|t| (t + 0.4).max(0.0)), taken(|t| 0.5 * t.max(0.0).powi(2))]
        {
            assert!(motion >= 194, "{motion}");
        }
        let spread = |t: f64| {
            if t == 0.0 {
                1.0
            } else if t.abs() == 1.0 {
                0.2
            } else {
                0.0
            }
        };
        let step = |t: f64| if t >= 0.0 { 1.0 } else { 0.0 };
        let half = |t: f64| if t == 0.0 { 0.5 } else { step(t) };
        for jump in [taken(|t| if t == 0.0 { 1.0 } else { 0.0 }), taken(spread), taken(step), taken(half)] {
            assert!(jump <= 6, "{jump}");
        }
    }

    #[test]
    fn a_contact_of_15_n_under_a_hit_of_50_n_moves() {
        // codes of the 3-D vibrometer while the contact slides and sticks again
        for x in [
            [-44.0, 67.0, 245.0, 419.0, 540.0, 552.0, 478.0, 468.0, 500.0, 498.0, 503.0, 537.0],
            [-52.0, 83.0, 270.0, 442.0, 542.0, 524.0, 447.0, 458.0, 479.0, 477.0, 491.0, 531.0],
            [-40.0, 105.0, 299.0, 468.0, 559.0, 536.0, 457.0, 469.0, 487.0, 488.0, 499.0, 550.0],
            [10.0, 177.0, 357.0, 489.0, 568.0, 592.0, 583.0, 646.0, 712.0, 756.0, 762.0, 741.0],
        ] {
            assert!(is_motion(&x), "{x:?}");
        }
    }
}
