//! Cells of the assembly that the fit of the contact predicts without having seen them.

use crate::report::figure::{Along, Axis, Figure, Mark, Marker, Packed, Panel, Role, Shape, Spread};
use crate::report::scale::middle_range;
use crate::report::words::number::decimals;
use crate::results::Results;

/// Range of the differences shown, relative to the width that four fifths of the lines have: the
/// others are mostly noise, where the signal is weak.
const SHOWN: f64 = 1.5;

/// For each predicted cell: above, predicted and measured receptance; below, how far they differ,
/// with the prediction's 95 % interval.
pub fn held_out(results: &Results) -> Option<Figure> {
    let all = &results.answer.as_ref()?.contact.held_out;
    let (mut above, mut below) = (Vec::new(), Vec::new());
    for (n, one) in all.iter().enumerate() {
        let values = one.measured_m_per_n.iter().chain(&one.predicted_m_per_n);
        let logs = values.filter(|value| **value > 0.0).map(|value| value.log10());
        let range = middle_range(logs, 1.0, 0.05)?.map(|exponent| 10f64.powf(exponent));
        let frequencies =
            Axis::frequency(Spread::Linear, [*one.frequency_hz.first()?, *one.frequency_hz.last()?]);
        let at = |field: &str| format!("/answer/contact/held_out/{n}/{field}/*");
        let along = || Along::of(&one.frequency_hz);
        let points = |values: &[f64], factor: f64, field: &str| {
            let both = one.frequency_hz.iter().zip(values).map(|(f, value)| [*f, factor * value]);
            Mark::points(Role::Measured, Marker::Dot, both.collect::<Vec<_>>())
                .named("measured")
                .from("x", at("frequency_hz"), 1.0)
                .from("y", at(field), factor)
        };
        let axis = one.direction.iter().map(|part| part.abs()).enumerate();
        let axis = axis.max_by(|a, b| a.1.total_cmp(&b.1)).map_or("", |(axis, _)| ["x", "y", "z"][axis]);
        let off = decimals(100.0 * one.part, 2);
        above.push(
            Panel::new(frequencies.clone(), Axis::log("receptance", "m/N", range))
                .titled(format!("{} × {} along {axis}: off by {off} %", one.impact, one.point))
                .with(
                    Mark::line(Role::Fitted, along(), one.predicted_m_per_n.iter().copied())
                        .named("predicted")
                        .from("x", at("frequency_hz"), 1.0)
                        .from("y", at("predicted_m_per_n"), 1.0),
                )
                .with(points(&one.measured_m_per_n, 1.0, "measured_m_per_n")),
        );
        let mut widths: Vec<f64> =
            one.off.iter().zip(&one.half_width).map(|(off, half)| off.abs().max(*half)).collect();
        widths.sort_by(f64::total_cmp);
        let shown = SHOWN * 100.0 * widths[widths.len() * 4 / 5];
        let band = |sign: f64| Packed::of(one.half_width.iter().map(move |half| 100.0 * sign * half));
        let ribbon = Shape::Ribbon { x: along(), low: band(-1.0), high: band(1.0) };
        below.push(
            Panel::new(frequencies, Axis::linear("measured − predicted", "%", [-shown, shown]))
                .with(
                    Mark::new(Role::Fitted, ribbon)
                        .named("predicted, 95 %")
                        .from("x", at("frequency_hz"), 1.0)
                        .from("low", at("half_width"), -100.0)
                        .from("high", at("half_width"), 100.0),
                )
                .with(points(&one.off, 100.0, "off")),
        );
    }
    let figure = Figure::new(
        "held-out",
        "",
        "Cells predicted from the others",
        "Each cell was left out of the fit and predicted by it. Below, the difference of the magnitudes; the band is the prediction's 95 % interval for noise, aims and places.",
    )
    .across(all.len().clamp(1, 3));
    (!all.is_empty()).then(|| above.into_iter().chain(below).fold(figure, Figure::with))
}
