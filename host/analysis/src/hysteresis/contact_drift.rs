//! Whether the contact's stiffness changed while it was hit: by wear, temperature, or a normal load
//! that relaxes.
//!
//! What a hit shows at the contact, T over the displacement between the spots, contains more than
//! the contact: inertia, and rotation between spot and contact. But these are the same for all hits
//! at one place of impact, except for the aim, which differs from cell to cell without regard to
//! time. So the relative deviation of each cell from the mean of its place of impact is fitted by a
//! straight line in time, and the cells' scatter about it gives the standard deviation. The result
//! is the mean over the places of impact, in the band in which it is known best. No model of the
//! structure and no position is needed; but near a resonance of a specimen the ratio can change by
//! more or less than the contact, and with the other sign.

use super::hammer_slip::{BANDS_HZ, CellHits, HitResponse, SIGMA_PER_S};
use num_complex::Complex;
use std::f64::consts::TAU;

/// Fewest cells of a place of impact: below, their scatter about a straight line is not known.
const FEWEST_CELLS: usize = 5;

/// A change is certain beyond this many standard deviations: they come from some thirty degrees of
/// freedom, and one of a thousand campaigns without a change shows as much.
const CERTAIN: f64 = 4.0;

/// Relative changes below this are no concern: the motion that the last hit left makes some 0.3 %.
const MUCH: f64 = 0.01;

/// A contact is said not to have changed if a change beyond this is excluded, by two standard
/// deviations: it is less than the interval of k_T.
const CLEAR: f64 = 0.02;

/// Change of T over the spots' displacement over the hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactDrift {
    /// Relative change from the first cell to the last.
    pub change: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Cells compared.
    pub cells: usize,
    /// T over the displacement between the spots, mean over the places of impact, N/m.
    pub at_the_spots_n_per_m: f64,
}

impl ContactDrift {
    /// From all cells whose hits move the contact, each with the time at which it was struck, in
    /// any unit; `None` if no place of impact has enough.
    pub fn of(cells: &[(f64, CellHits<'_>)]) -> Option<Self> {
        let mut impacts: Vec<Vec<&(f64, CellHits<'_>)>> = Vec::new();
        for cell in cells {
            match impacts.iter_mut().find(|own| own[0].1.impact == cell.1.impact) {
                Some(own) => own.push(cell),
                None => impacts.push(vec![cell]),
            }
        }
        impacts.retain(|own| own.len() >= FEWEST_CELLS);
        let times = || impacts.iter().flatten().map(|(at, _)| *at);
        let duration = times().fold(f64::NEG_INFINITY, f64::max) - times().fold(f64::INFINITY, f64::min);
        let of_band = |band| {
            let trends: Vec<Trend> = impacts.iter().map(|own| Trend::of(own, band)).collect();
            let sum = |part: fn(&Trend) -> f64| trends.iter().map(part).sum::<f64>();
            // not weighted by the variances, which ten cells hardly determine
            let squares = sum(|own| own.squares);
            let change = duration * sum(|own| own.squares * own.slope) / squares;
            let std = duration * sum(|own| own.squares * own.scatter).sqrt() / squares;
            let stiffness = sum(|own| own.stiffness_n_per_m) / trends.len() as f64;
            (change.is_finite() && std > 0.0).then_some([change, std, stiffness])
        };
        let known = BANDS_HZ.into_iter().filter_map(of_band);
        let [change, std, at_the_spots_n_per_m] = known.min_by(|[_, a, _], [_, b, _]| a.total_cmp(b))?;
        let cells = impacts.iter().map(Vec::len).sum();
        Some(Self { change, std, cells, at_the_spots_n_per_m })
    }

    /// Whether it changed; `None` if that is not clear.
    pub fn found(&self) -> Option<bool> {
        if self.change.abs() > MUCH.max(CERTAIN * self.std) {
            Some(true)
        } else {
            (self.change.abs() + 2.0 * self.std < CLEAR).then_some(false)
        }
    }
}

/// The straight line through the relative deviations of T over the spots' displacement at one place
/// of impact.
struct Trend {
    /// Change per unit of time.
    slope: f64,
    /// Sum of the squares of the cells' times from their mean.
    squares: f64,
    /// Variance of the deviations about the line.
    scatter: f64,
    /// Magnitude of the mean, N/m.
    stiffness_n_per_m: f64,
}

impl Trend {
    fn of(cells: &[&(f64, CellHits<'_>)], band: [f64; 2]) -> Self {
        let stiffness: Vec<Complex<f64>> =
            cells.iter().map(|(_, cell)| at_the_spots(&cell.hits, band)).collect();
        let count = cells.len() as f64;
        let mean = stiffness.iter().sum::<Complex<f64>>() / count;
        let middle = cells.iter().map(|(at, _)| at).sum::<f64>() / count;
        let points: Vec<[f64; 2]> =
            cells.iter().zip(&stiffness).map(|((at, _), k)| [at - middle, (k / mean - 1.0).re]).collect();
        let squares: f64 = points.iter().map(|[t, _]| t * t).sum();
        let slope = points.iter().map(|[t, y]| t * y).sum::<f64>() / squares;
        let rest: f64 = points.iter().map(|[t, y]| (y - slope * t).powi(2)).sum();
        Trend { slope, squares, scatter: rest / (count - 2.0), stiffness_n_per_m: mean.norm() }
    }
}

/// T over the displacement of spot A relative to spot B, least squares over hits and lines.
fn at_the_spots(hits: &[&HitResponse], band: [f64; 2]) -> Complex<f64> {
    let (mut product, mut square) = (Complex::default(), 0.0);
    for hit in hits {
        let [t, v_a, v_b] = &hit.per_newton;
        for line in hit.lines(band) {
            let s = Complex::new(SIGMA_PER_S, TAU * hit.frequency_hz(line));
            let moved = (v_a[line] - v_b[line]) / s;
            product += t[line] * moved.conj();
            square += moved.norm_sqr();
        }
    }
    product / square
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Four places of impact with ten cells of two hits each, whose stiffness rises by `change`
    /// from the first cell to the last and scatters by `scatter` from cell to cell.
    fn campaign(seed: u64, change: f64, scatter: f64) -> Vec<(String, f64, Vec<HitResponse>)> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..40)
            .map(|n| {
                let (impact, time) = (n / 10, f64::from(n) / 39.0);
                let stiffness = 1.5e8 * (1.0 + change * time) * (1.0 + scatter * normal());
                let hit = || HitResponse {
                    impulse_n_s: 0.01,
                    peak_n: 50.0,
                    peak_tangential_n: 10.0,
                    first_hz: 60.0,
                    step_hz: 2.0,
                    per_newton: {
                        let moved: Vec<Complex<f64>> =
                            (0..300).map(|l| Complex::new(1e-9, f64::from(l % 7 + impact) * 1e-10)).collect();
                        let speed =
                            |l: usize| moved[l] * Complex::new(SIGMA_PER_S, TAU * (60.0 + 2.0 * l as f64));
                        [
                            moved.iter().map(|x| x * stiffness).collect(),
                            (0..300).map(speed).collect(),
                            vec![Complex::default(); 300],
                        ]
                    },
                };
                (format!("AZ{impact}"), f64::from(n), vec![hit(), hit()])
            })
            .collect()
    }

    fn drift(cells: &[(String, f64, Vec<HitResponse>)]) -> Option<ContactDrift> {
        let cells: Vec<(f64, CellHits<'_>)> = cells
            .iter()
            .map(|(impact, at, hits)| (*at, CellHits { impact, hits: hits.iter().collect() }))
            .collect();
        ContactDrift::of(&cells)
    }

    #[test]
    fn a_change_is_found_with_its_size_and_none_without() {
        let mut squares = 0.0;
        for seed in 0..200 {
            // within a place of impact, only a quarter of the change is seen
            let found = drift(&campaign(seed, 0.06, 2e-3)).expect("enough cells");
            assert_eq!(found.found(), Some(true), "{found:?}");
            assert!((found.change - 0.06).abs() < 5.0 * found.std, "{found:?}");
            let none = drift(&campaign(1000 + seed, 0.0, 2e-3)).expect("enough cells");
            assert_ne!(none.found(), Some(true), "{none:?}");
            squares += (none.change / none.std).powi(2);
        }
        // about thirty degrees of freedom, and the best of four bands
        let rms = (squares / 200.0).sqrt();
        assert!((0.9..1.4).contains(&rms), "{rms}");
    }

    #[test]
    fn few_cells_and_large_scatter_are_not_clear() {
        assert_eq!(drift(&campaign(1, 0.0, 0.05)).expect("enough cells").found(), None);
        let few: Vec<_> = campaign(1, 0.0, 1e-3).into_iter().step_by(4).collect();
        assert_eq!(drift(&few), None);
    }
}
