//! Axes: from values to pixels, with ticks at 1, 2 and 5.

use crate::report::words::number::decimals;

/// How values are spread over an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spread {
    /// Evenly.
    Linear,
    /// By their logarithm; both ends must be positive.
    Logarithmic,
}

/// One axis: a range of values on a range of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    spread: Spread,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

/// A tick: where, and what is written there.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// The value.
    pub value: f64,
    /// The text beside it; empty for a minor tick.
    pub label: String,
}

impl Scale {
    /// An even axis from `range` onto `pixels`. An empty or broken range is widened to something drawable.
    pub fn linear(range: [f64; 2], pixels: [f64; 2]) -> Self {
        let [low, high] = drawable(range, Spread::Linear);
        Scale { spread: Spread::Linear, low, high, from: pixels[0], to: pixels[1] }
    }

    /// A logarithmic axis from `range` onto `pixels`.
    pub fn logarithmic(range: [f64; 2], pixels: [f64; 2]) -> Self {
        let [low, high] = drawable(range, Spread::Logarithmic);
        Scale { spread: Spread::Logarithmic, low, high, from: pixels[0], to: pixels[1] }
    }

    /// The range of values.
    pub fn range(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// Where a value stands, in pixels; values beyond the ends stand outside. `None` for what has no place.
    pub fn place(&self, value: f64) -> Option<f64> {
        let share = match self.spread {
            Spread::Linear => (value - self.low) / (self.high - self.low),
            Spread::Logarithmic if value <= 0.0 => return None,
            Spread::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        let place = self.from + share * (self.to - self.from);
        place.is_finite().then_some(place)
    }

    /// Like [`Scale::place`], held at the ends.
    pub fn place_within(&self, value: f64) -> f64 {
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        self.place(value).map_or(low, |p| p.clamp(low, high))
    }

    /// About `wanted` labelled ticks; a logarithmic axis adds minor ones.
    pub fn ticks(&self, wanted: usize) -> Vec<Tick> {
        match self.spread {
            Spread::Linear => self.even_ticks(wanted),
            Spread::Logarithmic => self.decade_ticks(),
        }
    }

    /// Ticks at multiples of `step` (for degrees, where 1-2-5 is not the custom).
    pub fn ticks_every(&self, step: f64) -> Vec<Tick> {
        let places = if step >= 1.0 { 0 } else { (-step.log10().floor()) as usize };
        let (first, last) =
            ((self.low / step - 1e-9).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        (first..=last)
            .map(|i| {
                let value = i as f64 * step;
                Tick { value, label: decimals(value, places) }
            })
            .collect()
    }

    fn even_ticks(&self, wanted: usize) -> Vec<Tick> {
        let raw = (self.high - self.low) / wanted.max(1) as f64;
        let decade = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|m| m * decade)
            .find(|s| *s >= raw * 0.999)
            .unwrap_or(decade * 10.0);
        self.ticks_every(step)
    }

    fn decade_ticks(&self) -> Vec<Tick> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let decades = (self.high / self.low).log10();
        let plain = self.low >= 0.1 && self.high <= 1e5;
        let mut ticks = Vec::new();
        for decade in first..=last {
            for digit in 1..10 {
                let value = f64::from(digit) * 10f64.powi(decade);
                if value < self.low * 0.999 || value > self.high * 1.001 {
                    continue;
                }
                let labelled = match digit {
                    1 => true,
                    2 | 5 => decades < 3.2,
                    _ => false,
                };
                let label = if !labelled {
                    String::new()
                } else if plain {
                    decimals(value, usize::try_from(-decade).unwrap_or(0))
                } else if digit == 1 {
                    format!("10{}", superscript(decade))
                } else if decades < 1.2 {
                    format!("{digit}·10{}", superscript(decade))
                } else {
                    String::new()
                };
                ticks.push(Tick { value, label });
            }
        }
        ticks
    }
}

fn drawable([low, high]: [f64; 2], spread: Spread) -> [f64; 2] {
    let positive = spread == Spread::Logarithmic;
    if !(low.is_finite() && high.is_finite()) || (positive && low.max(high) <= 0.0) {
        return if positive { [1.0, 10.0] } else { [0.0, 1.0] };
    }
    let (low, high) = (low.min(high), low.max(high));
    let low = if positive && low <= 0.0 { high * 1e-3 } else { low };
    if high > low {
        return [low, high];
    }
    if positive {
        [low / 2.0, high * 2.0]
    } else {
        [low - 0.5 * low.abs().max(1e-12), high + 0.5 * high.abs().max(1e-12)]
    }
}

fn superscript(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    exponent.to_string().chars().map(|c| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize])).collect()
}

/// The range that holds the share `keep` of the finite values in the middle, widened by `margin` of itself:
/// single lines that explode do not flatten the rest.
pub fn middle_range(values: impl IntoIterator<Item = f64>, keep: f64, margin: f64) -> Option<[f64; 2]> {
    let mut sorted: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let cut = (last as f64 * (1.0 - keep) / 2.0) as usize;
    let (low, high) = (sorted[cut], sorted[last - cut]);
    let wider = (high - low) * margin;
    Some([low - wider, high + wider])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &Scale, wanted: usize) -> Vec<String> {
        scale.ticks(wanted).into_iter().map(|t| t.label).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn linear_ticks_stand_at_one_two_five() {
        assert_eq!(labels(&Scale::linear([0.0, 103.0], [0.0, 1.0]), 5), ["0", "50", "100"]);
        assert_eq!(labels(&Scale::linear([-0.13, 0.14], [0.0, 1.0]), 5), ["−0.1", "0.0", "0.1"]);
        assert_eq!(
            labels(&Scale::linear([0.0, 1.0], [0.0, 1.0]), 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
    }

    #[test]
    fn logarithmic_ticks_read_as_frequencies_or_powers() {
        assert_eq!(
            labels(&Scale::logarithmic([20.0, 1000.0], [0.0, 1.0]), 5),
            ["20", "50", "100", "200", "500", "1000"]
        );
        assert_eq!(labels(&Scale::logarithmic([3e-10, 2e-7], [0.0, 1.0]), 5), ["10⁻⁹", "10⁻⁸", "10⁻⁷"]);
    }

    #[test]
    fn broken_ranges_are_still_drawable() {
        for range in [[f64::NAN, 1.0], [0.0, 0.0], [5.0, 5.0], [3.0, -2.0], [f64::NEG_INFINITY, 0.0]] {
            for scale in [Scale::linear(range, [0.0, 100.0]), Scale::logarithmic(range, [0.0, 100.0])] {
                assert!(scale.ticks(5).len() < 100);
                assert!(scale.place_within(1.0).is_finite());
            }
        }
        assert_eq!(Scale::logarithmic([1.0, 10.0], [0.0, 1.0]).place(-1.0), None);
    }

    #[test]
    fn exploding_lines_do_not_set_the_range() {
        let values = (0..100).map(f64::from).chain([1e9, -1e9, f64::NAN]);
        let [low, high] = middle_range(values, 0.9, 0.0).expect("values");
        assert!(low > 0.0 && high < 100.0);
        assert_eq!(middle_range([f64::NAN], 0.9, 0.0), None);
    }
}
