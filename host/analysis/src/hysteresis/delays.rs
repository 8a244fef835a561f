//! Aligns signals in time: removes the delays of each channel's decoder and converter.

/// Removes the relative delays (s) of the signals: afterwards all have the delay of the least
/// delayed one.
pub fn in_step<const N: usize>(signals: [Vec<f64>; N], delays_s: [f64; N], fs_hz: f64) -> [Vec<f64>; N] {
    let least = delays_s.into_iter().fold(f64::INFINITY, f64::min);
    let mut delays = delays_s.into_iter();
    signals.map(|signal| {
        let delay = delays.next().unwrap_or(least);
        advance(signal, (delay - least) * fs_hz)
    })
}

/// The signal `samples` earlier (not negative), by linear interpolation between samples, which
/// suffices because loop frequencies lie far below the sampling rate. The last value is repeated at
/// the end.
fn advance(mut signal: Vec<f64>, samples: f64) -> Vec<f64> {
    let Some(last) = signal.last().copied().filter(|_| samples > 0.0) else { return signal };
    let (whole, share) = (samples.floor() as usize, samples.fract());
    // only later samples are read, so it works in place
    let good = signal.len().saturating_sub(whole + 1);
    for i in 0..good {
        signal[i] = signal[i + whole] * (1.0 - share) + signal[i + whole + 1] * share;
    }
    signal[good..].fill(last);
    signal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_are_advanced_by_their_delay() {
        let ramp: Vec<f64> = (0..10).map(f64::from).collect();
        assert_eq!(advance(ramp.clone(), 0.0), ramp);
        let early = advance(ramp, 1.5);
        assert_eq!(early[..3], [1.5, 2.5, 3.5]);
        assert_eq!(early.len(), 10);
        assert!(advance(vec![], 3.0).is_empty());
    }

    #[test]
    fn the_least_late_signal_stays_where_it_is() {
        let ramp: Vec<f64> = (0..10).map(f64::from).collect();
        let [a, b] = in_step([ramp.clone(), ramp.clone()], [0.2, 0.1], 20.0);
        assert_eq!((a[0], &b), (2.0, &ramp));
    }
}
