//! Figures of single records and cells, for the page that watches a campaign: a hit, its channels, all hits of a cell over one another, and where
//! hammer and vibrometer go for it.

use jointrig_protocol::channel::{Channel, Quantity, Role as Measures};

use crate::analyse::places;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_row::RecordRow;
use crate::device::channels::ChannelMap;
use crate::report;
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Shape};
use crate::results::Results;

/// What is shown of a pulse before and after its peak, s.
const PULSE_S: [f64; 2] = [-3e-3, 9e-3];
/// Points of an envelope: two for each pixel of a wide screen.
const POINTS: usize = 1600;

/// The force of a hit around its peak, and everything that was measured over the whole record.
///
/// # Errors
/// The record is not there, or damaged.
pub fn hit(store: &Store, record: i64) -> Result<Option<Figure>, StoreError> {
    let row = store.record(record)?;
    let map = store.channels(row.session)?;
    let Some(force) = force(store, &row, &map)? else { return Ok(None) };
    Ok(Some(
        Figure::new("hit", "", "The hammer's force", "What the last hit did, around its peak.")
            .with(pulses(&[(format!("record {record}"), row.kept(), force)], f64::from(map.rate_hz))),
    ))
}

/// All hits of a cell over one another.
///
/// # Errors
/// The file cannot be read.
pub fn cell(store: &Store, cell: i64) -> Result<Option<Figure>, StoreError> {
    let mut all = Vec::new();
    let mut rate_hz = 0.0;
    for row in store.records_of(cell)?.into_iter().flatten() {
        let map = store.channels(row.session)?;
        rate_hz = f64::from(map.rate_hz);
        if let Some(force) = force(store, &row, &map)? {
            all.push((format!("attempt {}", row.attempt + 1), row.kept(), force));
        }
    }
    if all.is_empty() {
        return Ok(None);
    }
    let say = "Every hit of the cell, each around its own peak: what was kept, and what was refused.";
    Ok(Some(Figure::new("cell", "", "The cell's hits", say).with(pulses(&all, rate_hz))))
}

/// Where hammer and vibrometer go for a cell: its two places stand out of all others, which have no names.
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
        // what stands out is drawn last
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

/// Every channel of a record as the least and the largest value of each short stretch.
///
/// # Errors
/// The record is not there, or damaged.
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
        figure.panels.extend(envelope(
            channel,
            &map.to_si(place, samples.channel(place)),
            f64::from(map.rate_hz),
        ));
    }
    Ok((!figure.panels.is_empty()).then_some(figure))
}

fn force(store: &Store, row: &RecordRow, map: &ChannelMap) -> Result<Option<Vec<f64>>, StoreError> {
    let Some(place) = map.place(Measures::HammerForce) else { return Ok(None) };
    if row.scans == 0 {
        return Ok(None);
    }
    let samples = store.samples(row)?;
    Ok(Some(map.to_si(place, samples.channel(place))))
}

fn pulses(all: &[(String, bool, Vec<f64>)], rate_hz: f64) -> Panel {
    let largest = all.iter().flat_map(|(.., force)| force).fold(1.0_f64, |most, f| most.max(f.abs()));
    let x = Axis::linear("time from the peak", "ms", PULSE_S.map(|s| 1e3 * s));
    let mut panel =
        Panel::new(x, Axis::linear("force", "N", [-0.1 * largest, 1.1 * largest])).high(Height::Low);
    for (name, kept, force) in all {
        let peak =
            force.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map_or(0, |(i, _)| i);
        let before = (-PULSE_S[0] * rate_hz) as usize;
        let from = peak.saturating_sub(before);
        let to = (peak + (PULSE_S[1] * rate_hz) as usize).min(force.len());
        let first = 1e3 * (from as f64 - peak as f64) / rate_hz;
        let along = Along::Regular { first, step: 1e3 / rate_hz, count: to - from };
        // the force cell may be wired either way round: a hit is shown upwards
        let sign = force[peak].signum();
        let role = if *kept { Role::Force } else { Role::Refused };
        panel
            .marks
            .push(Mark::line(role, along, force[from..to].iter().map(|f| sign * f)).named(name.clone()));
    }
    panel
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
    // from the least to the largest value and on: a line through both fills what lies between
    let along = Along::Regular { first: 0.25 * step, step: 0.5 * step, count: 2 * ends.len() };
    let mark = Mark::line(Role::Group1, along, ends.into_iter().flatten());
    Some(Panel::new(x, y).titled(channel.name.as_str()).high(Height::Low).with(mark))
}
