//! The backbone: how force and stiffness of a slipping contact depend on amplitude, as a law fitted
//! to several levels.
//!
//! The law is Iwan's, with slider limits spread evenly from (1 − s) to (1 + s) times their mean: k
//! is its stiffness while all sliders stick, L the force while all of them slip. Without spread it
//! is a single Jenkins slider. At the tip of a loop of amplitude X each slider carries kX or its
//! limit, whichever is less, whatever path Δx took to get there (Masing's rule). The least-squares
//! slope k_eq would require a sinusoidal Δx, which a slipping contact does not have. The law is
//! therefore fitted to the peak secants.

use serde::Serialize;

/// Number of sliders that represent the spread.
const SLIDERS: usize = 20;

/// Three quantities are fitted: with fewer levels than this, the quality of the fit cannot be
/// judged.
pub const FEWEST_LEVELS: usize = 4;

/// Finest step of the spread, and of the logarithm of the reach.
const FINEST: f64 = 1e-3;

/// A law fitted to several levels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Law {
    /// Stiffness while everything sticks, N/m.
    pub stiffness_n_per_m: f64,
    /// Force while everything slips, N.
    pub limit_n: f64,
    /// Half the width of the distribution of the sliders' limits over their mean, 0 (one slider) to
    /// 1.
    pub spread: f64,
    /// Root mean square of the relative differences between the law and the levels' secants.
    pub residual: f64,
}

impl Law {
    /// Fits levels (amplitude of Δx in m, peak secant in N/m); `None` if there are too few, or if
    /// the stiffness never falls.
    pub fn through(levels: &[(f64, f64)]) -> Option<Law> {
        let usable = |(x, k): &(f64, f64)| *x > 0.0 && *k > 0.0 && x.is_finite() && k.is_finite();
        if levels.len() < FEWEST_LEVELS || !levels.iter().all(usable) {
            return None;
        }
        let (low, high) =
            levels.iter().fold((f64::INFINITY, 0.0f64), |(l, h), (x, _)| (l.min(*x), h.max(*x)));
        // a grid search finds the region of the minimum; halving the steps refines it
        let spreads = (0..=19).map(|i| 0.05 * f64::from(i));
        let reaches = (0..=60).map(|i| 0.1 * low * (10.0 * high / low).powf(f64::from(i) / 60.0));
        let grid = spreads.flat_map(|s| reaches.clone().map(move |r| (r, s)));
        let misfit = |(reach, spread): (f64, f64)| Self::with(levels, reach, spread).residual;
        let (mut at, mut least) = ((0.0, 0.0), f64::INFINITY);
        for place in grid {
            let found = misfit(place);
            if found < least {
                (at, least) = (place, found);
            }
        }
        let mut step = 0.05;
        while step > FINEST {
            let (reach, spread) = at;
            let around = [(1.0 + step, 0.0), (1.0 - step, 0.0), (1.0, step), (1.0, -step)];
            let better = around
                .map(|(factor, more)| (reach * factor, (spread + more).clamp(0.0, 0.99)))
                .into_iter()
                .find(|place| misfit(*place) < least);
            match better {
                Some(place) => (at, least) = (place, misfit(place)),
                None => step *= 0.5,
            }
        }
        // the weakest slider must slip below the largest amplitude
        (at.0 * (1.0 - at.1) < high).then(|| Self::with(levels, at.0, at.1))
    }

    /// With this reach L/k (m) and spread; the stiffness follows by least squares.
    fn with(levels: &[(f64, f64)], reach: f64, spread: f64) -> Law {
        let parts = levels.iter().map(|(x, k)| part(*x, reach, spread) / k);
        let (sum, squares) = parts.clone().fold((0.0, 0.0), |(s, q), a| (s + a, q + a * a));
        let stiffness = sum / squares;
        let apart: f64 = parts.map(|a| (stiffness * a - 1.0).powi(2)).sum();
        let residual = (apart / levels.len() as f64).sqrt();
        Law { stiffness_n_per_m: stiffness, limit_n: stiffness * reach, spread, residual }
    }

    /// Peak secant of the loop at this amplitude (m), N/m.
    pub fn secant(&self, amplitude_m: f64) -> f64 {
        self.stiffness_n_per_m * part(amplitude_m, self.limit_n / self.stiffness_n_per_m, self.spread)
    }

    /// Force at the tip of the loop of this amplitude (m), N.
    pub fn tip(&self, amplitude_m: f64) -> f64 {
        let (k, limit) = (self.stiffness_n_per_m, self.limit_n);
        mean(self.spread, |u| (k * amplitude_m).min(limit * u))
    }
}

/// Mean over the sliders of a function of (slider limit / mean limit).
fn mean(spread: f64, of: impl Fn(f64) -> f64) -> f64 {
    let limit = |i: usize| 1.0 + spread * (2.0 * i as f64 / (SLIDERS - 1) as f64 - 1.0);
    (0..SLIDERS).map(|i| of(limit(i))).sum::<f64>() / SLIDERS as f64
}

/// The secant at an amplitude over the stiffness while everything sticks.
fn part(amplitude_m: f64, reach: f64, spread: f64) -> f64 {
    mean(spread, |u| (reach * u / amplitude_m).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: Law = Law { stiffness_n_per_m: 143.7e6, limit_n: 171.0, spread: 0.0, residual: 0.0 };

    #[test]
    fn a_single_slider_has_its_closed_form() {
        // the textbook example: 28.5 N/µm and 171 N at 6 µm
        assert!((LAW.secant(6e-6) / 28.5e6 - 1.0).abs() < 1e-9, "{}", LAW.secant(6e-6));
        assert!(
            (LAW.secant(1e-6) / 143.7e6 - 1.0).abs() < 1e-12 && (LAW.tip(6e-6) / 171.0 - 1.0).abs() < 1e-12
        );
    }

    #[test]
    fn the_law_behind_levels_is_found() {
        for spread in [0.0, 0.4, 0.9] {
            let law = Law { spread, ..LAW };
            let levels: Vec<(f64, f64)> =
                [0.3e-6, 0.6e-6, 0.9e-6, 1.15e-6, 1.25e-6, 1.8e-6].map(|x| (x, law.secant(x))).to_vec();
            let found = Law::through(&levels).expect("enough levels");
            assert!((found.stiffness_n_per_m / 143.7e6 - 1.0).abs() < 0.01, "{found:?}");
            assert!((found.limit_n / 171.0 - 1.0).abs() < 0.02, "{found:?}");
            assert!((found.spread - spread).abs() < 0.05 && found.residual < 5e-3, "{found:?}");
        }
    }

    #[test]
    fn where_nothing_slips_or_little_was_measured_there_is_no_law() {
        let stuck: Vec<(f64, f64)> = [0.1e-6, 0.2e-6, 0.3e-6, 0.4e-6].map(|x| (x, 180e6)).to_vec();
        assert_eq!(Law::through(&stuck), None);
        assert_eq!(Law::through(&stuck[..3]), None);
        assert_eq!(Law::through(&[(1e-6, 1e8), (2e-6, f64::NAN), (3e-6, 1e7), (4e-6, 1e7)]), None);
    }
}
