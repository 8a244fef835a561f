//! Finds a hit that differs from all others, and the change that would make it match: channels in
//! another order, a sign, a scale.
//!
//! Each record may be valid and the hits still disagree: a sensor was turned between two hits,
//! cables were swapped, a gain was changed. The FRF of each hit is compared with the mean of the
//! others' FRFs, channel by channel.

use super::cross_spectra::CrossSpectra;
use num_complex::Complex;

/// A hit differs if one of its channels deviates from the others' mean by this fraction of the
/// larger of both
const DIFFERENT: f64 = 0.3;

/// and by this many times the others' scatter.
const BEYOND_SCATTER: f64 = 5.0;

/// A channel matches within this fraction, or within three times the others' scatter.
const FITS: f64 = 0.15;

/// Up to this many channels, all orders are tried.
const MOST_CHANNELS: usize = 4;

/// A hit that differs from the others.
#[derive(Debug, Clone, PartialEq)]
pub struct OddHit {
    /// Its index in the input.
    pub hit: usize,
    /// Largest relative difference of one of its channels from the others' mean.
    pub difference: f64,
    /// The change that makes it match, if any was found.
    pub fit: Option<Fit>,
}

/// Change that makes a hit match the others.
#[derive(Debug, Clone, PartialEq)]
pub enum Fit {
    /// Its channels, in order, are these channels of the others; `true` if the sign is inverted.
    Channels(Vec<(usize, bool)>),
    /// All its channels are the others' times this factor.
    Scaled(f64),
}

/// The hit that differs from the others, from the spectra of each hit over the same lines. With
/// only two hits, each differs from the other; the second one is returned, and only if some change
/// makes it match.
pub fn odd_hit(hits: &[CrossSpectra]) -> Option<OddHit> {
    let first = hits.first()?;
    let (lines, outputs) = (first.lines(), first.outputs());
    let alike = |one: &CrossSpectra| one.lines() == lines && one.outputs() == outputs;
    if hits.len() < 2 || lines == 0 || outputs == 0 || !hits.iter().all(alike) {
        return None;
    }
    let frfs: Vec<Vec<Signal>> = hits
        .iter()
        .map(|hit| (0..outputs).map(|o| (0..lines).map(|line| hit.h1(line, o)).collect()).collect())
        .collect();
    let candidates = if hits.len() == 2 { 1..2 } else { 0..hits.len() };
    let (_, odd) = candidates
        .filter_map(|hit| {
            let others = Others::of(&frfs, hit);
            let beyond = others.beyond(&frfs[hit])?;
            Some((
                beyond,
                OddHit { hit, difference: others.difference(&frfs[hit]), fit: others.fit(&frfs[hit]) },
            ))
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    (hits.len() > 2 || odd.fit.is_some()).then_some(odd)
}

/// FRF of one channel, line by line.
type Signal = Vec<Complex<f64>>;

fn norm(x: &[Complex<f64>]) -> f64 {
    x.iter().map(Complex::norm_sqr).sum::<f64>().sqrt()
}

/// |a − factor b| relative to the larger of both; 0 if both are zero.
fn apart(a: &[Complex<f64>], b: &[Complex<f64>], factor: f64) -> f64 {
    let rest: f64 = a.iter().zip(b).map(|(a, b)| (a - b * factor).norm_sqr()).sum();
    let larger = norm(a).max(factor.abs() * norm(b));
    if larger > 0.0 { rest.sqrt() / larger } else { 0.0 }
}

/// All hits except one.
struct Others {
    /// Mean of each channel.
    mean: Vec<Signal>,
    /// Largest relative deviation of one of them from the mean, for each channel.
    scatter: Vec<f64>,
}

impl Others {
    fn of(frfs: &[Vec<Signal>], without: usize) -> Self {
        let others = || frfs.iter().enumerate().filter(|(hit, _)| *hit != without).map(|(_, frf)| frf);
        let count = others().count() as f64;
        let outputs = frfs[without].len();
        let mean_of = |o: usize| -> Signal {
            let mut sum = vec![Complex::new(0.0, 0.0); frfs[without][o].len()];
            for frf in others() {
                sum.iter_mut().zip(&frf[o]).for_each(|(sum, h)| *sum += h / count);
            }
            sum
        };
        let mean: Vec<Signal> = (0..outputs).map(mean_of).collect();
        let scatter = (0..outputs)
            .map(|o| others().map(|frf| apart(&frf[o], &mean[o], 1.0)).fold(0.0, f64::max))
            .collect();
        Others { mean, scatter }
    }

    fn difference(&self, hit: &[Signal]) -> f64 {
        hit.iter().zip(&self.mean).map(|(a, b)| apart(a, b, 1.0)).fold(0.0, f64::max)
    }

    /// Deviation of the hit relative to the others' scatter; `None` if it is within the tolerance
    /// for differences between hits.
    fn beyond(&self, hit: &[Signal]) -> Option<f64> {
        let ratios = hit.iter().zip(&self.mean).zip(&self.scatter).filter_map(|((a, b), scatter)| {
            let away = apart(a, b, 1.0);
            (away > DIFFERENT && away > BEYOND_SCATTER * scatter).then(|| away / scatter.max(0.02))
        });
        ratios.max_by(f64::total_cmp)
    }

    fn fit(&self, hit: &[Signal]) -> Option<Fit> {
        self.channels(hit).map(Fit::Channels).or_else(|| self.scaled(hit).map(Fit::Scaled))
    }

    fn fits(&self, rest: f64, channel: usize) -> bool {
        rest < FITS.max(3.0 * self.scatter[channel])
    }

    /// The order and signs with the smallest misfit, if every channel then matches; among equals,
    /// the one that changes least.
    fn channels(&self, hit: &[Signal]) -> Option<Vec<(usize, bool)>> {
        let outputs = hit.len();
        if outputs > MOST_CHANNELS {
            return None;
        }
        let rest: Vec<Vec<[f64; 2]>> = hit
            .iter()
            .map(|a| self.mean.iter().map(|b| [apart(a, b, 1.0), apart(a, b, -1.0)]).collect())
            .collect();
        let mut best: Option<(f64, Vec<(usize, bool)>)> = None;
        for order in orders(outputs) {
            for signs in 0..1usize << outputs {
                let own: Vec<(usize, bool)> =
                    order.iter().enumerate().map(|(i, j)| (*j, signs >> i & 1 == 1)).collect();
                let left = |i: usize| rest[i][own[i].0][usize::from(own[i].1)];
                if !(0..outputs).all(|i| self.fits(left(i), own[i].0)) {
                    continue;
                }
                let changed = own.iter().enumerate().filter(|(i, own)| **own != (*i, false)).count();
                let cost = (0..outputs).map(left).sum::<f64>() + 1e-3 * changed as f64;
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, own));
                }
            }
        }
        best.map(|(_, own)| own)
    }

    fn scaled(&self, hit: &[Signal]) -> Option<f64> {
        let (mut product, mut power) = (0.0, 0.0);
        for (a, b) in hit.iter().zip(&self.mean) {
            product += a.iter().zip(b).map(|(a, b)| (a * b.conj()).re).sum::<f64>();
            power += b.iter().map(Complex::norm_sqr).sum::<f64>();
        }
        let factor = product / power;
        let all_fit = || (0..hit.len()).all(|o| self.fits(apart(&hit[o], &self.mean[o], factor), o));
        (factor.is_finite() && factor != 0.0 && all_fit()).then_some(factor)
    }
}

/// All permutations of the numbers below `count`.
fn orders(count: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for _ in 0..count {
        let longer = |order: Vec<usize>| -> Vec<Vec<usize>> {
            let next = (0..count).filter(|n| !order.contains(n)).collect::<Vec<_>>();
            next.into_iter().map(|n| [order.as_slice(), &[n]].concat()).collect()
        };
        all = all.into_iter().flat_map(longer).collect();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::estimate::{FrfSettings, estimate};
    use super::*;
    use crate::frf::MotionQuantity;
    use crate::spectra::estimate::ImpactRecords;
    use std::f64::consts::{PI, TAU};

    const FS: f64 = 4096.0;

    /// Spectra of hits on a ringing structure; `parts` gives the amplitude of each mode, by hit and
    /// channel.
    fn spectra(parts: &[Vec<[f64; 2]>]) -> Vec<CrossSpectra> {
        let force = |i: u32| {
            let t = (f64::from(i) - 40.0) / 8.0;
            if (0.0..1.0).contains(&t) { 20.0 * (PI * t).sin() } else { 0.0 }
        };
        let ring = |i: u32, hz: f64| {
            let t = (f64::from(i) - 44.0) / FS;
            if t > 0.0 { (-20.0 * t).exp() * (TAU * hz * t).sin() } else { 0.0 }
        };
        let records = ImpactRecords {
            fs_hz: FS,
            force_n: vec![(0..2048).map(force).collect(); parts.len()],
            response: (parts.iter())
                .map(|hit| {
                    let of = |[a, b]: &[f64; 2]| -> Vec<f64> {
                        (0..2048).map(|i| a * ring(i, 120.0) + b * ring(i, 310.0)).collect()
                    };
                    hit.iter().map(of).collect()
                })
                .collect(),
            quantity: MotionQuantity::Velocity,
        };
        (0..parts.len())
            .map(|hit| {
                let used: Vec<bool> = (0..parts.len()).map(|i| i == hit).collect();
                estimate(&records, &used, &FrfSettings::default()).expect("a hit").band(50.0, 400.0)
            })
            .collect()
    }

    const XYZ: [[f64; 2]; 3] = [[1.0, 0.2], [0.3, -0.5], [-0.1, 0.1]];

    /// A hit with the channels in this order and with these factors.
    fn hit(order: [usize; 3], factor: [f64; 3]) -> Vec<[f64; 2]> {
        order.iter().zip(factor).map(|(o, factor)| XYZ[*o].map(|part| factor * part)).collect()
    }

    #[test]
    fn a_turned_hit_is_named_with_the_order_and_the_signs_that_fit() {
        let good = || hit([0, 1, 2], [1.0, 1.01, 0.99]);
        for (order, signs) in [
            ([1, 2, 0], [1.0; 3]),
            ([1, 0, 2], [1.0; 3]),
            ([0, 1, 2], [1.0, -1.0, 1.0]),
            ([0, 1, 2], [1.0, 1.0, -1.0]),
            ([2, 1, 0], [1.0, 1.0, -1.0]),
        ] {
            let all = spectra(&[good(), hit(order, signs), hit([0, 1, 2], [1.0; 3]), good()]);
            let odd = odd_hit(&all).expect("one differs");
            let wanted: Vec<(usize, bool)> = order.into_iter().zip(signs.map(|s| s < 0.0)).collect();
            assert_eq!((odd.hit, odd.fit), (1, Some(Fit::Channels(wanted))));
            // of two hits, the second matches the first after a change
            assert!(odd_hit(&all[..2]).is_some_and(|odd| odd.hit == 1 && odd.fit.is_some()));
        }
    }

    #[test]
    fn a_changed_gain_is_a_scale_and_a_strange_hit_fits_nothing() {
        let good = || hit([0, 1, 2], [1.0; 3]);
        let odd = odd_hit(&spectra(&[good(), good(), hit([0, 1, 2], [0.5; 3])])).expect("one differs");
        let Some(Fit::Scaled(factor)) = odd.fit else { panic!("{odd:?}") };
        assert!(odd.hit == 2 && (factor - 0.5).abs() < 1e-9, "{odd:?}");
        let strange = vec![[0.2, 2.0], [0.7, 0.7], [1.0, -3.0]];
        let odd = odd_hit(&spectra(&[strange.clone(), good(), good()])).expect("one differs");
        assert_eq!((odd.hit, odd.fit), (0, None));
        // of two hits that differ, neither can be identified as the odd one
        assert_eq!(odd_hit(&spectra(&[strange, good()])), None);
    }

    #[test]
    fn hits_that_agree_have_no_odd_one() {
        let near = |k: f64| hit([0, 1, 2], [1.0 + 0.02 * k, 1.0 - 0.03 * k, 1.0 + 0.05 * k]);
        assert_eq!(odd_hit(&spectra(&[near(0.0), near(1.0), near(-1.0)])), None);
        assert_eq!(odd_hit(&spectra(&[near(0.0)])), None);
        assert_eq!(odd_hit(&[]), None);
    }
}
