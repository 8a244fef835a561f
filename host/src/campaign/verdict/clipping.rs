//! Overload: values at the range, or a flat top below it (an amplifier in front of the converter, or a foreign record whose
//! range nobody wrote down).

use crate::spectra::Pulse;

/// Evidence of clipping.
pub(super) struct Clipped {
    /// Level at which the signal stands, in its unit.
    pub(super) level: f64,
    /// Full scale where it is known, else the level again.
    pub(super) limit: f64,
    samples: usize,
}

impl Clipped {
    pub(super) fn sentence(&self, channel: &str, unit: &str) -> String {
        format!(
            "the {channel} stands at {:.4} {unit} for {} samples: it ran into its range",
            self.level, self.samples
        )
    }
}

/// A converter's last step or two below full scale count as full scale.
const AT_RANGE: f64 = 0.999;

/// Samples this close to the top, relative to it, are one flat top. The top of a half sine stays within it for 3 % of the pulse.
const FLAT: f64 = 1e-3;

/// Force at its range, or flat for three samples and an eighth of the pulse's width at half height.
pub(super) fn force(force_n: &[f64], pulse: &Pulse, range_n: Option<f64>) -> Option<Clipped> {
    if let Some(range) = range_n {
        let samples = force_n.iter().filter(|f| f.abs() >= AT_RANGE * range).count();
        if samples > 0 {
            return Some(Clipped { level: range, limit: range, samples });
        }
    }
    let top = force_n[pulse.peak_sample];
    let height = top - pulse.offset_n;
    let slack = (FLAT * height).max(2.5 * pulse.noise_n).min(0.02 * height);
    let mut longest = 0;
    let mut run = 0;
    for f in &force_n[pulse.start..pulse.end] {
        run = if top - f <= slack { run + 1 } else { 0 };
        longest = longest.max(run);
    }
    let half =
        force_n[pulse.start..pulse.end].iter().filter(|f| **f - pulse.offset_n >= 0.5 * height).count();
    // Wider slack under noise keeps more of a round top: its share of the width at half height is 0.95 √(slack / height).
    let round = 0.95 * (slack / height).sqrt() * half as f64;
    let needed = (0.12 * half as f64).max(1.8 * round).max(3.0);
    (longest as f64 >= needed).then_some(Clipped { level: top, limit: top, samples: longest })
}

/// A response at its range.
pub(super) fn response(x: &[f64], range: f64) -> Option<Clipped> {
    let samples = x.iter().filter(|v| v.abs() >= AT_RANGE * range).count();
    (samples > 0).then_some(Clipped { level: range, limit: range, samples })
}
