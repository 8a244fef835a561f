//! What was measured, and the provenance of the results.

use super::{HtmlTable, key, number, words};
use crate::report::html::escaped as escape;
use crate::report::words::number::{count, decimals, short};
use crate::results::Results;
use std::fmt::Write;

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
    let mut table = HtmlTable::new(1, "Hits", &heads);
    for (i, c) in results.completeness.iter().enumerate() {
        let mut cells = vec![
            words(c.configuration.clone()),
            number(
                Some(format!("{} of {}", c.cells_complete, c.cells)),
                format!("/completeness/{i}/cells_complete /completeness/{i}/cells"),
            ),
            number(Some(count(c.wanted as u64)), format!("/completeness/{i}/wanted")),
            number(Some(count(c.kept as u64)), format!("/completeness/{i}/kept")),
        ];
        cells.extend(verdicts.iter().map(|v| {
            let refused = c.refused.get(*v);
            refused.map_or_else(
                || words("none"),
                |n| number(Some(n.to_string()), format!("/completeness/{i}/refused/{}", key(v))),
            )
        }));
        table.row(cells);
    }
    Some(table.finish())
}

/// Calibrations that differ from those of device and plan, and why; `None` if there are none.
pub fn calibrations(results: &Results) -> Option<String> {
    let all = &results.source.calibrations;
    if all.is_empty() {
        return None;
    }
    let heads = [
        "channel",
        "entered",
        "why",
        "sensor",
        "from session",
        "V per unit before",
        "V per unit since",
        "ns before",
        "ns since",
        "uncertainty",
    ];
    let mut table = HtmlTable::new(
        4,
        "Calibrations entered in the campaign file; the last one of each channel is used",
        &heads,
    );
    for (i, own) in all.iter().enumerate() {
        let at = |field: &str| format!("/source/calibrations/{i}/{field}");
        let volts = |n: usize| number(Some(precise(own.sensitivity_v[n])), at(&format!("sensitivity_v/{n}")));
        let late = |n: usize| number(Some(decimals(1e9 * own.delay_s[n], 0)), at(&format!("delay_s/{n}")));
        table.row([
            words(format!("{} ({})", own.channel, own.unit)),
            words(own.utc.get(..19).unwrap_or(&own.utc).replace('T', " ") + " UTC"),
            words(own.reason.clone()),
            words(own.sensor.join(", ")),
            number(Some(own.from_session.to_string()), at("from_session")),
            volts(0),
            volts(1),
            late(0),
            late(1),
            number(own.uncertainty.map(|part| format!("{} %", short(100.0 * part))), at("uncertainty")),
        ]);
    }
    Some(table.finish())
}

/// With five significant digits, as in calibration certificates.
fn precise(value: f64) -> String {
    let places = 4 - value.abs().log10().floor().clamp(-10.0, 4.0) as i32;
    decimals(value, places.unsigned_abs() as usize)
}

/// Provenance: file, device, settings, records, link.
pub fn provenance(results: &Results) -> String {
    let source = &results.source;
    let mut rows: Vec<(String, String)> = vec![
        ("file".into(), source.file.clone()),
        ("computed by".into(), format!("{} {}", source.software.name, source.software.version)),
    ];
    rows.extend(source.started.iter().map(|s| ("campaign begun".into(), s.clone())));
    rows.extend(source.temperature_c.map(|[least, mean, most]| {
        let value = |celsius| decimals(celsius, 1);
        let text = format!("{} °C on average, {} to {} °C", value(mean), value(least), value(most));
        ("temperature of the specimen".into(), text)
    }));
    rows.extend(source.measured_again.iter().map(|again| ("measured again".into(), again.clone())));
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
    let mut html =
        String::from("<div class=\"wide\"><table class=\"pairs\"><caption>Source</caption><tbody>");
    for (name, value) in rows.iter().filter(|(_, value)| !value.is_empty()) {
        write!(html, "<tr><th scope=\"row\">{}</th><td>{}</td></tr>", escape(name), escape(value))
            .expect("writing into a String cannot fail");
    }
    html.push_str("</tbody></table></div>");
    html
}

fn spaced(name: &str) -> String {
    name.replace('_', " ")
}

/// Ranges of ids, the first dozen written out; results.json has all of them.
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
    fn long_lists_of_records_are_cut() {
        let ranges: Vec<[i64; 2]> = (0..40).map(|i| [10 * i, 10 * i]).collect();
        assert!(listed(&ranges).ends_with("and 28 more ranges (all in results.json)"));
    }
}
