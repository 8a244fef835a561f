//! The band in which the hammer effectively excited the structure.

use crate::band::Band;

/// The band around the maximum of the force auto-spectrum in which the spectrum stays within
/// `drop_db` (conventionally 6 dB) of it.
///
/// `s_ff` is a power: −6 dB is a factor of four. `None` when there is no line above 0 Hz or no
/// force.
pub fn usable_band(frequency_hz: &[f64], s_ff: &[f64], drop_db: f64) -> Option<Band> {
    let first = frequency_hz.iter().position(|f| *f > 0.0)?;
    let n = frequency_hz.len().min(s_ff.len());
    let top = (first..n).max_by(|&a, &b| s_ff[a].total_cmp(&s_ff[b]))?;
    let limit = s_ff[top] * 10f64.powf(-drop_db / 10.0);
    if !limit.is_finite() || limit <= 0.0 {
        return None;
    }
    let low = (first..=top).rev().take_while(|&l| s_ff[l] >= limit).last()?;
    let high = (top..n).take_while(|&l| s_ff[l] >= limit).last()?;
    Some(Band { low_hz: frequency_hz[low], high_hz: frequency_hz[high] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_sine_of_0_41_ms_reaches_2_khz() {
        let f: Vec<f64> = (0..1000).map(|i| 5.0 * i as f64).collect();
        // |F| of a half sine of width T: cos(π f T) / (1 − (2 f T)²)
        let s: Vec<f64> = f
            .iter()
            .map(|f| {
                let x = f * 0.41e-3;
                if (x - 0.5).abs() < 1e-9 {
                    std::f64::consts::FRAC_PI_4.powi(2)
                } else {
                    ((std::f64::consts::PI * x).cos() / (1.0 - 4.0 * x * x)).powi(2)
                }
            })
            .collect();
        let band = usable_band(&f, &s, 6.0).expect("a band");
        assert_eq!(band.low_hz, 5.0);
        // −6 dB of a half sine lies at 0.82 / T = 2.0 kHz
        assert!((band.high_hz - 2000.0).abs() < 30.0, "{band:?}");
        assert_eq!(usable_band(&f, &vec![0.0; 1000], 6.0), None);
    }
}
