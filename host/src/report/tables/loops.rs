//! The contact by loops in numbers: types of stiffness side by side (the paper's Tables 2 and 3),
//! the cycles of the decay, all levels.

use super::{HtmlTable, number, remarks, scattered, words};
use crate::report::html::escaped;
use crate::report::words as said;
use crate::report::words::number::{decimals, micro, short, with_ends, with_scatter};
use crate::results::{Excitation, Force, Hysteresis, OverCycles, Results, Shape};
use std::fmt::Write;

/// FBS and loops side by side, each with its meaning.
pub fn side_by_side(results: &Results) -> Option<String> {
    if results.side_by_side.is_empty() {
        return None;
    }
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"checks\"><caption>FBS and loops side by side (the paper's Tables 2 and 3)</caption><thead><tr>\
         <th scope=\"col\">found by</th><th scope=\"col\" class=\"n\">k ± σ, N/µm</th><th scope=\"col\">what it is</th></tr></thead><tbody>",
    );
    for (i, kind) in results.side_by_side.iter().enumerate() {
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}</th><td class=\"n\" data-path=\"/side_by_side/{i}/mean_n_per_m /side_by_side/{i}/std_n_per_m\">{}</td><td>{}</td></tr>",
            escaped(&kind.found),
            escaped(&with_scatter(micro(kind.mean_n_per_m), micro(kind.std_n_per_m))),
            escaped(&kind.meaning)
        );
    }
    html.push_str("</tbody></table></div>");
    Some(html)
}

/// If a cycle's slope scatters over the hits by more than this fraction of it, the cycle is not
/// informative by itself.
const UNSTEADY: f64 = 0.08;

/// The decay's cycles after the hits: slope and phase of each.
pub fn decay(results: &Results) -> Option<String> {
    let (row, loops) = results.hysteresis.iter().enumerate().find(|(_, h)| !h.decay.is_empty())?;
    let steps = &loops.decay;
    if steps.len() < 2 {
        return None;
    }
    let heads =
        ["cycle after the hit", "what it shows", "k_eq ± σ over hits, N/µm", "Δx lags T, °", "Δx, µm"];
    let mut table =
        HtmlTable::new(2, "The decay's cycles over all hits (the paper's Table 3, impacts)", &heads);
    for (i, step) in steps.iter().enumerate() {
        let k = step.k_eq_n_per_m;
        let at = |field: &str| format!("/hysteresis/{row}/decay/{i}/{field}");
        let tells = if k.std > UNSTEADY * k.mean.abs() {
            "differs from hit to hit, with the phases of the decaying modes"
        } else if step.phase_deg.abs() > said::TURNED_DEG {
            "Δx and T are out of phase"
        } else if step.cycle == 1 {
            "nearest to the contact's own line"
        } else {
            "near a straight line"
        };
        table.row([
            words(step.cycle.to_string()),
            words(tells),
            scattered(Some(with_scatter(micro(k.mean), micro(k.std))), &at("k_eq_n_per_m")),
            number(Some(decimals(step.phase_deg, 1)), at("phase_deg")),
            number(Some(short(step.amplitude_m * 1e6)), at("amplitude_m")),
        ]);
    }
    Some(table.finish())
}

/// The parameters of the force correction.
pub fn static_arm(results: &Results) -> Option<String> {
    let arm = results.static_arm.as_ref()?;
    Some(format!("<p>{}</p>", escaped(said::static_arm(arm).trim_end_matches(':'))))
}

const HEADS: [&str; 10] = [
    "excitation",
    "shape",
    "Δx, µm",
    "k_T of the contact (95 %), N/µm",
    "stick slope ± σ, N/µm",
    "k_eq ± σ, N/µm",
    "peak secant, N/µm",
    "energy ± σ, µJ",
    "Δx lags T, °",
    "cycles",
];

/// Loops: stiffness, energy, phase, and friction if something slips.
pub fn hysteresis(results: &Results) -> Option<String> {
    if results.hysteresis.is_empty() {
        return None;
    }
    let friction = results.hysteresis.iter().any(|h| h.friction_coefficient.is_some());
    let mut heads = HEADS.to_vec();
    if friction {
        heads.push("μ (95 % over the cycles)");
    }
    let mut table = HtmlTable::new(2, "Loops with the raw force (the paper's Table 3)", &heads);
    let mut corrected = HtmlTable::new(2, "Loops with the corrected force", &heads);
    let mut any_corrected = false;
    let over =
        |value: Option<OverCycles>, scale: f64| value.map(|v| with_scatter(v.mean * scale, v.std * scale));
    let mut told: Vec<(String, &str)> = Vec::new();
    for (i, h) in results.hysteresis.iter().enumerate() {
        let at = |field: &str| format!("/hysteresis/{i}/{field}");
        let slope = if h.slope_between_spots_n_per_m.is_some() {
            "slope_between_spots_n_per_m"
        } else {
            "k_t_n_per_m"
        };
        let of_cycles = h.stick_slope().or(h.k_eq_n_per_m);
        let mut cells = vec![
            words(said::excitation(h)),
            words(shape(h)),
            number(h.amplitude_m.map(|a| format!("± {}", short(a * 1e6))), at("amplitude_m")),
            number(
                h.own_k_t().map(|k| {
                    let [low, high] = k.ci95.map(|limit| short(micro(limit)));
                    format!("{} ({low}…{high})", short(micro(k.mean)))
                }),
                format!("{0}/mean {0}/ci95/0 {0}/ci95/1", at("k_t_n_per_m")),
            ),
            scattered(over(h.stick_slope(), 1e-6), &at(slope)),
            scattered(over(h.k_eq_n_per_m, 1e-6), &at("k_eq_n_per_m")),
            number(h.k_secant_n_per_m.map(|k| short(micro(k))), at("k_secant_n_per_m")),
            scattered(over(h.energy_j, 1e6), &at("energy_j")),
            number(h.phase_deg.map(|p| decimals(p, 1)), at("phase_deg")),
            number(
                of_cycles.map(|k| k.cycles.to_string()),
                at(&format!("{}/cycles", if h.stick_slope().is_some() { slope } else { "k_eq_n_per_m" })),
            ),
        ];
        if friction {
            let mu = h
                .friction_coefficient
                .map(|mu| h.friction_coefficient_ci95.map_or_else(|| short(mu), |ends| with_ends(mu, ends)));
            let ends = h
                .friction_coefficient_ci95
                .map_or_else(String::new, |_| format!(" {0}/0 {0}/1", at("friction_coefficient_ci95")));
            cells.push(number(mu, at("friction_coefficient") + &ends));
        }
        if h.force == Force::Corrected {
            corrected.row(cells);
            any_corrected = true;
        } else {
            table.row(cells);
        }
        told.extend(h.warnings.iter().map(|w| (said::excitation(h), w.as_str())));
        if let Some(why) = h.k_t_why.as_ref().filter(|_| h.k_t_n_per_m.is_none()) {
            told.push((said::excitation(h), why));
        }
    }
    let mut html = table.finish() + &remarks(&told);
    if any_corrected {
        let _ = write!(
            html,
            "<details><summary>The same with the corrected force</summary>{}</details>",
            corrected.finish()
        );
    }
    Some(html)
}

/// The shape in words. For impacts it comes from the decay's frequency, which does not determine
/// whether the loops are straight lines.
fn shape(h: &Hysteresis) -> String {
    let name = said::shape_name(h.shape);
    let opened =
        h.kind == Excitation::Impact && h.slope_between_spots_n_per_m.is_none() && h.k_t_n_per_m.is_none();
    if opened && h.shape == Shape::Stuck { "sticks, but not a straight line".into() } else { name.into() }
}
