//! Identifies the static arm between contact and load cells: its effective mass m at the contact
//! and the parallel path ρ in F = (1 + ρ) T + m ẍ_B (see [`super::correction`]).
//!
//! There are two methods. **Hits on B alone**: the force at the contact is that of the hammer,
//! transformed to the virtual point; both m and ρ come from one least-squares fit over frequency.
//! **Stuck loops at several frequencies**: T/Δx = k/(1 + ρ) − m/(1 + ρ) · ẍ_B/Δx must give the same
//! k at all of them; ρ cannot be separated from k this way and must be known. A contact with a
//! hidden resonance has no common k, which shows in the fit's residual.

use super::correction::Correction;
use super::tones::Tones;
use num_complex::Complex;
use serde::Serialize;

/// A fit with a larger relative rms residual of the force is rejected.
pub const WORST_RESIDUAL: f64 = 0.03;

/// The frequencies of the levels must have at least this ratio, highest over lowest.
const SPREAD: f64 = 1.5;

/// Source of the correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// Stated by the user or the plan.
    Given,
    /// Fitted to hits on B alone.
    Hits,
    /// Fitted to stuck loops at several frequencies.
    Levels,
}

/// An identified correction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Identified {
    /// m and ρ.
    #[serde(flatten)]
    pub correction: Correction,
    /// Source of the values.
    pub basis: Basis,
    /// Relative rms residual of the force after the fit; 0 if the values were given.
    pub residual: f64,
}

/// From lines of (T/F, ẍ_B/F) with F known at the contact; `parallel_path` is fitted if it is not
/// given. `None` without lines, or if the fit leaves too large a residual or gives no positive
/// mass.
pub fn from_known_force(
    lines: &[(Complex<f64>, Complex<f64>)],
    parallel_path: Option<f64>,
) -> Option<Identified> {
    let n = lines.len() as f64;
    let real: Vec<(f64, f64)> = lines.iter().map(|(t, a)| (t.re, a.re)).collect();
    let (factor, mass) = match parallel_path {
        Some(path) => {
            let factor = 1.0 + path;
            let (ay, aa) =
                real.iter().fold((0.0, 0.0), |(ay, aa), (t, a)| (ay + a * (1.0 - factor * t), aa + a * a));
            (factor, ay / aa)
        }
        None => least_squares(real.iter().map(|(t, a)| ([*t, *a], 1.0)))?,
    };
    let squares: f64 = real.iter().map(|(t, a)| (factor * t + mass * a - 1.0).powi(2)).sum();
    accepted(factor - 1.0, mass, (squares / n).sqrt(), Basis::Hits)
}

/// From stuck levels; `None` with too few frequencies, or if no common stiffness explains them.
pub fn from_levels(levels: &[Tones], parallel_path: f64) -> Option<Identified> {
    let (low, high) =
        levels.iter().fold((f64::INFINITY, 0.0f64), |(l, h), t| (l.min(t.omega_rad_s), h.max(t.omega_rad_s)));
    let mut distinct: Vec<f64> = levels.iter().map(|t| t.omega_rad_s).collect();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-3);
    if distinct.len() < 3 || high < SPREAD * low {
        return None;
    }
    let points: Vec<(f64, f64)> = levels
        .iter()
        .map(|t| {
            let inertia = t.omega_rad_s.powi(2) * t.b_m / t.relative_m();
            (inertia.re, (t.force_n / t.relative_m()).re)
        })
        .collect();
    let (stiffness, slope) = least_squares(points.iter().map(|(x, y)| ([1.0, *x], *y)))?;
    let squares: f64 = points.iter().map(|(x, y)| (stiffness + slope * x - y).powi(2)).sum();
    let residual = (squares / points.len() as f64).sqrt() / stiffness.abs();
    accepted(parallel_path, slope * (1.0 + parallel_path), residual, Basis::Levels)
}

fn accepted(parallel_path: f64, effective_mass_kg: f64, residual: f64, basis: Basis) -> Option<Identified> {
    (effective_mass_kg > 0.0 && residual < WORST_RESIDUAL && parallel_path > -0.1).then_some(Identified {
        correction: Correction { effective_mass_kg, parallel_path },
        basis,
        residual,
    })
}

/// p, q of p x₀ + q x₁ = y; `None` if the two are linearly dependent.
fn least_squares(rows: impl Iterator<Item = ([f64; 2], f64)>) -> Option<(f64, f64)> {
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ([a, b], y) in rows {
        aa += a * a;
        ab += a * b;
        bb += b * b;
        ay += a * y;
        by += b * y;
    }
    let determinant = aa * bb - ab * ab;
    (determinant > 1e-12 * aa * bb)
        .then(|| ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const MASS: f64 = 1.56;
    const CELLS: f64 = 150e6;
    const PATH: f64 = 0.0133;

    fn level(frequency_hz: f64, contact: f64) -> Tones {
        let w = TAU * frequency_hz;
        let stiffness = CELLS * (1.0 + PATH) - MASS * w * w;
        let b = 20.0 / stiffness;
        Tones {
            omega_rad_s: w,
            a_m: Complex::from_polar(b + 20.0 / contact, 0.3),
            b_m: Complex::from_polar(b, 0.3),
            force_n: Complex::from_polar(CELLS * b, 0.3),
        }
    }

    #[test]
    fn a_known_force_gives_mass_and_path() {
        let lines: Vec<_> = (100..600)
            .step_by(5)
            .map(|f| {
                let one = level(f64::from(f), 180e6);
                let w2 = one.omega_rad_s.powi(2);
                let turned = Complex::from_polar(20.0, 0.3);
                (one.force_n / turned, -w2 * one.b_m / turned)
            })
            .collect();
        let found = from_known_force(&lines, None).expect("a fit");
        assert!((found.correction.effective_mass_kg - MASS).abs() < 1e-6, "{found:?}");
        assert!((found.correction.parallel_path - PATH).abs() < 1e-9 && found.residual < 1e-9);
        let given = from_known_force(&lines, Some(PATH)).expect("a fit");
        assert!((given.correction.effective_mass_kg - MASS).abs() < 1e-6, "{given:?}");
        // a force other than the contact's
        let wrong: Vec<_> = lines.iter().map(|(t, a)| (t * 1.2, a * -0.4)).collect();
        assert_eq!(from_known_force(&wrong, Some(PATH)), None);
        assert_eq!(from_known_force(&[], None), None);
    }

    #[test]
    fn stuck_levels_give_the_mass_and_a_hidden_resonance_none() {
        let stuck: Vec<Tones> = [100.0, 200.0, 300.0, 500.0].map(|f| level(f, 180e6)).to_vec();
        let found = from_levels(&stuck, PATH).expect("a fit");
        assert!((found.correction.effective_mass_kg / MASS - 1.0).abs() < 1e-6, "{found:?}");
        let hidden =
            [(100.0, 140e6), (250.0, 190e6), (300.0, 173e6), (500.0, 165e6)].map(|(f, k)| level(f, k));
        assert_eq!(from_levels(&hidden, PATH), None);
        assert_eq!(from_levels(&stuck[..2], PATH), None);
        assert_eq!(from_levels(&[stuck[0], stuck[0], stuck[0]], PATH), None);
    }
}
