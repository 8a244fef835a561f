//! Joint stiffness: the estimates to quote, with their intervals and the bootstrap over hits; and
//! stiffness and damping by method, IDM set and band, in a collapsible section, in which rows that
//! failed come last, each with a short reason.

use super::{HtmlTable, TableCell, interval, kind_of, number, remarks, scattered, words};
use crate::report::html::{escaped, escaped as escape};
use crate::report::words as said;
use crate::report::words::number::{band, micro, short, with_scatter};
use crate::results::{Joint, MAIN_BAND, Results};
use crate::substructuring::Band;
use std::fmt::Write;

const HEADS: [&str; 9] = [
    "method",
    "verdict",
    "IDMs",
    "k_z ± σ, N/µm",
    "of noise, σ",
    "median",
    "95 % of the mean",
    "k_y ± σ, N/µm",
    "c_z ± σ, N s/m",
];

/// One table for each band, the main one first.
pub fn joint(results: &Results) -> Option<String> {
    if results.joint.is_empty() {
        return None;
    }
    let mut bands: Vec<Band> = Vec::new();
    for joint in &results.joint {
        if !bands.contains(&joint.band_hz) {
            bands.push(joint.band_hz);
        }
    }
    bands.sort_by_key(|range| *range != MAIN_BAND);
    let mut html = String::from("<details class=\"methods\"><summary>Every method in numbers</summary>");
    for range in bands {
        let mut rows: Vec<(usize, &Joint)> =
            results.joint.iter().enumerate().filter(|(_, j)| j.band_hz == range).collect();
        rows.sort_by_key(|(_, j)| verdict(j).is_some());
        let lines = rows.iter().map(|(_, j)| j.lines).max().unwrap_or(0);
        let mut table =
            HtmlTable::new(2, &format!("Joint by method, {}, {lines} lines", band(range)), &HEADS);
        for (i, joint) in &rows {
            table.row(row(*i, joint));
        }
        html.push_str(&table.finish());
        if range == MAIN_BAND {
            let named = |j: &Joint| format!("{}, {} IDMs", j.method, j.idms);
            let all: Vec<(String, &str)> =
                rows.iter().flat_map(|(_, j)| j.warnings.iter().map(|w| (named(j), w.as_str()))).collect();
            html.push_str(&remarks(&all));
        }
    }
    html.push_str("</details>");
    Some(html)
}

fn row(i: usize, joint: &Joint) -> Vec<TableCell> {
    let k = joint.sliding_stiffness();
    let over = |s: Option<&crate::results::Statistics>, scale: f64, path: String| {
        scattered(s.map(|s| with_scatter(s.mean * scale, s.std * scale)), &path)
    };
    vec![
        words(joint.method.clone()),
        words(verdict(joint).map_or_else(|| "✓ identified".into(), |why| format!("✗ {why}"))),
        if joint.idms == 0 {
            words("")
        } else {
            number(Some(joint.idms.to_string()), format!("/joint/{i}/idms"))
        },
        over(k, 1e-6, format!("/joint/{i}/stiffness_n_per_m/z")),
        number(joint.noise_n_per_m.get("z").map(|n| short(micro(*n))), format!("/joint/{i}/noise_n_per_m/z")),
        number(k.map(|k| short(micro(k.median))), format!("/joint/{i}/stiffness_n_per_m/z/median")),
        interval(
            k.and_then(|k| k.ci95).map(|[low, high]| format!("{}…{}", short(micro(low)), short(micro(high)))),
            &format!("/joint/{i}/stiffness_n_per_m/z/ci95"),
        ),
        over(joint.stiffness_n_per_m.get("y"), 1e-6, format!("/joint/{i}/stiffness_n_per_m/y")),
        over(joint.damping_n_s_per_m.get("z"), 1.0, format!("/joint/{i}/damping_n_s_per_m/z")),
    ]
}

/// A short reason why a row identified nothing; `None` if it did.
pub fn verdict(joint: &Joint) -> Option<&'static str> {
    if joint.identified() {
        return None;
    }
    let Some(k) = joint.sliding_stiffness() else { return Some("no k_z") };
    let noise = joint.noise_n_per_m.get("z").copied().unwrap_or(0.0);
    Some(if k.mean <= 0.0 {
        "negative on average"
    } else if noise > k.mean {
        "buried in noise"
    } else {
        "lines scatter widely"
    })
}

/// Methods that could not be applied, with each kind of reason listed once.
pub fn refusals(results: &Results) -> Option<String> {
    if results.refused.is_empty() {
        return None;
    }
    let mut kinds: Vec<(String, &str, Vec<String>)> = Vec::new();
    for r in &results.refused {
        let named = format!("{} ({} IDMs)", r.method, r.idms);
        match kinds.iter_mut().find(|(kind, ..)| *kind == kind_of(&r.reason)) {
            Some((_, _, names)) => names.push(named),
            None => kinds.push((kind_of(&r.reason), &r.reason, vec![named])),
        }
    }
    let mut html = String::new();
    let _ = write!(
        html,
        "<details class=\"remarks\"><summary>{} methods could not be applied to this data</summary><ul class=\"notes\">",
        results.refused.len()
    );
    for (_, reason, names) in kinds {
        let _ = write!(html, "<li><b>{}</b>: {}</li>", escaped(&names.join(", ")), escaped(reason));
    }
    html.push_str("</ul></details>");
    Some(html)
}

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
