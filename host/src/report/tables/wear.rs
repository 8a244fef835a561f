//! The wear runs by decades of cycles.

use super::{HtmlTable, number};
use crate::report::words::number::{decimals, micro};
use crate::results::Results;

/// Means over the cycles of each decade.
pub fn wear(results: &Results) -> Option<String> {
    let wear = results.wear.as_ref()?;
    let heads = [
        "cycles from",
        "to",
        "k_T, N/µm",
        "tangent without slip, N/µm",
        "μN, N",
        "μ",
        "Δx, µm",
        "energy, J",
        "energy up to its end, J",
    ];
    let mut table = HtmlTable::new(0, "Wear runs: means over the cycles of each decade, uncorrected", &heads);
    for (i, decade) in wear.decades.iter().enumerate() {
        let at = |name: &str| format!("/wear/decades/{i}/{name}");
        let shown = |value: Option<f64>, places: usize, name: &str| {
            number(value.map(|value| decimals(value, places)), at(name))
        };
        table.row([
            number(Some(decade.first.to_string()), at("first")),
            number(Some(decade.last.to_string()), at("last")),
            shown(decade.k_t_n_per_m.map(micro), 2, "k_t_n_per_m"),
            shown(decade.tangent_n_per_m.map(micro), 2, "tangent_n_per_m"),
            shown(decade.friction_n, 2, "friction_n"),
            shown(decade.friction_coefficient, 4, "friction_coefficient"),
            shown(decade.amplitude_m.map(|m| 1e6 * m), 3, "amplitude_m"),
            shown(Some(decade.energy_j), 4, "energy_j"),
            shown(Some(decade.energy_to_j), 4, "energy_to_j"),
        ]);
    }
    Some(table.finish())
}
