//! The same results in plain sentences, for the terminal and the head of the report.

use super::level_sentences::{record_loops, slope_name};
use super::names::{method, slope, static_arm};
use super::number::{band, count, micro, short, stiffness};
use super::{answer_sentences, side_by_side};
use crate::results::{Bootstrap, Excitation, Force, Hysteresis, Joint, MAIN_BAND, RECORD, Results, Shape};
use crate::substructuring::{Dof, fit};

/// The FBS result between the arms, in one sentence: the recommended estimate, otherwise the
/// headline's method.
pub fn substructuring(results: &Results) -> Option<String> {
    recommended(results).or_else(|| by_one_method(results))
}

/// The recommended estimate over the main band.
fn recommended(results: &Results) -> Option<String> {
    let estimate = results.quoted()?;
    Some(format!(
        "Substructuring (FBS, Eq. A.1 averaged as an admittance, {} IDMs, {}) sees between the arms, along the sliding direction: {}",
        estimate.idms,
        band(MAIN_BAND),
        estimate.statement()?
    ))
}

fn by_one_method(results: &Results) -> Option<String> {
    let joint = results.headline_joint()?;
    let k = joint.sliding_stiffness()?;
    let median = short(micro(k.median));
    let rest = if !joint.identified() {
        format!(
            ": scatter or noise is larger than the value (median {median}), so the joint is not identified"
        )
    } else if k.std > 0.3 * k.mean.abs() {
        format!("; single lines scatter widely, their median is {median}")
    } else {
        String::new()
    };
    Some(format!(
        "Substructuring (FBS, {}, {} IDMs, {}) sees {} between the arms along the sliding direction{rest}.",
        method(&joint.method),
        joint.idms,
        band(joint.band_hz),
        stiffness(k.mean, k.std)
    ))
}

/// The bootstrap result for the sliding direction.
pub fn bootstrapped(bootstrap: &Bootstrap) -> String {
    let z = bootstrap.hits.get(&Dof::Z).zip(bootstrap.joint.get(&Dof::Z));
    let said = z.map_or_else(
        || "k_z was not included".to_owned(),
        |(hits, whole)| {
            let high = if whole.identified { short(micro(whole.ci95[1])) } else { "no upper limit".into() };
            format!(
                "k_z scatters by {} N/µm from hit to hit; with errors of position and angle, 95 % {}…{high} N/µm",
                short(micro(hits.std)),
                short(micro(whole.ci95[0]))
            )
        },
    );
    format!(
        "Hits resampled {} times ({}): {said}.",
        count(bootstrap.replicates as u64),
        band(bootstrap.band_hz)
    )
}

/// The result of the impact loops, in one sentence.
pub fn impact_loops(results: &Results) -> Option<String> {
    let loops = results.impact_loops()?;
    let (name, k) = slope(loops)?;
    let of = if k.cycles == 1 {
        "the first cycle of 1 hit".into()
    } else {
        format!("the first cycles of {} hits", count(k.cycles as u64))
    };
    Some(format!(
        "The impacts' own loops, measured at the specimens ({of}), give {name} = {}.",
        stiffness(k.mean, k.std)
    ))
}

/// The result of the shaker's loops, in one sentence: the slope between the measured points where
/// they stick, with its range over frequency and amplitude.
pub fn shaker_loops(results: &Results) -> Option<String> {
    let rows: Vec<&Hysteresis> =
        results.hysteresis.iter().filter(|h| h.kind == Excitation::Shaker && h.force == Force::Raw).collect();
    let values: Vec<f64> = rows.iter().filter_map(|h| h.stick_slope()).map(|k| micro(k.mean)).collect();
    let name = slope_name(&rows);
    let ellipses = rows.iter().filter(|h| h.shape == Shape::Elliptical).count();
    let aside = match ellipses {
        0 => String::new(),
        n => format!("; {n} of {} loops are ellipses and give only k_eq", rows.len()),
    };
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    match values.len() {
        0 if rows.is_empty() => None,
        0 if rows.len() == 1 => Some("The shaker's loop gives no slope between the spots.".into()),
        0 => Some(format!("None of the shaker's {} loops gives a slope between the spots.", rows.len())),
        1 => Some(format!("The shaker's loop gives a {name} of {} N/µm{aside}.", short(low))),
        n => Some(format!(
            "The shaker's loops ({n}) give a {name} of {} to {} N/µm{aside}.",
            short(low),
            short(high)
        )),
    }
}

/// The results of the shaker's levels for the contact itself.
pub fn levels_at_the_contact(results: &Results) -> Option<String> {
    let asked: Vec<&Hysteresis> = results.hysteresis.iter().filter(|h| h.k_t_why.is_some()).collect();
    let values: Vec<f64> = asked.iter().filter_map(|h| h.k_t_n_per_m).map(|k| micro(k.mean)).collect();
    let levels = asked.len();
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    match values.len() {
        0 if levels == 0 => None,
        0 => Some(format!("The contact's own k_T is known at none of the shaker's {levels} levels.")),
        1 => Some(format!(
            "Corrected for the specimens' rotation and arm B, one of {levels} levels gives a k_T of the contact's own: {} N/µm.",
            short(low)
        )),
        n => Some(format!(
            "Corrected for the specimens' rotation and arm B, {n} of {levels} levels give a k_T of the contact's own: {} to {} N/µm.",
            short(low),
            short(high)
        )),
    }
}

/// One row of the joint table as text.
fn joint_line(joint: &Joint) -> Option<String> {
    let k = joint.sliding_stiffness()?;
    let ci95 = k
        .ci95
        .map_or(String::new(), |[low, high]| format!(", 95 % {}…{}", short(micro(low)), short(micro(high))));
    let noise = joint.noise_n_per_m.get("z");
    let verdict = if joint.identified() { "" } else { "; not identified" };
    // the fit uses all lines together
    let spread = if joint.method == fit::NAME {
        format!("σ of the estimate from {} lines", joint.lines)
    } else {
        let noise = noise.map_or(String::new(), |noise| format!(", noise alone {}", short(micro(*noise))));
        format!("σ over {} lines{noise}; median {}", joint.lines, short(micro(k.median)))
    };
    Some(format!(
        "  {:<17} {}  {:>11}  k_z {} ({spread}{ci95}){verdict}",
        joint.method,
        if joint.idms == 0 { "      ".to_owned() } else { format!("{} IDMs", joint.idms) },
        band(joint.band_hz),
        stiffness(k.mean, k.std),
    ))
}

/// The whole summary, line by line, as printed by `demo` and `analyse`.
pub fn summary(results: &Results) -> Vec<String> {
    if results.source.kind == RECORD {
        return record_loops(results);
    }
    let mut lines = answer_sentences::lines(results);
    lines.extend(substructuring(results));
    lines.extend(impact_loops(results));
    lines.extend(shaker_loops(results));
    lines.extend(levels_at_the_contact(results));
    if lines.is_empty() {
        lines.push("No stiffness could be found from this file.".into());
    }
    for check in &results.checks {
        let mark = match check.ok {
            Some(true) => "ok",
            Some(false) => "!!",
            None => "??",
        };
        lines.push(format!("{mark} {}: {}", check.name, check.meaning));
    }
    if !results.recommended.is_empty() {
        lines.push(String::new());
        lines.push("Recommended (Eq. A.1, averaged as an admittance before it is inverted):".into());
        lines.extend(
            results
                .recommended
                .iter()
                .filter_map(|r| Some(format!("  {:>11}  {}", band(r.band_hz), r.statement()?))),
        );
    }
    if let Some(bootstrap) = &results.bootstrap {
        lines.push(String::new());
        lines.push(bootstrapped(bootstrap));
    }
    // a campaign is analysed in every way: print only the main band
    let read_here = |j: &&Joint| results.source.kind != "campaign" || j.band_hz == MAIN_BAND || j.idms == 0;
    let table: Vec<String> = results.joint.iter().filter(read_here).filter_map(joint_line).collect();
    if !table.is_empty() {
        lines.push(String::new());
        lines.push("Joint stiffness along z, by method, interface modes and band:".into());
        lines.extend(table);
        if results.joint.iter().any(|j| !read_here(&j)) {
            lines.push("  (the other bands are in results.json and report.html)".into());
        }
    }
    let kinds = side_by_side::kinds(results);
    if !kinds.is_empty() {
        lines.push(String::new());
        lines.push("What was found along z, side by side (raw force), in N/µm:".into());
        for kind in kinds {
            let k = stiffness(kind.mean_n_per_m, kind.std_n_per_m);
            lines.push(format!("  {:<44} {k}: {}", kind.found, kind.meaning));
        }
    }
    let corrected = side_by_side::corrected(results);
    if let (Some(arm), false) = (&results.static_arm, corrected.is_empty()) {
        lines.push(String::new());
        lines.push(static_arm(arm));
        lines.extend(
            corrected.iter().map(|kind| {
                format!("  {:<44} {}", kind.found, stiffness(kind.mean_n_per_m, kind.std_n_per_m))
            }),
        );
    }
    if !results.completeness.is_empty() {
        lines.push(String::new());
        lines.push("Hits:".into());
        lines.extend(results.completeness.iter().map(|c| {
            let refused: Vec<String> =
                c.refused.iter().filter(|(_, n)| **n > 0).map(|(v, n)| format!("{n} {v}")).collect();
            let refused = if refused.is_empty() {
                "none refused".into()
            } else {
                format!("refused: {}", refused.join(", "))
            };
            format!(
                "  {:<4} {} of {} kept in {} of {} cells; {refused}",
                c.configuration, c.kept, c.wanted, c.cells_complete, c.cells
            )
        }));
    }
    if !results.missing.is_empty() {
        lines.push(String::new());
        lines.push("Missing:".into());
        lines.extend(results.missing.iter().map(|m| format!("  {m}")));
    }
    if !results.refused.is_empty() {
        lines.push(String::new());
        lines.push("Not applicable here:".into());
        lines.extend(
            results.refused.iter().map(|r| format!("  {} with {} IDMs: {}", r.method, r.idms, r.reason)),
        );
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{Source, example_tests as example};

    #[test]
    fn the_summary_says_both_numbers_and_that_one_is_not_k_t() {
        let text = summary(&example::results()).join("\n");
        assert!(text.contains("26.8 ± 0.9 N/µm between the arms"), "{text}");
        assert!(text.contains("k_eq = 148 ± 4 N/µm"), "{text}");
        assert!(text.contains("not k_T"), "{text}");
        assert!(text.contains("double hit"), "{text}");
    }

    #[test]
    fn an_empty_document_says_so() {
        let empty = Results::new(Source::default());
        assert_eq!(summary(&empty), ["No stiffness could be found from this file."]);
    }

    #[test]
    fn more_scatter_than_value_is_called_not_identified() {
        let mut results = example::results();
        for joint in &mut results.joint {
            if let Some(k) = joint.stiffness_n_per_m.get_mut("z") {
                k.std = 2.0 * k.mean;
            }
        }
        assert!(substructuring(&results).is_some_and(|s| s.contains("not identified")));
    }
}
