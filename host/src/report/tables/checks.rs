//! The checks on which the credibility of the numbers rests: each with its outcome, its meaning and
//! its figures.

use crate::report::page::escaped;
use crate::report::words;
use crate::report::words::number::{count, short};
use crate::results::Results;
use std::fmt::Write;

/// Checks with their outcome, meaning and figures.
pub fn checks(results: &Results) -> Option<String> {
    if results.checks.is_empty() {
        return None;
    }
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"checks\"><caption>Checks</caption><thead><tr><th scope=\"col\">check</th><th scope=\"col\">outcome</th>\
         <th scope=\"col\">what it means</th></tr></thead><tbody>",
    );
    for (i, check) in results.checks.iter().enumerate() {
        let (class, sign) = match check.ok {
            Some(true) => ("good", "✓"),
            Some(false) => ("bad", "✗"),
            None => ("open", "?"),
        };
        let mut figures: Vec<String> = check
            .frequency_hz
            .iter()
            .map(|f| {
                format!(
                    "<span data-path=\"/checks/{i}/frequency_hz\">{}</span>",
                    escaped(&format!("at {} Hz", short(*f)))
                )
            })
            .collect();
        figures.extend(check.values.iter().map(|(name, value)| {
            let path = escaped(&format!("/checks/{i}/{name}"));
            format!("<span data-path=\"{path}\">{}</span>", escaped(&figure(name, *value)))
        }));
        let name = escaped(&check.name);
        let _ = write!(
            html,
            "<tr id=\"check-{name}\"><th scope=\"row\">{}</th><td><span class=\"{class}\">{sign} {}</span></td><td>{} <small>{}</small></td></tr>",
            escaped(&check.name.replace('-', " ")),
            words::outcome(check.ok),
            escaped(&check.meaning),
            figures.join("; ")
        );
    }
    html.push_str("</tbody></table></div>");
    Some(html)
}

/// `series_stiffness_n_per_m`, 3.1e7 → `series stiffness 31.0 N/µm`; counts and ranks have no
/// decimals.
fn figure(name: &str, value: f64) -> String {
    const UNITS: [(&str, f64, &str); 6] = [
        ("_n_per_m", 1e-6, " N/µm"),
        ("_m_per_n", 1e6, " µm/N"),
        ("_hz", 1.0, " Hz"),
        ("_deg", 1.0, "°"),
        ("_percent", 1.0, " %"),
        ("_m", 1e6, " µm"),
    ];
    let (stem, scale, unit) = UNITS
        .into_iter()
        .find_map(|(end, scale, unit)| name.strip_suffix(end).map(|stem| (stem, scale, unit)))
        .unwrap_or((name, 1.0, ""));
    let counted =
        ["rank", "dofs", "modes", "impacts", "responses", "hits"].iter().any(|word| name.contains(word));
    let whole = value.fract() == 0.0 && value >= 0.0;
    let text = if counted && whole { count(value as u64) } else { short(value * scale) };
    format!("{} {text}{unit}", stem.replace('_', " "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_checks_carry_units() {
        assert_eq!(figure("series_stiffness_n_per_m", 31.2e6), "series stiffness 31.2 N/µm");
        assert_eq!(figure("ratio", 5.5), "ratio 5.50");
        assert_eq!(figure("rank_p", 6.0), "rank p 6");
    }
}
