//! The specimens' decay after one hit, and the same put together from two sinusoids (the paper's Fig. 9).

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, INK, Panel, VERMILION, legend};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::report::words::number::{decimals, short};
use crate::results::Results;

/// Above: specimen A; below: specimen B.
pub fn rebuilt(results: &Results) -> Option<String> {
    let shown = results.reconstruction.as_ref()?;
    let mut drawing = Drawing::new("rebuilt", WIDTH, 400.0);
    let measured = Stroke::new(INK, 1.1);
    let (hidden, common) = (decimals(shown.hidden_hz, 0), decimals(shown.common_hz, 0));
    let rows = [
        (
            &shown.displacement_a_m,
            &shown.rebuilt_a_m,
            VERMILION,
            format!(
                "specimen A: {hidden} and {common} Hz explain {} %, {common} Hz alone {} %",
                short(100.0 * shown.explained_a[0]),
                short(100.0 * shown.explained_a[1])
            ),
        ),
        (
            &shown.displacement_b_m,
            &shown.rebuilt_b_m,
            BLUE,
            format!("specimen B: {common} Hz alone explains {} %", short(100.0 * shown.explained_b)),
        ),
    ];
    let length = shown.displacement_a_m.len() as f64 * shown.step_s * 1e3;
    for (i, (found, rebuilt, colour, title)) in rows.into_iter().enumerate() {
        let area = Area { left: 70.0, top: 42.0 + 180.0 * i as f64, width: WIDTH - 82.0, height: 130.0 };
        let range = middle_range(found.iter().chain(rebuilt).map(|v| v * 1e9), 1.0, 0.08)?;
        let x = Scale::linear([0.0, length], [area.left, area.right()]);
        let panel = Panel { area, x, y: Scale::linear(range, [area.bottom(), area.top]) };
        let (x_ticks, y_ticks) = (x.ticks(8), panel.y.ticks(4));
        panel.grid(&mut drawing, &x_ticks, &y_ticks);
        let along = |values: &[f64]| -> Vec<(f64, f64)> {
            values.iter().enumerate().map(|(l, v)| (l as f64 * shown.step_s * 1e3, v * 1e9)).collect()
        };
        let fitted = Stroke::new(colour, 1.8).dashed("7 4");
        panel.curve(&mut drawing, along(found).into_iter(), measured);
        panel.curve(&mut drawing, along(rebuilt).into_iter(), fitted);
        panel.axes(
            &mut drawing,
            (&x_ticks, (i == 1).then_some("time after the second cycle begins, ms")),
            (&y_ticks, Some("nm")),
        );
        drawing.text([area.left, area.top - 8.0], Anchor::Start, "title", &title);
        let entries = [(measured, "measured".to_owned()), (fitted, "from sinusoids".to_owned())];
        legend(&mut drawing, [WIDTH - 300.0, area.top - 8.0], &entries);
    }
    Some(
        drawing.finish("Decay of both specimens after one hit, measured and put together from two sinusoids"),
    )
}
