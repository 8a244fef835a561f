//! Cutting a steady record into its cycles.

use super::HysteresisError;
use super::integration::closed_cycle;
use super::record::Relative;

/// Fewer samples than this make no loop.
const FEWEST_SAMPLES: usize = 16;

/// One closed cycle: M equidistant points of one period.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycle {
    /// Relative displacement, mean removed, m.
    pub displacement_m: Vec<f64>,
    /// Relative velocity, mean removed, m/s.
    pub velocity_m_per_s: Vec<f64>,
    /// Tangential force, mean removed, N.
    pub force_n: Vec<f64>,
}

/// All whole cycles of `frequency_hz`, each resampled to the same number of points: a period need not be a whole
/// number of samples.
///
/// # Errors
/// When there is no whole cycle, or too few samples in one.
pub(super) fn steady(
    motion: &Relative,
    force_n: &[f64],
    fs_hz: f64,
    frequency_hz: f64,
) -> Result<Vec<Cycle>, HysteresisError> {
    let period = fs_hz / frequency_hz;
    let points = period.round() as usize;
    // a hair of tolerance: 20 cycles exactly must not count as 19
    let cycles = (force_n.len() as f64 / period + 1e-6).floor() as usize;
    if cycles == 0 || points < FEWEST_SAMPLES {
        return Err(HysteresisError::NoCycle { frequency_hz, samples: force_n.len(), points });
    }
    let dt_s = 1.0 / (frequency_hz * points as f64);
    Ok((0..cycles)
        .map(|c| {
            let cut = |x: &[f64]| -> Vec<f64> {
                (0..points).map(|j| interpolate(x, (c as f64 + j as f64 / points as f64) * period)).collect()
            };
            let (displacement_m, velocity_m_per_s) = match motion {
                Relative::Velocity(v) => {
                    let v = centred(cut(v));
                    (closed_cycle(&v, dt_s), v)
                }
                Relative::Displacement(x) => {
                    let x = centred(cut(x));
                    let v = (0..points)
                        .map(|j| (x[(j + 1) % points] - x[(j + points - 1) % points]) / (2.0 * dt_s))
                        .collect();
                    (x, v)
                }
            };
            Cycle { displacement_m, velocity_m_per_s, force_n: centred(cut(force_n)) }
        })
        .collect())
}

/// The average of all cycles, point by point.
pub(super) fn synchronous_average(cycles: &[Cycle]) -> Cycle {
    let mean = |pick: fn(&Cycle) -> &[f64]| -> Vec<f64> {
        let n = pick(&cycles[0]).len();
        (0..n).map(|j| cycles.iter().map(|c| pick(c)[j]).sum::<f64>() / cycles.len() as f64).collect()
    };
    Cycle {
        displacement_m: mean(|c| &c.displacement_m),
        velocity_m_per_s: mean(|c| &c.velocity_m_per_s),
        force_n: mean(|c| &c.force_n),
    }
}

fn centred(mut x: Vec<f64>) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    for v in &mut x {
        *v -= mean;
    }
    x
}

/// Cubic (Catmull–Rom) interpolation at a fractional sample; exact at samples.
fn interpolate(x: &[f64], at: f64) -> f64 {
    let last = x.len() - 1;
    let nearest = at.round();
    if (at - nearest).abs() < 1e-6 {
        return x[(nearest as usize).min(last)];
    }
    let i = at.floor() as usize;
    let sample = |k: usize| x[k.min(last)];
    let (p0, p1, p2, p3) = (sample(i.saturating_sub(1)), sample(i), sample(i + 1), sample(i + 2));
    let t = at - at.floor();
    p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0)))
}
