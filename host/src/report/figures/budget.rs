//! Contributions to the interval of k_T, and whether k_T depends on frequency.

use super::{MICRO, below_name};
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role, Spread};
use crate::report::words::number::{micro, short};
use crate::results::Results;

/// Left: the causes of the uncertainty. Right: k_T bin by bin.
pub fn budget(results: &Results) -> Option<Figure> {
    let contact = &results.answer.as_ref()?.contact;
    let mut causes: Vec<(&str, f64)> =
        contact.budget.iter().map(|(cause, part)| (*cause, 100.0 * part)).collect();
    causes.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = causes.first().map(|(_, part)| *part).filter(|part| *part > 0.0)?;
    let names = causes
        .iter()
        .map(|(cause, part)| format!("{}: {} %", cause.replace('-', " "), short(*part)))
        .collect();
    let mut shares = Panel::new(
        Axis::linear("standard deviation of k_T by cause", "%", [0.0, 1.15 * most]),
        Axis::named("", names),
    )
    .high(Height::Rows);
    for (i, (cause, part)) in causes.iter().enumerate() {
        shares.marks.push(
            Mark::points(Role::Answer, Marker::Stroke, [[*part, below_name(i)]])
                .barred("x", [[0.0, *part]])
                .from("x", format!("/answer/contact/budget/{cause}"), 100.0),
        );
    }
    let mut figure = Figure::new(
        "budget",
        "",
        "What makes the interval of k_T",
        "Left, how far each cause alone moves k_T; their squares add up. Right, k_T bin by bin: a contact's stiffness does not change with frequency.",
    )
    .across(2)
    .with(shares);
    let bins = &contact.of_frequency;
    let (Some(first), Some(last), Some(k)) = (bins.first(), bins.last(), &contact.k_t_n_per_m) else {
        return Some(figure);
    };
    let ends = || bins.iter().flat_map(|b| b.k_t_n_per_m.ci95).map(micro);
    let (low, high) =
        (ends().fold(f64::INFINITY, f64::min).max(0.0), ends().fold(0.0, f64::max).min(3.0 * micro(k.mean)));
    let bars = bins.iter().map(|b| b.k_t_n_per_m.ci95.map(micro));
    let bin = Mark::points(
        Role::Answer,
        Marker::Ring,
        bins.iter().map(|b| [b.frequency_hz, micro(b.k_t_n_per_m.mean)]),
    )
    .barred("y", bars)
    .named("k_T of a bin, 95 %")
    .from("x", "/answer/contact/of_frequency/*/frequency_hz", 1.0)
    .estimate("y", "/answer/contact/of_frequency/*/k_t_n_per_m/mean", 1.0 / MICRO);
    let x = Axis::frequency(Spread::Linear, [first.frequency_hz - 15.0, last.frequency_hz + 15.0]);
    let mut flat = Panel::new(x, Axis::linear("k_T", "N/µm", [0.9 * low, 1.05 * high]))
        .high(Height::Tall)
        .with(
            Mark::level(Role::Answer, micro(k.mean))
                .named(format!("k_T {} N/µm", short(micro(k.mean))))
                .from("at", "/answer/contact/k_t_n_per_m/mean", 1.0 / MICRO),
        )
        .with(bin);
    if let Some(truth) = results.answer.as_ref().and_then(|a| a.truth.as_ref()) {
        flat.marks.push(
            Mark::level(Role::Truth, micro(truth.contact_k_t_n_per_m))
                .named("truth of the simulated rig")
                .from("at", "/answer/truth/contact_k_t_n_per_m", 1.0 / MICRO),
        );
    }
    figure.panels.push(flat);
    Some(figure)
}
