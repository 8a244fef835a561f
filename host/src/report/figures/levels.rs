//! The shaker's levels: stiffness against frequency and against amplitude, before and after the hammer's cells.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, FAINT, GREEN, INK, Panel, VERMILION, legend};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::report::words;
use crate::report::words::number::{decimals, micro};
use crate::results::{Excitation, Force, Hysteresis, OverCycles, Results};

/// One level, ready to be drawn.
struct Dot {
    frequency_hz: f64,
    nanometres: f64,
    mean: f64,
    std: f64,
    /// Whether it is k_T; k_eq otherwise.
    straight: bool,
    after: bool,
}

const COLOURS: [&str; 6] = [BLUE, VERMILION, GREEN, "#cc79a7", "#8a6d00", INK];

/// As many names as the legend of a panel has room for.
const NAMED: usize = 5;

/// Left: against frequency, a colour for each amplitude. Right: against amplitude, a colour for each frequency.
pub fn levels(results: &Results) -> Option<String> {
    let dots: Vec<Dot> = results.hysteresis.iter().filter_map(dot).collect();
    if dots.len() < 2 {
        return None;
    }
    let highest = dots.iter().map(|d| d.mean + d.std).fold(0.0, f64::max);
    let range = [0.0, 1.08 * highest];
    let mut drawing = Drawing::new("levels", WIDTH, 372.0);
    let frequencies = distinct(&dots, |d| d.frequency_hz, 0.001);
    let amplitudes = distinct(&dots, |d| d.nanometres, 0.04);
    let areas = [70.0, 590.0].map(|left| Area { left, top: 62.0, width: 438.0, height: 262.0 });
    panel(
        &mut drawing,
        areas[0],
        &dots,
        range,
        Axis {
            of: |d| d.frequency_hz,
            colour: |d| d.nanometres,
            groups: &amplitudes,
            unit: "nm",
            label: "frequency in Hz",
            spread: 0.012,
            logarithmic: false,
        },
    )?;
    let span = amplitudes.last()? / amplitudes.first()?;
    panel(
        &mut drawing,
        areas[1],
        &dots,
        range,
        Axis {
            of: |d| d.nanometres,
            colour: |d| d.frequency_hz,
            groups: &frequencies,
            unit: "Hz",
            label: "amplitude of Δx in nm",
            spread: 0.006,
            logarithmic: span > 8.0,
        },
    )?;
    drawing.text(
        [70.0, 16.0],
        Anchor::Start,
        "legend",
        "● slope, before   ○ slope, after   ■ k_eq, before   □ k_eq, after   (bars: ± σ over cycles; raw force)",
    );
    Some(drawing.finish(
        "Stiffness of the shaker's loops against frequency and amplitude, before and after the campaign",
    ))
}

/// How one panel is laid out.
#[derive(Clone, Copy)]
struct Axis<'a> {
    of: fn(&Dot) -> f64,
    colour: fn(&Dot) -> f64,
    groups: &'a [f64],
    unit: &'a str,
    label: &'a str,
    /// How far apart dots of the same place stand, as a part of the axis.
    spread: f64,
    logarithmic: bool,
}

fn panel(drawing: &mut Drawing, area: Area, dots: &[Dot], range: [f64; 2], axis: Axis<'_>) -> Option<()> {
    let values = dots.iter().map(axis.of);
    let x = if axis.logarithmic {
        let [low, high] = middle_range(values.map(f64::log10), 1.0, 0.08)?;
        Scale::logarithmic([10f64.powf(low), 10f64.powf(high)], [area.left, area.right()])
    } else {
        let [low, high] = middle_range(values, 1.0, 0.12)?;
        Scale::linear([low.max(0.0), high], [area.left, area.right()])
    };
    let panel = Panel { area, x, y: Scale::linear(range, [area.bottom(), area.top]) };
    let (x_ticks, y_ticks) = (x.ticks(6), panel.y.ticks(6));
    panel.grid(drawing, &x_ticks, &y_ticks);
    let colour_of = |group: usize| COLOURS[group % COLOURS.len()];
    let mut entries = Vec::new();
    for (group, centre) in axis.groups.iter().enumerate() {
        let colour = colour_of(group);
        let mut own: Vec<&Dot> =
            dots.iter().filter(|d| ((axis.colour)(d) / centre - 1.0).abs() < 0.05).collect();
        own.sort_by(|a, b| (axis.of)(a).total_cmp(&(axis.of)(b)));
        let aside = (group as f64 - 0.5 * (axis.groups.len() - 1) as f64) * axis.spread * area.width;
        for after in [false, true] {
            let line = own.iter().filter(|d| d.after == after).map(|d| ((axis.of)(d), d.mean));
            let stroke = Stroke::new(colour, 0.8);
            panel.curve(drawing, line, if after { stroke.dashed("4 4") } else { stroke });
        }
        for d in own {
            let side = aside + if d.after { 3.0 } else { 0.0 };
            let at = [panel.x.place_within((axis.of)(d)) + side, panel.y.place_within(d.mean)];
            let bar = [panel.y.place_within(d.mean - d.std), panel.y.place_within(d.mean + d.std)];
            drawing.line([at[0], bar[0]], [at[0], bar[1]], Stroke::new(colour, 1.4));
            if d.straight {
                drawing.dot(at, 4.0, colour, d.after);
            } else {
                let square = |half: f64| Area {
                    left: at[0] - half,
                    top: at[1] - half,
                    width: 2.0 * half,
                    height: 2.0 * half,
                };
                drawing.fill(square(4.2), colour, 1.0);
                if d.after {
                    drawing.fill(square(2.6), "#fff", 1.0);
                }
            }
        }
        entries.push((
            Stroke::new(colour, 1.6),
            format!("{} {}", decimals(*centre, usize::from(*centre < 10.0)), axis.unit),
        ));
    }
    if entries.len() > NAMED {
        let more = entries.len() + 1 - NAMED;
        entries.truncate(NAMED - 1);
        entries.push((Stroke::new(FAINT, 1.6), format!("{more} more")));
    }
    legend(drawing, [area.left, 44.0], &entries);
    panel.axes(drawing, (&x_ticks, Some(axis.label)), (&y_ticks, Some("stiffness in N/µm")));
    Some(())
}

fn dot(row: &Hysteresis) -> Option<Dot> {
    if row.kind != Excitation::Shaker || row.force != Force::Raw {
        return None;
    }
    let (name, OverCycles { mean, std, .. }) = words::slope(row)?;
    Some(Dot {
        frequency_hz: row.frequency_hz?,
        nanometres: 1e9 * row.amplitude_m?,
        mean: micro(mean),
        std: micro(std),
        straight: name != "k_eq",
        after: row.moment == Some("after"),
    })
}

/// The distinct values, those within a part of one another as one (their first).
fn distinct(dots: &[Dot], of: impl Fn(&Dot) -> f64, part: f64) -> Vec<f64> {
    let mut values: Vec<f64> = dots.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    values.dedup_by(|a, b| (*a / *b - 1.0).abs() < part);
    values
}
