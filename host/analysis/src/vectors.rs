//! Loops over long arrays, with the widest vector instructions of the processor in use.
//!
//! Distributed binaries must run on every x86-64 and aarch64 processor, for which the compiler may
//! process two numbers at a time; most machines have four, newer ones eight. The width is selected
//! at run time. Each number is computed by the same operations either way, so results are
//! bit-identical.
//!
//! Sums over long arrays in parallel lanes: a single running sum would wait for each addition to
//! finish.

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

/// Σ x.
pub(super) fn sum(x: &[f64]) -> f64 {
    let (lanes, rest) = x.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    wide(|| {
        for lane in lanes {
            for i in 0..LANES {
                sums[i] += lane[i];
            }
        }
    });
    sums.iter().chain(rest).sum()
}

/// Mean of x; NaN for an empty array.
pub(super) fn mean(x: &[f64]) -> f64 {
    sum(x) / x.len() as f64
}

/// Σ x y over the length of the shorter one.
pub(super) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len());
    let ((xs, x), (ys, y)) = (x[..n].as_chunks::<LANES>(), y[..n].as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    wide(|| {
        for (x, y) in xs.iter().zip(ys) {
            for i in 0..LANES {
                sums[i] += x[i] * y[i];
            }
        }
    });
    sums.iter().sum::<f64>() + x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>()
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

#[cfg(test)]
mod sums_tests {
    use super::*;

    #[test]
    fn sums_are_those_of_every_length() {
        for n in 0..40 {
            let x: Vec<f64> = (0..n).map(f64::from).collect();
            assert_eq!(sum(&x), x.iter().sum::<f64>());
            assert_eq!(dot(&x, &x), x.iter().map(|x| x * x).sum::<f64>());
        }
        assert!((mean(&[1.0, 2.0]), dot(&[3.0], &[2.0, 9.0])) == (1.5, 6.0) && mean(&[]).is_nan());
    }
}
