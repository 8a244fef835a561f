//! Formats numbers for readers: few digits, with units, N/µm for stiffness.
//!
//! A line of the answer, whose numbers are marked with their paths in `results.json`.

use crate::contact::Interval;
use crate::substructuring::Band;

/// `value` with enough decimals to show about three significant digits: 148, 26.8, 0.91, 0.0123.
pub fn short(value: f64) -> String {
    decimals(value, places(value, 3))
}

/// `mean ± std`, both with the number of decimals that shows three digits of the mean or two of the
/// scatter, whichever is fewer; never `26.8134 ± 4`.
pub fn with_scatter(mean: f64, std: f64) -> String {
    let few = places(mean, 3).min(places(std, 2));
    // a nonzero scatter must not be shown as zero
    let places = if std > 0.0 { few.max(places(std, 1).min(few + 2)) } else { few };
    format!("{} ± {}", decimals(mean, places), decimals(std, places))
}

/// The decimals that show two digits of half an interval, at most nine.
pub fn interval_places(half: f64) -> usize {
    places(half, 2).min(9)
}

/// `mean ± half`, both with the decimals that show two digits of `half`, at most nine.
pub fn to_its_interval(mean: f64, half: f64) -> String {
    let places = interval_places(half);
    format!("{} ± {}", decimals(mean, places), decimals(half, places))
}

/// `mean (low…high)`, with the decimals that show two digits of half the interval; as [`short`]
/// where it has no width.
pub fn with_ends(mean: f64, [low, high]: [f64; 2]) -> String {
    let half = 0.5 * (high - low);
    let digits = if half > 0.0 { interval_places(half) } else { places(mean, 3) };
    let [mean, low, high] = [mean, low, high].map(|of| decimals(of, digits));
    format!("{mean} ({low}…{high})")
}

/// A stiffness in N/m, shown in N/µm without the unit.
pub fn micro(stiffness_n_per_m: f64) -> f64 {
    stiffness_n_per_m * 1e-6
}

/// A stiffness with its scatter, in N/µm with the unit.
pub fn stiffness(mean_n_per_m: f64, std_n_per_m: f64) -> String {
    format!("{} N/µm", with_scatter(micro(mean_n_per_m), micro(std_n_per_m)))
}

/// A band: `300–600 Hz`.
pub fn band(band: Band) -> String {
    format!("{}–{} Hz", short(band.low_hz), short(band.high_hz))
}

/// With thousands separated: 12 345.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A value with the metric prefix that puts it between 1 and 1000.
pub fn prefixed(value: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 7] =
        [(1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p")];
    // so that 999.6 µm becomes 1.00 mm
    let size = value.abs() * 1.0005;
    let (factor, prefix) = PREFIXES.into_iter().find(|(factor, _)| size >= *factor).unwrap_or((1.0, ""));
    format!("{} {prefix}{unit}", short(value / factor))
}

/// A length with its scatter, with the prefix of the length.
pub fn length(mean_m: f64, std_m: f64) -> String {
    let (factor, unit) = if mean_m.abs() >= 1e-3 { (1e3, "mm") } else { (1e6, "µm") };
    format!("{} {unit}", with_scatter(factor * mean_m, factor * std_m))
}

fn places(value: f64, significant: i32) -> usize {
    if value == 0.0 || !value.is_finite() {
        return significant.max(1) as usize - 1;
    }
    let places = |value: f64| (significant - 1 - value.abs().log10().floor() as i32).clamp(0, 12);
    // 0.09998 rounds to 0.100, not 0.1000
    let scale = 10f64.powi(places(value));
    let rounded = (value * scale).round() / scale;
    // the value rounds to zero at the available decimals, so it is shown as 0
    if rounded == 0.0 { 0 } else { places(rounded) as usize }
}

/// `value` with this many decimals and a typographic minus sign; a dash if it is not finite.
pub fn decimals(value: f64, places: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let text = format!("{value:.places$}");
    let zero = text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.');
    if zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") }
}

/// Start of a line without a number.
pub const UNKNOWN: &str = "not known.";

/// Label of the true value of a simulated rig.
pub const TRUTH: &str = "SIMULATED rig, its truth:";

/// Paths of the answers.
pub const CONTACT: &str = "/answer/contact/k_t_n_per_m";
/// See [`CONTACT`].
pub const BETWEEN: &str = "/answer/between_arms/k_n_per_m";
/// See [`CONTACT`].
pub const CLAMP: &str = "/answer/clamp/k_n_per_m";

/// One line: its subject, and the statement about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AnswerLine {
    /// The subject; may be empty.
    pub head: String,
    /// The statement.
    pub text: String,
    /// The numbers in it, in order, each with its path in `results.json`.
    pub numbers: Vec<(String, String)>,
}

impl AnswerLine {
    /// Whether it is the true value of a simulated rig, which was not measured.
    pub fn is_truth(&self) -> bool {
        self.head == TRUTH
    }

    /// A line without subject and without numbers from `results.json`.
    pub fn words(text: String) -> Self {
        AnswerLine { head: String::new(), text, numbers: Vec::new() }
    }

    /// Adds the numbers of an interval at `place`, as in `N/µm (95 % low…high)`.
    #[must_use]
    pub fn interval(mut self, k: &Interval, place: &str) -> Self {
        for (value, field) in [(k.mean, "mean"), (k.ci95[0], "ci95/0"), (k.ci95[1], "ci95/1")] {
            self = self.stiffness(value, &format!("{place}/{field}"));
        }
        self
    }

    /// Adds a stiffness, N/m, as it is written in N/µm.
    #[must_use]
    pub fn stiffness(mut self, value: f64, place: &str) -> Self {
        self.numbers.push((short(micro(value)), place.to_owned()));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_prefix_that_leaves_few_digits() {
        assert_eq!(prefixed(2.5e-2, "m"), "25.0 mm");
        assert_eq!(prefixed(9.999e-4, "m"), "1.00 mm");
        assert_eq!(prefixed(11_000.0, "N"), "11.0 kN");
        assert_eq!(prefixed(-1.6e-3, "J"), "−1.60 mJ");
        assert_eq!(prefixed(0.0, "J"), "0.00 J");
        assert_eq!(length(3.0e-3, 2e-6), "3.000 ± 0.002 mm");
    }

    #[test]
    fn the_ends_of_an_interval_can_be_told_from_its_mean() {
        assert_eq!(with_ends(0.6, [0.5998, 0.6002]), "0.60000 (0.59980…0.60020)");
        assert_eq!(with_ends(0.41, [0.2, 0.6]), "0.41 (0.20…0.60)");
        assert_eq!(with_ends(0.4, [0.4, 0.4]), "0.400 (0.400…0.400)");
    }

    #[test]
    fn digits_follow_the_scatter() {
        assert_eq!(stiffness(26.813e6, 0.912e6), "26.8 ± 0.9 N/µm");
        assert_eq!(stiffness(148.2e6, 4.1e6), "148 ± 4 N/µm");
        assert_eq!(stiffness(148.2e6, 1e-8), "148 ± 0 N/µm");
        assert_eq!(stiffness(-12.3e6, 241.0e6), "−12 ± 241 N/µm");
        assert_eq!(with_scatter(26.8, 0.0), "26.8 ± 0.0");
        assert_eq!(short(0.012_34), "0.0123");
        assert_eq!(short(0.099_98), "0.100");
        assert_eq!(with_scatter(184.2, 0.31), "184.2 ± 0.3");
        assert_eq!(short(f64::NAN), "–");
        assert_eq!(band([300.0, 600.0].into()), "300–600 Hz");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(decimals(-0.001, 1), "0.0");
    }
}
