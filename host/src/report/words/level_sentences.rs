//! Sentences on the records of the shaker: the contact stiffness from a level, or why there is
//! none, and the lines that `jointrig hysteresis` prints for a time record: every figure of its
//! loop, and its faults.

use super::names::{BETWEEN_SPOTS, shape_name};
use super::number::{decimals, prefixed, short, stiffness, with_ends};
use super::warning_sentences::loop_finding;
use crate::analyse::NoLevelStiffness;
use crate::contact::Shares;
use crate::results::{BESIDE_THE_CONTACT, Excitation, Force, Hysteresis, Results, Shape};

/// Contributions to a level's interval; `correction` is the part of T/Δx at the measured points
/// that is not due to the contact.
pub fn corrected(shares: &Shares, correction: f64) -> String {
    let mut causes = [
        (shares.fit, "the hits' estimates of spots, points, gains and force"),
        (shares.hammer_gain, "the gain of the hammer's force cell"),
        (shares.turning, "noise of the specimens' rotation at this frequency"),
        (shares.place, "where the shaker pushes"),
        (shares.level, "the level's own scatter"),
    ];
    causes.sort_by(|a, b| b.0.total_cmp(&a.0));
    format!(
        "Force and Δx were corrected to those at the contact, with the specimens' rotation from the hits: {} % of T/Δx at the spots was not due to the contact. Most of its \
         uncertainty comes from {} ({:.1} %).",
        short(100.0 * correction),
        causes[0].1,
        100.0 * causes[0].0
    )
}

/// Why a level has no k_T.
pub fn none(why: &NoLevelStiffness) -> String {
    let reason = match why {
        NoLevelStiffness::NoContact => {
            "the hits do not determine the specimens' rotation and the force at the contact: see answer.contact"
                .into()
        }
        NoLevelStiffness::Doubted => "the result of the hits, which is needed for its correction, is doubtful: see answer.contact".into(),
        NoLevelStiffness::SlipsUnderTheHammer => {
            "the contact slips under the hammer, so the hits do not describe the stuck contact".into()
        }
        NoLevelStiffness::Slips => {
            format!("the loop slips ({} or {})", shape_name(Shape::Microslip), shape_name(Shape::GrossSlip))
        }
        NoLevelStiffness::Finding(finding) => loop_finding(finding),
        NoLevelStiffness::Level(error) => error.to_string(),
        NoLevelStiffness::Apart(deviations) => format!(
            "it is {} standard deviations from the result of the hits: see answer.contact",
            short(*deviations)
        ),
        NoLevelStiffness::Wide(half) => format!(
            "so much of Δx at this frequency comes from the specimens' rotation that k_T is known only to ± {} %",
            short(100.0 * half)
        ),
    };
    format!("no k_T: {reason}")
}

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
        let coefficient = row.friction_coefficient.map_or(
            "no coefficient μ without a normal load (--normal-load N)".to_owned(),
            |mu| {
                let shown = row.friction_coefficient_ci95.map_or_else(
                    || short(mu),
                    |ends| format!("{}, of the scatter over the cycles alone", with_ends(mu, ends)),
                );
                format!("coefficient μ = {shown}")
            },
        );
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
        Shape::Elliptical => "an ellipse without visible slip",
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::words::levels_at_the_contact;
    use crate::results::{OverCycles, example_tests as example};

    #[test]
    fn a_level_says_what_made_its_interval() {
        let shares = Shares { fit: 0.01, hammer_gain: 0.005, turning: 0.002, place: 0.021, level: 1e-4 };
        let said = corrected(&shares, 0.31);
        assert!(said.contains("31") && said.contains("where the shaker pushes (2.1 %)"), "{said}");
    }

    #[test]
    fn only_levels_with_an_interval_of_their_own_are_called_k_t() {
        let mut results = example::results();
        assert_eq!(levels_at_the_contact(&results), None, "nobody asked");
        let levels = results.hysteresis.iter_mut().filter(|row| row.level.is_some());
        let mut count = 0;
        for (n, row) in levels.enumerate() {
            count += 1;
            row.k_t_why = Some(none(&NoLevelStiffness::Wide(0.3)));
            if n == 1 {
                row.k_t_n_per_m =
                    Some(OverCycles { mean: 171e6, std: 1e5, cycles: 100, ci95: Some([160e6, 183e6]) });
                row.k_t_budget =
                    Some(Shares { fit: 0.01, hammer_gain: 0.0, turning: 0.0, place: 0.02, level: 0.0 });
                assert_ne!(row.stick_slope().map(|k| k.mean), Some(171e6), "the loop's own slope is another");
            }
        }
        let said = levels_at_the_contact(&results).expect("levels");
        assert!(said.contains(&format!("one of {count} levels")) && said.contains("171 N/µm"), "{said}");
    }
}
