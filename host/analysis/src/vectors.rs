//! Loops over long rows, with the widest vectors that the processor at hand has.
//!
//! What is shipped runs on every x86-64 and every aarch64, so that the compiler may use two numbers at a time; most machines
//! have four, newer ones eight. Which a loop gets is found out when it runs. Each number is computed by the same operations either way: results are equal to the
//! last bit.

use pulp::{Arch, WithSimd};

/// Does `work`, a loop that is inlined with all that it calls, compiled for this processor. A closure of more than a few lines is not
/// inlined: that takes a type with a `call` that always is. A work that has to know how many numbers a vector holds is told.
#[inline]
pub(crate) fn wide<T>(work: impl WithSimd<Output = T>) -> T {
    Arch::new().dispatch(work)
}

/// Values that are looked at side by side.
const LANES: usize = 8;

/// Whether all are numbers.
pub(crate) fn all_finite(x: &[f64]) -> bool {
    // blocks without branches inside are several values per cycle
    let fine = |block: &[f64]| wide(|| block.iter().fold(true, |fine, v| fine & v.is_finite()));
    x.chunks(512).all(fine)
}

/// The largest value; −∞ of nothing. What is not a number does not count.
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
