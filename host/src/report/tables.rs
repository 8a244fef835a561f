//! The tables: html text from results.

use super::drawing::escape;
use crate::report::words;
use crate::report::words::number::{band, count, decimals, micro, short, with_scatter};
use crate::report::words::side_by_side;
use crate::results::{MAIN_BAND, OverCycles, Results};
use crate::substructuring::Band;
use std::fmt::Write;

/// Builds one table; cells are escaped, columns after the first `text_columns` are set to the right.
pub(super) struct Table {
    html: String,
    text_columns: usize,
}

impl Table {
    pub(super) fn new(text_columns: usize, heads: &[&str]) -> Self {
        let mut table = Table { html: "<table><thead>".into(), text_columns };
        table.cells("th", heads.iter().map(|h| (*h).to_owned()));
        table.html.push_str("</thead><tbody>");
        table
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.cells("td", cells);
    }

    fn cells(&mut self, tag: &str, cells: impl IntoIterator<Item = String>) {
        self.html.push_str("<tr>");
        for (i, cell) in cells.into_iter().enumerate() {
            let class = if i < self.text_columns { "" } else { " class=\"n\"" };
            write!(self.html, "<{tag}{class}>{}</{tag}>", escape(&cell))
                .expect("writing into a String cannot fail");
        }
        self.html.push_str("</tr>");
    }

    fn note(&mut self, columns: usize, text: &str) {
        write!(self.html, "<tr class=\"note\"><td colspan=\"{columns}\">{}</td></tr>", escape(text))
            .expect("writing into a String cannot fail");
    }

    pub(super) fn finish(mut self) -> String {
        self.html.push_str("</tbody></table>");
        self.html
    }
}

pub(super) const UNKNOWN: &str = "–";

/// Joint stiffness and damping by method, IDM set and band.
pub fn joint(results: &Results) -> Option<String> {
    if results.joint.is_empty() {
        return None;
    }
    let heads = [
        "method",
        "IDMs",
        "band",
        "k_z ± σ, N/µm",
        "of noise, σ",
        "median",
        "95 % of mean",
        "k_y ± σ, N/µm",
        "c_z ± σ, N s/m",
        "lines",
    ];
    let mut bands: Vec<Band> = Vec::new();
    for joint in &results.joint {
        if !bands.contains(&joint.band_hz) {
            bands.push(joint.band_hz);
        }
    }
    let mut notes: Vec<(String, &str)> = Vec::new();
    let mut elsewhere = 0;
    let mut html = String::new();
    for range in bands {
        let mut table = Table::new(1, &heads);
        for joint in results.joint.iter().filter(|j| j.band_hz == range) {
            let k = joint.sliding_stiffness();
            let stiffness = |dof: &str| {
                let k = joint.stiffness_n_per_m.get(dof);
                k.map_or(UNKNOWN.into(), |k| with_scatter(micro(k.mean), micro(k.std)))
            };
            let interval = k.and_then(|k| k.ci95).map_or(UNKNOWN.into(), |[low, high]| {
                format!("{} … {}", short(micro(low)), short(micro(high)))
            });
            let damping = joint.damping_n_s_per_m.get("z");
            table.row([
                joint.method.clone(),
                joint.idms.to_string(),
                band(joint.band_hz),
                stiffness("z") + if k.is_none() || joint.identified() { "" } else { ", not identified" },
                joint.noise_n_per_m.get("z").map_or(UNKNOWN.into(), |noise| short(micro(*noise))),
                k.map_or(UNKNOWN.into(), |k| short(micro(k.median))),
                interval,
                stiffness("y"),
                damping.map_or(UNKNOWN.into(), |c| with_scatter(c.mean, c.std)),
                joint.lines.to_string(),
            ]);
            if range != MAIN_BAND {
                elsewhere += joint.warnings.len();
                continue;
            }
            let row = format!("{}, {} IDMs", joint.method, joint.idms);
            notes.extend(joint.warnings.iter().map(|w| (row.clone(), w.as_str())));
        }
        if range == MAIN_BAND {
            html.push_str(&table.finish());
        } else {
            write!(html, "<details><summary>{}</summary>{}</details>", band(range), table.finish())
                .expect("writing into a String cannot fail");
        }
    }
    html.push_str(&gathered_notes(&notes));
    if elsewhere > 0 {
        write!(
            html,
            "<p><small>Remarks are on {}; {elsewhere} more, on the other bands, stand in results.json.</small></p>",
            band(MAIN_BAND)
        )
        .expect("writing into a String cannot fail");
    }
    Some(html)
}

/// Each warning once, with the rows it belongs to.
fn gathered_notes(notes: &[(String, &str)]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let mut gathered: Vec<(&str, Vec<&str>)> = Vec::new();
    for (row, warning) in notes {
        match gathered.iter_mut().find(|(w, _)| w == warning) {
            Some((_, rows)) => rows.push(row),
            None => gathered.push((warning, vec![row])),
        }
    }
    let mut html = String::from("<ul class=\"notes\">");
    for (warning, rows) in gathered {
        write!(html, "<li><b>{}</b>: {}</li>", escape(&rows.join("; ")), escape(warning))
            .expect("writing into a String cannot fail");
    }
    html.push_str("</ul>");
    html
}

/// FBS and loops side by side, each with what it is.
pub fn side_by_side(results: &Results) -> Option<String> {
    let kinds = side_by_side::kinds(results);
    if kinds.is_empty() {
        return None;
    }
    let mut html = String::from(
        "<table class=\"checks\"><thead><tr><th>found by</th><th class=\"n\">k ± σ, N/µm</th><th>what it is</th></tr></thead><tbody>",
    );
    for kind in kinds {
        write!(
            html,
            "<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            escape(&kind.found),
            with_scatter(micro(kind.mean_n_per_m), micro(kind.std_n_per_m)),
            escape(&kind.meaning)
        )
        .expect("writing into a String cannot fail");
    }
    html.push_str("</tbody></table>");
    Some(html)
}

/// The decay's cycles after the hits: slope and phase of each.
pub fn decay(results: &Results) -> Option<String> {
    let steps = &results.impact_loops()?.decay;
    if steps.len() < 2 {
        return None;
    }
    let mut table =
        Table::new(0, &["cycle after the hit", "k_eq ± σ over hits, N/µm", "Δx lags T, °", "Δx, nm"]);
    for step in steps {
        let k = step.k_eq_n_per_m;
        table.row([
            step.cycle.to_string(),
            with_scatter(micro(k.mean), micro(k.std)),
            decimals(step.phase_deg, 1),
            format!("± {}", short(step.amplitude_m * 1e9)),
        ]);
    }
    Some(table.finish())
}

/// What the corrected force was corrected by.
pub fn static_arm(results: &Results) -> Option<String> {
    let arm = results.static_arm.as_ref()?;
    Some(format!("<p>{}</p>", escape(words::static_arm(arm).trim_end_matches(':'))))
}

/// Loops: stiffness, energy, phase.
pub fn hysteresis(results: &Results) -> Option<String> {
    if results.hysteresis.is_empty() {
        return None;
    }
    let heads = [
        "excitation",
        "shape",
        "Δx, nm",
        "k_T of the contact (95 %), N/µm",
        "stick slope ± σ, N/µm",
        "k_eq ± σ, N/µm",
        "peak secant, |T₁/Δx₁|, N/µm",
        "energy ± σ, µJ",
        "phase, °",
        "μ",
        "cycles",
    ];
    let mut table = Table::new(2, &heads);
    let over = |value: Option<OverCycles>, scale: f64| {
        value.map_or(UNKNOWN.into(), |v| with_scatter(v.mean * scale, v.std * scale))
    };
    // a remark stands once, at the first row that has it
    let mut told: Vec<&String> = Vec::new();
    for h in &results.hysteresis {
        let cycles = h.stick_slope().or(h.k_eq_n_per_m).map_or(UNKNOWN.into(), |k| k.cycles.to_string());
        table.row([
            words::excitation(h),
            words::shape_name(h.shape).into(),
            h.amplitude_m.map_or(UNKNOWN.into(), |a| format!("± {}", short(a * 1e9))),
            h.own_k_t().map_or(UNKNOWN.into(), |k| {
                let [low, high] = k.ci95.map(|limit| short(micro(limit)));
                format!("{} ({low}…{high})", short(micro(k.mean)))
            }),
            over(h.stick_slope(), 1e-6),
            over(h.k_eq_n_per_m, 1e-6),
            h.k_secant_n_per_m
                .zip(h.k_fundamental_n_per_m)
                .map_or(UNKNOWN.into(), |(secant, fundamental)| {
                    format!("{}, {}", short(micro(secant)), short(micro(fundamental)))
                }),
            over(h.energy_j, 1e6),
            h.phase_deg.map_or(UNKNOWN.into(), |p| decimals(p, 1)),
            h.friction_coefficient.map_or(UNKNOWN.into(), short),
            cycles,
        ]);
        for warning in h.warnings.iter().filter(|warning| !told.contains(warning)) {
            table.note(heads.len(), warning);
        }
        told.extend(&h.warnings);
        if let Some(why) = h.k_t_why.as_ref().filter(|why| h.k_t_n_per_m.is_none() && !told.contains(why)) {
            table.note(heads.len(), why);
            told.push(why);
        }
    }
    Some(table.finish())
}

/// Checks with their outcome, meaning and figures.
pub fn checks(results: &Results) -> Option<String> {
    if results.checks.is_empty() {
        return None;
    }
    let mut html = String::from(
        "<table class=\"checks\"><thead><tr><th>check</th><th>outcome</th><th>what it means</th></tr></thead><tbody>",
    );
    for check in &results.checks {
        let class = match check.ok {
            Some(true) => "good",
            Some(false) => "bad",
            None => "open",
        };
        let mut figures: Vec<String> =
            check.frequency_hz.iter().map(|f| format!("at {} Hz", short(*f))).collect();
        figures.extend(check.values.iter().map(|(name, value)| figure(name, *value)));
        write!(
            html,
            "<tr><td>{}</td><td><span class=\"{class}\">{}</span></td><td>{} <small>{}</small></td></tr>",
            escape(&check.name),
            words::outcome(check.ok),
            escape(&check.meaning),
            escape(&figures.join("; "))
        )
        .expect("writing into a String cannot fail");
    }
    html.push_str("</tbody></table>");
    Some(html)
}

/// `series_stiffness_n_per_m`, 3.1e7 → `series stiffness 31.0 N/µm`.
fn figure(name: &str, value: f64) -> String {
    const UNITS: [(&str, f64, &str); 6] = [
        ("_n_per_m", 1e-6, " N/µm"),
        ("_m_per_n", 1e6, " µm/N"),
        ("_hz", 1.0, " Hz"),
        ("_deg", 1.0, "°"),
        ("_percent", 1.0, " %"),
        ("_m", 1e9, " nm"),
    ];
    let (stem, scale, unit) = UNITS
        .into_iter()
        .find_map(|(end, scale, unit)| name.strip_suffix(end).map(|stem| (stem, scale, unit)))
        .unwrap_or((name, 1.0, ""));
    format!("{} {}{unit}", stem.replace('_', " "), short(value * scale))
}

/// Kept and refused hits per configuration.
pub fn completeness(results: &Results) -> Option<String> {
    if results.completeness.is_empty() {
        return None;
    }
    let mut verdicts: Vec<&str> = Vec::new();
    for verdict in results.completeness.iter().flat_map(|c| c.refused.keys()) {
        if !verdicts.contains(&verdict.as_str()) {
            verdicts.push(verdict);
        }
    }
    verdicts.sort_unstable();
    let titles: Vec<String> = verdicts.iter().map(|v| format!("refused: {v}")).collect();
    let mut heads = vec!["configuration", "cells complete", "hits wanted", "kept"];
    heads.extend(titles.iter().map(String::as_str));
    let mut table = Table::new(1, &heads);
    for c in &results.completeness {
        let mut cells = vec![
            c.configuration.clone(),
            format!("{} of {}", c.cells_complete, c.cells),
            c.wanted.to_string(),
            c.kept.to_string(),
        ];
        cells.extend(verdicts.iter().map(|v| c.refused.get(*v).copied().unwrap_or(0).to_string()));
        table.row(cells);
    }
    Some(table.finish())
}

/// Where everything comes from: file, device, settings, records, link.
pub fn provenance(results: &Results) -> String {
    let source = &results.source;
    let mut rows: Vec<(String, String)> = vec![
        ("file".into(), source.file.clone()),
        ("computed by".into(), format!("{} {}", source.software.name, source.software.version)),
    ];
    rows.extend(source.started.iter().map(|s| ("campaign begun".into(), s.clone())));
    rows.extend(source.device.iter().map(|(k, v)| (format!("device: {}", spaced(k)), v.clone())));
    rows.extend(source.settings.iter().map(|(k, v)| {
        let text = v.as_str().map_or_else(|| v.to_string(), str::to_owned);
        (format!("setting: {}", spaced(k)), text)
    }));
    for (configuration, ranges) in &source.records {
        let total: i64 = ranges.iter().map(|r| r[1] - r[0] + 1).sum();
        rows.push((format!("records of {configuration}"), format!("{total}: {}", listed(ranges))));
    }
    rows.extend(source.link.iter().map(|(k, v)| (format!("link: {}", spaced(k)), count(*v))));
    let mut html = String::from("<table class=\"pairs\"><tbody>");
    for (name, value) in rows.iter().filter(|(_, value)| !value.is_empty()) {
        write!(html, "<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(value))
            .expect("writing into a String cannot fail");
    }
    html.push_str("</tbody></table>");
    html
}

fn spaced(name: &str) -> String {
    name.replace('_', " ")
}

/// Ranges of ids, the first dozen written out; all of them stand in results.json.
fn listed(ranges: &[[i64; 2]]) -> String {
    let shown: Vec<String> = ranges
        .iter()
        .take(12)
        .map(|[a, b]| if a == b { a.to_string() } else { format!("{a}–{b}") })
        .collect();
    let rest = ranges.len().saturating_sub(12);
    let rest =
        if rest > 0 { format!(" and {rest} more ranges (all in results.json)") } else { String::new() };
    format!("{}{rest}", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_checks_carry_units() {
        assert_eq!(figure("series_stiffness_n_per_m", 31.2e6), "series stiffness 31.2 N/µm");
        assert_eq!(figure("ratio", 5.5), "ratio 5.50");
    }

    #[test]
    fn long_lists_of_records_are_cut() {
        let ranges: Vec<[i64; 2]> = (0..40).map(|i| [10 * i, 10 * i]).collect();
        assert!(listed(&ranges).ends_with("and 28 more ranges (all in results.json)"));
    }
}
