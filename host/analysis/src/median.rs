//! Median of long records, used as an estimate that is robust against pulses and bursts, and noise
//! by it.

use crate::vectors::wide;
use pulp::NullaryFnOnce;

/// With fewer values, all of them are searched directly.
const FEW: usize = 4096;
/// Size of the sample that brackets the median.
const SAMPLE: usize = 1024;
/// Width of the bracket around the sample's median, ranks: four standard deviations (√1024 / 2 =
/// 16).
const MARGIN: usize = 64;

/// Values that are tested together for any inside the bracket.
const BLOCK: usize = 64;

/// The value at half the length of the list sorted by [`f64::total_cmp`]; `None` for an empty list.
///
/// A sample brackets the median. For a coarsely quantised signal, whose few values recur often, the
/// sample's median is already the result, and only needs to be confirmed by counting. Otherwise the
/// values between two values of the sample are searched. If the bracket was wrong, as can happen
/// for a periodic record, all values are searched.
pub fn middle(values: &[f64]) -> Option<f64> {
    let at = values.len() / 2;
    let all = || values.iter().map(|v| key(*v)).collect::<Vec<i64>>();
    if values.len() < FEW {
        return (!values.is_empty()).then(|| value(*all().select_nth_unstable(at).1));
    }
    let mut sample: Vec<i64> = values.iter().step_by(values.len() / SAMPLE).map(|v| key(*v)).collect();
    sample.sort_unstable();
    let middle = sample.len() / 2;
    let [below, equal] = wide(Counted { values, from: sample[middle], to: sample[middle] });
    if (below..below + equal).contains(&at) {
        return Some(value(sample[middle]));
    }
    let (from, to) = if at < below {
        (sample[middle - MARGIN], sample[middle])
    } else {
        (sample[middle], sample[middle + MARGIN])
    };
    let [below, count] = wide(Counted { values, from, to });
    if !(below..below + count).contains(&at) {
        return Some(value(*all().select_nth_unstable(at).1));
    }
    let mut between = Vec::with_capacity(count);
    for block in values.chunks(BLOCK) {
        let [_, within] = wide(Counted { values: block, from, to });
        if within > 0 {
            between.extend(block.iter().map(|v| key(*v)).filter(|key| (from..=to).contains(key)));
        }
    }
    Some(value(*between.select_nth_unstable(at - below).1))
}

/// Counts the keys below `from`, and those from `from` to `to` inclusive.
struct Counted<'a> {
    values: &'a [f64],
    from: i64,
    to: i64,
}

impl NullaryFnOnce for Counted<'_> {
    type Output = [usize; 2];

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) -> [usize; 2] {
        let (mut below, mut up_to) = (0_u64, 0_u64);
        for value in self.values {
            let key = key(*value);
            below += u64::from(key < self.from);
            up_to += u64::from(key <= self.to);
        }
        [below as usize, (up_to - below) as usize]
    }
}

/// Maps a value to an integer of the same order as [`f64::total_cmp`]; integers compare faster.
#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[inline(always)]
fn key(value: f64) -> i64 {
    let bits = value.to_bits().cast_signed();
    bits ^ ((bits >> 63).cast_unsigned() >> 1).cast_signed()
}

/// The value of a key; the bit operation is its own inverse.
fn value(key: i64) -> f64 {
    f64::from_bits((key ^ ((key >> 63).cast_unsigned() >> 1).cast_signed()).cast_unsigned())
}

/// Standard deviation of the independent noise of a closed signal, from the median of its third
/// differences: smooth parts vanish in them, and few corners do not move a median.
pub(crate) fn noise_of(signal: &[f64]) -> f64 {
    let n = signal.len();
    let third = |i: usize| {
        let at = |by: usize| signal[(i + by) % n];
        (at(3) - 3.0 * at(2) + 3.0 * at(1) - at(0)).abs()
    };
    let differences: Vec<f64> = (0..n).map(third).collect();
    // the median of |N(0, 1)| is 0.6745, and the squares of 1, 3, 3, 1 add up to 20
    middle(&differences).unwrap_or(f64::NAN) / (0.6745 * 20f64.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn sorted(values: &[f64]) -> Option<f64> {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    }

    #[test]
    fn it_is_the_middle_of_the_sorted_list() {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(5);
        for n in (0..40).chain([FEW - 1, FEW, FEW + 1, 51_199, 102_400]) {
            let noise: Vec<f64> = (0..n).map(|_| stream.random_range(-1.0..1.0)).collect();
            // few different values, as in a quiet channel; rising; a wave whose period divides the
            // sampling step; zeros of both signs
            let coarse = noise.iter().map(|v| (v * 3.0).round()).collect();
            let rising = (0..n).map(|i| i as f64 - 9.0).collect();
            let wave = (0..n).map(|i| ((i % 100) as f64 - 50.0) / 7.0).collect();
            let infinite = noise.iter().map(|v| if *v > 0.9 { f64::INFINITY } else { *v }).collect();
            for values in [noise, coarse, rising, wave, infinite] {
                let values: Vec<f64> = values;
                assert_eq!(middle(&values).map(f64::to_bits), sorted(&values).map(f64::to_bits), "{n}");
            }
        }
    }

    #[test]
    fn a_sample_that_misleads_changes_nothing() {
        // every sampled value is far above the others
        let step = 102_400 / SAMPLE;
        let values: Vec<f64> =
            (0..102_400).map(|i| if i % step == 0 { 1e9 + i as f64 } else { (i % 977) as f64 }).collect();
        assert_eq!(middle(&values), sorted(&values));
    }
}
