//! Directions.

/// `v` at length one; `v` must not be zero.
pub(super) fn normalized(v: [f64; 3]) -> [f64; 3] {
    // The largest component goes first, so that neither tiny nor huge vectors leave the range of their squares.
    let largest = v.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
    let v = v.map(|c| c / largest);
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}
