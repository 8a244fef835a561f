//! The shaker's levels: stiffness against frequency and against amplitude, before and after the
//! hammer's cells (the paper's Fig. 5).

use super::MICRO;
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role, Spread};
use crate::report::scale::middle_range;
use crate::report::words;
use crate::report::words::number::{decimals, micro, short};
use crate::results::{Excitation, Force, Hysteresis, OverCycles, Results};

/// One level, ready for plotting.
struct Dot {
    frequency_hz: f64,
    micrometres: f64,
    mean: f64,
    std: f64,
    /// Whether the value is the slope of a straight loop; otherwise it is k_eq.
    straight: bool,
    after: bool,
}

/// Offset between points at the same place, px: about their own width.
const SIDE: f64 = 8.0;

/// Paths of the stiffnesses.
const SLOPE: &str = "/hysteresis/*/slope_between_spots_n_per_m/mean";
const WHOLE: &str = "/hysteresis/*/k_eq_n_per_m/mean";

/// The number of groups is limited to that of the distinct roles.
const MOST: usize = 6;

/// Left: against frequency, with one role per amplitude. Right: against amplitude, with one role
/// per frequency.
pub fn levels(results: &Results) -> Option<Figure> {
    let dots: Vec<Dot> = results.hysteresis.iter().filter_map(dot).collect();
    if dots.len() < 2 {
        return None;
    }
    let highest = dots.iter().map(|d| d.mean + d.std).fold(0.0, f64::max);
    let lowest = dots.iter().map(|d| d.mean - d.std).fold(0.0, f64::min);
    let y = Axis::linear("stiffness", "N/µm", [1.08 * lowest, 1.08 * highest]);
    let frequencies = distinct(&dots, |d| d.frequency_hz, 0.001);
    let amplitudes = distinct(&dots, |d| d.micrometres, 0.04);
    let by_frequency =
        Panel::new(axis("frequency", "Hz", dots.iter().map(|d| d.frequency_hz), false)?, y.clone());
    let wide = amplitudes.last()? / amplitudes.first()? > 8.0;
    let by_amplitude =
        Panel::new(axis("amplitude of Δx", "µm", dots.iter().map(|d| d.micrometres), wide)?, y);
    Some(
        Figure::new(
            "levels",
            "5",
            "The shaker's levels",
            "Circles are slopes of straight loops between the spots, squares are k_eq of elliptical or slipping loops; filled before the hammer's \
             cells, hollow after them. Bars are ± σ over cycles, with the raw force.",
        )
        .across(2)
        .with(group(by_frequency, &dots, &amplitudes, (|d| d.frequency_hz, "/hysteresis/*/frequency_hz", 1.0), |d| d.micrometres, "µm"))
        .with(group(by_amplitude, &dots, &frequencies, (|d| d.micrometres, "/hysteresis/*/amplitude_m", MICRO), |d| d.frequency_hz, "Hz")),
    )
}

fn axis(
    quantity: &str,
    unit: &'static str,
    values: impl Iterator<Item = f64>,
    logarithmic: bool,
) -> Option<Axis> {
    if logarithmic {
        let range = middle_range(values.map(f64::log10), 1.0, 0.08)?.map(|e| 10f64.powf(e));
        return Some(Axis { scale: Spread::Log, ..Axis::linear(quantity, unit, range) });
    }
    let [low, high] = middle_range(values, 1.0, 0.12)?;
    // a single value is placed in the middle
    let [low, high] = if high > low { [low, high] } else { [0.8 * low, 1.2 * high] };
    Some(Axis::linear(quantity, unit, [low.max(0.0), high]))
}

fn group(
    panel: Panel,
    dots: &[Dot],
    groups: &[f64],
    (place, place_path, factor): (fn(&Dot) -> f64, &str, f64),
    of: fn(&Dot) -> f64,
    unit: &str,
) -> Panel {
    let mut marks = Vec::new();
    for (i, centre) in groups.iter().enumerate() {
        let role = Role::group(i);
        let name = if i + 1 >= MOST && groups.len() > MOST {
            format!("{} more", groups.len() + 1 - MOST)
        } else {
            format!("{} {unit}", decimals(*centre, if *centre < 10.0 { 2 } else { 0 }))
        };
        for (after, straight) in [(false, true), (true, true), (false, false), (true, false)] {
            let own = || {
                let near = move |d: &&Dot| (of(d) / centre - 1.0).abs() < 0.05;
                dots.iter().filter(near).filter(move |d| d.after == after && d.straight == straight)
            };
            if own().next().is_none() {
                continue;
            }
            let marker = match (after, straight) {
                (false, true) => Marker::Dot,
                (true, true) => Marker::Ring,
                (false, false) => Marker::Square,
                (true, false) => Marker::Frame,
            };
            let says = own().map(|d| {
                let moment = if d.after { "after" } else { "before" };
                format!(
                    "{} Hz, {} µm, {moment}: {} N/µm",
                    decimals(d.frequency_hz, 0),
                    short(d.micrometres),
                    short(d.mean)
                )
            });
            marks.push(
                Mark::points(role, marker, own().map(|d| [place(d), d.mean]))
                    .barred("y", own().map(|d| [d.mean - d.std, d.mean + d.std]))
                    .aside(
                        SIDE * (i as f64 - 0.5 * (groups.len() - 1) as f64)
                            + if after { 0.5 * SIDE } else { 0.0 },
                    )
                    .saying(says.collect())
                    .named(name.clone())
                    .from("x", place_path, factor)
                    .scatter("y", if straight { SLOPE } else { WHOLE }, 1.0 / MICRO),
            );
        }
    }
    panel.high(Height::Tall).with_all(marks)
}

fn dot(row: &Hysteresis) -> Option<Dot> {
    if row.kind != Excitation::Shaker || row.force != Force::Raw {
        return None;
    }
    let (name, OverCycles { mean, std, .. }) =
        words::slope(&Hysteresis { k_t_n_per_m: None, ..row.clone() })?;
    Some(Dot {
        frequency_hz: row.frequency_hz?,
        micrometres: MICRO * row.amplitude_m?,
        mean: micro(mean),
        std: micro(std),
        straight: name != "k_eq",
        after: row.moment == Some("after"),
    })
}

/// The distinct values; values that differ by less than `part` of each other count as one (the
/// first of them).
fn distinct(dots: &[Dot], of: impl Fn(&Dot) -> f64, part: f64) -> Vec<f64> {
    let mut values: Vec<f64> = dots.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    values.dedup_by(|a, b| (*a / *b - 1.0).abs() < part);
    values
}
