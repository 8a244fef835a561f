//! The answer in a few lines, for readers who read nothing else: the first screen, the end of the
//! terminal's output, and the first line of `identify`, the number that was requested.

use super::answer_sentences::{why_they_differ, with_interval};
use super::number::{
    AnswerLine, BETWEEN, CLAMP, CONTACT, TRUTH, UNKNOWN, band, decimals, micro, short, stiffness,
};
use super::summary;
use crate::campaign::store::session_table::SessionInfo;
use crate::contact::Interval;
use crate::results::{
    AS_STATED, BACK_COUPLING, Check, HAMMER_SLIP, HIDDEN_RESONANCE, INTERFACE_MODES, INTERNALS, Joint,
    ONE_STRUCTURE, PREDICTED, Results, SAME_IN_ALL, SENSOR_MASSES, SERIES_COMPLIANCE, STEADY, UNCHANGED,
    headline_rank,
};
use crate::substructuring::{Dof, fit};

fn line(head: &str, text: impl Into<String>) -> AnswerLine {
    AnswerLine { head: head.into(), text: text.into(), numbers: Vec::new() }
}

/// What was measured; a simulated rig is identified as such first. The names of the structures
/// follow, and the direction of z if it is not the usual one.
pub fn on_what(results: &Results) -> String {
    let settings = &results.source.settings;
    let names = settings.get("structure").and_then(|names| names.as_str()).map(str::to_owned);
    let sliding =
        settings.get("sliding_direction").and_then(|direction| direction.as_array()).map(|direction| {
            let parts: Vec<String> = direction
                .iter()
                .filter_map(serde_json::Value::as_f64)
                .map(|part| decimals(part, 2))
                .collect();
            format!("z is the sliding direction ({}) of the plan", parts.join(", "))
        });
    let told: Vec<String> = names.into_iter().chain(sliding).collect();
    let on = measured_on(results);
    if told.is_empty() { on } else { format!("{on}; {}", told.join("; ")) }
}

fn measured_on(results: &Results) -> String {
    let source = &results.source;
    let file = &source.file;
    let seed = source.settings.get("seed").map_or(String::new(), |seed| {
        format!(", seed {}", seed.as_str().map_or_else(|| seed.to_string(), str::to_owned))
    });
    if source.simulated {
        let rig =
            source.settings.get("rig").and_then(|r| r.as_str()).map_or(String::new(), |r| format!(" “{r}”"));
        return format!("SIMULATED rig{rig}{seed}: {file}");
    }
    let of = |key: &str| source.device.get(key).map(String::as_str);
    match (of("board"), of("serial")) {
        (Some(SessionInfo::IMPORTED), _) => format!("From imported records: {file}"),
        (Some(board), Some(serial)) => format!("Measured by {board}, serial number {serial}: {file}"),
        (Some(board), None) => format!("Measured by {board}: {file}"),
        _ => format!("From {file}"),
    }
}

/// The main results; empty if no campaign was analysed.
pub fn answer(results: &Results) -> Vec<AnswerLine> {
    let Some(answer) = &results.answer else { return Vec::new() };
    let own = &answer.contact;
    let mut lines = vec![match &own.k_t_n_per_m {
        Some(k) => line("k_T of the contact:", format!("{}.", with_interval(k))).interval(k, CONTACT),
        None => line("k_T of the contact:", format!("{UNKNOWN} {}", own.why)),
    }];
    lines.push(match &answer.between_arms.k_n_per_m {
        Some(k) => {
            line("Between the arms:", format!("{}, which is not k_T.", with_interval(k))).interval(k, BETWEEN)
        }
        None => line("Between the arms:", format!("{UNKNOWN} {}", answer.between_arms.why)),
    });
    if let Some(clamp) = &answer.clamp {
        let k = &clamp.k_n_per_m;
        lines.push(
            line("Clamps, in series with the contact:", format!("{}.", with_interval(k))).interval(k, CLAMP),
        );
    }
    if let Some(truth) = &answer.truth {
        let clamps =
            truth.clamps_k_n_per_m.map_or(String::new(), |k| format!(", clamps {}", short(micro(k))));
        let told = line(
            TRUTH,
            format!(
                "contact {}{clamps}, between the arms {} N/µm.",
                short(micro(truth.contact_k_t_n_per_m)),
                short(micro(truth.between_arms_k_n_per_m))
            ),
        )
        .stiffness(truth.contact_k_t_n_per_m, "/answer/truth/contact_k_t_n_per_m");
        let told = match truth.clamps_k_n_per_m {
            Some(k) => told.stiffness(k, "/answer/truth/clamps_k_n_per_m"),
            None => told,
        };
        lines.push(told.stiffness(truth.between_arms_k_n_per_m, "/answer/truth/between_arms_k_n_per_m"));
    }
    lines
}

/// A failed check in a few words, for readers unfamiliar with it.
pub fn failed(check: &Check) -> String {
    let at = check.frequency_hz.map_or(String::new(), |f| format!(" at {} Hz", decimals(f, 0)));
    match check.name.as_str() {
        HIDDEN_RESONANCE => format!(
            "One specimen resonates on its own clamp{at}: loops near this resonance do not measure the contact."
        ),
        SERIES_COMPLIANCE => {
            "The clamps give way: what is found between the arms is softer than the contact.".into()
        }
        HAMMER_SLIP => "The contact slips under the hammer.".into(),
        SENSOR_MASSES => {
            "A sensor on B was measured on B alone or in the assembly, but not in both: its mass changes k_T."
                .into()
        }
        STEADY => "The contact changed while it was hit: k_T is a mean over that time.".into(),
        PREDICTED => "The fit of the contact does not predict a cell that was left out of it.".into(),
        // its first sentence names what is off
        AS_STATED => format!("{}.", check.meaning.split(". ").next().unwrap_or_default()),
        UNCHANGED => "The contact is not the same after the hits as before.".into(),
        INTERFACE_MODES => "Six rigid motions do not describe what couples the parts.".into(),
        INTERNALS => "The points away from the interface do not suffice for every method.".into(),
        ONE_STRUCTURE => "The device reported another structure during the campaign.".into(),
        SAME_IN_ALL => "A or B is not the same alone as in the assembly.".into(),
        BACK_COUPLING => {
            format!("A and B, joined by the stiffness found, do not reproduce the measured assembly{at}.")
        }
        other => format!("{other} failed."),
    }
}

/// Maximum number of lines on the terminal.
pub const MOST: usize = 15;

/// The last lines of `demo` and `analyse`: at most [`MOST`], of which the caller needs `after`.
pub fn terminal(results: &Results, after: usize) -> Vec<String> {
    let mut lines = vec![on_what(results)];
    let answer = answer(results);
    if answer.is_empty() {
        let found = [
            super::substructuring(results),
            super::impact_loops(results),
            super::shaker_loops(results),
            super::levels_at_the_contact(results),
        ];
        lines.extend(found.into_iter().flatten());
    } else {
        lines.extend(answer.into_iter().map(|line| format!("{} {}", line.head, line.text)));
        lines.extend(why_they_differ(results).map(|line| line.text));
    }
    if lines.len() == 1 {
        lines.push("No stiffness could be found from this file.".into());
    }
    let failed: Vec<String> = results
        .checks
        .iter()
        .filter(|c| c.ok == Some(false))
        .map(|c| format!("Look here: {}", failed(c)))
        .collect();
    // reserve at least one line for missing items
    let kept = usize::from(!results.missing.is_empty());
    let room = MOST.saturating_sub(lines.len() + after + kept);
    shortened(&mut lines, &failed, room, "checks failed");
    let missing: Vec<String> = results.missing.iter().map(|one| format!("Missing: {one}")).collect();
    let room = MOST.saturating_sub(lines.len() + after);
    shortened(&mut lines, &missing, room, "things are missing");
    lines
}

/// As many lines of `all` as fit; the last line counts the others.
fn shortened(lines: &mut Vec<String>, all: &[String], room: usize, what: &str) {
    if all.len() <= room {
        lines.extend_from_slice(all);
    } else if room > 0 {
        lines.extend_from_slice(&all[..room - 1]);
        lines.push(format!("{} more {what}: see the report.", all.len() + 1 - room));
    }
}

/// The main result in one line: the answer of a campaign, otherwise the first number available.
pub fn headline(results: &Results) -> String {
    let answer = answer(results).into_iter().next();
    answer
        .map(|line| format!("{} {}", line.head, line.text))
        .or_else(|| between_the_arms(results))
        .or_else(|| summary::summary(results).into_iter().next())
        .unwrap_or_else(|| "no stiffness was found".into())
}

/// The stiffness along the sliding direction, from the best available source: the fit if it was
/// requested, then the recommended estimate, then single methods. `None` if no method identified
/// it.
pub fn between_the_arms(results: &Results) -> Option<String> {
    let said = fitted(results).or_else(|| recommended(results)).or_else(|| by_one_method(results))?;
    Some(format!("k_z between the arms: {said}."))
}

fn fitted(results: &Results) -> Option<String> {
    let row = best(results, |row| row.method == fit::NAME)?;
    let k = row.sliding_stiffness()?;
    Some(match k.ci95 {
        Some(ci95) => {
            let told = with_interval(&Interval { mean: k.mean, ci95 });
            format!("{told}, {} with {} IDMs, {}", row.method, row.idms, band(row.band_hz))
        }
        None => with_scatter(row, k.mean, k.std),
    })
}

fn recommended(results: &Results) -> Option<String> {
    let z = |r: &crate::results::Averaged| r.joint.get(&Dof::Z).filter(|z| z.identified).copied();
    let (estimate, z) = results.recommended.iter().find_map(|r| Some((r, z(r)?)))?;
    let told = with_interval(&Interval { mean: z.stiffness, ci95: z.ci95 });
    let of = if estimate.noise_known { "" } else { " (of errors of position and angle alone)" };
    Some(format!("{told}{of}, recommended, {} IDMs, {}", estimate.idms, band(estimate.band_hz)))
}

fn by_one_method(results: &Results) -> Option<String> {
    let row = best(results, |_| true)?;
    let k = row.sliding_stiffness()?;
    Some(with_scatter(row, k.mean, k.std))
}

fn with_scatter(row: &Joint, mean: f64, std: f64) -> String {
    let (method, idms, band, lines) = (&row.method, row.idms, band(row.band_hz), row.lines);
    format!("{} (scatter of {lines} lines), {method} with {idms} IDMs, {band}", stiffness(mean, std))
}

/// Of the rows that identified it and satisfy `wanted`, the best one in the first band.
fn best(results: &Results, wanted: impl Fn(&Joint) -> bool) -> Option<&Joint> {
    let rows = || results.joint.iter().filter(|row| row.identified() && wanted(row));
    let first = rows().next()?.band_hz;
    rows().filter(|row| row.band_hz == first).max_by_key(|row| headline_rank(&row.method, row.idms))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::example_tests as example;

    #[test]
    fn the_end_of_the_output_is_short_even_when_everything_failed() {
        let mut results = example::results();
        for n in 0..20 {
            results.checks.push(Check::new(&format!("check-{n}"), Some(false), "no"));
            results.missing.push("something".into());
        }
        let lines = terminal(&results, 2);
        assert!(lines.len() + 2 <= MOST, "{}", lines.join("\n"));
        assert!(lines.iter().any(|l| l.contains("more checks failed")));
        assert!(lines.iter().any(|l| l.contains("things are missing")), "{lines:?}");
    }

    #[test]
    fn a_simulated_rig_is_called_so_first() {
        let mut results = example::results();
        results.source.simulated = true;
        results.source.settings.insert("seed".into(), 7.into());
        assert!(on_what(&results).starts_with("SIMULATED rig, seed 7"));
        results.source.simulated = false;
        results.source.device.insert("board".into(), "nucleo-u5a5".into());
        results.source.device.insert("serial".into(), "0042".into());
        assert!(on_what(&results).contains("nucleo-u5a5, serial number 0042"));
    }
}

#[cfg(test)]
mod headline_tests {
    use super::*;
    use crate::results::{Source, example_tests as example};

    #[test]
    fn the_best_number_comes_first_and_none_is_made_up() {
        let mut results = example::results();
        let one = between_the_arms(&results);
        assert!(one.as_ref().is_some_and(|line| line.contains("26.8 ± 0.9 N/µm")), "{one:?}");
        example::add_interface(&mut results);
        let quoted = between_the_arms(&results);
        assert!(quoted.as_ref().is_some_and(|line| line.contains("recommended")), "{quoted:?}");
        assert_eq!(between_the_arms(&Results::new(Source::default())), None);
    }
}
