//! Random numbers that depend only on their purpose.
//!
//! Every stream is seeded from the rig's seed and a list of words (configuration, cell, attempt,
//! purpose): FNV-1a (64 bit) over the words' bytes, each word preceded by its length so that
//! "a","bc" and "ab","c" differ, then SplitMix64's finaliser to distribute the bits that FNV leaves
//! clustered. This is part of the format of simulated campaigns: changing it changes every record.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

/// The random generator of every stream.
pub type Stream = Xoshiro256PlusPlus;

/// The stream of `words` on the rig `seed`.
pub fn stream(seed: u64, words: &[&str]) -> Stream {
    Stream::seed_from_u64(key(seed, words))
}

/// A standard normal random number.
#[inline]
pub fn normal(stream: &mut Stream) -> f64 {
    StandardNormal.sample(stream)
}

/// Uniform in [0, 1).
#[inline]
pub fn uniform(stream: &mut Stream) -> f64 {
    use rand::Rng;
    // The upper 53 bits are the generator's best, and exactly fill an f64's mantissa.
    (stream.next_u64() >> 11) as f64 * (-53_f64).exp2()
}

fn key(seed: u64, words: &[&str]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut eat = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    seed.to_le_bytes().into_iter().for_each(&mut eat);
    for word in words {
        (word.len() as u64).to_le_bytes().into_iter().for_each(&mut eat);
        word.bytes().for_each(&mut eat);
    }
    let mut z = hash.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_the_format_and_do_not_change() {
        assert_eq!(key(1, &["AJB", "AZ1", "A1"]), key(1, &["AJB", "AZ1", "A1"]));
        assert_ne!(key(1, &["a", "bc"]), key(1, &["ab", "c"]));
        assert_ne!(key(1, &["a"]), key(2, &["a"]));
    }
}
