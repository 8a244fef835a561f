//! The estimates to quote, with their intervals, and the result of the bootstrap over hits.

use super::{HtmlTable, interval, number, words};
use crate::report::page::escaped as escape;
use crate::report::words as said;
use crate::report::words::number::{band, short};
use crate::results::Results;
use std::fmt::Write;

/// The estimates to quote, with their intervals, and the result of the bootstrap over hits.
pub fn recommended(results: &Results) -> Option<String> {
    if results.recommended.is_empty() {
        return None;
    }
    let mut html = String::from("<h3>The joint in all directions</h3>");
    let heads = [
        "direction",
        "band",
        "K",
        "95 % interval",
        "of noise, σ",
        "of positions and angles, σ",
        "bias removed",
        "C, N s/m or N m s/rad",
        "",
    ];
    let mut table = HtmlTable::new(
        1,
        "Recommended estimate between the arms: Eq. A.1, averaged as an admittance before it is inverted (the paper's Table 2 with intervals)",
        &heads,
    );
    for (i, estimate) in results.recommended.iter().enumerate() {
        for (dof, k) in &estimate.joint {
            let (scale, unit) = if dof.is_translation() { (1e-6, "N/µm") } else { (1e-3, "kN m/rad") };
            let shown = |value: f64| short(scale * value);
            let at = |field: &str| format!("/recommended/{i}/joint/{dof}/{field}");
            let range = if k.identified {
                interval(Some(format!("{}…{}", shown(k.ci95[0]), shown(k.ci95[1]))), &at("ci95"))
            } else {
                number((k.ci95[0] > 0.0).then(|| format!("above {}", shown(k.ci95[0]))), at("ci95/0"))
            };
            table.row([
                words(format!("{dof}, {unit}")),
                interval(Some(band(estimate.band_hz)), &format!("/recommended/{i}/band_hz")),
                number(k.identified.then(|| shown(k.stiffness)), at("stiffness")),
                range,
                number(estimate.noise_known.then(|| shown(k.std_noise)), at("std_noise")),
                number(Some(shown(k.std_geometry)), at("std_geometry")),
                number(Some(shown(k.bias)), at("bias")),
                number(Some(short(k.damping)), at("damping")),
                words(if k.identified { "" } else { "not identified" }),
            ]);
        }
    }
    html.push_str(&table.finish());
    let sentences =
        results.recommended.iter().filter_map(|r| Some(format!("{}: {}", band(r.band_hz), r.statement()?)));
    let sentences = sentences.chain(results.bootstrap.as_ref().map(said::bootstrapped));
    html.push_str("<ul class=\"notes\">");
    for sentence in sentences {
        write!(html, "<li>{}</li>", escape(&sentence)).expect("writing into a String cannot fail");
    }
    html.push_str("</ul>");
    Some(html)
}
