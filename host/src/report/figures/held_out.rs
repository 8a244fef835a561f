//! Cells of the assembly that the fit of the contact predicts without having seen them.

use crate::report::figure::{Along, Axis, Figure, How, Mark, Marker, Packed, Panel, Role, Shape, Spread};
use crate::report::scale::middle_range;
use crate::report::words::number::decimals;
use crate::results::Results;

/// One panel for each predicted cell: the prediction's 95 % interval, and what was measured.
pub fn held_out(results: &Results) -> Option<Figure> {
    let all = &results.answer.as_ref()?.contact.held_out;
    if all.is_empty() {
        return None;
    }
    let mut figure = Figure::new(
        "held-out",
        "",
        "Cells predicted from the others",
        "Each cell was left out of the fit and predicted by it. The band is the prediction's 95 % interval from noise, aims and places; about one point in twenty lies outside it.",
    )
    .across(all.len().min(3));
    for (n, one) in all.iter().enumerate() {
        let values = one.measured_m_per_n.iter().chain(&one.predicted_m_per_n);
        let logs = values.filter(|value| **value > 0.0).map(|value| value.log10());
        let range = middle_range(logs, 1.0, 0.05)?.map(|exponent| 10f64.powf(exponent));
        let ends = [*one.frequency_hz.first()?, *one.frequency_hz.last()?];
        let band = |sign: f64| {
            let both = one.predicted_m_per_n.iter().zip(&one.half_width_m_per_n);
            Packed::of(both.map(move |(value, half)| (value + sign * half).max(range[0])))
        };
        let at = |field: &str| format!("/answer/contact/held_out/{n}/{field}");
        let [predicted, half] = ["predicted_m_per_n/*", "half_width_m_per_n/*"].map(at);
        let x = Along::of(&one.frequency_hz);
        let ribbon = Shape::Ribbon { x, low: band(-1.0), high: band(1.0) };
        let axis = one.direction.iter().map(|part| part.abs()).enumerate();
        let axis = axis.max_by(|a, b| a.1.total_cmp(&b.1)).map_or("", |(axis, _)| ["x", "y", "z"][axis]);
        figure.panels.push(
            Panel::new(Axis::frequency(Spread::Linear, ends), Axis::log("receptance", "m/N", range))
                .titled(format!(
                    "{} × {} along {axis}: off by {} %",
                    one.impact,
                    one.point,
                    decimals(100.0 * one.part, 2)
                ))
                .with(
                    Mark::new(Role::Fitted, ribbon)
                        .named("predicted, 95 %")
                        .from("x", at("frequency_hz/*"), 1.0)
                        .from_two("low", predicted.clone(), How::Minus, half.clone(), 1.0)
                        .from_two("high", predicted, How::Plus, half, 1.0),
                )
                .with(
                    Mark::points(
                        Role::Measured,
                        Marker::Dot,
                        one.frequency_hz.iter().zip(&one.measured_m_per_n).map(|(f, value)| [*f, *value]),
                    )
                    .named("measured")
                    .from("x", at("frequency_hz/*"), 1.0)
                    .from("y", at("measured_m_per_n/*"), 1.0),
                ),
        );
    }
    Some(figure)
}
