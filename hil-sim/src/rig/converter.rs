//! From a channel's true value to its code: the channel's delay, in whole scans and fractions of
//! one, and the converter's rounding to an integer.

/// Delays a signal: cubic interpolation through the four samples around the delayed time.
#[derive(Debug, Clone)]
pub(super) struct DelayLine {
    past: Vec<f64>,
    at: usize,
    /// Age of the newest of the four samples used, in scans, and the four weights.
    first: usize,
    weights: [f64; 4],
}

impl DelayLine {
    pub(super) fn new(delay_scans: f64) -> Self {
        // The cubic is most accurate in its middle interval; a delay below one scan has no newer
        // sample than the present one.
        let first = (delay_scans.floor() as usize).saturating_sub(1);
        let d = delay_scans - first as f64;
        let mut weights = [1.0; 4];
        for (i, weight) in weights.iter_mut().enumerate() {
            for j in (0..4).filter(|j| *j != i) {
                *weight *= (d - j as f64) / (i as f64 - j as f64);
            }
        }
        // A power of two, so that the index wraps with a mask instead of a division.
        Self { past: vec![0.0; (first + 4).next_power_of_two()], at: 0, first, weights }
    }

    #[inline]
    pub(super) fn pass(&mut self, value: f64) -> f64 {
        let mask = self.past.len() - 1;
        self.past[self.at & mask] = value;
        let newest = self.at.wrapping_sub(self.first);
        let late = (0..4).map(|i| self.weights[i] * self.past[newest.wrapping_sub(i) & mask]).sum();
        self.at = self.at.wrapping_add(1);
        late
    }
}

/// Rounded to the nearest code, saturating.
#[inline]
pub(super) fn code(exact: f64) -> i16 {
    // At 1.5 · 2^52 the last bit of an f64 is one, so the sum rounds and its low bits are the
    // integer. Unlike a cast, this needs no branch, so the ten channels are vectorised. The
    // comparisons map NaN to the lower limit.
    const ONES_PLACE: f64 = 6_755_399_441_055_744.0;
    let above = if exact > -32768.0 { exact } else { -32768.0 };
    let within = if above < 32767.0 { above } else { 32767.0 };
    (within + ONES_PLACE).to_bits() as i16
}
