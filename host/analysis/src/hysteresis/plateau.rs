//! The plateaus of a loop in gross slip: the friction limit at the middle of the stroke, and how it goes with the place.

use super::cycle::Cycle;
use super::loops::{slope, swing};

/// The plateau begins so many times the flank's length behind the reversal: the structure rings when the contact lets go.
const BEYOND_FLANK: f64 = 1.25;

/// And ends before this part of the stroke, where the motion stops.
const UNTIL: f64 = 0.97;

/// Fewer samples on either plateau say nothing.
const FEWEST_SAMPLES: usize = 6;

/// Both plateaus as straight lines T = ±μN (1 + a x/X).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plateaus {
    /// μN at the middle, N.
    pub limit_n: f64,
    /// a.
    pub change: f64,
    /// Standard deviation of a.
    pub std: f64,
}

/// Less change along the stroke is not told,
const UNEVEN: f64 = 0.05;

/// nor less than so many standard deviations: ringing goes together from point to point.
const SIGNIFICANT: f64 = 8.0;

impl Plateaus {
    /// Whether the limit goes with the place.
    pub fn is_uneven(&self) -> bool {
        self.change.abs() > UNEVEN.max(SIGNIFICANT * self.std)
    }

    /// Of the averaged loop, whose flanks have the stiffness k (N/m) and end near ± `limit_n`; none where they are too short.
    pub fn of(cycle: &Cycle, strokes: &[Vec<usize>; 2], stiffness: f64, limit_n: f64) -> Option<Self> {
        let x = &cycle.displacement_m;
        let (low, high) =
            x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let (middle, half) = (0.5 * (low + high), 0.5 * swing(x));
        let flank = BEYOND_FLANK * 2.0 * limit_n / stiffness;
        let mut lines = strokes.iter().map(|stroke| {
            let from = x[*stroke.first()?];
            let inside = |i: &&usize| ((flank)..(UNTIL * 2.0 * half)).contains(&(x[**i] - from).abs());
            let (places, forces): (Vec<f64>, Vec<f64>) =
                stroke.iter().filter(inside).map(|&i| ((x[i] - middle) / half, cycle.force_n[i])).unzip();
            (places.len() >= FEWEST_SAMPLES).then(|| line(&places, &forces))
        });
        let ([down, down_slope, down_var], [up, up_slope, up_var]) = (lines.next()??, lines.next()??);
        let limit = 0.5 * (up - down);
        Some(Self {
            limit_n: limit,
            change: 0.5 * (up_slope - down_slope) / limit,
            std: 0.5 * (down_var + up_var).sqrt() / limit.abs(),
        })
    }
}

/// Value at 0, slope, and the slope's variance.
fn line(x: &[f64], y: &[f64]) -> [f64; 3] {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let steep = slope(x, y);
    let apart: f64 = x.iter().zip(y).map(|(x, y)| (y - my - steep * (x - mx)).powi(2)).sum();
    let spread: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
    [my - steep * mx, steep, apart / (n - 2.0) / spread]
}
