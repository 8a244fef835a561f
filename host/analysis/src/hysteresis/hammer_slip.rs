//! Detects whether the contact slips under the hammer, by comparing hits of different force in the
//! same cell.
//!
//! The response of a linear structure is proportional to the force. However many modes beat in a
//! decay, and whatever resonance hides between the measured points, T, v_A and v_B per newton of
//! hammer force are the same from hit to hit. A contact that slips limits the force to its
//! friction, so all three change with the force. A hammer's own scatter of two per cent is enough
//! to see that, because the hits of one cell share everything else: place, aim and direction.
//!
//! So the response to each hit per newton is computed line by line ([`HitResponse`]), and
//! d ln(response per newton) / d ln(force) is estimated from the differences of hits within each
//! cell, separately for each band and signal. [`HammerSlip`] compares it with the remaining scatter
//! as a ratio of variances, whose mean is one while nothing slips. No model of the structure, no
//! stiffness and no noise level is assumed. A plan that makes every second hit softer
//! (`force.softer`) resolves it ten times more finely than a hammer's own scatter.

use crate::spectra::fft::forward;
use num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Bands in which responses are compared, Hz; within each, the lines are weighted by their
/// strength.
pub const BANDS_HZ: [[f64; 2]; 4] = [[60.0, 150.0], [150.0, 250.0], [250.0, 400.0], [400.0, 700.0]];

/// T, v_A, v_B, and v_A − v_B: slip shows first in the last one.
const SIGNALS: usize = 4;

/// With fewer differences between hits than this, one place of impact is not evaluated.
const FEWEST_OF_IMPACT: usize = 3;

/// With fewer over all places, no verdict is given.
const FEWEST: usize = 12;

/// A dependence on force is significant if chance alone would give it with less than this
/// probability: one of a thousand campaigns without slip.
const NO_ACCIDENT: f64 = 1e-3;

/// A change of T per newton below this does not count as slip: the hammer strikes when some 0.3 %
/// of the last hit's motion is left, most of it in the mode that rings longest. The runner strikes
/// the softer of two forces first in every second cell of an impact, so that a third of the change
/// that this makes follows the force. Where the softer hit always comes second, as in records of
/// other programs, all of it does: on simulated rigs without slip up to 0.6 %, and 1.4 % with a
/// fifth of the damping.
const LEFT_BEHIND: f64 = 0.015;

/// Standard deviations above which a single change is not scatter.
const CERTAIN: f64 = 4.0;

/// Sticking is reported only if T per newton is known to change by less than this per relative
/// change of force: microslip that changes T by as much changes k_T by more than its interval. A
/// contact that slips strongly settles in a different position after each hit and responds
/// differently to the next one, so that the scatter hides the dependence on force.
const MUCH: f64 = 0.03;

/// With a standard deviation above this, such a change would not show.
const TOO_COARSE: f64 = MUCH;

/// A change larger than that does not count as slip if chance alone gives as much with more than
/// this probability in campaigns without slip: with few hits at a place of impact, its scatter is
/// poorly known.
const BY_CHANCE: f64 = 0.05;

/// The hits of one cell: one place of impact, one aim.
#[derive(Debug, Clone, PartialEq)]
pub struct CellHits<'a> {
    /// The impact's name: cells of the same impact are expected to respond alike.
    pub impact: &'a str,
    /// Its kept hits.
    pub hits: Vec<&'a HitResponse>,
}

/// Verdict on slip from all hits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum HammerSlip {
    /// The response per newton changes with the force: the contact slips.
    Slips(Scaling),
    /// It does not, and the hits differ enough to have shown it.
    Sticks(Scaling),
    /// The hits do not allow a verdict.
    CannotTell(Unclear),
}

/// How the response per newton depends on the hammer's force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scaling {
    /// Magnitude of d ln(T/F) / d ln F in the band where T is best known: 0 for a linear structure;
    /// 1 if 1 % more force gives 1 % less T per newton.
    pub change_per_force: f64,
    /// Standard deviation of its real and imaginary parts, each.
    pub std: f64,
    /// Probability of changes as large as the largest in a contact that sticks.
    pub chance: f64,
    /// Hits compared.
    pub hits: usize,
    /// Relative standard deviation of the hammer's impulse within the cells.
    pub force_scatter: f64,
    /// Largest |T|, averaged over the hits, N.
    pub peak_tangential_n: f64,
}

/// Why the hits do not allow a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unclear {
    /// Too few cells with two hits or more.
    TooFewHits {
        /// Hits beyond the first of each cell.
        differences: usize,
        /// Number needed.
        needed: usize,
    },
    /// The hits are too similar in force, or too noisy, to show the difference that slip would
    /// make.
    TooAlike {
        /// Relative standard deviation of the hammer's impulse within the cells.
        force_scatter: f64,
        /// Standard deviation of the estimated d ln(T/F) / d ln F.
        std: f64,
    },
}

impl HammerSlip {
    /// Whether it slips; `None` if the hits do not allow a verdict.
    pub fn found(&self) -> Option<bool> {
        match self {
            Self::Slips(_) => Some(true),
            Self::Sticks(_) => Some(false),
            Self::CannotTell(_) => None,
        }
    }

    /// From all cells whose hits move the contact.
    pub fn of(cells: &[CellHits<'_>]) -> Self {
        let mut names: Vec<&str> = cells.iter().map(|c| c.impact).collect();
        names.sort_unstable();
        names.dedup();
        let impacts: Vec<SlipImpact> = names
            .into_iter()
            .map(|name| SlipImpact::of(cells.iter().filter(|c| c.impact == name)))
            .filter(|impact| impact.freedom() >= FEWEST_OF_IMPACT)
            .collect();
        let differences: usize = impacts.iter().map(SlipImpact::freedom).sum();
        if differences < FEWEST {
            return Self::CannotTell(Unclear::TooFewHits { differences, needed: FEWEST });
        }
        let features = impacts[0].features.len();
        let least = (0..features).map(|j| chance(impacts.iter().map(|i| (&i.features[j], i.freedom()))));
        // corrects for testing all features: any of them may be the most significant one
        let chance = (features as f64 * least.fold(1.0, f64::min)).min(1.0);
        let (squares, hits) =
            impacts.iter().fold((0.0, 0), |(s, n), impact| (s + impact.squares, n + impact.hits));
        let force_scatter = (squares / differences as f64).sqrt();
        let (change_per_force, std) = tangential(&impacts);
        let scaling = Scaling {
            change_per_force,
            std,
            chance,
            hits,
            force_scatter,
            peak_tangential_n: impacts.iter().map(|i| i.peak_tangential_n).sum::<f64>() / hits as f64,
        };
        let largest = impacts.iter().map(SlipImpact::largest_of_tangential).fold(0.0, f64::max);
        if chance < NO_ACCIDENT && largest > LEFT_BEHIND {
            Self::Slips(Scaling { change_per_force: change_per_force.max(largest), ..scaling })
        } else if std < TOO_COARSE && (change_per_force < MUCH || chance > BY_CHANCE) {
            Self::Sticks(scaling)
        } else {
            Self::CannotTell(Unclear::TooAlike { force_scatter, std })
        }
    }
}

/// Probability of changes as large as these if nothing depends on force: of one feature over all
/// impacts, each with the degrees of freedom ν of its hits. A change over its scatter follows F(2,
/// 2ν), whose tail is (1 + F/ν)^−ν; −2 Σ ln of n such probabilities follows χ² with 2n degrees of
/// freedom (Fisher).
fn chance<'a>(slopes: impl Iterator<Item = (&'a Slope, usize)>) -> f64 {
    let (mut half, mut count) = (0.0, 0);
    for (slope, freedom) in slopes {
        let freedom = freedom as f64;
        half += freedom * (slope.ratio() / freedom).ln_1p();
        count += 1;
    }
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..count {
        term *= half / f64::from(k);
        sum += term;
    }
    if half.is_finite() { (-half).exp() * sum } else { 0.0 }
}

/// d ln(T/F) / d ln F over all impacts in the band where it is best known, and the standard
/// deviation of its parts.
fn tangential(impacts: &[SlipImpact]) -> (f64, f64) {
    let of_band = |band: usize| {
        let (mut sum, mut weights) = (Complex::default(), 0.0);
        for impact in impacts {
            let slope = &impact.features[band];
            let weight = 1.0 / slope.variance;
            sum += slope.value * weight;
            weights += weight;
        }
        ((sum / weights).norm(), weights.recip().sqrt())
    };
    (0..BANDS_HZ.len())
        .map(of_band)
        .fold((0.0, f64::INFINITY), |best, own| if own.1 < best.1 { own } else { best })
}

/// All cells of one impact.
struct SlipImpact {
    /// First T in each band, then v_A, v_B and v_A − v_B.
    features: Vec<Slope>,
    /// Hits.
    hits: usize,
    /// Σ of squares of ln(impulse) within the cells.
    squares: f64,
    /// Hits beyond the first of each cell.
    differences: usize,
    /// Σ over the hits, N.
    peak_tangential_n: f64,
}

/// Change of one signal in one band with ln(force).
struct Slope {
    value: Complex<f64>,
    /// Variance of the real and imaginary parts, each.
    variance: f64,
}

impl Slope {
    /// Variance that depends on force over variance that does not: 1 in the mean for a linear
    /// structure.
    fn ratio(&self) -> f64 {
        let change = self.value.norm_sqr();
        if change > 0.0 { change / (2.0 * self.variance) } else { 0.0 }
    }
}

impl SlipImpact {
    fn of<'a>(cells: impl Iterator<Item = &'a CellHits<'a>>) -> Self {
        let cells: Vec<Vec<&HitResponse>> =
            cells.map(|cell| alike(&cell.hits)).filter(|own| own.len() > 1).collect();
        // deviations of each hit from its cell's mean: of ln(impulse), and of every feature
        let (mut forces, mut features) = (Vec::new(), vec![Vec::new(); SIGNALS * BANDS_HZ.len()]);
        let (mut hits, mut differences, mut peak_tangential_n) = (0, 0, 0.0);
        for (i, own) in cells.iter().enumerate() {
            hits += own.len();
            differences += own.len() - 1;
            peak_tangential_n += own.iter().map(|h| h.peak_tangential_n).sum::<f64>();
            let logs: Vec<f64> = own.iter().map(|h| h.impulse_n_s.ln()).collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            forces.extend(logs.iter().map(|l| l - mean));
            let others =
                || cells.iter().enumerate().filter(|(j, _)| *j != i).flat_map(|(_, cell)| cell).copied();
            let usual: Vec<&HitResponse> = others().filter(|hit| same_lines(hit, own[0])).collect();
            let usual = if usual.is_empty() { own } else { &usual };
            for (j, feature) in features.iter_mut().enumerate() {
                feature.extend(apart(own, usual, j / BANDS_HZ.len(), BANDS_HZ[j % BANDS_HZ.len()]));
            }
        }
        let squares: f64 = forces.iter().map(|f| f * f).sum();
        let freedom = differences.saturating_sub(1).max(1) as f64;
        let features = features
            .into_iter()
            .map(|values: Vec<Complex<f64>>| {
                let value = values.iter().zip(&forces).map(|(v, f)| v * f).sum::<Complex<f64>>() / squares;
                let rest: f64 = values.iter().zip(&forces).map(|(v, f)| (v - value * f).norm_sqr()).sum();
                Slope { value, variance: rest / (2.0 * freedom * squares) }
            })
            .collect();
        Self { features, hits, squares, differences, peak_tangential_n }
    }

    /// Largest significant d ln(T/F) / d ln F of all bands.
    fn largest_of_tangential(&self) -> f64 {
        let of_t = self.features[..BANDS_HZ.len()].iter();
        let certain = of_t.filter(|slope| slope.value.norm_sqr() > CERTAIN * CERTAIN * slope.variance);
        certain.map(|slope| slope.value.norm()).fold(0.0, f64::max)
    }

    /// Degrees of freedom left after one slope is fitted.
    fn freedom(&self) -> usize {
        self.differences.saturating_sub(1)
    }
}

fn same_lines(a: &HitResponse, b: &HitResponse) -> bool {
    a.first_hz == b.first_hz && a.step_hz == b.step_hz && a.per_newton[0].len() == b.per_newton[0].len()
}

/// The hits that have the lines of the first.
fn alike<'a>(hits: &[&'a HitResponse]) -> Vec<&'a HitResponse> {
    hits.iter().filter(|hit| same_lines(hit, hits[0])).copied().collect()
}

/// Deviation of each hit of a cell from the cell's mean in one band of one signal: the projection
/// on the `usual` response at this impact, normalised by it. The usual response comes from hits of
/// other cells: otherwise a hit's own noise, which is larger per newton the softer the hit, would
/// look like slip.
fn apart(hits: &[&HitResponse], usual: &[&HitResponse], signal: usize, band: [f64; 2]) -> Vec<Complex<f64>> {
    let inside = hits[0].lines(band);
    let value = |hit: &HitResponse, l: usize| match signal {
        3 => hit.per_newton[1][l] - hit.per_newton[2][l],
        own => hit.per_newton[own][l],
    };
    let mean = |of: &[&HitResponse], l: usize| {
        of.iter().map(|h| value(h, l)).sum::<Complex<f64>>() / of.len() as f64
    };
    let mut sums = vec![Complex::default(); hits.len()];
    let mut strength = 0.0;
    for l in inside {
        let (own, usual) = (mean(hits, l), mean(usual, l));
        strength += usual.norm_sqr();
        for (sum, hit) in sums.iter_mut().zip(hits) {
            *sum += (value(hit, l) - own) * usual.conj();
        }
    }
    sums.into_iter().map(|s| s / strength).collect()
}

/// Range of lines used, Hz: below it, the motion is truncated at the ends of the records; above it,
/// little of it passes the contact.
pub const LINES_HZ: [f64; 2] = [60.0, 700.0];

/// Length of record used, from [`LEAD_S`] before the pulse's peak, s: slip shows in the first
/// cycles, and noise accumulates after them.
pub const LENGTH_S: f64 = 0.3;

/// Time kept before the pulse's peak, s.
pub const LEAD_S: f64 = 2e-3;

/// Decay rate of the exponential window, 1/s: what remains at the truncated end is small, and the
/// same fraction for every hit.
pub const SIGMA_PER_S: f64 = 8.0;

/// T, v_A and v_B.
pub const CONTACT_SIGNALS: usize = 3;

/// The contact's signals after one hit.
#[derive(Debug, Clone, Copy)]
pub struct HitSignals<'a> {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// The hammer's force, N.
    pub hammer_n: &'a [f64],
    /// T (N), v_A and v_B (m/s), of the same length.
    pub contact: [&'a [f64]; CONTACT_SIGNALS],
    /// Delay of each signal relative to the hammer's force, s.
    pub delay_s: [f64; CONTACT_SIGNALS],
}

/// One hit's response per unit of its own force.
#[derive(Debug, Clone, PartialEq)]
pub struct HitResponse {
    /// The hammer's impulse, N s.
    pub impulse_n_s: f64,
    /// The hammer's largest force, N.
    pub peak_n: f64,
    /// The largest |T|, N.
    pub peak_tangential_n: f64,
    /// First line, Hz.
    pub first_hz: f64,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// T (N/N), v_A and v_B (m/s/N) at s = σ + iω.
    pub per_newton: [Vec<Complex<f64>>; CONTACT_SIGNALS],
}

impl HitResponse {
    /// Frequency of a line, Hz.
    pub fn frequency_hz(&self, line: usize) -> f64 {
        self.first_hz + self.step_hz * line as f64
    }

    /// The lines within a band, Hz.
    pub fn lines(&self, [low, high]: [f64; 2]) -> impl Iterator<Item = usize> {
        (0..self.per_newton[0].len()).filter(move |line| (low..high).contains(&self.frequency_hz(*line)))
    }

    /// From one hit; `None` without a pulse, or if the signals differ in length.
    pub fn of(signals: &HitSignals<'_>) -> Option<Self> {
        let HitSignals { fs_hz, hammer_n, contact, delay_s } = *signals;
        if contact.iter().any(|x| x.len() != hammer_n.len()) || !(fs_hz.is_finite() && fs_hz > 0.0) {
            return None;
        }
        let peak = (0..hammer_n.len()).max_by(|&a, &b| hammer_n[a].abs().total_cmp(&hammer_n[b].abs()))?;
        // the truncation is at the same distance after the pulse in every hit, so it removes the
        // same fraction of each
        let from = peak.saturating_sub((LEAD_S * fs_hz).round() as usize);
        let length = ((LENGTH_S * fs_hz) as usize).min(hammer_n.len() - from);
        let size = ((LENGTH_S * fs_hz) as usize).next_power_of_two();
        let fft = forward(size);
        let window: Vec<f64> = (0..length).map(|i| (-SIGMA_PER_S * i as f64 / fs_hz).exp()).collect();
        let step_hz = fs_hz / size as f64;
        let lines = (LINES_HZ[0] / step_hz).ceil() as usize..=(LINES_HZ[1] / step_hz).floor() as usize;
        if *lines.end() >= size / 2 {
            return None;
        }
        let spectrum = |x: &[f64]| -> Option<Vec<Complex<f64>>> {
            let own = &x[from..from + length];
            // a sensor's offset does not scale with the force, so if it remained it would look like
            // slip
            let rest = mean(&x[x.len() - x.len() / 4..]);
            let mut windowed = vec![0.0; size];
            windowed.iter_mut().zip(own).zip(&window).for_each(|((to, x), w)| *to = (x - rest) * w);
            let mut out = fft.make_output_vec();
            fft.process(&mut windowed, &mut out).ok()?;
            Some(out)
        };
        let force = spectrum(hammer_n)?;
        let impulse_n_s = force[0].norm() / fs_hz;
        if impulse_n_s.is_nan() || impulse_n_s <= 0.0 {
            return None;
        }
        let mut per_newton: [Vec<Complex<f64>>; CONTACT_SIGNALS] = Default::default();
        for ((to, x), late) in per_newton.iter_mut().zip(contact).zip(delay_s) {
            let moved = spectrum(x)?;
            to.extend(lines.clone().map(|l| {
                let s = Complex::new(SIGMA_PER_S, TAU * step_hz * l as f64);
                moved[l] / force[l] * (s * late).exp()
            }));
        }
        let largest = |x: &[f64]| x.iter().map(|v| v.abs()).fold(0.0, f64::max);
        Some(Self {
            impulse_n_s,
            peak_n: hammer_n[peak].abs(),
            peak_tangential_n: largest(contact[0]),
            first_hz: step_hz * *lines.start() as f64,
            step_hz,
            per_newton,
        })
    }
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Hits of 2 % scatter in force, whose response per newton is proportional to force^−`power`
    /// and scatters by `noise`.
    fn campaign(power: f64, scatter: f64, noise: f64) -> Vec<HitResponse> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..56)
            .map(|_| {
                let force = 1.0 + scatter * normal();
                let lines = 200;
                let own = Complex::new(1.0 + noise * normal(), noise * normal());
                let line = |l: usize| own * Complex::from_polar(force.powf(-power), 0.03 * l as f64);
                let signal: Vec<Complex<f64>> = (0..lines).map(line).collect();
                HitResponse {
                    impulse_n_s: 0.013 * force,
                    peak_n: 50.0 * force,
                    peak_tangential_n: 16.0 * force,
                    first_hz: 60.0,
                    step_hz: 3.125,
                    per_newton: [signal.clone(), signal.clone(), signal.iter().map(|v| v * 0.7).collect()],
                }
            })
            .collect()
    }

    fn verdict(hits: &[HitResponse]) -> HammerSlip {
        let impact = |i: usize| ["AZ1", "AZ2", "AZ3", "I_MZ"][i / 7 % 4];
        let cells: Vec<CellHits<'_>> = hits
            .chunks(2)
            .enumerate()
            .map(|(i, own)| CellHits { impact: impact(i), hits: own.iter().collect() })
            .collect();
        HammerSlip::of(&cells)
    }

    #[test]
    fn what_goes_with_the_force_is_slip() {
        for (power, scatter, noise, found) in [
            (0.0, 0.02, 1e-3, Some(false)),
            (0.8, 0.02, 1e-3, Some(true)),
            // each hit meets the contact in a different position
            (0.8, 0.02, 8e-3, Some(true)),
            // hits of equal force
            (0.0, 1e-4, 1e-3, None),
        ] {
            let verdict = verdict(&campaign(power, scatter, noise));
            assert_eq!(verdict.found(), found, "{power} {scatter} {noise}: {verdict:?}");
        }
        assert!(matches!(
            verdict(&campaign(0.0, 0.02, 1e-3)[..8]),
            HammerSlip::CannotTell(Unclear::TooFewHits { .. })
        ));
    }

    /// Hits of two forces in every cell, on the motion that the hit before left: 0.6 % of the
    /// response to that one. `first_soft` tells whether a cell of an impact begins with the softer.
    fn on_what_is_left(power: f64, first_soft: impl Fn(usize) -> bool) -> HammerSlip {
        let mut hits = campaign(power, 0.01, 1e-3);
        for (cell, own) in hits.chunks_mut(2).enumerate() {
            let mut before = 0.0;
            for (hit, soft) in own.iter_mut().zip([first_soft(cell % 7), !first_soft(cell % 7)]) {
                let force: f64 = if soft { 0.7 } else { 1.0 };
                let share = Complex::from_polar(force.powf(-power), 0.0) + 0.006 * before / force;
                hit.per_newton.iter_mut().flatten().for_each(|value| *value *= share);
                hit.impulse_n_s *= force;
                before = force;
            }
        }
        let impact = |i: usize| ["AZ1", "AZ2", "AZ3", "I_MZ"][i / 7];
        let cells = hits.chunks(2).enumerate();
        let cells: Vec<CellHits<'_>> =
            cells.map(|(i, own)| CellHits { impact: impact(i), hits: own.iter().collect() }).collect();
        HammerSlip::of(&cells)
    }

    #[test]
    fn what_is_left_of_the_last_hit_is_no_slip_where_the_order_of_the_forces_alternates() {
        let every_second = |cell: usize| cell % 2 == 1;
        let verdict = on_what_is_left(0.0, every_second);
        assert_eq!(verdict.found(), Some(false), "{verdict:?}");
        // in a fixed order it would be taken for slip
        assert_eq!(on_what_is_left(0.0, |_| false).found(), Some(true));
        let HammerSlip::Slips(scaling) = on_what_is_left(0.04, every_second) else { panic!("it slips") };
        // a quarter of what is left follows the force where three of seven cells begin with the
        // softer one
        assert!((scaling.change_per_force - 0.04).abs() < 0.012, "{scaling:?}");
    }

    #[test]
    fn the_change_with_force_is_that_of_the_hits() {
        let HammerSlip::Slips(scaling) = verdict(&campaign(0.5, 0.02, 1e-3)) else { panic!("it slips") };
        assert!((scaling.change_per_force - 0.5).abs() < 4.0 * scaling.std, "{scaling:?}");
        assert!((scaling.force_scatter / 0.02 - 1.0).abs() < 0.3, "{scaling:?}");
        assert_eq!(scaling.hits, 56);
    }
}
