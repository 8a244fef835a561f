//! Sums over long arrays in parallel lanes: a single running sum would wait for each addition to
//! finish.

use crate::vectors::wide;

/// Number of parallel partial sums.
const LANES: usize = 8;

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
    fn sums_are_those_of_every_length() {
        for n in 0..40 {
            let x: Vec<f64> = (0..n).map(f64::from).collect();
            assert_eq!(sum(&x), x.iter().sum::<f64>());
            assert_eq!(dot(&x, &x), x.iter().map(|x| x * x).sum::<f64>());
        }
        assert!((mean(&[1.0, 2.0]), dot(&[3.0], &[2.0, 9.0])) == (1.5, 6.0) && mean(&[]).is_nan());
    }
}
