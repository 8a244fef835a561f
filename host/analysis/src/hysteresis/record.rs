//! Data of a hysteresis measurement: motion on both sides of the contact, and the tangential force,
//! aligned in time by removing the delays of each channel's decoder and converter.

use super::HysteresisError;
use crate::parallel::prelude::*;
use std::ops::Range;

/// A record shorter than this cannot contain a loop.
const FEWEST_SAMPLES: usize = 32;

/// A time record. All signals have the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct HysteresisRecord {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Motion on both sides of the contact.
    pub motion: RelativeMotion,
    /// Tangential force T, N: the load cells' sum, or a corrected force; positive when it pushes A
    /// back.
    pub force_n: Vec<f64>,
    /// Frequency of the shaker, Hz; `None` for an impact.
    pub excitation_hz: Option<f64>,
    /// Normal load, N, if known.
    pub normal_load_n: Option<f64>,
}

/// Motion of the two specimens along the sliding direction.
#[derive(Debug, Clone, PartialEq)]
pub enum RelativeMotion {
    /// Measured by vibrometers.
    Velocity {
        /// Of specimen A, m/s.
        a_m_per_s: Vec<f64>,
        /// Of specimen B, m/s.
        b_m_per_s: Vec<f64>,
    },
    /// Measured by displacement sensors.
    Displacement {
        /// Of specimen A, m.
        a_m: Vec<f64>,
        /// Of specimen B, m.
        b_m: Vec<f64>,
    },
}

/// Relative motion A − B, in the measured quantity.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Relative {
    /// Velocity, m/s.
    Velocity(Vec<f64>),
    /// Displacement, m.
    Displacement(Vec<f64>),
}

impl HysteresisRecord {
    pub(super) fn relative(&self) -> Relative {
        let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        match &self.motion {
            RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => {
                Relative::Velocity(difference(a_m_per_s, b_m_per_s))
            }
            RelativeMotion::Displacement { a_m, b_m } => Relative::Displacement(difference(a_m, b_m)),
        }
    }

    /// A − B over a range of samples, into `to`; beyond the ends of the record its end values are
    /// repeated.
    pub(super) fn relative_motion(&self, range: Range<isize>, to: &mut Vec<f64>) {
        let (RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b }
        | RelativeMotion::Displacement { a_m: a, b_m: b }) = &self.motion;
        within(range, a.len(), to, |inside, to| {
            to.extend(a[inside.clone()].iter().zip(&b[inside]).map(|(a, b)| a - b));
        });
    }

    /// The force over a range of samples, as [`Self::relative_motion`].
    pub(super) fn force(&self, range: Range<isize>, to: &mut Vec<f64>) {
        within(range, self.force_n.len(), to, |inside, to| to.extend(&self.force_n[inside]));
    }

    pub(super) fn check(&self) -> Result<(), HysteresisError> {
        let (a, b) = match &self.motion {
            RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => (a_m_per_s, b_m_per_s),
            RelativeMotion::Displacement { a_m, b_m } => (a_m, b_m),
        };
        if a.len() != b.len() || a.len() != self.force_n.len() {
            return Err(HysteresisError::Lengths { a: a.len(), b: b.len(), force: self.force_n.len() });
        }
        if a.len() < FEWEST_SAMPLES {
            return Err(HysteresisError::TooShort { samples: a.len() });
        }
        if self.fs_hz.is_nan() || self.fs_hz <= 0.0 {
            return Err(HysteresisError::SamplingRate(self.fs_hz));
        }
        let bad = [a, b, &self.force_n].into_iter().filter_map(|x| not_finite(x)).min();
        if let Some(sample) = bad {
            return Err(HysteresisError::NotFinite { sample });
        }
        Ok(())
    }
}

/// Number of samples checked per chunk.
const CHUNK: usize = 1 << 14;

/// Index of the first value that is not finite.
fn not_finite(x: &[f64]) -> Option<usize> {
    let place = |(chunk, values): (usize, &[f64])| {
        // without an early exit, the compiler vectorises the loop
        let all = values.iter().fold(true, |all, v| all & v.is_finite());
        if all { None } else { values.iter().position(|v| !v.is_finite()).map(|i| chunk * CHUNK + i) }
    };
    x.par_chunks(CHUNK).enumerate().filter_map(place).min()
}

/// Fills `to` with a range of samples out of `len`: the part inside by `fill`, the parts outside
/// with the first and last value.
pub(super) fn within(
    range: Range<isize>,
    len: usize,
    to: &mut Vec<f64>,
    fill: impl FnOnce(Range<usize>, &mut Vec<f64>),
) {
    let len = len.cast_signed();
    let inside = range.start.clamp(0, len - 1)..range.end.clamp(1, len);
    to.clear();
    fill(inside.start as usize..inside.end as usize, to);
    let (Some(first), Some(last)) = (to.first().copied(), to.last().copied()) else { return };
    let before = (inside.start - range.start).max(0) as usize;
    to.splice(0..0, std::iter::repeat_n(first, before));
    to.resize(to.len() + (range.end - inside.end).max(0) as usize, last);
}

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
