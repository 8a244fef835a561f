//! The specimens' decay after one hit, and its reconstruction from two sinusoids (the paper's Fig.
//! 9).

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Mark, Panel, Role};
use crate::report::scale::middle_range;
use crate::report::words::number::{decimals, short};
use crate::results::Results;

/// Specimen A at the top, specimen B below.
pub fn rebuilt(results: &Results) -> Option<Figure> {
    let shown = results.reconstruction.as_ref()?;
    let (hidden, common) = (decimals(shown.hidden_hz, 0), decimals(shown.common_hz, 0));
    let rows = [
        (
            (&shown.displacement_a_m, "displacement_a_m"),
            (&shown.rebuilt_a_m, "rebuilt_a_m"),
            Role::SpecimenA,
            format!(
                "Specimen A: {hidden} and {common} Hz explain {} %, {common} Hz alone {} %",
                short(100.0 * shown.explained_a[0]),
                short(100.0 * shown.explained_a[1])
            ),
        ),
        (
            (&shown.displacement_b_m, "displacement_b_m"),
            (&shown.rebuilt_b_m, "rebuilt_b_m"),
            Role::SpecimenB,
            format!("Specimen B: {common} Hz alone explains {} %", short(100.0 * shown.explained_b)),
        ),
    ];
    let step = shown.step_s * 1e3;
    let mut figure = Figure::new(
        "rebuilt",
        "9",
        "The decay put together from two sinusoids",
        "Both specimens after one hit, and the sum of decaying sinusoids: the mode that all share, and for A the hidden resonance beside it.",
    )
    .of_records(vec![[shown.record; 2]]);
    for ((found, field), (again, again_field), role, title) in rows {
        let range = middle_range(found.iter().chain(again).map(|v| v * MICRO), 1.0, 0.08)?;
        let along = Along::Regular { first: 0.0, step, count: found.len() };
        let x = Axis::linear("time after the second cycle begins", "ms", [0.0, step * found.len() as f64]);
        let line = |role, values: &[f64], field: &str| {
            Mark::line(role, along.clone(), values.iter().map(|v| v * MICRO))
                .from("y", format!("/reconstruction/{field}/*"), MICRO)
                .from("step", "/reconstruction/step_s", 1e3)
        };
        figure = figure.with(
            Panel::new(x.linked("decay-time"), Axis::linear("displacement", "µm", range))
                .titled(title)
                .with(line(role, found, field).named("measured"))
                .with(line(Role::Guide, again, again_field).named("from sinusoids")),
        );
    }
    Some(figure)
}
