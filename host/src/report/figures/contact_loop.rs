//! One impact at the contact: the time signals and the loop of the first cycle with its slope.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, GREEN, INK, Panel, SHADE, VERMILION, legend};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::report::words::number::{decimals, micro};
use crate::results::{LoopCurve, Results};

/// Left: Δx, x_A, x_B and T over time. Right: T against Δx.
pub fn contact_loop(results: &Results) -> Option<String> {
    let curve = results.example_loop.as_ref()?;
    let mut drawing = Drawing::new("contact-loop", WIDTH, 470.0);
    time_signals(curve, &mut drawing)?;
    first_cycle(curve, &mut drawing)?;
    Some(drawing.finish("Time signals of one impact and the loop of its first cycle with the fitted slope"))
}

fn cycle(curve: &LoopCurve) -> std::ops::Range<usize> {
    let end = curve.cycle[1].min(curve.force_n.len()).min(curve.displacement_m.len());
    curve.cycle[0].min(end)..end
}

fn time_signals(curve: &LoopCurve, drawing: &mut Drawing) -> Option<()> {
    let milliseconds = |i: usize| i as f64 * curve.step_s * 1e3;
    let length = milliseconds(curve.force_n.len());
    let shown: Vec<(&[f64], Stroke, &str)> = [
        (&curve.displacement_a_m[..], Stroke::new(VERMILION, 1.1), "x_A"),
        (&curve.displacement_b_m[..], Stroke::new(BLUE, 1.1), "x_B"),
        (&curve.displacement_m[..], Stroke::new(GREEN, 1.3), "Δx = x_A − x_B"),
    ]
    .into_iter()
    .filter(|(values, ..)| !values.is_empty())
    .collect();
    let nanometres = |v: &f64| v * 1e9;
    let force = Stroke::new(INK, 1.1);
    let displacement = middle_range(shown.iter().flat_map(|(v, ..)| v.iter().map(nanometres)), 1.0, 0.06)?;
    let forces = middle_range(curve.force_n.iter().copied(), 1.0, 0.06)?;
    let mut entries: Vec<_> = shown.iter().map(|(_, stroke, name)| (*stroke, (*name).to_owned())).collect();
    entries.push((force, "T".into()));
    legend(drawing, [70.0, 38.0], &entries);
    let title = format!("Record {}, hit at {}", curve.record, curve.impact);
    drawing.text([70.0, 16.0], Anchor::Start, "title", &title);
    for (top, range, label, last) in
        [(50.0, displacement, "displacement in nm", false), (248.0, forces, "T in N", true)]
    {
        let area = Area { left: 70.0, top, width: 450.0, height: 180.0 };
        let x = Scale::linear([0.0, length], [area.left, area.right()]);
        let panel = Panel { area, x, y: Scale::linear(range, [area.bottom(), area.top]) };
        let (x_ticks, y_ticks) = (x.ticks(6), panel.y.ticks(5));
        panel.grid(drawing, &x_ticks, &y_ticks);
        let range = cycle(curve);
        panel.shade(drawing, [milliseconds(range.start), milliseconds(range.end)], SHADE, 0.16);
        if last {
            let points = curve.force_n.iter().enumerate().map(|(i, v)| (milliseconds(i), *v));
            panel.curve(drawing, points, force);
        } else {
            for (values, stroke, _) in &shown {
                let points = values.iter().enumerate().map(|(i, v)| (milliseconds(i), nanometres(v)));
                panel.curve(drawing, points, *stroke);
            }
        }
        panel.axes(drawing, (&x_ticks, last.then_some("time in ms")), (&y_ticks, Some(label)));
    }
    Some(())
}

fn first_cycle(curve: &LoopCurve, drawing: &mut Drawing) -> Option<()> {
    let range = cycle(curve);
    let x: Vec<f64> = curve.displacement_m[range.clone()].iter().map(|v| v * 1e9).collect();
    let t = &curve.force_n[range];
    let (horizontal, vertical) =
        (middle_range(x.iter().copied(), 1.0, 0.08)?, middle_range(t.iter().copied(), 1.0, 0.08)?);
    let area = Area { left: 620.0, top: 50.0, width: 408.0, height: 378.0 };
    let panel = Panel {
        area,
        x: Scale::linear(horizontal, [area.left, area.right()]),
        y: Scale::linear(vertical, [area.bottom(), area.top]),
    };
    let (x_ticks, y_ticks) = (panel.x.ticks(6), panel.y.ticks(7));
    panel.grid(drawing, &x_ticks, &y_ticks);
    let centre = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (x0, t0) = (centre(&x), centre(t));
    // N/m times nm
    let line = |at: f64| (at, t0 + curve.slope_n_per_m * 1e-9 * (at - x0));
    panel.curve(drawing, x.iter().copied().zip(t.iter().copied()), Stroke::new(BLUE, 1.2));
    let slope = Stroke::new(VERMILION, 1.8).dashed("7 4");
    panel.curve(drawing, horizontal.into_iter().map(line), slope);
    panel.axes(drawing, (&x_ticks, Some("Δx in nm")), (&y_ticks, Some("T in N")));
    drawing.text([area.left, 16.0], Anchor::Start, "title", "Loop of the first cycle (shaded on the left)");
    let fit = format!("fitted slope {} N/µm", decimals(micro(curve.slope_n_per_m), 0));
    legend(drawing, [area.left, 38.0], &[(Stroke::new(BLUE, 1.2), "T against Δx".into()), (slope, fit)]);
    Some(())
}
