//! A line of the answer, whose numbers are marked with their paths in `results.json`.

use super::number::{micro, short};
use crate::contact::Interval;

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
pub struct Line {
    /// The subject; may be empty.
    pub head: String,
    /// The statement.
    pub text: String,
    /// The numbers in it, in order, each with its path in `results.json`.
    pub numbers: Vec<(String, String)>,
}

impl Line {
    /// Whether it is the true value of a simulated rig, which was not measured.
    pub fn is_truth(&self) -> bool {
        self.head == TRUTH
    }

    /// A line without subject and without numbers from `results.json`.
    pub fn words(text: String) -> Self {
        Line { head: String::new(), text, numbers: Vec::new() }
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
