//! The answer on one axis: the contact, the clamps, the stiffness between the arms, and that from
//! loops, with their intervals.

use super::{MICRO, below_name};
use crate::contact::Interval;
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role};
use crate::report::words::number::{decimals, micro, short, stiffness};
use crate::results::{Excitation, Force, HIDDEN_RESONANCE, Hysteresis, Results, Shape};
use crate::substructuring::Dof;

struct AnswerRow {
    label: String,
    role: Role,
    mean: f64,
    ends: [f64; 2],
    /// Whether it is a valid estimate of the quantity that it is named after.
    believed: bool,
    truth: Option<f64>,
    /// Its path in `results.json`.
    path: String,
    ends_are: Ends,
}

/// Meaning of the ends of a row's bar.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    Interval,
    Scatter,
    /// Minimum and maximum.
    Extremes,
}

/// A few estimates, with the one to quote first.
pub fn answer(results: &Results) -> Option<Figure> {
    let rows = rows(results);
    if rows.is_empty() {
        return None;
    }
    let all = || rows.iter().flat_map(|r| [r.mean, r.ends[0], r.ends[1]].into_iter().chain(r.truth));
    let high = all().fold(0.0, f64::max);
    let low = rows.iter().map(|r| r.mean).fold(0.0, f64::min);
    let x = Axis::linear("stiffness along the sliding direction", "N/µm", [1.1 * low, 1.08 * high]);
    let names = rows.iter().map(|r| r.label.clone()).collect();
    let mut panel = Panel::new(x, Axis::named("", names)).high(Height::Rows);
    for (i, row) in rows.iter().enumerate() {
        let y = below_name(i);
        let marker = if row.believed { Marker::Dot } else { Marker::Cross };
        let mark = Mark::points(row.role, marker, [[row.mean, y]])
            .barred("x", [row.ends])
            .saying(vec![row.label.clone()]);
        panel.marks.push(match row.ends_are {
            Ends::Interval => mark.estimate("x", &row.path, 1.0 / MICRO),
            Ends::Scatter => mark.scatter("x", &row.path, 1.0 / MICRO),
            Ends::Extremes => {
                ["x", "low", "high"].into_iter().fold(mark, |m, of| m.from(of, row.path.clone(), 1.0 / MICRO))
            }
        });
        panel.marks.extend(row.truth.map(|truth| {
            Mark::points(Role::Truth, Marker::Stroke, [[truth, y]])
                .named("truth of the simulated rig")
                .saying(vec![format!("truth: {} N/µm", short(truth))])
                .from("x", "/answer/truth/*", 1.0 / MICRO)
        }));
    }
    let say = "Estimates with their 95 % intervals (loops: ± σ). A cross marks what must not be taken for the contact's stiffness.";
    Some(Figure::new("answer", "", "What was found, on one axis", say).across(2).with(panel))
}

fn rows(results: &Results) -> Vec<AnswerRow> {
    let mut rows = Vec::new();
    if let Some(answer) = &results.answer {
        let truth = answer.truth.as_ref();
        let found = [
            (
                "k_T of the contact",
                Role::Answer,
                answer.contact.k_t_n_per_m,
                truth.map(|t| t.contact_k_t_n_per_m),
                "/answer/contact/k_t_n_per_m/mean",
            ),
            (
                "clamps alone",
                Role::Clamp,
                answer.clamp.map(|clamp| clamp.k_n_per_m),
                truth.and_then(|t| t.clamps_k_n_per_m),
                "/answer/clamp/k_n_per_m/mean",
            ),
            (
                "between the arms",
                Role::BetweenArms,
                answer.between_arms.k_n_per_m,
                truth.map(|t| t.between_arms_k_n_per_m),
                "/answer/between_arms/k_n_per_m/mean",
            ),
        ];
        let known = found.into_iter().filter_map(|(what, role, k, truth, path)| {
            Some(AnswerRow { truth: truth.map(micro), ..estimated(what, role, k?, path) })
        });
        rows.extend(known);
    }
    if !rows.iter().any(|row| row.role == Role::BetweenArms) {
        rows.extend(quoted(results).or_else(|| headline(results)));
    }
    rows.extend(levels(results));
    rows.extend(impacts(results));
    rows
}

/// An estimate with its interval: `between the arms: 26.9 N/µm (25.4…28.4)`.
fn estimated(what: &str, role: Role, k: Interval, path: &str) -> AnswerRow {
    let [mean, low, high] = [k.mean, k.ci95[0], k.ci95[1]].map(|k| short(micro(k)));
    AnswerRow {
        label: format!("{what}: {mean} N/µm ({low}…{high})"),
        role,
        mean: micro(k.mean),
        ends: k.ci95.map(micro),
        believed: true,
        truth: None,
        path: path.into(),
        ends_are: Ends::Interval,
    }
}

fn quoted(results: &Results) -> Option<AnswerRow> {
    let z = results.quoted()?.joint.get(&Dof::Z).filter(|z| z.identified)?;
    let k = Interval { mean: z.stiffness, ci95: z.ci95 };
    Some(estimated("between the arms", Role::BetweenArms, k, "/recommended/*/joint/z/stiffness"))
}

fn headline(results: &Results) -> Option<AnswerRow> {
    let joint = results.headline_joint()?;
    let k = joint.sliding_stiffness()?;
    Some(AnswerRow {
        label: format!("between the arms, {}: {}", joint.method, stiffness(k.mean, k.std)),
        role: Role::BetweenArms,
        mean: micro(k.mean),
        ends: [micro(k.mean - k.std), micro(k.mean + k.std)],
        believed: joint.identified(),
        truth: None,
        path: "/joint/*/stiffness_n_per_m/z/mean".into(),
        ends_are: Ends::Scatter,
    })
}

/// The range of the levels' straight loops from the softest to the stiffest.
fn levels(results: &Results) -> Option<AnswerRow> {
    let straight = |h: &&Hysteresis| h.kind == Excitation::Shaker && h.force == Force::Raw;
    let slipping = |h: &Hysteresis| matches!(h.shape, Shape::Microslip | Shape::GrossSlip);
    let rows = || results.hysteresis.iter().filter(straight);
    let slips = rows().any(|h| h.stick_slope().is_some() && slipping(h));
    let mut found: Vec<f64> = rows().filter_map(Hysteresis::stick_slope).map(|k| micro(k.mean)).collect();
    found.sort_by(f64::total_cmp);
    let (low, high) = (*found.first()?, *found.last()?);
    let campaign = results.source.kind == "campaign";
    Some(AnswerRow {
        label: if found.len() == 1 {
            format!("the shaker's loop: {} N/µm", short(low))
        } else {
            let which = if slips { "shaker loops, where they stick" } else { "straight shaker loops" };
            format!("{} {which}: {}…{} N/µm", found.len(), short(low), short(high))
        },
        role: Role::Loops,
        mean: found[found.len() / 2],
        ends: [low, high],
        // between the measured points, a specimen's tilt is included
        believed: !campaign,
        truth: None,
        path: "/hysteresis/*/*/mean".into(),
        ends_are: Ends::Extremes,
    })
}

fn impacts(results: &Results) -> Option<AnswerRow> {
    let k = results.impact_loops()?.k_eq_n_per_m?;
    let hidden = results.check(HIDDEN_RESONANCE).filter(|c| c.ok == Some(false)).and_then(|c| c.frequency_hz);
    let beside = hidden.map_or(String::new(), |f| format!(", with {} Hz", decimals(f, 0)));
    Some(AnswerRow {
        label: format!("impacts, first cycle: {}{beside}", stiffness(k.mean, k.std)),
        role: Role::Loops,
        mean: micro(k.mean),
        ends: [micro(k.mean - k.std), micro(k.mean + k.std)],
        believed: false,
        truth: None,
        path: "/hysteresis/*/k_eq_n_per_m/mean".into(),
        ends_are: Ends::Scatter,
    })
}
