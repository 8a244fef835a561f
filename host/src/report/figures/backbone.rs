//! A contact that slips, against amplitude: stiffness and tip force of the levels, and the law through them.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, GREEN, Panel, VERMILION};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::report::words::number::{decimals, micro, short};
use crate::results::{Backbone, Force, Hysteresis, OverCycles, Results};

/// Most laws in one figure.
const MOST: usize = 3;

const COLOURS: [&str; MOST] = [BLUE, VERMILION, GREEN];

/// Points of a law's curve.
const POINTS: usize = 160;

/// Left: slope of the stick part and peak secant of each level and the law's secant. Right: the force at the loops' tips and the law's backbone.
pub fn backbone(results: &Results) -> Option<String> {
    let shown = &results.backbones[..results.backbones.len().min(MOST)];
    let rows: Vec<Vec<&Hysteresis>> = shown.iter().map(|one| rows(results, one)).collect();
    let all = || rows.iter().flatten();
    let amplitudes = all().filter_map(|row| row.amplitude_m).map(|x| (1e6 * x).log10());
    let [low, high] = middle_range(amplitudes, 1.0, 0.1)?;
    let (low, high) = (10f64.powf(low), 10f64.powf(high));
    let k_t = all().filter_map(|row| row.stick_slope()).map(|k| k.mean + k.std);
    let stiffest = k_t.chain(all().filter_map(|row| row.k_secant_n_per_m)).map(micro).fold(0.0, f64::max);
    let strongest = all().filter_map(|row| tip(row)).fold(0.0, f64::max);
    let most_n = shown.iter().map(|one| one.law.tip(1e-6 * high)).fold(strongest, f64::max);
    let mut drawing = Drawing::new("backbone", WIDTH, 400.0);
    let top = 40.0 + 18.0 * shown.len() as f64;
    let panels = [(70.0, 1.1 * stiffest), (590.0, 1.1 * most_n)].map(|(left, most)| {
        let area = Area { left, top, width: 438.0, height: 352.0 - top };
        Panel {
            area,
            x: Scale::logarithmic([low, high], [area.left, area.right()]),
            y: Scale::linear([0.0, most], [area.bottom(), area.top]),
        }
    });
    let ticks = panels.map(|panel| (panel.x.ticks(6), panel.y.ticks(6)));
    for (panel, (x, y)) in panels.iter().zip(&ticks) {
        panel.grid(&mut drawing, x, y);
    }
    let along: Vec<f64> = (0..=POINTS).map(|i| low * (high / low).powf(i as f64 / POINTS as f64)).collect();
    for (((one, own), colour), line) in shown.iter().zip(&rows).zip(COLOURS).zip(0_i32..) {
        let stroke = Stroke::new(colour, 1.5);
        let law = &one.law;
        panels[0].curve(&mut drawing, along.iter().map(|x| (*x, micro(law.secant(1e-6 * x)))), stroke);
        panels[1].curve(&mut drawing, along.iter().map(|x| (*x, law.tip(1e-6 * x))), stroke);
        for row in own {
            level(&mut drawing, &panels, row, colour);
        }
        let y = 36.0 + 18.0 * f64::from(line);
        drawing.line([70.0, y - 4.0], [92.0, y - 4.0], stroke);
        drawing.text([98.0, y], Anchor::Start, "legend", &in_words(one));
    }
    let labels = ["stiffness in N/µm", "force at the tip in N"];
    for ((panel, (x, y)), label) in panels.iter().zip(&ticks).zip(labels) {
        panel.axes(&mut drawing, (x, Some("amplitude of Δx in µm")), (y, Some(label)));
    }
    drawing.text(
        [70.0, 16.0],
        Anchor::Start,
        "legend",
        "○ slope of the stick part   ■ peak secant; force at the tip   (bars: ± σ over cycles; raw force)",
    );
    Some(drawing.finish("Stiffness and tip force of the shaker's loops against amplitude, with the law of sliders through them"))
}

fn level(drawing: &mut Drawing, [left, right]: &[Panel; 2], row: &Hysteresis, colour: &'static str) {
    let Some(x) = row.amplitude_m.map(|x| 1e6 * x) else { return };
    let square = |drawing: &mut Drawing, at: [f64; 2]| {
        let half = 4.0;
        let area = Area { left: at[0] - half, top: at[1] - half, width: 2.0 * half, height: 2.0 * half };
        drawing.fill(area, colour, 1.0);
    };
    let at = |panel: &Panel, y: f64| [panel.x.place_within(x), panel.y.place_within(y)];
    let bar = |drawing: &mut Drawing, k: &OverCycles| {
        let ends = [k.mean - k.std, k.mean + k.std].map(|end| at(left, micro(end)));
        drawing.line(ends[0], ends[1], Stroke::new(colour, 1.4));
    };
    if let Some(k) = &row.stick_slope() {
        bar(drawing, k);
        drawing.dot(at(left, micro(k.mean)), 5.0, colour, true);
    }
    if let Some(k) = row.k_secant_n_per_m {
        square(drawing, at(left, micro(k)));
    }
    if let Some(force) = tip(row) {
        square(drawing, at(right, force));
    }
}

fn rows<'a>(results: &'a Results, one: &Backbone) -> Vec<&'a Hysteresis> {
    let own = |row: &&Hysteresis| {
        row.force == Force::Raw && row.level.is_some_and(|level| one.levels.contains(&level))
    };
    results.hysteresis.iter().filter(own).collect()
}

/// Half the swing of T, N.
fn tip(row: &Hysteresis) -> Option<f64> {
    Some(row.k_secant_n_per_m? * row.amplitude_m?)
}

fn in_words(one: &Backbone) -> String {
    let law = &one.law;
    format!(
        "{} Hz{}: stuck {} N/µm, all slipping {} N, limits spread by ± {} %; the levels lie within {} % of it",
        short(one.frequency_hz),
        one.moment.map_or(String::new(), |moment| format!(", {moment}")),
        decimals(micro(law.stiffness_n_per_m), 0),
        decimals(law.limit_n, 0),
        decimals(100.0 * law.spread, 0),
        decimals(100.0 * law.residual, 1),
    )
}
