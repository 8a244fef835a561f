//! Which modes and residual terms the data give evidence for.
//!
//! A mode is kept if χ² rises by more than a threshold when it is removed and all others adapt, and
//! added if χ² falls by as much. The threshold is what noise alone exceeds once in a thousand
//! identifications ([`FALSE_ALARMS`]), given the number of places at which it was searched for.
//! Where χ² per degree of freedom exceeds one, the noise is taken to be larger by that factor: what
//! the model does not explain must not count as evidence for more modes.

use super::Settings;
use super::data::Data;
use super::likelihood::{
    Beyond, Evaluation, Model, NARROWEST, Normal, fit, fit_roughly, fit_to_the_end, gains, rank_one,
    with_shapes,
};
use crate::C;
use crate::parallel::{join, prelude::*};
use nalgebra::DMatrix;

/// Probability that noise alone yields a mode in one identification.
const FALSE_ALARMS: f64 = 1e-3;

/// Powers of s that every model has: inertia below the band (1/s²) and stiffness above it (1).
const POWERS: [i32; 2] = [-2, 0];

/// Powers tried in addition: the next terms of the series of a mode above the band (s², s, …) and
/// of one below it (s⁻⁴, s⁻³). Odd powers are due to damping.
const MORE_POWERS: [i32; 6] = [2, 1, 4, 3, -4, -3];

/// Places outside the band where a pole is tried, as multiples of its lower and upper end: the
/// series of a mode near the band converges slowly, a pole needs fewer parameters.
const BELOW: [f64; 3] = [0.15, 0.4, 0.8];
const ABOVE: [f64; 7] = [1.1, 1.3, 1.6, 2.0, 2.6, 3.5, 5.0];

/// Peaks of the residual that are tried before the search ends without one that is a mode.
const TRIES: usize = 4;

/// Rounds of additions and removals, at most; the second normally changes nothing.
const ROUNDS: usize = 4;

/// Additions in one round, at most.
const ADDITIONS: usize = 30;

/// The decrease of χ² that noise alone exceeds by one more mode anywhere in the band with the
/// probability [`FALSE_ALARMS`].
///
/// For white noise of variance one, the decrease is the largest squared singular value of an
/// output × input matrix of complex normal numbers, or less. It is bounded by Davidson and
/// Szarek's inequality for singular values and by the χ² distribution of the sum of all squares
/// (Wilson and Hilferty's approximation), whichever is less.
pub(super) fn threshold(data: &Data) -> f64 {
    // each line with three dampings
    let places = 3.0 * data.lines() as f64;
    let x = (places / FALSE_ALARMS).ln();
    let (m, n) = (data.outputs as f64, data.inputs as f64);
    let by_singular_value = 2.0 * (m.sqrt() + n.sqrt() + x.sqrt()).powi(2);
    let z = (2.0 * x - (4.0 * std::f64::consts::PI * x).ln()).sqrt();
    let d = 2.0 * m * n;
    let by_sum = d * (1.0 - 2.0 / (9.0 * d) + z * (2.0 / (9.0 * d)).sqrt()).powi(3);
    by_singular_value.min(by_sum)
}

/// Factor by which the window's correlation between lines enlarges the noise of a mode's residue.
pub(super) fn correlated(data: &Data, pole: C) -> f64 {
    data.noise_at_start() * data.share_of_noise(pole)
}

/// Noise variance over the given one.
pub(super) fn scale(data: &Data, at: &Evaluation) -> f64 {
    let found = at.chi2_per_dof(data);
    match data.noise {
        super::NoiseKnown::Given => found.max(1.0),
        super::NoiseKnown::Estimated => found.max(ROUNDING),
    }
}

/// Relative variance of values that are exact but for rounding; below it nothing is evidence.
const ROUNDING: f64 = 1e-20;

/// The model with all poles and residual terms that the data give evidence for, and whether the
/// search for them came to its end.
///
/// It is ended after the work that the settings allow: data that no linear structure gives (FRFs
/// of impacts at differing places, without any noise to explain the differences) have evidence for
/// ever more poles. Half of the work is kept for removing poles without evidence.
pub(super) fn select(data: &Data, starts: &[C], settings: &Settings) -> (Evaluation, bool) {
    let most_work = settings.most_work;
    let starts: Vec<C> = starts.iter().copied().filter(|pole| is_mode(data, *pole, settings)).collect();
    let start = with_shapes(data, &starts, &POWERS).unwrap_or_else(|| Model::empty(data, &POWERS));
    let mut at = fit_roughly(data, start);
    // a start that was not a mode becomes a part of the background, which is described better below
    while let Some(r) = at.model.poles.iter().position(|pole| !is_mode(data, *pole, settings)) {
        at = fit_roughly(data, at.model.without(r));
    }
    let mut complete = true;
    for _ in 0..ROUNDS {
        // first all additions: as long as something is not described, the noise seems larger than
        // it is, and what is needed would be removed
        let mut additions = 0;
        while scale(data, &at) > ROUNDING && additions < ADDITIONS && data.work() < most_work / 2 {
            let Some(better) = with_one_more(data, &at, settings) else { break };
            at = better;
            additions += 1;
        }
        complete &= data.work() < most_work / 2;
        let before = at.model.poles.len();
        at = without_insignificant(data, at, most_work);
        if additions == 0 || at.model.poles.len() == before {
            break;
        }
    }
    let at = fit(data, at.model);
    let at = without_insignificant(data, at, most_work);
    complete &= data.work() < most_work;
    (fit(data, at.model), complete)
}

fn within(data: &Data, pole: C) -> bool {
    (data.s[0].im..=data.s[data.lines() - 1].im).contains(&pole.norm())
}

/// Half widths of a peak that the band must contain on both sides of its frequency, so that the
/// pole is that of a mode and not a part of the background.
const CONTAINED: f64 = 1.5;

/// Whether a pole is that of a mode: its damping is below the limit, and its peak in the band.
pub(super) fn is_mode(data: &Data, pole: C, settings: &Settings) -> bool {
    let width = CONTAINED * data.half_width(pole);
    let (low, high) = (data.s[0].im, data.s[data.lines() - 1].im);
    // at the limit of the fit a pole describes a single line
    if data.half_width(pole) < 1.5 * NARROWEST * data.step {
        return false;
    }
    -pole.re / pole.norm() < settings.damping_limit && pole.im - width >= low && pole.im + width <= high
}

/// Distance of two poles, in half widths, below which each is removed on trial.
const CLOSE: f64 = 0.5;

/// Removes the poles without evidence, the weakest first, as long as less than `most_work` has been
/// done.
fn without_insignificant(data: &Data, mut at: Evaluation, most_work: u64) -> Evaluation {
    loop {
        let poles = &at.model.poles;
        let Some(normal) = Normal::new(data, &at) else { return at };
        let noise = scale(data, &at);
        // the loss does not let the other poles move, which matters next to another one
        let is_close = |r: usize| {
            let near = |k: usize| (poles[k] - poles[r]).norm() < CLOSE * data.half_width(poles[r]);
            (0..poles.len()).any(|k| k != r && near(k))
        };
        let mut doubtful: Vec<(usize, [f64; 2], f64)> = normal
            .loss_without(&at.model)
            .into_iter()
            .enumerate()
            .map(|(r, loss)| (r, loss, threshold(data) * noise * correlated(data, poles[r])))
            .filter(|(r, [adapted, _], needed)| *adapted < 2.0 * needed || is_close(*r))
            .collect();
        doubtful.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let mut next = None;
        for (mode, [_, at_most], needed) in doubtful {
            if data.work() >= most_work {
                return at;
            }
            let without = fit_to_the_end(data, at.model.without(mode));
            if at_most < needed || without.chi2 - at.chi2 < needed {
                next = Some(without);
                break;
            }
        }
        match next {
            Some(without) => at = without,
            None => return at,
        }
    }
}

/// Something to add to the model.
struct Candidate {
    /// Decrease of χ² that is expected and that which is needed, for noise of variance one.
    gain: f64,
    needed: f64,
    model: Model,
}

/// The model with one more pole or residual term that the data give evidence for; none if there is
/// none.
fn with_one_more(data: &Data, at: &Evaluation, settings: &Settings) -> Option<Evaluation> {
    let noise = scale(data, at);
    let residual = weighted(data, at.residuals(data));
    let (mut all, beyond) = join(|| peaks(data, at, &residual, settings), || beyond(data, at, &residual));
    all.extend(beyond);
    all.sort_by(|a, b| (b.gain - b.needed * noise).total_cmp(&(a.gain - a.needed * noise)));
    for candidate in all.into_iter().take(TRIES) {
        let with = fit_roughly(data, candidate.model);
        if at.chi2 - with.chi2 > candidate.needed * scale(data, &with) {
            return Some(with);
        }
    }
    None
}

/// Residual terms, and poles outside the band.
fn beyond(data: &Data, at: &Evaluation, weighted: &DMatrix<f64>) -> Vec<Candidate> {
    let (low, high) = (data.s[0].im, data.s[data.lines() - 1].im);
    let powers = MORE_POWERS.iter().filter(|power| !at.model.powers.contains(power));
    let places = BELOW.iter().map(|times| times * low).chain(ABOVE.iter().map(|times| times * high));
    let places = places.filter(|omega| *omega > 0.0);
    let more: Vec<Beyond> = (powers.map(|power| Beyond::Power(*power)))
        .chain(places.map(|omega| Beyond::Pole(C::new(-0.01 * omega, omega))))
        .collect();
    let noise = scale(data, at);
    // what noise gains in all cells, each with so many real values: the mean of its χ² and five
    // standard deviations of it
    let by_noise = |values: f64| {
        let all = values * data.cells() as f64;
        (all + 5.0 * (2.0 * all).sqrt()) * data.noise_at_start()
    };
    let gains = gains(data, at, &more);
    let candidate = |(gain, one): (f64, Beyond)| match one {
        Beyond::Power(power) => {
            let needed = by_noise(1.0);
            (gain > needed * noise).then(|| Candidate { gain, needed, model: at.model.with_power(power) })
        }
        Beyond::Pole(pole) => (gain > by_noise(2.0) * noise).then(|| {
            let (shape, participation) = rank_one(&residues(data, weighted, pole));
            let needed = threshold(data) * data.noise_at_start();
            Candidate { gain, needed, model: at.model.with(pole, &shape, &participation) }
        }),
    };
    gains.into_iter().zip(more).filter_map(candidate).collect()
}

/// The peaks of the residual, strongest first: a matched filter for one mode on a grid of
/// frequencies and dampings.
fn peaks(data: &Data, at: &Evaluation, weighted: &DMatrix<f64>, settings: &Settings) -> Vec<Candidate> {
    let (low, high) = (data.s[0].im, data.s[data.lines() - 1].im);
    let narrowest = (1.1 * data.sigma).max(0.5 * data.step);
    let damping = (0.5 * settings.damping_limit).min(0.06);
    let mut grid = Vec::new();
    let mut width = narrowest;
    while width < data.sigma + damping * high {
        // three places per two half widths of the peak
        let from = (low + CONTAINED * width).max((width - data.sigma) / damping);
        let places = ((high - CONTAINED * width - from) / (0.67 * width)).max(0.0).floor() as usize;
        grid.extend((0..=places).map(|k| C::new(data.sigma - width, from + 0.67 * width * k as f64)));
        width *= 2.0;
    }
    let limit = threshold(data);
    let noise = scale(data, at);
    let of_group = |poles: &[C]| -> Vec<(f64, f64, C)> {
        let found = filtered(data, weighted, poles).into_iter().zip(poles).filter_map(|(filtered, &pole)| {
            let needed = limit * correlated(data, pole);
            // cheap test first
            if 2.0 * filtered.norm_squared() < needed * noise {
                return None;
            }
            let gain = rank_one(&filtered).0.norm_squared();
            (2.0 * gain > needed * noise).then_some((gain, needed, pole))
        });
        found.collect()
    };
    let found: Vec<Vec<(f64, f64, C)>> = grid.par_chunks(GROUP).map(of_group).collect();
    let mut found = found.concat();
    found.sort_by(|a, b| (b.0 / b.1).total_cmp(&(a.0 / a.1)));
    let mut taken: Vec<C> = Vec::new();
    let mut peaks = Vec::new();
    for (gain, needed, pole) in found {
        let apart =
            |other: &C| (other.im - pole.im).abs() > data.half_width(*other).max(data.half_width(pole));
        if taken.len() >= TRIES {
            break;
        }
        if taken.iter().all(apart) {
            taken.push(pole);
            let (shape, participation) = rank_one(&residues(data, weighted, pole));
            let model = at.model.with(pole, &shape, &participation);
            peaks.push(Candidate { gain, needed, model });
        }
    }
    peaks
}

/// Lines on which a peak is looked for, in half widths on either side.
const REACH: f64 = 6.0;

/// Lines within the reach of a pole; all lines for one outside the band.
fn reach(data: &Data, pole: C) -> std::ops::Range<usize> {
    if !within(data, pole) {
        return 0..data.lines();
    }
    let width = REACH * data.half_width(pole);
    let from = data.s.partition_point(|s| s.im < pole.im - width);
    from..data.s.partition_point(|s| s.im <= pole.im + width)
}

/// Poles that are filtered at a time: neighbours of one width share most of their lines, and a
/// product of matrices is several times faster than as many sums.
const GROUP: usize = 16;

/// The residual times its weight.
fn weighted(data: &Data, mut residual: DMatrix<f64>) -> DMatrix<f64> {
    let mut halves = residual.rows_range_pair_mut(..data.lines(), data.lines()..);
    halves.0.component_mul_assign(&data.weight);
    halves.1.component_mul_assign(&data.weight);
    residual
}

/// By pole, output × input: the residual's correlation with a peak there, in units of its noise.
fn filtered(data: &Data, weighted: &DMatrix<f64>, poles: &[C]) -> Vec<DMatrix<C>> {
    let sums = correlations(data, weighted, poles);
    (sums.into_iter())
        .map(|(sum, power)| {
            sum.zip_map(&power, |sum, power| if power > 0.0 { sum / power.sqrt() } else { C::from(0.0) })
        })
        .collect()
}

/// Output × input: the residue of a peak at this pole.
fn residues(data: &Data, weighted: &DMatrix<f64>, pole: C) -> DMatrix<C> {
    let (sum, power) = correlations(data, weighted, &[pole]).swap_remove(0);
    sum.zip_map(&power, |sum, power| if power > 0.0 { sum / power } else { C::from(0.0) })
}

/// By pole, output × input: the weighted sums of conj(peak) × residual and of |peak|².
fn correlations(data: &Data, weighted: &DMatrix<f64>, poles: &[C]) -> Vec<(DMatrix<C>, DMatrix<f64>)> {
    let ranges: Vec<std::ops::Range<usize>> = poles.iter().map(|pole| reach(data, *pole)).collect();
    let from = ranges.iter().map(|range| range.start).min().unwrap_or(0);
    let to = ranges.iter().map(|range| range.end).max().unwrap_or(0).max(from);
    let (count, lines) = (to - from, data.lines());
    let mut re = DMatrix::zeros(poles.len(), count);
    let mut im = DMatrix::zeros(poles.len(), count);
    for (k, (pole, range)) in poles.iter().zip(&ranges).enumerate() {
        for l in range.clone() {
            let peak = (data.s[l] - pole).inv() * data.to_quantity[l];
            (re[(k, l - from)], im[(k, l - from)]) = (peak.re, peak.im);
        }
    }
    let square = re.map(|v| v * v) + im.map(|v| v * v);
    let (r_re, r_im) = (weighted.rows(from, count), weighted.rows(lines + from, count));
    let sum_re = &re * r_re + &im * r_im;
    let sum_im = &re * r_im - &im * r_re;
    let power = square * data.weight.rows(from, count);
    let of_pole = |k: usize| {
        let cell = |o: usize, i: usize| (k, o * data.inputs + i);
        (
            DMatrix::from_fn(data.outputs, data.inputs, |o, i| {
                C::new(sum_re[cell(o, i)], sum_im[cell(o, i)])
            }),
            DMatrix::from_fn(data.outputs, data.inputs, |o, i| power[cell(o, i)]),
        )
    };
    (0..poles.len()).map(of_pole).collect()
}
