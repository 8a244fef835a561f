//! A line of the answer, whose numbers say where they stand in `results.json`.

use super::number::{micro, short};
use crate::contact::Interval;

/// How a line begins that has no number.
pub const UNKNOWN: &str = "not known.";

/// What the truth of a simulated rig is announced by.
pub const TRUTH: &str = "SIMULATED rig, its truth:";

/// Where the answers stand.
pub const CONTACT: &str = "/answer/contact/k_t_n_per_m";
/// See [`CONTACT`].
pub const BETWEEN: &str = "/answer/between_arms/k_n_per_m";
/// See [`CONTACT`].
pub const CLAMP: &str = "/answer/clamp/k_n_per_m";

/// One line: what it is about, and what is said of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// What it is about; may be empty.
    pub head: String,
    /// What is said.
    pub text: String,
    /// The numbers in it, in their order, each with its place in `results.json`.
    pub numbers: Vec<(String, String)>,
}

impl Line {
    /// Whether it tells a simulated rig's truth, which nobody measured.
    pub fn is_truth(&self) -> bool {
        self.head == TRUTH
    }

    /// Words without a head and without numbers that stand elsewhere.
    pub fn words(text: String) -> Self {
        Line { head: String::new(), text, numbers: Vec::new() }
    }

    /// The same with the numbers of an interval at `place`, as `N/µm (95 % low…high)`.
    #[must_use]
    pub fn interval(mut self, k: &Interval, place: &str) -> Self {
        for (value, field) in [(k.mean, "mean"), (k.ci95[0], "ci95/0"), (k.ci95[1], "ci95/1")] {
            self = self.stiffness(value, &format!("{place}/{field}"));
        }
        self
    }

    /// The same with a stiffness, N/m, as it is written in N/µm.
    #[must_use]
    pub fn stiffness(mut self, value: f64, place: &str) -> Self {
        self.numbers.push((short(micro(value)), place.to_owned()));
        self
    }
}
