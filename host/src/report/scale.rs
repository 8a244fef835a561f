//! Axis scales: from values to pixels, with ticks at multiples of 1, 2 and 5.

use super::figure::{Axis, Spread};
use crate::report::words::number::decimals;

/// Maps the range of an axis to a range of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    spread: Spread,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

/// A tick: its value and label.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// The value.
    pub value: f64,
    /// The label; empty for a minor tick.
    pub label: String,
}

impl Scale {
    /// A linear axis from `range` onto `pixels`. An empty or invalid range is widened to one that
    /// can be drawn.
    pub fn linear(range: [f64; 2], pixels: [f64; 2]) -> Self {
        let [low, high] = drawable(range, Spread::Linear);
        Scale { spread: Spread::Linear, low, high, from: pixels[0], to: pixels[1] }
    }

    /// A logarithmic axis from `range` onto `pixels`.
    pub fn logarithmic(range: [f64; 2], pixels: [f64; 2]) -> Self {
        let [low, high] = drawable(range, Spread::Log);
        Scale { spread: Spread::Log, low, high, from: pixels[0], to: pixels[1] }
    }

    /// The scale of an axis description.
    pub fn of(axis: &Axis, pixels: [f64; 2]) -> Self {
        match axis.scale {
            Spread::Linear => Scale::linear(axis.range, pixels),
            Spread::Log => Scale::logarithmic(axis.range, pixels),
        }
    }

    /// The range of values.
    pub fn range(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// Position of a value, in pixels; a value outside the range gives a position outside. `None`
    /// if it has no position (zero or less on a logarithmic axis).
    pub fn place(&self, value: f64) -> Option<f64> {
        let share = match self.spread {
            Spread::Linear => (value - self.low) / (self.high - self.low),
            Spread::Log if value <= 0.0 => return None,
            Spread::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        let place = self.from + share * (self.to - self.from);
        place.is_finite().then_some(place)
    }

    /// As [`Scale::place`], clamped to the ends.
    pub fn place_within(&self, value: f64) -> f64 {
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        self.place(value).map_or(low, |p| p.clamp(low, high))
    }

    /// Ticks at multiples of 1, 2 and 5, with as many labels as fit on these pixels without
    /// touching; those in between have no label. `page/ticks.js` does the same; a test compares the
    /// two on random axes.
    pub fn ticks(&self, lie: Lie) -> Vec<Tick> {
        match self.spread {
            Spread::Linear => self.even_ticks(lie),
            Spread::Log => self.decade_ticks(lie),
        }
    }

    /// Ticks at multiples of `step` (for degrees, where 1-2-5 is not customary).
    pub fn ticks_every(&self, step: f64) -> Vec<Tick> {
        let places = usize::try_from(-exponent(step)).unwrap_or(0);
        let first = (self.low / step - NEAR).ceil();
        let last = (self.high / step + NEAR).floor();
        let count = (last - first + 1.0).clamp(0.0, MOST_TICKS) as usize;
        (0..count)
            .map(|i| {
                let value = (first + i as f64) * step;
                Tick { value, label: decimals(value, places) }
            })
            .collect()
    }

    fn length(&self) -> f64 {
        (self.to - self.from).abs()
    }

    fn even_ticks(&self, lie: Lie) -> Vec<Tick> {
        let span = self.high - self.low;
        let finest = span * lie.least() / self.length();
        let mut found: Vec<Tick> = Vec::new();
        for decade in exponent(finest)..exponent(finest) + 4 {
            for digit in [1, 2, 5] {
                let step = power(digit, decade);
                if step < finest {
                    continue;
                }
                let ticks = self.ticks_every(step);
                if ticks.len() < 2 && !found.is_empty() {
                    return found;
                }
                let apart = step / span * self.length();
                found = ticks;
                if apart >= found.iter().map(|t| lie.room(&t.label)).fold(0.0, f64::max) {
                    return found;
                }
            }
        }
        found
    }

    fn decade_ticks(&self, lie: Lie) -> Vec<Tick> {
        let (first, last) = (exponent(self.low), exponent(self.high));
        let plain = self.low >= 0.1 && self.high <= 1e5;
        let within = |value: f64| value >= self.low * (1.0 - NEAR) && value <= self.high * (1.0 + NEAR);
        let places = |digits: &[u32], every: i32| {
            let mut chosen: Vec<(u32, i32)> = Vec::new();
            for decade in (first..=last).filter(|d| d.rem_euclid(every) == 0) {
                chosen.extend(digits.iter().map(|d| (*d, decade)).filter(|(d, e)| within(power(*d, *e))));
            }
            chosen
        };
        let label = |digit: u32, decade: i32| match (plain, digit) {
            (true, _) => decimals(power(digit, decade), usize::try_from(-decade).unwrap_or(0)),
            (false, 1) => format!("10{}", superscript(decade)),
            (false, _) => format!("{digit}·10{}", superscript(decade)),
        };
        let choices: [(&[u32], i32); 8] = [
            (&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1),
            (&[1, 2, 5], 1),
            (&[1, 3], 1),
            (&[1], 1),
            (&[1], 2),
            (&[1], 3),
            (&[1], 5),
            (&[1], 10),
        ];
        for (digits, every) in choices {
            let chosen = places(digits, every);
            if chosen.len() < 2 {
                break;
            }
            let at = |(digit, decade): (u32, i32)| self.place(power(digit, decade)).unwrap_or(f64::NAN);
            let apart = chosen.windows(2).all(|two| {
                (at(two[1]) - at(two[0])).abs()
                    >= two.iter().map(|(d, e)| lie.room(&label(*d, *e))).fold(0.0, f64::max)
            });
            if !apart {
                continue;
            }
            // minor lines only if the decades are wide enough
            let minor = (self.high / self.low).log10() < 3.0;
            let all = if minor { places(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1) } else { places(&[1], 1) };
            return all
                .into_iter()
                .map(|(digit, decade)| Tick {
                    value: power(digit, decade),
                    label: if chosen.contains(&(digit, decade)) {
                        label(digit, decade)
                    } else {
                        String::new()
                    },
                })
                .collect();
        }
        self.within_a_decade(lie)
    }

    /// Linear steps on a logarithmic axis of less than a decade; labels that would touch the
    /// previous one are omitted.
    fn within_a_decade(&self, lie: Lie) -> Vec<Tick> {
        let even = Scale { spread: Spread::Linear, ..*self };
        let mut end = f64::NEG_INFINITY;
        let mut ticks = even.even_ticks(lie);
        ticks.retain(|tick| tick.value > 0.0);
        for tick in &mut ticks {
            let at = (self.place(tick.value).unwrap_or(f64::NAN) - self.from).abs();
            if at < end {
                tick.label.clear();
            } else {
                end = at + lie.room(&tick.label);
            }
        }
        ticks
    }
}

/// Orientation of an axis: labels side by side need more space than labels one above the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lie {
    /// Horizontal.
    Across,
    /// Vertical.
    Up,
}

/// Width of a digit in tick labels, px.
const DIGIT: f64 = 7.0;
/// Distance between labels side by side, px.
const BESIDE: f64 = 26.0;
/// Distance between labels one above the other, px.
const ABOVE: f64 = 30.0;
/// Smallest distance between labels one above the other, px; used if larger steps would leave a
/// single label.
const TIGHT_ABOVE: f64 = 16.0;
/// The same for labels side by side.
const TIGHT_BESIDE: f64 = 48.0;
/// A tick beyond the end by less than this fraction of a step still counts as at the end, because
/// of rounding.
const NEAR: f64 = 1e-9;
/// Limit on the number of ticks; a few dozen are needed at most.
const MOST_TICKS: f64 = 200.0;

impl Lie {
    fn least(self) -> f64 {
        match self {
            Lie::Across => TIGHT_BESIDE,
            Lie::Up => TIGHT_ABOVE,
        }
    }

    fn room(self, label: &str) -> f64 {
        match self {
            Lie::Across => DIGIT * label.chars().count() as f64 + BESIDE,
            Lie::Up => ABOVE,
        }
    }
}

/// The decimal exponent, taken from the printed digits so that it is the same on every machine.
fn exponent(value: f64) -> i32 {
    format!("{value:e}").split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0)
}

/// The number closest to digit · 10^decade.
fn power(digit: u32, decade: i32) -> f64 {
    format!("{digit}e{decade}").parse().unwrap_or(f64::NAN)
}

fn drawable([low, high]: [f64; 2], spread: Spread) -> [f64; 2] {
    let positive = spread == Spread::Log;
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

/// The range that contains the middle fraction `keep` of the finite values, widened by the fraction
/// `margin`, so that a few extreme lines do not compress the others.
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

    fn labels(scale: &Scale) -> Vec<String> {
        scale.ticks(Lie::Across).into_iter().map(|t| t.label).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn linear_ticks_stand_at_one_two_five() {
        assert_eq!(labels(&Scale::linear([0.0, 103.0], [0.0, 150.0])), ["0", "50", "100"]);
        assert_eq!(labels(&Scale::linear([-0.13, 0.14], [0.0, 200.0])), ["−0.1", "0.0", "0.1"]);
        assert_eq!(
            labels(&Scale::linear([0.0, 1.0], [0.0, 300.0])),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
    }

    #[test]
    fn logarithmic_ticks_read_as_frequencies_or_powers() {
        assert_eq!(
            labels(&Scale::logarithmic([20.0, 1000.0], [0.0, 400.0])),
            ["20", "50", "100", "200", "500", "1000"]
        );
        assert_eq!(labels(&Scale::logarithmic([3e-10, 2e-7], [0.0, 200.0])), ["10⁻⁹", "10⁻⁸", "10⁻⁷"]);
        assert_eq!(
            labels(&Scale::logarithmic([190.0, 194.0], [0.0, 300.0])),
            ["190", "191", "192", "193", "194"]
        );
    }

    #[test]
    fn an_axis_with_room_for_two_labels_has_two() {
        for [low, high] in [[-3.1e-5, 2.9e-5], [0.2, 0.9], [-1.0, 256.0], [1e6, 1.2e6]] {
            let found = labels(&Scale::linear([low, high], [0.0, 260.0]));
            assert!(found.len() >= 2, "{low}…{high}: {found:?}");
        }
    }

    #[test]
    fn broken_ranges_are_still_drawable() {
        for range in [[f64::NAN, 1.0], [0.0, 0.0], [5.0, 5.0], [3.0, -2.0], [f64::NEG_INFINITY, 0.0]] {
            for scale in [Scale::linear(range, [0.0, 100.0]), Scale::logarithmic(range, [0.0, 100.0])] {
                assert!(scale.ticks(Lie::Up).len() < 100);
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
