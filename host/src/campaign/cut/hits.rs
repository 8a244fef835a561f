//! Finds the hits in a long force signal.
//!
//! The signal is read twice, in pieces of any length. The first reading ([`ForceLevels`]) finds,
//! in blocks of a quarter second, the resting level (median) and how far the signal usually rises
//! above it. Slow drift of the amplifier moves the resting level, and noise and mains hum raise the
//! usual excursion; hits fill few blocks and change neither. The second reading ([`HitFinder`])
//! takes the force above the resting level and reports every time that it exceeds the plan's
//! trigger level and twice the usual excursion.

/// Length of a block, s: no pulse fills half of it, and the resting level drifts little in it.
const BLOCK_S: f64 = 0.25;
/// Fewest samples of a block.
const FEWEST: usize = 32;
/// Blocks on each side that determine the usual excursion.
const AROUND: usize = 20;
/// Quantile of their excursions: hits may fill up to two thirds of the blocks.
const USUAL: f64 = 0.3;
/// A hit rises to this multiple of the usual excursion. The largest of the samples of a block of
/// Gaussian noise varies by less than half.
const ABOVE: f64 = 2.0;
/// A pulse ends when the force falls below this fraction of the level, so that noise on its flank
/// does not count as another pulse.
const RELEASE: f64 = 0.5;
/// The sign of the force is wrong if this many times more blocks fall than rise.
const REVERSED: usize = 3;

/// What counts as a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HitCriteria {
    /// Force above the resting level, N.
    pub level_n: f64,
    /// A pulse within this time after the end of the one before belongs to the same hit, s: the
    /// hammer bounced.
    pub apart_s: f64,
}

/// A hit in the force signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundHit {
    /// Scan at which the force reaches the level.
    pub start: u64,
    /// Scan of its highest value.
    pub peak_scan: u64,
    /// The highest value above the resting level, N.
    pub peak_n: f64,
    /// Time above the level of its first pulse, s.
    pub width_s: f64,
    /// Number of pulses above the level: more than one if the hammer bounced.
    pub pulses: usize,
}

/// A block of the first reading.
#[derive(Clone, Copy, Debug)]
struct Block {
    middle: f64,
    rise: f64,
    fall: f64,
}

/// The first reading: resting level and usual excursion over time.
#[derive(Debug)]
pub struct ForceLevels {
    length: usize,
    open: Vec<f64>,
    blocks: Vec<Block>,
}

impl ForceLevels {
    /// No samples yet, of a signal with this rate.
    pub fn new(fs_hz: f64) -> Self {
        let length = ((BLOCK_S * fs_hz) as usize).max(FEWEST);
        Self { length, open: Vec::with_capacity(length), blocks: Vec::new() }
    }

    /// Takes the next samples, N.
    pub fn push(&mut self, mut force_n: &[f64]) {
        while !force_n.is_empty() {
            let (now, rest) = force_n.split_at(force_n.len().min(self.length - self.open.len()));
            self.open.extend_from_slice(now);
            force_n = rest;
            if self.open.len() == self.length {
                self.close();
            }
        }
    }

    fn close(&mut self) {
        let most = self.open.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = self.open.iter().copied().fold(f64::INFINITY, f64::min);
        let at = self.open.len() / 2;
        let middle = *self.open.select_nth_unstable_by(at, f64::total_cmp).1;
        self.blocks.push(Block { middle, rise: most - middle, fall: middle - least });
        self.open.clear();
    }

    /// Ends the first reading. The last block may be shorter, unless it is too short for a median.
    fn finish(&mut self) {
        if self.open.len() >= FEWEST || (self.blocks.is_empty() && !self.open.is_empty()) {
            self.close();
        }
        self.open.clear();
    }

    /// Whether the force falls during the hits instead of rising: its sign is wrong.
    pub fn is_reversed(&self, criteria: &HitCriteria) -> bool {
        let usual = |of: fn(&Block) -> f64, at: usize| usual(&self.blocks, at, of);
        let count = |of: fn(&Block) -> f64, other: fn(&Block) -> f64| {
            let blocks = self.blocks.iter().enumerate();
            let is_hit = |(at, block): &(usize, &Block)| {
                of(block) > criteria.level_n.max(ABOVE * usual(of, *at)) && of(block) > 2.0 * other(block)
            };
            blocks.filter(is_hit).count()
        };
        let (rises, falls) = (count(|b| b.rise, |b| b.fall), count(|b| b.fall, |b| b.rise));
        falls > REVERSED * rises
    }
}

/// The usual excursion around a block.
fn usual(blocks: &[Block], at: usize, of: fn(&Block) -> f64) -> f64 {
    let range = at.saturating_sub(AROUND)..(at + AROUND + 1).min(blocks.len());
    let mut all: Vec<f64> = blocks[range].iter().map(of).collect();
    // below the length, since the quantile is below 1
    let place = (USUAL * all.len() as f64) as usize;
    *all.select_nth_unstable_by(place, f64::total_cmp).1
}

/// A hit that has begun.
#[derive(Clone, Copy, Debug)]
struct Open {
    hit: FoundHit,
    last_above: u64,
    released: bool,
}

/// The second reading.
#[derive(Debug)]
pub struct HitFinder {
    fs_hz: f64,
    apart: u64,
    length: usize,
    middles: Vec<f64>,
    levels: Vec<f64>,
    scan: u64,
    open: Option<Open>,
    found: Vec<FoundHit>,
}

impl HitFinder {
    /// Begins the second reading with what the first one found.
    pub fn new(mut first: ForceLevels, fs_hz: f64, criteria: &HitCriteria) -> Self {
        first.finish();
        let level = |at| criteria.level_n.max(ABOVE * usual(&first.blocks, at, |b| b.rise));
        Self {
            fs_hz,
            apart: (criteria.apart_s * fs_hz).ceil() as u64,
            length: first.length,
            middles: first.blocks.iter().map(|block| block.middle).collect(),
            levels: (0..first.blocks.len()).map(level).collect(),
            scan: 0,
            open: None,
            found: Vec::new(),
        }
    }

    /// The resting level at a scan: a line through the blocks' medians.
    fn middle(&self, scan: u64) -> f64 {
        let at = scan as f64 / self.length as f64 - 0.5;
        let left = at.floor().max(0.0) as usize;
        let last = self.middles.len().saturating_sub(1);
        let (one, other) = (self.middles.get(left.min(last)), self.middles.get((left + 1).min(last)));
        let part = (at - left as f64).clamp(0.0, 1.0);
        one.zip(other).map_or(0.0, |(one, other)| one + part * (other - one))
    }

    /// The lowest force that counts as a hit at a scan, N.
    pub fn level_n(&self, scan: u64) -> f64 {
        let at = (scan / self.length as u64) as usize;
        self.levels.get(at.min(self.levels.len().saturating_sub(1))).copied().unwrap_or(f64::INFINITY)
    }

    /// Takes the next samples, N.
    pub fn push(&mut self, force_n: &[f64]) {
        for value in force_n {
            let scan = self.scan;
            self.scan += 1;
            let level = self.level_n(scan);
            // cheap test first: most samples are far below the level
            if self.open.is_none() && *value < level + self.lowest_middle(scan) {
                continue;
            }
            let force = value - self.middle(scan);
            if force < level {
                if let Some(open) = &mut self.open {
                    if force < RELEASE * level && !open.released {
                        open.released = true;
                        if open.hit.pulses == 1 {
                            open.hit.width_s = (scan - open.hit.start) as f64 / self.fs_hz;
                        }
                    }
                    if scan - open.last_above > self.apart {
                        self.found.extend(self.open.take().map(|open| open.hit));
                    }
                }
                continue;
            }
            match &mut self.open {
                None => {
                    let hit =
                        FoundHit { start: scan, peak_scan: scan, peak_n: force, width_s: 0.0, pulses: 1 };
                    self.open = Some(Open { hit, last_above: scan, released: false });
                }
                Some(open) => {
                    if open.released {
                        open.hit.pulses += 1;
                        open.released = false;
                    }
                    if force > open.hit.peak_n {
                        (open.hit.peak_n, open.hit.peak_scan) = (force, scan);
                    }
                    open.last_above = scan;
                }
            }
        }
    }

    /// The lower of the two medians between which the resting level lies.
    fn lowest_middle(&self, scan: u64) -> f64 {
        let at = (scan / self.length as u64) as usize;
        let range = at.saturating_sub(1)..(at + 2).min(self.middles.len());
        self.middles.get(range).unwrap_or_default().iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Every hit of the signal, in order.
    pub fn finish(mut self) -> Vec<FoundHit> {
        self.found.extend(self.open.take().map(|open| open.hit));
        self.found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use std::f64::consts::{PI, TAU};

    const FS_HZ: f64 = 5000.0;
    const CRITERIA: HitCriteria = HitCriteria { level_n: 3.0, apart_s: 0.25 };

    fn find(force: &[f64]) -> Vec<FoundHit> {
        let mut first = ForceLevels::new(FS_HZ);
        force.chunks(777).for_each(|piece| first.push(piece));
        let mut second = HitFinder::new(first, FS_HZ, &CRITERIA);
        force.chunks(1031).for_each(|piece| second.push(piece));
        second.finish()
    }

    fn pulse(force: &mut [f64], at_s: f64, peak_n: f64) {
        let width = 4e-3;
        for (i, value) in force.iter_mut().enumerate() {
            let t = i as f64 / FS_HZ - at_s;
            if (0.0..width).contains(&t) {
                *value += peak_n * (PI * t / width).sin();
            }
        }
    }

    /// A minute with drift, noise of 0.3 N rms and 2 N of mains hum.
    fn background() -> Vec<f64> {
        let mut dice = Xoshiro256PlusPlus::seed_from_u64(5);
        let scans = (60.0 * FS_HZ) as usize;
        (0..scans)
            .map(|i| {
                let t = i as f64 / FS_HZ;
                let noise: f64 = StandardNormal.sample(&mut dice);
                20.0 - 0.5 * t + 2.0 * (TAU * 50.0 * t).sin() + 0.3 * noise
            })
            .collect()
    }

    #[test]
    fn hits_are_found_in_drift_noise_and_hum() {
        let mut force = background();
        assert_eq!(find(&force), []);
        let times = [0.01, 5.0, 5.6, 20.0, 59.99];
        for at in times {
            pulse(&mut force, at, 40.0);
        }
        // a weak touch, and a bounce after 60 ms
        pulse(&mut force, 30.0, 12.0);
        pulse(&mut force, 20.06, 15.0);
        let found = find(&force);
        let at: Vec<f64> = found.iter().map(|hit| hit.start as f64 / FS_HZ).collect();
        let wanted = [0.01, 5.0, 5.6, 20.0, 30.0, 59.99];
        assert_eq!(at.len(), wanted.len(), "{at:?}");
        // the level is reached within a millisecond
        assert!(at.iter().zip(wanted).all(|(one, other)| (0.0..1e-3).contains(&(one - other))), "{at:?}");
        assert_eq!(found.iter().map(|hit| hit.pulses).collect::<Vec<_>>(), [1, 1, 1, 2, 1, 1]);
        // hum of 2 N and four times the noise of 0.3 N
        assert!(
            found
                .iter()
                .zip([40.0, 40.0, 40.0, 40.0, 12.0, 40.0])
                .all(|(hit, n)| (hit.peak_n - n).abs() < 3.5)
        );
        assert!((found[1].width_s - 4e-3).abs() < 1.2e-3, "{}", found[1].width_s);
    }

    #[test]
    fn a_force_of_the_wrong_sign_is_noticed() {
        let mut force = background();
        for at in 0..10 {
            pulse(&mut force, 3.0 + 5.0 * f64::from(at), 40.0);
        }
        let is_reversed = |force: &[f64]| {
            let mut first = ForceLevels::new(FS_HZ);
            first.push(force);
            first.is_reversed(&CRITERIA)
        };
        assert!(!is_reversed(&force));
        assert!(is_reversed(&force.iter().map(|f| -f).collect::<Vec<_>>()));
        assert!(!is_reversed(&background()));
    }

    #[test]
    fn short_and_empty_signals_give_no_hits() {
        assert_eq!(find(&[]), []);
        assert_eq!(find(&[1.0; 10]), []);
        assert_eq!(find(&vec![0.0; 5000]), []);
    }
}
