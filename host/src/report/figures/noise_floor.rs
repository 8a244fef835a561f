//! Figures of the measurement's noise and excitation:
//!
//! - an FRF compared with its own noise, and the resulting dynamic stiffness (the paper's Fig.
//!   C.16)
//! - the random error of each cell's FRF
//! - the coherence of every cell, one strip each
//! - the frequency ranges in which the hammer's force was sufficient
//! - the hammer over the campaign: peak force of every hit, and the coil's pulse that produced it

use super::{MICRO, below_name};
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Marker, Packed, Panel, Role, Shape, Spread};
use crate::report::scale::middle_range;
use crate::report::words::number::short;
use crate::results::{CellRow, Cells, HitRow, MAIN_BAND, Results};
use crate::structure::Structure;

/// Receptance and noise, and the inverse of the receptance.
pub fn noise_floor(results: &Results) -> Option<Figure> {
    let one = results.noise_floor.as_ref()?;
    let count = one.magnitude_m_per_n.len();
    let along = Along::Regular { first: one.first_hz, step: one.step_hz, count };
    let frequencies = [one.first_hz, one.first_hz + one.step_hz * count.saturating_sub(1) as f64];
    let logarithmic = |values: &mut dyn Iterator<Item = f64>| -> Option<[f64; 2]> {
        let range = middle_range(values.filter(|v| *v > 0.0).map(f64::log10), 1.0, 0.05)?;
        Some(range.map(|e| 10f64.powf(e)))
    };
    let receptance = logarithmic(&mut one.magnitude_m_per_n.iter().chain(&one.noise_m_per_n).copied())?;
    let stiffness = logarithmic(&mut one.dynamic_stiffness_n_per_m.iter().map(|k| k / MICRO))?;
    let x = || Axis::frequency(Spread::Log, frequencies);
    let line = |role, values: &[f64], field: &str, factor: f64| {
        Mark::line(role, along.clone(), values.iter().map(|v| v * factor))
            .from("y", format!("/noise_floor/{field}/*"), factor)
            .from("first", "/noise_floor/first_hz", 1.0)
            .from("step", "/noise_floor/step_hz", 1.0)
    };
    Some(
        Figure::new(
            "noise-floor",
            "C.16",
            "Noise floor and dynamic stiffness",
            format!(
                "{}: {} from {}. Where the receptance comes near its noise, what is computed from it is noise too; the dynamic stiffness is its inverse.",
                one.configuration, one.output, one.input
            ),
        )
        .across(2)
        .with(
            Panel::new(x(), Axis::log("receptance", "m/N", receptance))
                .with(line(Role::Measured, &one.magnitude_m_per_n, "magnitude_m_per_n", 1.0).named("receptance"))
                .with(line(Role::Noise, &one.noise_m_per_n, "noise_m_per_n", 1.0).named("its noise, σ")),
        )
        .with(
            Panel::new(x(), Axis::log("dynamic stiffness", "N/µm", stiffness))
                .with(line(Role::Measured, &one.dynamic_stiffness_n_per_m, "dynamic_stiffness_n_per_m", 1.0 / MICRO)),
        ),
    )
}

/// Cells in the order of the plan, with one role per configuration.
pub fn random_error(results: &Results) -> Option<Figure> {
    let cells = &results.cells.as_ref()?.cells;
    let known: Vec<(usize, f64)> = cells
        .iter()
        .enumerate()
        .filter_map(|(i, c)| Some((i, 100.0 * c.random_error.filter(|e| *e > 0.0)?)))
        .collect();
    let low = known.iter().map(|(_, e)| *e).reduce(f64::min)?;
    let high = known.iter().map(|(_, e)| *e).fold(low, f64::max);
    let mut panel = Panel::new(
        Axis::linear("cell, in the order of the plan", "", [-1.0, cells.len() as f64]),
        Axis::log("random error", "%", [0.8 * low, 1.25 * high]),
    );
    for (group, configuration) in Structure::ALL.map(Structure::name).into_iter().enumerate() {
        let own: Vec<&(usize, f64)> =
            known.iter().filter(|(i, _)| cells[*i].configuration == configuration).collect();
        if own.is_empty() {
            continue;
        }
        let says = own.iter().map(|(i, e)| {
            format!("{configuration}, impact {}, response {}: {e:.2} %", cells[*i].impact, cells[*i].response)
        });
        panel.marks.push(
            Mark::points(Role::group(group), Marker::Ring, own.iter().map(|(i, e)| [*i as f64, *e]))
                .saying(says.collect())
                .named(configuration)
                .from("x", "/cells/cells/*", 1.0)
                .from("y", "/cells/cells/*/random_error", 100.0),
        );
    }
    Some(
        Figure::new(
            "random-error",
            "",
            "Random error by cell",
            "How far noise alone moves the FRF of each cell, from coherence and number of hits: median over the main band.",
        )
        .with(panel),
    )
}

/// A panel for each configuration.
pub fn coherence(results: &Results) -> Option<Figure> {
    let cells = results.cells.as_ref()?;
    let mut figure = Figure::new(
        "coherence",
        "",
        "Coherence of every cell",
        "One strip for each cell, along the hit's own direction. White is 0.99 and more; the darker, the less of the response the hammer's force explains.",
    )
    .across(3);
    let range = [*cells.frequency_hz.first()?, *cells.frequency_hz.last()?];
    for configuration in Structure::ALL.map(Structure::name) {
        figure.panels.extend(panel(cells, configuration, range));
    }
    (!figure.panels.is_empty() && range[0] < range[1]).then_some(figure)
}

fn panel(cells: &Cells, configuration: &str, range: [f64; 2]) -> Option<Panel> {
    let lines = cells.frequency_hz.len();
    let own: Vec<&CellRow> = cells
        .cells
        .iter()
        .filter(|c| c.configuration == configuration && c.coherence.len() == lines)
        .collect();
    if own.is_empty() {
        return None;
    }
    let shape = Shape::Strips {
        x: Packed::of(cells.frequency_hz.iter().copied()),
        values: Packed::of(own.iter().flat_map(|c| c.coherence.iter().copied())),
        says: own.iter().map(|c| format!("{} measured at {}", c.impact, c.response)).collect(),
    };
    let mark = Mark::new(Role::Refused, shape)
        .named("coherence below 0.99")
        .from("values", "/cells/cells/*/coherence/*", 1.0)
        .from("x", "/cells/frequency_hz/*", 1.0);
    let y = Axis::linear("cell", "", [-0.5, own.len() as f64 - 0.5]);
    Some(
        Panel::new(Axis::frequency(Spread::Log, range), y)
            .titled(super::cells::counted(configuration, own.len()))
            .high(Height::Tall)
            .with(mark),
    )
}

/// A bar for each configuration.
pub fn usable_bands(results: &Results) -> Option<Figure> {
    let bands = &results.usable_bands;
    let low = bands.iter().map(|b| b.band_hz.low_hz).filter(|f| *f > 0.0).reduce(f64::min)?;
    let high = bands.iter().map(|b| b.band_hz.high_hz).fold(low, f64::max);
    let names = bands
        .iter()
        .map(|b| {
            format!("{}: {} to {} Hz", b.configuration, short(b.band_hz.low_hz), short(b.band_hz.high_hz))
        })
        .collect();
    let mut panel =
        Panel::new(Axis::frequency(Spread::Log, [0.8 * low, 1.25 * high]), Axis::named("", names))
            .high(Height::Rows)
            .with(Mark::shade(Role::Band, MAIN_BAND).named("main band"));
    for (i, band) in bands.iter().enumerate() {
        let (from, to) = (band.band_hz.low_hz.max(low), band.band_hz.high_hz);
        panel.marks.push(
            Mark::points(Role::Group1, Marker::Stroke, [[from, below_name(i)], [to, below_name(i)]])
                .barred("x", [[from, to], [from, to]])
                .from("x", "/usable_bands/*/band_hz/*", 1.0),
        );
    }
    Some(
        Figure::new(
            "usable-bands",
            "",
            "The usable band",
            "Where the auto-spectrum of the hammer's force is within 6 dB of its level at low frequency.",
        )
        .across(2)
        .with(panel),
    )
}

/// Force at the top, pulse below.
pub fn pulses(results: &Results) -> Option<Figure> {
    let hits = &results.hits;
    // overloads and hits that missed would stretch the axis: its range is that of the kept hits
    let kept = hits.iter().filter(|h| h.kept || hits.iter().all(|h| !h.kept)).map(|h| h.peak_n);
    let force = middle_range(kept, 1.0, 0.06)?;
    let pulse = middle_range(hits.iter().map(|h| f64::from(h.pulse_us)), 1.0, 0.1)?;
    let x = || {
        let (first, last) = (hits.first().map_or(0, |h| h.record), hits.last().map_or(1, |h| h.record));
        Axis::linear("record", "", [first as f64 - 1.0, last as f64 + 1.0]).linked("record")
    };
    let points = |kept: bool, of: fn(&HitRow) -> f64| {
        let own = hits.iter().filter(move |h| h.kept == kept && of(h) > 0.0);
        let (role, marker, name) = if kept {
            (Role::Group1, Marker::Dot, "kept")
        } else {
            (Role::Refused, Marker::Cross, "refused")
        };
        Mark::points(role, marker, own.clone().map(|h| [h.record as f64, of(h)])).named(name).from(
            "x",
            "/hits/*/record",
            1.0,
        )
    };
    let mut peak = Panel::new(x(), Axis::linear("peak force", "N", [0.0, 1.5 * force[1]]));
    let mut coil = Panel::new(x(), Axis::linear("coil's pulse", "µs", pulse)).high(Height::Low);
    for kept in [true, false] {
        if hits.iter().any(|h| h.kept == kept) {
            peak.marks.push(points(kept, |h| h.peak_n).from("y", "/hits/*/peak_n", 1.0));
            coil.marks.push(points(kept, |h| f64::from(h.pulse_us)).from("y", "/hits/*/pulse_us", 1.0));
        }
    }
    Some(
        Figure::new(
            "pulses",
            "",
            "The hammer over the campaign",
            "Peak force of every hit, and the duration of the coil's pulse, by which the force is controlled. Overloads lie beyond the frame.",
        )
        .with(peak)
        .with(coil),
    )
}
