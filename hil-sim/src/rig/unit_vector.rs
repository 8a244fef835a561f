//! Unit vectors.

/// `v` normalised to length one; `v` must not be zero.
pub(super) fn normalized(v: [f64; 3]) -> [f64; 3] {
    // Divided by the largest component first, so that the squares of very small or large vectors
    // neither underflow nor overflow.
    let largest = v.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
    let v = v.map(|c| c / largest);
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}
