//! k_T from steady levels of the shaker, and one k_T from the hits and the levels together.
//!
//! A level uses force and Δx at the contact instead of T and Δx at the spots. It contains T and
//! both spots. It does not contain how arm B and the specimens move per newton of T at its
//! frequency. That comes from the hits on the moving mass (`driven`), which push it where the
//! shaker does. Everything else (the force's form, spot positions, gains, delays) comes from the
//! fit of all hits, with its covariance. So F = (a₀ + a₁s) T + Σ (b₀ + b₁s + b₂s²)(z_B, θ_x, θ_y),
//! Δx = x_A − x_B − r_A × θ_A + r_B × θ_B at s = iω, and F/Δx = k_T + iω c_T. The result is a
//! reading of the contact's compliance, with its uncertainties ([`Reading`]).
//!
//! A level's compliance therefore also depends on the hits, and the readings are not independent:
//! they are averaged with their full covariance (generalised least squares). What they share is
//! known: each is a sum over the parameters of the hits' fit plus an independent part. No weight is
//! negative: for readings with nearly the same errors, negative weights would trust the covariance
//! more than it deserves.

use super::block::{Block, blocks};
use super::driven::{Driven, MOTIONS, Part, REACH_HZ};
use super::model::bulk_of_spot;
use super::outcome::{FORCE_BALANCE, Interval, Variances, beside, over_time, stiffness_of};
use super::parameters::{CENTRE, Cause, DELAYS, FORM, GAINS, HAMMER, INERTIA_B, Parameters, SPOTS, TIP_B};
use super::{BAND, ContactError, Input, Known, START_M_PER_N, SecondPath, Stiffness};
use crate::C;
use crate::band::Band;
use crate::frf::noise::shared_by_lines;
use crate::hysteresis::contact_drift::ContactDrift;
use crate::identified::COMPLIANCE_HALF_WIDTH;
use crate::parallel::prelude::*;
use crate::substructuring::geometry::Grouping;
use crate::substructuring::joint_over_bands::NORMAL_95;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The band that the lightly damped lines must cover: wider than the band in which levels can be
/// read.
pub const LEVEL_LINES: Band =
    Band { low_hz: BAND.low_hz - REACH_HZ - 1.0, high_hz: BAND.high_hz + REACH_HZ + 1.0 };

/// Relative step of finite differences: F/Δx is a ratio of two bilinear forms, so that rounding and
/// curvature both stay below 1e-8.
const STEP: f64 = 1e-4;

/// One steady level.
#[derive(Debug, Clone, PartialEq)]
pub struct SteadyLevel {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Complex amplitudes of T (N) and of the spots' displacements on A and B (m), on a common time
    /// base. One set for each of several stretches of the record of equal length; their scatter is
    /// the noise.
    pub stretches: Vec<[C; 3]>,
}

/// Relative standard deviations of a level's k_T by source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shares {
    /// The fit of the hits: spots, points, gains, delays, form.
    pub fit: f64,
    /// The gain of the hammer's force cell.
    pub hammer_gain: f64,
    /// The motions per newton at this frequency: noise of the hits there, and the extrapolation to
    /// s = iω.
    pub turning: f64,
    /// The difference between the shaker's line of action and the hammer's.
    pub place: f64,
    /// Scatter of the level itself.
    pub level: f64,
}

/// k_T of one level.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelStiffness {
    /// k_T, N/m.
    pub k_t_n_per_m: Interval,
    /// Scatter of k_T over the level's stretches, N/m.
    pub std_n_per_m: f64,
    /// c_T, N s/m.
    pub c_t_n_s_per_m: Interval,
    /// Sources of the uncertainty of k_T.
    pub shares: Shares,
    /// Difference from the hits' k_T, in standard deviations of that difference.
    pub apart: f64,
    /// The compliance and its uncertainties, for averaging.
    pub(super) reading: Reading,
    /// Combined relative error of using Δx at the spots and T in place of F, |k_T/(T/Δx) − 1|.
    pub correction: f64,
}

/// The reason why a level has no k_T.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LevelError {
    /// Its frequency is outside the band in which the bodies are rigid and the hits have data.
    #[error("its frequency is outside {low:.0}–{high:.0} Hz, the band in which k_T can be determined", low = BAND.low_hz, high = BAND.high_hz)]
    OutOfBand,
    /// No impact drives the contact.
    #[error(
        "there is no impact along z on the moving mass (grouping 3), which is needed to know where the shaker pushes"
    )]
    NoImpact,
    /// The hits have no lines around its frequency.
    #[error("the hits have no usable lines around its frequency")]
    NoLines,
    /// The effect of the shaker's position matters, and its size is unknown.
    #[error(
        "the effect of a tilt of the hammer is not known: hit A along z at three places that are not in a line"
    )]
    NoPlace,
    /// A single stretch has no scatter.
    #[error("its record is too short to estimate its scatter")]
    Short,
    /// The compliance cannot be distinguished from zero.
    #[error("most of Δx at this frequency comes from the specimens' rotation, so k_T cannot be determined")]
    NotIdentified,
    /// The spectra do not belong together.
    #[error(transparent)]
    Contact(#[from] ContactError),
}

/// Corrects levels with the result of the hits. `light` is the input of the fit with spectra of a
/// lightly damped window instead of the heavily damped one, for the same cells in the same order;
/// `known` is the result of the fit.
pub fn level_stiffness(
    light: &Input<'_>,
    known: &Known,
    levels: &[SteadyLevel],
) -> Vec<Result<LevelStiffness, LevelError>> {
    let Some(spots) = light.spots_from_contact() else {
        return levels.iter().map(|_| Err(ContactError::NoSpots.into())).collect();
    };
    let mut parameters = Parameters::new(&light.priors, START_M_PER_N, spots, light.elastic_priors());
    let blocks = match blocks(&Input { band_hz: LEVEL_LINES, ..light.clone() }, &mut parameters) {
        Ok(blocks) if parameters.all().len() == known.p.len() => blocks,
        Ok(_) => return levels.iter().map(|_| Err(LevelError::NoLines)).collect(),
        Err(error) => return levels.iter().map(|_| Err(error.clone().into())).collect(),
    };
    let sigma_per_s = light.cells.first().map_or(0.0, |cell| cell.spectra.sigma_per_s());
    let read = |level: &SteadyLevel| one(light, known, &blocks, sigma_per_s, level);
    levels.par_iter().map(read).collect()
}

/// Impacts that can replace the shaker: each impact on the moving mass, and those on arm A combined
/// to push along the same line. A rod between mass and arm transmits little besides the axial push.
///
/// A hit's line of action is known from where it hits and how it is tilted. A tilted hit also
/// pushes sideways, and rotates the structure about its supports. Their position is not stated, so
/// it is taken to be anywhere along the structure.
fn stand_ins(light: &Input<'_>, blocks: &[Block]) -> Vec<Vec<Part>> {
    let positions = &light.priors.positions;
    let assembly = |grouping: fn(Grouping) -> bool| -> Vec<usize> {
        (0..blocks.len()).filter(|b| blocks[*b].along_z.is_none() && grouping(blocks[*b].grouping)).collect()
    };
    let [low, high] = assembly(|_| true)
        .iter()
        .map(|b| blocks[*b].at_m[2])
        .fold([light.contact_m[2]; 2], |[low, high]: [f64; 2], z| [low.min(z), high.max(z)]);
    let place_m2 = |b: usize| {
        let [below, above] = [blocks[b].at_m[2] - low, high - blocks[b].at_m[2]];
        // mean square distance to a point that is equally likely anywhere between both ends
        let lever_m2 = (below.powi(3) + above.powi(3)) / (3.0 * (high - low)).max(f64::MIN_POSITIVE);
        positions.position_m.powi(2) + positions.aim_m.powi(2) + positions.hammer_angle_rad.powi(2) * lever_m2
    };
    let part = |block: usize, weight: f64| Part { block, weight, place_m2: place_m2(block) };
    let on_mass = assembly(|grouping| grouping == Grouping::InternalA);
    let mut all: Vec<Vec<Part>> = on_mass.iter().map(|b| vec![part(*b, 1.0)]).collect();
    let Some(line) = on_mass.first().map(|b| blocks[*b].at_m) else { return all };
    let on_arm = assembly(|grouping| grouping == Grouping::InterfaceA);
    if let Some(weights) = along(&on_arm.iter().map(|b| blocks[*b].at_m).collect::<Vec<_>>(), line) {
        let weight = |(b, weight): (&usize, f64)| part(*b, weight * blocks[*b].direction[2].signum());
        all.push(on_arm.iter().zip(weights).map(weight).collect());
    }
    all
}

/// The smallest weights for parallel pushes at `from` such that their sum pushes along the line
/// through `to`; none if the pushes do not span it.
fn along(from: &[[f64; 3]], to: [f64; 3]) -> Option<Vec<f64>> {
    let rows = DMatrix::from_fn(3, from.len(), |r, c| if r == 0 { 1.0 } else { from[c][r - 1] - to[r - 1] });
    let gram = &rows * rows.transpose();
    let wanted = DVector::from_column_slice(&[1.0, 0.0, 0.0]);
    let solved = gram.cholesky()?.solve(&wanted);
    let weights: Vec<f64> = (rows.transpose() * solved).iter().copied().collect();
    // for positions on a line the Gram matrix is singular, and the weights are rounding
    weights.iter().all(|w| w.abs() < 10.0).then_some(weights)
}

/// The compliance at the contact from one replacement of the shaker, with its uncertainties.
struct LevelCompliance {
    compliance: C,
    by_parameter: DVector<C>,
    /// E|δ|² of the motions per newton, and of where the shaker pushes.
    turning: f64,
    place: f64,
    /// One per stretch.
    stretches: Vec<C>,
}

/// The mean over the replacements of the shaker, each weighted by its certainty. If they differ by
/// more than their uncertainties, these are widened.
fn together(found: &[LevelCompliance]) -> LevelCompliance {
    let certainty = |one: &LevelCompliance| (one.turning + one.place).max(f64::MIN_POSITIVE).recip();
    let whole: f64 = found.iter().map(certainty).sum();
    let counts: Vec<f64> = found.iter().map(|one| certainty(one) / whole).collect();
    let mean = |of: &dyn Fn(&LevelCompliance) -> C| -> C {
        found.iter().zip(&counts).map(|(one, w)| of(one) * *w).sum()
    };
    let compliance = mean(&|one| one.compliance);
    let apart: f64 = found.iter().map(|one| (one.compliance - compliance).norm_sqr() * certainty(one)).sum();
    let wider = (apart / (found.len().max(2) - 1) as f64).max(1.0);
    let squares = |of: fn(&LevelCompliance) -> f64| -> f64 {
        found.iter().zip(&counts).map(|(one, w)| of(one) * w * w).sum()
    };
    let mut by_parameter = DVector::<C>::zeros(found[0].by_parameter.len());
    for (one, w) in found.iter().zip(&counts) {
        by_parameter += &one.by_parameter * C::from(*w);
    }
    LevelCompliance {
        compliance,
        by_parameter,
        turning: squares(|one| one.turning) * wider,
        place: squares(|one| one.place) * wider,
        stretches: (0..found[0].stretches.len()).map(|n| mean(&|one| one.stretches[n])).collect(),
    }
}

fn one(
    light: &Input<'_>,
    known: &Known,
    blocks: &[Block],
    sigma_per_s: f64,
    level: &SteadyLevel,
) -> Result<LevelStiffness, LevelError> {
    if !BAND.contains(level.frequency_hz) {
        return Err(LevelError::OutOfBand);
    }
    if level.stretches.len() < 2 {
        return Err(LevelError::Short);
    }
    let chosen = stand_ins(light, blocks);
    if chosen.is_empty() {
        return Err(LevelError::NoImpact);
    }
    let shared = |step_hz: f64| shared_by_lines(sigma_per_s, step_hz);
    let driven: Vec<Driven<'_>> = chosen
        .iter()
        .filter_map(|parts| Driven::of(blocks, parts, &known.p, level.frequency_hz, shared))
        .collect();
    let near = !driven.is_empty();
    let found: Vec<LevelCompliance> =
        driven.iter().filter_map(|driven| through(driven, known, level)).collect();
    if found.is_empty() {
        return Err(if near { LevelError::NoPlace } else { LevelError::NoLines });
    }
    let LevelCompliance { compliance, by_parameter, turning, place, stretches } = together(&found);

    let omega = TAU * level.frequency_hz;
    let stiffness = compliance.inv();
    let k = stiffness.re;
    // dK = −K² dC. For complex noise without a preferred phase half of the variance is in the real
    // part; the effect of a shift may be entirely real
    let slope = -stiffness * stiffness;
    let unknown = slope.norm_sqr() * (0.5 * turning + place);
    let real = by_parameter.map(|d| (slope * d).re);
    let imaginary = by_parameter.map(|d| (slope * d).im / omega);
    let of_fit = |row: &DVector<f64>| known.variance(row);
    let scattered: Vec<C> = stretches.iter().map(C::inv).collect();
    let n = scattered.len() as f64;
    let mean = scattered.iter().sum::<C>() / n;
    let of_mean =
        |part: fn(C) -> f64| scattered.iter().map(|k| part(k - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
    let relative = |variance: f64| variance.sqrt() / k.abs();
    let of_fit_and_hammer = of_fit(&real);
    let of_hammer = known.share(HAMMER, &real).min(of_fit_and_hammer);
    let shares = Shares {
        fit: relative(of_fit_and_hammer - of_hammer),
        hammer_gain: relative(of_hammer),
        turning: relative(0.5 * slope.norm_sqr() * turning),
        place: relative(slope.norm_sqr() * place),
        level: relative(of_mean(|c| c.re)),
    };
    let Shares { fit, hammer_gain, turning: of_turning, place: of_place, level: of_level } = shares;
    let sigma = [fit, hammer_gain, of_turning, of_place, of_level].iter().map(|s| s * s).sum::<f64>().sqrt();
    let half = NORMAL_95 * sigma;
    if !(k > 0.0 && half < COMPLIANCE_HALF_WIDTH) {
        return Err(LevelError::NotIdentified);
    }
    let c = stiffness.im / omega;
    let of_c = of_fit(&imaginary) + unknown / (omega * omega) + of_mean(|c| c.im) / (omega * omega);
    let half_c = NORMAL_95 * of_c.sqrt();
    let [t, a, b] = mean_of(&level.stretches);
    // d(1/k) = −dk/k²
    let reading = Reading {
        frequency_hz: level.frequency_hz,
        compliance: k.recip(),
        row: &real * -(k * k).recip(),
        turning: (shares.turning / k).powi(2),
        place: (shares.place / k).powi(2),
        level: (shares.level / k).powi(2),
    };
    Ok(LevelStiffness {
        apart: apart(known, &reading),
        reading,
        k_t_n_per_m: Interval { mean: k, ci95: [k / (1.0 + half), k / (1.0 - half)] },
        std_n_per_m: shares.level * k * n.sqrt(),
        c_t_n_s_per_m: Interval { mean: c, ci95: [c - half_c, c + half_c] },
        shares,
        correction: (stiffness * (a - b) / t - 1.0).norm(),
    })
}

fn mean_of(stretches: &[[C; 3]]) -> [C; 3] {
    std::array::from_fn(|c| stretches.iter().map(|s| s[c]).sum::<C>() / stretches.len() as f64)
}

/// The level's compliance with these motions per newton, and its derivatives.
fn through(driven: &Driven<'_>, known: &Known, level: &SteadyLevel) -> Option<LevelCompliance> {
    let s = C::new(0.0, TAU * level.frequency_hz);
    let p = &known.p;
    let tones = mean_of(&level.stretches);
    let u = driven.per_t;
    let own_b = driven.specimen_b();
    let compliance = contact(p, s, &u, tones, own_b);
    // a body moves by about 1/K of the load cells per newton, so that a fraction of the largest
    // motion is a suitable step for every motion
    let largest = u.iter().map(|u| u.norm()).fold(0.0, f64::max);
    let g: [C; MOTIONS] = std::array::from_fn(|k| {
        let step = STEP * largest;
        let moved = |by: f64| {
            let mut moved = u;
            moved[k] += by;
            contact(p, s, &moved, tones, own_b)
        };
        (moved(step) - moved(-step)) / (2.0 * step)
    });
    let turning = driven.known(&g);
    let mut by_parameter = DVector::<C>::zeros(p.len());
    let own = (FORM..SPOTS + 4).chain([GAINS, GAINS + 1, DELAYS, DELAYS + 1, HAMMER]);
    for i in own {
        let step = STEP * known.certainty.covariance[(i, i)].max(0.0).sqrt();
        if step > 0.0 {
            let moved = |by: f64| {
                let mut moved = p.clone();
                moved[i] += by;
                contact(&moved, s, &u, tones, own_b)
            };
            by_parameter[i] = (moved(step) - moved(-step)) / (2.0 * step);
        }
    }
    for (i, value) in &turning.by_parameter {
        by_parameter[*i] += value;
    }
    Some(LevelCompliance {
        compliance,
        by_parameter,
        turning: turning.noise + turning.bend,
        place: turning.place?,
        stretches: level.stretches.iter().map(|own| contact(p, s, &u, *own, own_b)).collect(),
    })
}

/// Δx/F at the contact from a level's T, x_A and x_B, with the motions `u` per newton of T; `own_b`
/// states whether specimen B has points of its own. The form of the force and the bulk are per
/// newton that the hammer shows.
fn contact(p: &[f64], s: C, u: &[C; MOTIONS], [t, a, b]: [C; 3], own_b: bool) -> C {
    let displacement =
        |channel: usize, seen: C| seen / ((1.0 + p[GAINS + channel]) * (-s * p[DELAYS + channel]).exp());
    // (θ × r) along z is θ_x y − θ_y x
    let tilt = |spot: usize, turn: [C; 2]| t * (turn[0] * p[SPOTS + spot + 1] - turn[1] * p[SPOTS + spot]);
    // per newton of F: the spots' displacements beyond the bodies', and that of B's surface
    let tip = if own_b { 0.0 } else { p[TIP_B] };
    let bulk = |of_a: bool| bulk_of_spot(p, of_a, own_b).value[(2, 2)];
    let (bulk_a, bulk_b) = (bulk(true), bulk(false) + tip);
    // from the stated contact to its centre
    let centre = t * ((u[6] - u[4]) * p[CENTRE + 1] - (u[7] - u[5]) * p[CENTRE]);
    let z_a = displacement(0, a) - tilt(0, [u[6], u[7]]);
    let z_b = displacement(1, b) - tilt(2, [u[4], u[5]]);
    let z_arm = z_b + t * (u[0] - u[3]);
    let form = |n: usize| p[FORM + n] + p[FORM + n + 1] * s + p[FORM + n + 2] * s * s;
    let force = (p[FORM] + p[FORM + 1] * s) * t
        + form(2) * z_arm
        + t * (form(5) * u[1] + form(8) * u[2])
        + s * s
            * (p[INERTIA_B] * (z_b - z_arm)
                + t * (p[INERTIA_B + 1] * (u[4] - u[1]) - p[INERTIA_B + 2] * (u[5] - u[2])));
    // z_arm of the form is without what F itself bends
    let force = force / (1.0 + form(2) * bulk_b);
    ((z_a - z_b + centre) / force - bulk_a + bulk_b - tip) * (1.0 + p[HAMMER])
}

/// A level's compliance, its dependence on the parameters of the hits' fit, and its other
/// uncertainties.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The level's frequency, Hz.
    pub frequency_hz: f64,
    /// 1/k_T, m/N.
    pub compliance: f64,
    /// Its derivatives by the parameters.
    pub row: DVector<f64>,
    /// Variance of the motions per newton at this frequency.
    pub turning: f64,
    /// Variance due to where the shaker pushes.
    pub place: f64,
    /// Variance due to the scatter of the level itself.
    pub level: f64,
}

/// Difference between a level's compliance and that of the hits, in standard deviations of the
/// difference.
pub fn apart(known: &Known, reading: &Reading) -> f64 {
    let (compliance, row) = known.of_contact();
    let own = reading.turning + reading.place + reading.level;
    let variance = known.of_sum(&(&reading.row - row)).values().sum::<f64>() + own;
    (reading.compliance - compliance) / variance.sqrt()
}

/// k_T of hits and levels together.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// k_T, N/m.
    pub k_t_n_per_m: Interval,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<Cause, f64>,
    /// Number of levels with a positive weight.
    pub levels: usize,
}

impl Joint {
    /// As [`Stiffness::allow_for`], whose interval is not narrower.
    pub fn allow_for(&mut self, drift: &ContactDrift) {
        if let Some(k_t) = over_time(self.k_t_n_per_m, &mut self.budget, drift) {
            self.k_t_n_per_m = k_t;
        }
    }

    /// As [`Stiffness::allow_for_path`], whose interval is not narrower.
    pub fn allow_for_path(&mut self, path: &SecondPath) {
        if let Some(k_t) = beside(self.k_t_n_per_m, &mut self.budget, path) {
            self.k_t_n_per_m = k_t;
        }
    }
}

/// Averages hits and levels; none if no level narrows the interval of the hits. Nor if the force of
/// the hits is in doubt, on which the levels depend too.
pub fn joint(hits: &Stiffness, known: &Known, levels: &[&LevelStiffness]) -> Option<Joint> {
    if hits.contradictions.iter().any(|one| one.what == FORCE_BALANCE) {
        return None;
    }
    let readings: Vec<&Reading> = levels.iter().map(|level| &level.reading).collect();
    let (compliance, row) = known.of_contact();
    let values: Vec<f64> = std::iter::once(compliance).chain(readings.iter().map(|r| r.compliance)).collect();
    let rows: Vec<DVector<f64>> =
        std::iter::once(row).chain(readings.iter().map(|r| r.row.clone())).collect();
    let covariance = &known.certainty.covariance * known.misfit;
    let answered: Vec<DVector<f64>> = rows.iter().map(|row| &covariance * row).collect();
    let whole = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        let own = if i == 0 || j == 0 { 0.0 } else { shared(readings[i - 1], readings[j - 1], i == j) };
        rows[i].dot(&answered[j]) + own
    });
    let weights = weights(&whole)?;
    let compliance: f64 = values.iter().zip(&weights).map(|(value, weight)| value * weight).sum();
    let mut row = DVector::zeros(known.p.len());
    for (of, weight) in rows.iter().zip(&weights) {
        row += of * *weight;
    }
    let mut variances: Variances = known.of_sum(&row);
    let counted: Vec<(&Reading, f64)> = readings.iter().copied().zip(weights[1..].iter().copied()).collect();
    let products = |of: fn(&Reading, &Reading) -> f64| -> f64 {
        counted.iter().flat_map(|(a, v)| counted.iter().map(move |(b, w)| v * w * of(a, b))).sum()
    };
    let scatter: f64 = counted.iter().map(|(reading, weight)| weight * weight * reading.level).sum();
    *variances.entry(Cause::Noise).or_default() += products(turning) + scatter;
    *variances.entry(Cause::Aim).or_default() += products(place);
    let (k_t_n_per_m, budget) = stiffness_of(compliance, variances).ok()?;
    let width = |k: &Interval| k.ci95[0].recip() - k.ci95[1].recip();
    let levels = weights[1..].iter().filter(|weight| **weight > 0.0).count();
    (levels > 0 && width(&k_t_n_per_m) < width(&hits.k_t_n_per_m)).then_some(Joint {
        k_t_n_per_m,
        budget,
        levels,
    })
}

/// Covariance of two levels in addition to that from the parameters.
fn shared(a: &Reading, b: &Reading, same: bool) -> f64 {
    turning(a, b) + place(a, b) + if same { a.level } else { 0.0 }
}

/// The motions per newton are read from lines within a reach of each frequency, so nearby levels
/// share some of these lines.
fn turning(a: &Reading, b: &Reading) -> f64 {
    let overlap = (1.0 - (a.frequency_hz - b.frequency_hz).abs() / (2.0 * REACH_HZ)).max(0.0);
    overlap * (a.turning * b.turning).sqrt()
}

/// The shaker pushes at one place at all frequencies. The sign of the effect is not kept, so full
/// correlation is assumed as the worst case.
fn place(a: &Reading, b: &Reading) -> f64 {
    (a.place * b.place).sqrt()
}

/// Weights of the smallest variance among those that are non-negative and add up to one.
fn weights(covariance: &DMatrix<f64>) -> Option<Vec<f64>> {
    let scale = covariance[(0, 0)];
    let mut kept: Vec<usize> = (0..covariance.nrows()).collect();
    loop {
        let own = DMatrix::from_fn(kept.len(), kept.len(), |i, j| covariance[(kept[i], kept[j])] / scale);
        let solved = own.cholesky()?.solve(&DVector::from_element(kept.len(), 1.0));
        let (least, value) =
            solved.iter().enumerate().map(|(i, v)| (i, *v)).min_by(|a, b| a.1.total_cmp(&b.1))?;
        if value >= 0.0 {
            let mut all = vec![0.0; covariance.nrows()];
            for (place, weight) in kept.iter().zip(solved.iter()) {
                all[*place] = weight / solved.sum();
            }
            return Some(all);
        }
        kept.remove(least);
    }
}

#[cfg(test)]
mod tests {
    use super::weights;
    use nalgebra::DMatrix;

    #[test]
    fn readings_of_shared_errors_count_by_what_is_their_own() {
        // independent: weights proportional to 1/variance
        let independent = weights(&DMatrix::from_diagonal_element(2, 2, 1.0)).expect("positive");
        assert_eq!(independent, [0.5, 0.5]);
        let unequal = weights(&DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 4.0])).expect("positive");
        assert!((unequal[0] - 0.8).abs() < 1e-12);
        // the second has all of the first's error and some more: it adds no information, and must
        // not get a negative weight
        let contained = weights(&DMatrix::from_row_slice(2, 2, &[1.0, 1.2, 1.2, 2.0])).expect("positive");
        assert_eq!(contained, [1.0, 0.0]);
    }
}
