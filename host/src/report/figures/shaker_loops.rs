//! A loop of the shaker at each frequency: T over Δx, and both specimens over the same cycle (the paper's Fig. 6).

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, GREEN, INK, Panel, VERMILION, legend};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::report::words;
use crate::report::words::number::{decimals, micro, short};
use crate::results::{Results, ShakerLoop, Shape};

/// Most loops side by side.
const MOST: usize = 5;

/// Up to five loops, spread over the frequencies that were measured.
pub fn shaker_loops(results: &Results) -> Option<String> {
    let all = &results.shaker_loops;
    let count = all.len().min(MOST);
    if count == 0 {
        return None;
    }
    let pick = |i: usize| &all[if count > 1 { i * (all.len() - 1) / (count - 1) } else { 0 }];
    let mut drawing = Drawing::new("shaker-loops", WIDTH, 470.0);
    let entries = [
        (Stroke::new(INK, 1.3), "T against Δx; T over the cycle".to_owned()),
        (Stroke::new(VERMILION, 1.2).dashed("6 4"), "least-squares slope".into()),
        (Stroke::new(VERMILION, 1.2), "x_A".into()),
        (Stroke::new(BLUE, 1.2), "x_B".into()),
        (Stroke::new(GREEN, 1.2), "Δx".into()),
    ];
    legend(&mut drawing, [70.0, 16.0], &entries);
    let column = (WIDTH - 70.0 - 12.0) / count as f64;
    for i in 0..count {
        one(&mut drawing, pick(i), 70.0 + column * i as f64, column - 34.0, i == 0)?;
    }
    Some(drawing.finish(
        "Loops of the shaker at several frequencies with the specimens' displacements over one cycle",
    ))
}

fn one(drawing: &mut Drawing, shown: &ShakerLoop, left: f64, width: f64, first: bool) -> Option<()> {
    let nanometres = |values: &[f64]| values.iter().map(|v| v * 1e9).collect::<Vec<f64>>();
    let (x, t) = (nanometres(&shown.displacement_m), &shown.force_n);
    let area = Area { left, top: 64.0, width, height: 190.0 };
    let horizontal = middle_range(x.iter().copied(), 1.0, 0.1)?;
    let vertical = middle_range(t.iter().copied(), 1.0, 0.1)?;
    let panel = Panel {
        area,
        x: Scale::linear(horizontal, [area.left, area.right()]),
        y: Scale::linear(vertical, [area.bottom(), area.top]),
    };
    let (x_ticks, y_ticks) = (panel.x.ticks(5), panel.y.ticks(5));
    panel.grid(drawing, &x_ticks, &y_ticks);
    let closed = || x.iter().copied().zip(t.iter().copied()).chain([(x[0], t[0])]);
    panel.curve(drawing, closed(), Stroke::new(INK, 1.3));
    let line = horizontal.into_iter().map(|at| (at, shown.slope_n_per_m * 1e-9 * at));
    panel.curve(drawing, line, Stroke::new(VERMILION, 1.4).dashed("6 4"));
    panel.axes(drawing, (&x_ticks, Some("Δx in nm")), (&y_ticks, first.then_some("T in N")));
    let name = if shown.shape == Shape::Stuck { "slope" } else { "k_eq" };
    let title = format!("{} Hz: {}", short(shown.frequency_hz), words::shape_name(shown.shape));
    drawing.text([left, 40.0], Anchor::Start, "title", &title);
    let slope = format!("{name} {} N/µm", decimals(micro(shown.slope_n_per_m), 0));
    drawing.text([left, 57.0], Anchor::Start, "legend", &slope);
    cycle(drawing, shown, Area { left, top: 306.0, width, height: 116.0 }, first)
}

/// Displacements and force over one cycle, each to its own largest value of the panel.
fn cycle(drawing: &mut Drawing, shown: &ShakerLoop, area: Area, first: bool) -> Option<()> {
    let displacements = [
        (&shown.displacement_a_m, Stroke::new(VERMILION, 1.2)),
        (&shown.displacement_b_m, Stroke::new(BLUE, 1.2)),
        (&shown.displacement_m, Stroke::new(GREEN, 1.2)),
    ];
    let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let most = displacements.iter().map(|(v, _)| largest(v)).fold(0.0, f64::max);
    let force = largest(&shown.force_n);
    if most == 0.0 || force == 0.0 {
        return None;
    }
    let panel = Panel {
        area,
        x: Scale::linear([0.0, 1.0], [area.left, area.right()]),
        y: Scale::linear([-1.1, 1.1], [area.bottom(), area.top]),
    };
    let (x_ticks, y_ticks) = (panel.x.ticks(2), panel.y.ticks(3));
    panel.grid(drawing, &x_ticks, &y_ticks);
    let along = |values: &[f64], scale: f64| -> Vec<(f64, f64)> {
        let n = values.len() as f64;
        values.iter().enumerate().map(|(i, v)| (i as f64 / n, v / scale)).collect()
    };
    for (values, stroke) in displacements {
        panel.curve(drawing, along(values, most).into_iter(), stroke);
    }
    panel.curve(drawing, along(&shown.force_n, force).into_iter(), Stroke::new(INK, 1.0).dashed("3 3"));
    panel.axes(drawing, (&x_ticks, Some("cycle")), (&y_ticks, first.then_some("over the largest")));
    Some(())
}
