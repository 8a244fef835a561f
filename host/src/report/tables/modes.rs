//! The modes in numbers.

use super::{HtmlTable, TableCell, interval, number, words};
use crate::contact::Interval;
use crate::report::html::escaped;
use crate::report::words::mode_sentences::heading;
use crate::report::words::number::{decimals, interval_places};
use crate::results::Results;
use std::fmt::Write;

/// Frequencies and damping of all structures, with what limits their use.
pub fn modes(results: &Results) -> Option<String> {
    if results.modal.is_empty() {
        return None;
    }
    let heads = [
        "structure",
        "moves most",
        "natural frequency, Hz",
        "95 %",
        "damping ratio, %",
        "95 %",
        "phase collinearity",
    ];
    let mut table =
        HtmlTable::new(2, "Natural frequencies and damping ratios with their 95 % intervals", &heads);
    for fit in &results.modal {
        for (i, mode) in results.modes.iter().enumerate().filter(|(_, mode)| mode.structure == fit.structure)
        {
            let [frequency, of_frequency] =
                shown(&mode.frequency_hz, 1.0, &format!("/modes/{i}/frequency_hz"));
            let [damping, of_damping] =
                shown(&mode.damping_ratio, 100.0, &format!("/modes/{i}/damping_ratio"));
            table.row([
                words(mode.structure.clone().unwrap_or_default()),
                words(mode.largest.clone()),
                frequency,
                of_frequency,
                damping,
                of_damping,
                number(Some(decimals(mode.phase_collinearity, 3)), format!("/modes/{i}/phase_collinearity")),
            ]);
        }
    }
    let mut html = table.finish();
    html.push_str("<ul class=\"notes\">");
    for fit in &results.modal {
        let count = results.modes.iter().filter(|mode| mode.structure == fit.structure).count();
        let _ = write!(html, "<li>{}.</li>", escaped(&heading(fit, count)));
        for warning in &fit.warnings {
            let _ = write!(html, "<li>{}</li>", escaped(warning));
        }
    }
    html.push_str("</ul>");
    Some(html)
}

/// Mean and interval of a quantity at `place`, multiplied by `scale`.
fn shown(value: &Interval, scale: f64, place: &str) -> [TableCell; 2] {
    let half = 0.5 * scale * (value.ci95[1] - value.ci95[0]);
    let text = |v: f64| decimals(scale * v, interval_places(half));
    [
        number(Some(text(value.mean)), format!("{place}/mean")),
        interval(Some(format!("{}…{}", text(value.ci95[0]), text(value.ci95[1]))), &format!("{place}/ci95")),
    ]
}
