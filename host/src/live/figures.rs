//! Figures of single records and cells for the live page: a hit, its channels, all hits of a cell
//! overlaid, and the positions of hammer and vibrometer for a cell.

use jointrig_protocol::channel::{Channel, Quantity};

use crate::analyse::places;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::live::now::Shaker;
use crate::report;
use crate::report::cell_records::{Shown, close};
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Shape};
use crate::results::Results;

/// Points of an envelope: two per pixel of a wide screen.
const POINTS: usize = 1600;

/// A hit: its force, and the response along each axis.
///
/// # Errors
/// The record does not exist or is damaged.
pub fn hit(store: &Store, record: i64) -> Result<Option<Figure>, StoreError> {
    let row = store.record(record)?;
    let shown = Shown::of(store, row.cell, &row)?;
    Ok(close(&format!("Record {record}"), shown.as_slice()))
}

/// All hits of a cell overlaid; damaged records are left out.
///
/// # Errors
/// The file cannot be read.
pub fn cell(store: &Store, cell: i64) -> Result<Option<Figure>, StoreError> {
    let mut all = Vec::new();
    for row in store.records_for(cell)?.iter().flatten() {
        match Shown::of(store, cell, row) {
            Ok(shown) => all.extend(shown),
            Err(StoreError::Damaged { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(close("The cell's hits", &all))
}

/// The positions of hammer and vibrometer for a cell: its two points are highlighted, all others
/// are drawn without names.
///
/// # Errors
/// The file cannot be read.
pub fn place(store: &Store, cell: i64) -> Result<Option<Figure>, StoreError> {
    let Some(row) = store.cells()?.into_iter().find(|row| row.id == cell) else { return Ok(None) };
    let results = Results { geometry: places(&store.plan()?), ..Results::default() };
    let Some(mut figure) = report::all_figures(&results).into_iter().find(|figure| figure.name == "geometry")
    else {
        return Ok(None);
    };
    for mark in figure.panels.iter_mut().flat_map(|panel| &mut panel.marks) {
        let Shape::Scene(scene) = &mut mark.shape else { continue };
        for spot in &mut scene.spots {
            let here = if spot.toward.is_some() { &row.cell.impact } else { &row.cell.response };
            if spot.name == *here {
                spot.role = Role::Next;
            } else {
                spot.name.clear();
                spot.role = Role::Guide;
            }
        }
        // highlighted points are drawn last
        scene.spots.sort_by_key(|spot| !spot.name.is_empty());
    }
    let (impact, response) = (&row.cell.impact, &row.cell.response);
    Ok(Some(Figure {
        name: "place",
        number: "",
        title: format!("Hammer at {impact}, vibrometer at {response}"),
        say: "The arrow is the hammer's place and direction, the square is where the vibrometer looks. Drag or use the arrow keys to turn it; x, y and z look along an axis."
            .into(),
        ..figure
    }))
}

/// A running level of the shaker: the controlled quantity with its set point, the drive, and the
/// last cycle as a loop. `None` before any data.
pub fn shaker(now: &Shaker) -> Option<Figure> {
    let last = now.windows.last()?;
    let time = || Axis::linear("time", "s", [0.0, last[0].max(1.0)]).linked("level-time");
    let at = |column: usize, by: f64| -> Vec<f64> { now.windows.iter().map(|w| w[column] * by).collect() };
    let top = |values: &[f64], least: f64| 1.08 * values.iter().copied().fold(least, f64::max);
    let seconds = at(0, 1.0);
    // with a controlled drive the motion has no set point
    let ordered = now.held != "drive";
    let (quantity, unit, by) = match now.held {
        "force" => ("force", "N", 1.0),
        _ => ("relative displacement", "µm", 1e6),
    };
    let held = at(1, by);
    let order = by * now.order;
    let mut amplitude = Panel::new(
        time(),
        Axis::linear(quantity, unit, [0.0, top(&held, if ordered { 1.1 * order } else { 1e-9 })]),
    )
    .titled("amplitude of what is held");
    if ordered {
        amplitude = amplitude.with(Mark::level(Role::Guide, order).named("order"));
    }
    let amplitude = amplitude.with(Mark::line(Role::Relative, Along::of(&seconds), held).named("measured"));
    let volts = at(2, 1.0);
    let drive =
        Panel::new(time(), Axis::linear("drive", "V", [0.0, top(&volts, 1e-3).min(1.08 * now.most_drive_v)]))
            .titled("drive")
            .with(Mark::line(Role::Measured, Along::of(&seconds), volts));
    let mut figure = Figure::new(
        "shaker-now",
        "",
        now.title.clone(),
        "Amplitude of every window of some whole cycles, the drive that brings it about, and the last cycle as a loop, raw.",
    )
    .across(3)
    .with(amplitude)
    .with(drive);
    if let Some([x, force]) = &now.turn {
        let reach = |values: &[f64]| {
            let most = values.iter().fold(1e-9_f64, |most, v| most.max(v.abs()));
            [-1.1 * most, 1.1 * most]
        };
        let mut panel = Panel::new(
            Axis::linear("relative displacement", "µm", reach(x)),
            Axis::linear("force", "N", reach(force)),
        )
        .titled("the loop as it turns")
        .high(Height::Square);
        panel = panel.with(Mark::looped(Role::Loops, x.iter().copied(), force.iter().copied()));
        figure = figure.with(panel);
    }
    Some(figure)
}

/// Every channel of a record as the smallest and largest value of each short stretch.
///
/// # Errors
/// The record does not exist or is damaged.
pub fn channels(store: &Store, record: i64) -> Result<Option<Figure>, StoreError> {
    let row = store.record(record)?;
    if row.scans == 0 {
        return Ok(None);
    }
    let map = store.channels(row.session)?;
    let samples = store.samples(&row)?;
    let mut figure = Figure::new(
        "channels",
        "",
        format!("Every channel of record {record}"),
        "Least and largest value of each short stretch, in the unit of the channel.",
    )
    .across(2);
    for (place, channel) in map.channels.iter().enumerate() {
        figure.panels.extend(envelope(channel, &map.to_si(place, samples.channel(place)), map.fs_hz()));
    }
    Ok((!figure.panels.is_empty()).then_some(figure))
}

fn envelope(channel: &Channel, values: &[f64], rate_hz: f64) -> Option<Panel> {
    let (name, unit, factor) = match channel.quantity {
        Quantity::Force => ("force", "N", 1.0),
        Quantity::Velocity => ("velocity", "mm/s", 1e3),
        Quantity::Displacement => ("displacement", "µm", 1e6),
        Quantity::Acceleration => ("acceleration", "m/s²", 1.0),
        Quantity::Voltage => ("voltage", "V", 1.0),
    };
    let stretch = values.len().div_ceil(POINTS).max(1);
    let ends = values.chunks(stretch).map(|own| {
        own.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
    });
    let ends: Vec<[f64; 2]> = ends.map(|both| both.map(|v| factor * v)).collect();
    let [low, high] = ends
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], own| [low.min(own[0]), high.max(own[1])]);
    if !(low.is_finite() && high.is_finite()) {
        return None;
    }
    let margin = 0.06 * (high - low).max(1e-9);
    let length_s = values.len() as f64 / rate_hz;
    let x = Axis::linear("time", "s", [0.0, length_s]).linked("record-time");
    let y = Axis::linear(name, unit, [low - margin, high + margin]);
    let step = stretch as f64 / rate_hz;
    // alternating the smallest and largest values makes one line that fills the range between them
    let along = Along::Regular { first: 0.25 * step, step: 0.5 * step, count: 2 * ends.len() };
    let mark = Mark::line(Role::Group1, along, ends.into_iter().flatten());
    Some(Panel::new(x, y).titled(channel.name.as_str()).high(Height::Low).with(mark))
}
