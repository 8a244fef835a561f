//! The slope that each impact gave, by where it was hit.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, INK, Panel, VERMILION};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::report::words::number::{micro, stiffness};
use crate::results::Results;
use std::collections::BTreeMap;

/// One dot per record in a column per impact position; mean ± σ across all.
pub fn impacts(results: &Results) -> Option<String> {
    if results.impact_slopes.len() < 2 {
        return None;
    }
    let mut columns: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for slope in &results.impact_slopes {
        columns.entry(&slope.impact).or_default().push(micro(slope.k_eq_n_per_m));
    }
    let range = middle_range(columns.values().flatten().copied(), 1.0, 0.15)?;
    let area = Area { left: 70.0, top: 14.0, width: WIDTH - 70.0 - 130.0, height: 190.0 };
    let panel = Panel {
        area,
        x: Scale::linear([0.0, columns.len() as f64], [area.left, area.right()]),
        y: Scale::linear(range, [area.bottom(), area.top]),
    };
    let y_ticks = panel.y.ticks(5);
    let mut drawing = Drawing::new("impacts", WIDTH, area.bottom() + 44.0);
    panel.grid(&mut drawing, &[], &y_ticks);
    if let Some(k) = results.impact_loops().and_then(|h| h.k_eq_n_per_m) {
        let (mean, std) = (micro(k.mean), micro(k.std));
        let (top, bottom) = (panel.y.place_within(mean + std), panel.y.place_within(mean - std));
        drawing.fill(Area { top, height: bottom - top, ..area }, VERMILION, 0.12);
        panel.level(&mut drawing, panel.x.range(), mean, Stroke::new(VERMILION, 1.6));
        let at = panel.y.place_within(mean) + 4.0;
        drawing.text([area.right() + 8.0, at], Anchor::Start, "legend", &stiffness(k.mean, k.std));
    }
    for (i, (name, values)) in columns.iter().enumerate() {
        let (left, right) = (panel.x.place_within(i as f64 + 0.2), panel.x.place_within(i as f64 + 0.8));
        let step = (right - left) / values.len() as f64;
        for (j, value) in values.iter().enumerate() {
            let at = [left + (j as f64 + 0.5) * step, panel.y.place_within(*value)];
            drawing.dot(at, 2.6, BLUE, true);
        }
        let text = format!("{name} ({})", values.len());
        drawing.text([f64::midpoint(left, right), area.bottom() + 18.0], Anchor::Middle, "tick", &text);
        if i > 0 {
            let x = panel.x.place_within(i as f64);
            drawing.line([x, area.top], [x, area.bottom()], Stroke::new(INK, 0.4).dashed("2 4"));
        }
    }
    panel.axes(&mut drawing, (&[], None), (&y_ticks, Some("slope in N/µm")));
    drawing.text(
        [f64::midpoint(area.left, area.right()), area.bottom() + 38.0],
        Anchor::Middle,
        "label",
        "hit at (records)",
    );
    Some(drawing.finish("Slope of the first cycle of every impact, by impact position"))
}
