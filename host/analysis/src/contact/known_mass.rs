//! The scale of k_T from a known mass: a free body of mass m that is struck along the sliding
//! direction moves by F = m a, so that s m v / F of each sensor is (1 + its gain's error) /
//! (1 + the hammer's). k_T is proportional to that ratio's inverse, and nothing else in a campaign
//! shows it: where all vibrometers or the hammer are off, the contact only seems to be stiffer or
//! softer. (Established practice: ISO 7626-5, ratio calibration.)

use super::BAND;
use crate::frf::MotionQuantity;
use crate::frf::noise::shared_by_lines;
use crate::spectra::CrossSpectra;

/// What hits on a free body of known mass along the sliding direction show. Each ratio |s m v / F|,
/// with its standard deviation from noise, is 1 if the sensor's velocity v and the hammer's force F
/// are right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownMass {
    /// Relative standard deviation of the mass, and of hits beside its centre of gravity.
    pub sigma: f64,
    /// The ratios of the vibrometers of spots A and B if they were aimed at the mass.
    pub spots: [Option<[f64; 2]>; 2],
    /// That of the 3-D vibrometer's axis along the sliding direction.
    pub point: Option<[f64; 2]>,
    /// Which of its axes that is: 0, 1 or 2.
    pub axis: usize,
}

/// The ratio |s m v / F| of one output of the hits on a body of `mass_kg`, and its standard
/// deviation: mean and scatter over the lines of [`BAND`]. The body's support must be soft, its
/// first mode far below the band. `None` with fewer than two such lines, or where the output shows
/// nothing.
pub fn mass_ratio(
    spectra: &CrossSpectra,
    output: usize,
    quantity: MotionQuantity,
    mass_kg: f64,
) -> Option<[f64; 2]> {
    let frequency_hz = spectra.frequency_hz();
    let inside: Vec<usize> = (0..spectra.lines()).filter(|l| BAND.contains(frequency_hz[*l])).collect();
    // acceleration times mass, per newton
    let order = 2 - quantity.order_of_s();
    let ratios: Vec<f64> = inside
        .iter()
        .map(|l| (spectra.h1(*l, output) * spectra.s(*l).powi(order)).norm() * mass_kg)
        .collect();
    let [first, second, ..] = inside[..] else { return None };
    let n = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / n;
    let scatter = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let shared = shared_by_lines(spectra.sigma_per_s(), frequency_hz[second] - frequency_hz[first]);
    let sigma = (scatter * shared / n).sqrt();
    (mean > 0.0 && mean.is_finite() && sigma.is_finite()).then_some([mean, sigma.max(ROUNDING * mean)])
}

/// Relative standard deviation below which a ratio is not known: windows and delays.
const ROUNDING: f64 = 1e-4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::cross_spectra::OutputSums;
    use num_complex::Complex;

    #[test]
    fn a_free_mass_shows_the_product_of_both_gains() {
        let (mass_kg, gains, sigma_per_s) = (3.0, 1.04 / 0.97, 2.3);
        let frequency_hz: Vec<f64> = (0..2000).map(|line| 0.5 * f64::from(line)).collect();
        for (quantity, order) in [
            (MotionQuantity::Velocity, 1),
            (MotionQuantity::Displacement, 2),
            (MotionQuantity::Acceleration, 0),
        ] {
            let value = |f: &f64| {
                let s = Complex::new(sigma_per_s, std::f64::consts::TAU * f);
                gains / (mass_kg * s.powi(order)) * (-s * 2e-5).exp()
            };
            let h1: Vec<Complex<f64>> = frequency_hz.iter().map(value).collect();
            let output = OutputSums {
                s_xx: h1.iter().map(Complex::norm_sqr).collect(),
                s_xf: h1,
                ..OutputSums::default()
            };
            let lines = frequency_hz.len();
            let spectra =
                CrossSpectra::new(1.0, frequency_hz.clone(), sigma_per_s, 1, vec![1.0; lines], vec![output])
                    .expect("alike");
            let [ratio, sigma] = mass_ratio(&spectra, 0, quantity, mass_kg).expect("a ratio");
            // the window turns a delay of 20 µs into a factor of exp(−σ 20 µs)
            assert!((ratio / gains - 1.0).abs() < 1e-4, "{ratio}");
            assert!(sigma < 2e-4, "{sigma}");
        }
    }
}
