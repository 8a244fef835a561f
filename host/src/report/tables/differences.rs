//! Two campaigns in numbers.

use super::{Table, number, words};
use crate::report::words::number::{decimals, short};
use crate::results::Compared;

/// Both values and their difference, quantity by quantity.
pub fn differences(compared: &Compared) -> String {
    let heads =
        ["quantity", "differ?", "first", "second", "second − first", "95 % interval", "of the first, %"];
    let mut table = Table::new(2, "Differences", &heads);
    for (i, d) in compared.differences.iter().enumerate() {
        let (scale, unit) = if d.unit == "N/m" { (1e-6, "N/µm") } else { (1.0, "N s/m") };
        let at = |field: &str| format!("/differences/{i}/{field}");
        let shown = |value: f64| short(scale * value);
        let [low, high] = d.b_minus_a.ci95;
        table.row([
            words(format!("{}, {unit}", d.quantity)),
            words(if d.differ { "✗ yes" } else { "✓ no" }),
            number(Some(shown(d.a.mean)), at("a/mean")),
            number(Some(shown(d.b.mean)), at("b/mean")),
            number(Some(shown(d.b_minus_a.mean)), at("b_minus_a/mean")),
            number(Some(format!("{}…{}", shown(low), shown(high))), at("b_minus_a/ci95/0")),
            words(decimals(100.0 * d.b_minus_a.mean / d.a.mean, 1)),
        ]);
    }
    table.finish()
}
