//! Loops over long arrays, with the widest vector instructions of the processor in use.
//!
//! Distributed binaries must run on every x86-64 and aarch64 processor, for which the compiler may
//! process two numbers at a time; most machines have four, newer ones eight. The width is selected
//! at run time. Each number is computed by the same operations either way, so results are
//! bit-identical.

use pulp::{Arch, WithSimd};

/// Runs `work`, a loop that is inlined with everything it calls, compiled for this processor.
/// Closures of more than a few lines are not inlined; use a type with an always-inlined `call`
/// instead. A `work` that needs the number of values per vector receives it.
#[inline]
pub(crate) fn wide<T>(work: impl WithSimd<Output = T>) -> T {
    Arch::new().dispatch(work)
}

/// Number of values processed in parallel.
const LANES: usize = 8;

/// Whether all values are finite.
pub(crate) fn all_finite(x: &[f64]) -> bool {
    // blocks without branches process several values per cycle
    let fine = |block: &[f64]| wide(|| block.iter().fold(true, |fine, v| fine & v.is_finite()));
    x.chunks(512).all(fine)
}

/// The largest value; −∞ for an empty array. NaN is ignored.
pub(crate) fn largest(x: &[f64]) -> f64 {
    let (lanes, rest) = x.as_chunks::<LANES>();
    let mut most = [f64::NEG_INFINITY; LANES];
    wide(|| {
        for lane in lanes {
            for i in 0..LANES {
                most[i] = most[i].max(lane[i]);
            }
        }
    });
    most.iter().chain(rest).fold(f64::NEG_INFINITY, |most, v| most.max(*v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_and_the_odd_one_are_found_wherever_they_are() {
        assert_eq!(largest(&[]), f64::NEG_INFINITY);
        for n in [1, 7, 8, 9, 40, 1025] {
            for at in 0..n {
                let mut x = vec![-1.0; n];
                assert!(all_finite(&x));
                x[at] = 2.5;
                assert_eq!(largest(&x), 2.5);
                x[at] = f64::NAN;
                assert!(!all_finite(&x) && (n == 1 || largest(&x) == -1.0));
            }
        }
    }
}
