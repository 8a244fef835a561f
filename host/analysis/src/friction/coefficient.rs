//! The friction coefficients of a sliding loop, and where its plateaus rise.
//!
//! Three coefficients are in use, and they agree only for a loop with flat plateaus:
//!
//! - by peak: half the swing of the force over the normal load. It contains hooks at the ends;
//! - by energy: E / (4 N δ), δ half the loop's width at zero force, which is the sliding half
//!   stroke (Fouvry, Kapsa & Vincent, Wear 200 (1996) 186). It is the mean over the stroke;
//! - by plateau: half the distance between the medians of the plateaus over the normal load.

use super::loops::MeasuredLoop;
use crate::median;
use serde::Serialize;

/// A plateau begins when the contact has moved this many times the travel of a spring of the
/// flank's stiffness from one limit to the other.
const ONSET: f64 = 1.25;

/// A plateau covers at least this part of the stroke.
const LEAST_PLATEAU: f64 = 0.3;

/// On a plateau the mean slope is below this fraction of the flank's.
const FLAT: f64 = 0.1;

/// A rise from one third of the plateau to the next counts above this fraction of the plateau…
const RISE: f64 = 0.02;

/// … and this many standard deviations.
const SIGNIFICANT: f64 = 4.0;

/// A hook rises in the last third of the plateau by this many times the rise before. A line rises
/// by the same, a force that approaches its limit by less.
const HOOK: f64 = 1.5;

/// The friction coefficients of one loop in gross slip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrictionCoefficients {
    /// By peak: half the swing of the force over the normal load.
    pub peak: f64,
    /// By energy: energy per cycle over four times normal load and sliding half stroke.
    pub energy: f64,
    /// By plateau: half the distance between the plateaus' medians over the normal load.
    pub plateau: f64,
}

/// To which ends of the stroke the friction rises on the plateaus. The rises are fractions of the
/// plateau's force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "ends")]
pub enum LoopEnds {
    /// No gross slip: no plateau.
    NoPlateau,
    /// Flat, or approaching a limit.
    Plain,
    /// To both ends along a line: a spring in parallel, or a law with a slope while it slides.
    Sloped {
        /// From the first to the last third of each plateau.
        rise: f64,
    },
    /// To both ends, most of it at the end of each stroke: a hooked loop.
    Hooked {
        /// From the middle to the last third of each plateau.
        rise: f64,
    },
    /// To one end of the stroke, and falling to the other: a wedge; the normal load depends on the
    /// position.
    Wedge {
        /// From the first to the last third of the stroke towards positive displacement.
        rise: f64,
    },
}

/// A loop in gross slip.
#[derive(Debug, Clone, PartialEq)]
pub struct SlidingLoop {
    /// Half the swing of the force, N.
    pub peak_n: f64,
    /// Energy over four times the sliding half stroke, N.
    pub energy_n: f64,
    /// Half the distance between the plateaus' medians, N.
    pub plateau_n: f64,
    /// Sliding half stroke: half the width of the loop at zero force, m.
    pub sliding_m: f64,
    /// Where they rise.
    pub ends: LoopEnds,
}

/// One stroke: displacement in m and force in N in the direction of motion, from the reversal on.
struct LoopStroke {
    travel_m: Vec<f64>,
    force_n: Vec<f64>,
}

impl LoopStroke {
    /// Travel at which the force crosses zero, m.
    fn crossing(&self) -> Option<f64> {
        let at = self.force_n.iter().position(|f| *f > 0.0)?;
        let before = at.checked_sub(1)?;
        let (low, high) = (self.force_n[before], self.force_n[at]);
        let share = if high > low { -low / (high - low) } else { 0.0 };
        Some(self.travel_m[before] + share * (self.travel_m[at] - self.travel_m[before]))
    }

    /// Forces from a travel on, with their travels.
    fn from(&self, onset_m: f64) -> (&[f64], &[f64]) {
        let first = self.travel_m.partition_point(|x| *x < onset_m);
        (&self.travel_m[first..], &self.force_n[first..])
    }
}

impl SlidingLoop {
    /// From a measured loop; `None` without gross slip.
    pub fn of(one: &MeasuredLoop) -> Option<Self> {
        let strokes = strokes(one)?;
        let stroke_m = 2.0 * one.amplitude_m();
        let crossings = [strokes[0].crossing()?, strokes[1].crossing()?];
        let sliding_m = 0.5 * (stroke_m - crossings[0] - crossings[1]);
        let energy_n = one.energy_j() / (4.0 * sliding_m);
        if sliding_m <= 0.0 || energy_n <= 0.0 {
            return None;
        }
        // the flank rises by the limit up to the crossing, and by as much after it
        let flank_m = 0.5 * (crossings[0] + crossings[1]);
        let onset_m = ONSET * 2.0 * flank_m;
        if stroke_m - onset_m < LEAST_PLATEAU * stroke_m {
            return None;
        }
        let thirds: Vec<[f64; 3]> =
            strokes.iter().map(|stroke| thirds(stroke, onset_m, stroke_m)).collect::<Option<_>>()?;
        let medians: Vec<f64> =
            strokes.iter().map(|stroke| median::middle(stroke.from(onset_m).1)).collect::<Option<_>>()?;
        let plateau_n = 0.5 * (medians[0] + medians[1]);
        let mean = |of: fn(&[f64; 3]) -> f64| 0.5 * (of(&thirds[0]) + of(&thirds[1]));
        let rise = mean(|m| m[2] - m[0]);
        if rise.abs() > FLAT * (energy_n / flank_m) * (stroke_m - onset_m) {
            return None;
        }
        let points = strokes.iter().map(|stroke| stroke.from(onset_m).1.len()).min()?;
        // a difference between the means of two thirds of two plateaus
        let std = one.noise().force_n * (3.0 / points as f64).sqrt();
        let counts = |rise: f64| rise.abs() > (RISE * plateau_n).max(SIGNIFICANT * std);
        let [early, late] = [mean(|m| m[1] - m[0]), mean(|m| m[2] - m[1])];
        // the second stroke runs towards negative displacement
        let wedge = 0.5 * ((thirds[0][2] - thirds[0][0]) - (thirds[1][2] - thirds[1][0]));
        let hooked = late > 0.0 && counts(late) && late > HOOK * early;
        let ends = if counts(0.5 * wedge) && wedge.abs() > if hooked { 2.0 * late } else { rise.abs() } {
            LoopEnds::Wedge { rise: wedge / plateau_n }
        } else if hooked {
            LoopEnds::Hooked { rise: late / plateau_n }
        } else if late > 0.0 && counts(late) && HOOK * late > early {
            LoopEnds::Sloped { rise: rise / plateau_n }
        } else {
            LoopEnds::Plain
        };
        Some(Self { peak_n: one.force_amplitude_n(), energy_n, plateau_n, sliding_m, ends })
    }
}

impl LoopEnds {
    /// Where the plateaus of a loop rise.
    pub fn of(one: &MeasuredLoop) -> Self {
        SlidingLoop::of(one).map_or(Self::NoPlateau, |plateaus| plateaus.ends)
    }
}

impl FrictionCoefficients {
    /// The coefficients of a loop at a normal load, N; `None` without gross slip or without a
    /// positive load.
    pub fn of(one: &MeasuredLoop, normal_load_n: f64) -> Option<Self> {
        let plateaus = SlidingLoop::of(one).filter(|_| normal_load_n > 0.0 && normal_load_n.is_finite())?;
        Some(Self {
            peak: plateaus.peak_n / normal_load_n,
            energy: plateaus.energy_n / normal_load_n,
            plateau: plateaus.plateau_n / normal_load_n,
        })
    }
}

/// The strokes towards positive and towards negative displacement, with the force relative to the
/// middle between both at the middle of the stroke: the zero of the load cells is unknown.
fn strokes(one: &MeasuredLoop) -> Option<[LoopStroke; 2]> {
    let (x, f) = (one.smooth_displacement_m(), one.force_n());
    let n = x.len();
    let (low, high) = one.ends_m();
    let bottom = x.iter().position(|v| *v <= low)?;
    let top = x.iter().position(|v| *v >= high)?;
    let middle = 0.5 * (low + high);
    let part = |from: usize, to: usize| -> Vec<usize> {
        let count = (to + n - from) % n;
        (0..=count).map(|i| (from + i) % n).collect()
    };
    let (up, down) = (part(bottom, top), part(top, bottom));
    let centre = |indices: &[usize]| {
        let near = |i: &&usize| (x[**i] - middle).abs() < 0.1 * (high - low);
        let forces: Vec<f64> = indices.iter().filter(near).map(|&i| f[i]).collect();
        median::middle(&forces)
    };
    let offset = 0.5 * (centre(&up)? + centre(&down)?);
    let stroke = |indices: &[usize], from: f64, sign: f64| {
        // small motion against the stroke is not travel
        let mut travelled = 0.0f64;
        LoopStroke {
            travel_m: indices
                .iter()
                .map(|&i| {
                    travelled = travelled.max(sign * (x[i] - from));
                    travelled
                })
                .collect(),
            force_n: indices.iter().map(|&i| sign * (f[i] - offset)).collect(),
        }
    };
    Some([stroke(&up, low, 1.0), stroke(&down, high, -1.0)])
}

/// Mean force of each third of a stroke's plateau, N.
fn thirds(stroke: &LoopStroke, onset_m: f64, stroke_m: f64) -> Option<[f64; 3]> {
    let (travel, force) = stroke.from(onset_m);
    let third = (stroke_m - onset_m) / 3.0;
    let mut found = [0.0; 3];
    for (number, mean) in found.iter_mut().enumerate() {
        let from = onset_m + number as f64 * third;
        // rounding may leave the last travel above the stroke
        let to = if number == 2 { f64::INFINITY } else { from + third };
        let (mut sum, mut count) = (0.0, 0.0f64);
        for (x, f) in travel.iter().zip(force) {
            if *x >= from && *x < to {
                sum += f;
                count += 1.0;
            }
        }
        if count < 2.0 {
            return None;
        }
        *mean = sum / count;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::{FrictionLaw, LawKind, LoopNoise};
    use rand::{RngExt as _, SeedableRng as _};
    use rand_distr::{Distribution as _, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus as Rng;
    use std::f64::consts::TAU;

    const LIMIT: f64 = 150.0;
    const STIFFNESS: f64 = 150e6;
    const AMPLITUDE: f64 = 8e-6;

    /// A sliding loop whose force is multiplied by a factor of position (−1 to 1) and direction.
    fn sliding(rng: &mut Rng, factor: impl Fn(f64, f64) -> f64) -> MeasuredLoop {
        let law = FrictionLaw::new(LawKind::Jenkins, &[STIFFNESS, LIMIT]).expect("a law");
        let n = 400;
        let phase: f64 = rng.random_range(0.0..TAU);
        let turn = |i: usize| TAU * i as f64 / n as f64 + phase;
        let x: Vec<f64> = (0..n).map(|i| AMPLITUDE * turn(i).sin()).collect();
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let force = law.steady(&x);
        let force = (0..n)
            .map(|i| {
                force[i] * factor(turn(i).sin(), turn(i).cos().signum()) + 12.0 + 0.005 * LIMIT * normal()
            })
            .collect();
        let x = x.iter().map(|v| v + 0.002 * AMPLITUDE * normal()).collect();
        let noise =
            LoopNoise { displacement_m: 0.002 * AMPLITUDE, force_n: 0.005 * LIMIT, force_correlation: 0.0 };
        MeasuredLoop::new(x, force, Some(noise)).expect("a loop")
    }

    #[test]
    fn hooks_wedges_slopes_and_plain_loops_are_told_apart() {
        let mut rng = Rng::seed_from_u64(11);
        let mut right = [0; 5];
        for _ in 0..200 {
            let size: f64 = rng.random_range(0.15..0.5);
            let hook = sliding(&mut rng, |x, s| 1.0 + size * (s * x).max(0.0).powi(4));
            right[0] += i32::from(matches!(LoopEnds::of(&hook), LoopEnds::Hooked { rise } if rise > 0.0));
            let bowl = sliding(&mut rng, |x, _| 1.0 + size * x.powi(4));
            right[1] += i32::from(matches!(LoopEnds::of(&bowl), LoopEnds::Hooked { rise } if rise > 0.0));
            let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let wedge = sliding(&mut rng, |x, _| 1.0 + 0.5 * sign * size * x);
            right[2] +=
                i32::from(matches!(LoopEnds::of(&wedge), LoopEnds::Wedge { rise } if rise * sign > 0.0));
            let slope = sliding(&mut rng, |x, s| 1.0 + 0.5 * size * s * x);
            right[3] += i32::from(matches!(LoopEnds::of(&slope), LoopEnds::Sloped { rise } if rise > 0.0));
            let plain = sliding(&mut rng, |_, _| 1.0);
            right[4] += i32::from(LoopEnds::of(&plain) == LoopEnds::Plain);
        }
        assert!(
            right.iter().all(|count| *count >= 195),
            "hooked, bowl, wedge, sloped, plain: {right:?} of 200"
        );
    }

    #[test]
    fn the_three_coefficients_agree_on_flat_plateaus_and_differ_in_hooks() {
        let mut rng = Rng::seed_from_u64(12);
        let flat = FrictionCoefficients::of(&sliding(&mut rng, |_, _| 1.0), 500.0).expect("gross slip");
        for mu in [flat.energy, flat.plateau] {
            assert!((mu / 0.3 - 1.0).abs() < 0.01, "{flat:?}");
        }
        // the peak contains the largest noise of 400 points, about three standard deviations
        assert!(flat.peak > 0.3 && flat.peak < 0.3 * 1.025, "{flat:?}");
        let hook = sliding(&mut rng, |x, s| 1.0 + 0.4 * (s * x).max(0.0).powi(6));
        let hooked = FrictionCoefficients::of(&hook, 500.0).expect("gross slip");
        assert!((hooked.peak / 0.42 - 1.0).abs() < 0.03, "{hooked:?}");
        assert!(hooked.plateau < hooked.energy && hooked.energy < hooked.peak, "{hooked:?}");
        assert!((hooked.plateau / 0.3 - 1.0).abs() < 0.03, "{hooked:?}");
    }

    #[test]
    fn a_loop_without_gross_slip_has_no_coefficient() {
        let law = FrictionLaw::new(LawKind::Iwan, &[STIFFNESS, LIMIT, -0.3, 0.4]).expect("a law");
        let x: Vec<f64> = (0..256).map(|i| 0.5e-6 * (TAU * f64::from(i) / 256.0).sin()).collect();
        let force = law.steady(&x);
        let microslip = MeasuredLoop::new(x, force, None).expect("a loop");
        assert_eq!(FrictionCoefficients::of(&microslip, 500.0), None);
        assert_eq!(LoopEnds::of(&microslip), LoopEnds::NoPlateau);
    }
}
