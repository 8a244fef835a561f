//! Output of `jointrig hysteresis` for one time record: every figure of its loop, and its faults.

use super::names::{BETWEEN_SPOTS, shape_name};
use super::number::{decimals, prefixed, short, stiffness};
use super::warning_sentences::loop_finding;
use crate::results::{BESIDE_THE_CONTACT, Excitation, Force, Hysteresis, Results, Shape};

/// The loops of a record, line by line; empty if there are none.
pub fn record_loops(results: &Results) -> Vec<String> {
    let beside = results.source.settings.contains_key(BESIDE_THE_CONTACT);
    results.hysteresis.iter().flat_map(|row| of_row(row, beside)).collect()
}

fn of_row(row: &Hysteresis, beside: bool) -> Vec<String> {
    let force = match row.force {
        Force::Raw => "",
        Force::Corrected => " (corrected force)",
    };
    let motion = match row.kind {
        Excitation::Shaker => "Loop of a steady excitation",
        Excitation::Impact => "Loops of a decay after an impact",
    };
    let at = row.frequency_hz.map_or(String::new(), |f| format!(" at {} Hz", short(f)));
    let by = row.amplitude_m.map_or(String::new(), |x| format!(", Δx ± {}", prefixed(x, "m")));
    let cycles = row.k_eq_n_per_m.map_or(String::new(), |k| {
        format!(", {} {}", k.cycles, if k.cycles == 1 { "cycle" } else { "cycles" })
    });
    let mut lines = vec![
        format!("{motion}{at}{by}{cycles}{force}:"),
        format!("  shape: {}, {}", shape_name(row.shape), in_words(row.shape)),
    ];
    let name = if beside { BETWEEN_SPOTS } else { "k_T" };
    let slope = if beside { row.stick_slope() } else { row.k_t_n_per_m };
    lines.push(match (slope, row.stick_part) {
        (Some(k), Some([from, to])) => format!(
            "  {name}: {}, over {} to {} % of the force's swing after each reversal",
            stiffness(k.mean, k.std),
            decimals(100.0 * from, 0),
            decimals(100.0 * to, 0)
        ),
        (Some(k), None) => format!("  {name}: {}, over the whole loop", stiffness(k.mean, k.std)),
        (None, _) => format!("  {name}: none (see below)"),
    });
    if let Some(k) = row.k_eq_n_per_m {
        lines.push(format!("  k_eq: {}, least-squares slope over the whole loop", stiffness(k.mean, k.std)));
    }
    if let Some(energy) = row.energy_j {
        lines.push(format!(
            "  energy: {} per cycle (scatter {})",
            prefixed(energy.mean, "J"),
            prefixed(energy.std, "J")
        ));
    }
    if let Some(limit) = row.friction_limit_n {
        let coefficient = row
            .friction_coefficient
            .map_or("no coefficient μ without a normal load (--normal-load N)".to_owned(), |mu| {
                format!("coefficient μ = {}", short(mu))
            });
        lines.push(format!("  friction limit μN: {}; {coefficient}", prefixed(limit, "N")));
    }
    if let Some(phase) = row.phase_deg {
        lines.push(format!("  phase: Δx lags T by {}°", decimals(phase, 1)));
    }
    let findings: Vec<String> = row.findings.iter().map(loop_finding).collect();
    lines.extend(
        row.findings.iter().zip(&findings).map(|(found, said)| format!("!! {}: {said}", found.name())),
    );
    // the warnings also contain the findings' sentences, which are already printed
    lines
        .extend(row.warnings.iter().filter(|said| !findings.contains(said)).map(|said| format!("!! {said}")));
    lines
}

fn in_words(shape: Shape) -> &'static str {
    match shape {
        Shape::Stuck => "a straight line",
        Shape::Elliptical => "an ellipse in which no slip is seen",
        Shape::Microslip => "a part of the contact slips, or the loop bends",
        Shape::GrossSlip => "all of the contact slips",
    }
}

/// Name of the shaker's slopes: k_T in a record of the contact itself, otherwise the slope between
/// the measured points.
pub(super) fn slope_name(rows: &[&Hysteresis]) -> &'static str {
    let contact = |row: &&Hysteresis| row.slope_between_spots_n_per_m.is_none() && row.level.is_none();
    let mut with = rows.iter().copied().filter(|row| row.stick_slope().is_some()).peekable();
    if with.peek().is_some() && with.all(|row| contact(&row)) { "k_T" } else { BETWEEN_SPOTS }
}
