//! One axis of a panel: its quantity, unit and range.

use serde::Serialize;

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Spread {
    /// Linear.
    Linear,
    /// Logarithmic; both ends must be positive.
    Log,
}

/// One axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// Quantity shown along it.
    pub quantity: String,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
    /// Scale.
    pub scale: Spread,
    /// Full range.
    pub range: [f64; 2],
    /// Ticks at multiples of this, e.g. for degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<f64>,
    /// Axes with the same link are zoomed together.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub link: &'static str,
    /// Names instead of numbers, at 0, 1, 2 …; on a vertical axis they start at the top.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(quantity: impl Into<String>, unit: &'static str, range: [f64; 2]) -> Self {
        Axis {
            quantity: quantity.into(),
            unit,
            scale: Spread::Linear,
            range,
            every: None,
            link: "",
            names: Vec::new(),
        }
    }

    /// A logarithmic axis.
    pub fn log(quantity: impl Into<String>, unit: &'static str, range: [f64; 2]) -> Self {
        Axis { scale: Spread::Log, ..Axis::linear(quantity, unit, range) }
    }

    /// Frequencies, Hz, zoomed together with all other frequency axes of the page.
    pub fn frequency(scale: Spread, range: [f64; 2]) -> Self {
        Axis { scale, link: "frequency", ..Axis::linear("frequency", "Hz", range) }
    }

    /// An axis of names.
    pub fn named(quantity: impl Into<String>, names: Vec<String>) -> Self {
        let range = [-0.5, names.len() as f64 - 0.5];
        Axis { names, ..Axis::linear(quantity, "", range) }
    }

    /// The same axis with ticks at multiples of `every`.
    #[must_use]
    pub fn every(self, every: f64) -> Self {
        Axis { every: Some(every), ..self }
    }

    /// The same axis, zoomed together with others of this link.
    #[must_use]
    pub fn linked(self, link: &'static str) -> Self {
        Axis { link, ..self }
    }

    /// The axis label.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.quantity.clone() } else { format!("{}, {}", self.quantity, self.unit) }
    }
}
