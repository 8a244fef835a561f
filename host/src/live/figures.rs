//! Figures for the live page: a hit, its channels, all hits of a cell overlaid, the positions of
//! hammer and vibrometer for a cell, the force spectrum of the last hit, and the growing average
//! FRF of its cell. The spectra come from single hits, read one at a time, and each only once.

use super::now::Shaker;
use crate::analyse::{AnalysedLength, LINES_HZ, before_the_hit, places};
use crate::campaign::plan::{Cell as PlanCell, Plan};
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_table::RecordRow;
use crate::device::samples::ChannelView;
use crate::report;
use crate::report::cell_records::{Shown, close};
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Packed, Panel, Role, Shape, Spread};
use crate::results::Results;
use crate::spectra::{
    CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, SpectraError, Windowing, estimate, usable_band,
};
use jointrig_protocol::channel::{Channel, Quantity, Role as ChannelRole};
use std::sync::{Mutex, PoisonError};

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
    .titled("controlled amplitude");
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
        "Amplitude of each window of a few whole cycles, the drive that produces it, and the last cycle as a raw loop.",
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
        .titled("the latest loop")
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
        "Smallest and largest value of each short stretch, in the unit of the channel.",
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

/// Lines averaged into one value of the force spectrum, as for the usable bands of the report, so
/// that noise of single lines does not end a band.
const FORCE_LINES: usize = 16;
/// Drop that bounds the excited band, dB; the customary value.
const DROP_DB: f64 = 6.0;
/// The force spectrum is shown up to this multiple of the band's upper end; beyond it is noise.
const BEYOND: f64 = 2.5;
/// Smallest magnitude shown, relative to the largest: a front end of 120 dB cannot distinguish
/// smaller values from noise.
const LOWEST: f64 = 1e-6;

/// The spectrum of a hit's force, with the band in which it stays within 6 dB.
///
/// # Errors
/// The record does not exist or is damaged.
pub fn force(store: &Store, record: i64) -> Result<Option<Figure>, StoreError> {
    let row = store.record(record)?;
    match of_hit(store, &store.plan()?, row.cell, &row) {
        Ok(hit) => Ok(of_force(record, &hit)),
        Err(NoSpectra::Store(error)) => Err(error),
        // a hit without a pulse has no spectrum; its verdict states the reason
        Err(_) => Ok(None),
    }
}

fn of_force(record: i64, hit: &CrossSpectra) -> Option<Figure> {
    let step_hz = hit.frequency_hz().windows(2).next().map(|two| two[1] - two[0])?;
    let all = hit.force_spectrum();
    let power: Vec<f64> =
        all.chunks(FORCE_LINES).map(|lines| lines.iter().sum::<f64>() / lines.len() as f64).collect();
    let first = hit.frequency_hz()[0] + 0.5 * step_hz * (FORCE_LINES - 1) as f64;
    let step = step_hz * FORCE_LINES as f64;
    let frequency_hz: Vec<f64> = (0..power.len()).map(|i| first + step * i as f64).collect();
    let band = usable_band(&frequency_hz, &power, DROP_DB)?;
    let shown = frequency_hz.partition_point(|f| *f <= BEYOND * band.high_hz);
    // the Fourier integral |F| is in N s; expressed in N/Hz it is the same number
    let size = |power: f64| 1e3 * power.sqrt();
    let top = size(power.iter().copied().fold(0.0, f64::max));
    let low = power[..shown].iter().map(|p| size(*p)).fold(top, f64::min).max(1e-3 * top);
    let panel = Panel::new(
        Axis::linear("frequency", "Hz", [0.0, frequency_hz[shown - 1]]).linked("force-frequency"),
        Axis::log("force spectrum", "mN/Hz", [0.8 * low, 1.3 * top]),
    )
    .high(Height::Low)
    .with(Mark::shade(Role::Band, band).named("within 6 dB"))
    .with(
        Mark::line(
            Role::Force,
            Along::Regular { first, step, count: shown },
            power[..shown].iter().map(|p| size(*p)),
        )
        .named("force"),
    );
    let (low, high) = (band.low_hz, band.high_hz);
    let say = format!(
        "The hammer excites {low:.0} Hz to {high:.0} Hz: there its force is within 6 dB of its largest."
    );
    Some(Figure::new("force-spectrum", "", format!("Force of record {record}"), say).with(panel))
}

/// The FRF of a cell's newest kept hits along the hit's direction, with ±1 σ and coherence from the
/// second hit on.
///
/// # Errors
/// The file cannot be read.
pub fn frf(averages: &Averages, store: &Store, cell: i64) -> Result<Option<Figure>, StoreError> {
    let Some(row) = store.cells()?.into_iter().find(|row| row.id == cell) else { return Ok(None) };
    let average = averages.of_cell(store, cell)?;
    let axis = own_axis(&store.plan()?, &row.cell);
    let name = crate::campaign::plan::configuration_name(row.cell.configuration);
    let title = format!("FRF of {name} {}→{}", row.cell.impact, row.cell.response);
    Ok(of_average(&title, &average, axis))
}

/// The channel of the cell's location whose axis is closest to the hit's direction; the report
/// states coherence and random error along the same one.
fn own_axis(plan: &Plan, cell: &PlanCell) -> usize {
    let geometry = &plan.geometry;
    let hit = geometry.impact.iter().map(toml::Spanned::get_ref).find(|p| p.name == cell.impact);
    let place = geometry.response.iter().map(toml::Spanned::get_ref).find(|p| p.name == cell.response);
    let (Some(hit), Some(place)) = (hit, place) else { return 0 };
    let felt = |axis: [f64; 3]| (0..3).map(|i| axis[i] * hit.direction[i]).sum::<f64>().abs();
    let axes = place.axes().into_iter().enumerate();
    axes.max_by(|a, b| felt(a.1.1).total_cmp(&felt(b.1.1))).map_or(0, |(number, _)| number)
}

fn of_average(title: &str, average: &Average, axis: usize) -> Option<Figure> {
    let spectra = average.spectra.as_ref()?;
    let frequency_hz = spectra.frequency_hz();
    let range = [*frequency_hz.first()?, *frequency_hz.last()?];
    let size: Vec<f64> = (0..spectra.lines()).map(|line| spectra.h1(line, axis).norm()).collect();
    let top = size.iter().copied().fold(0.0, f64::max);
    if top <= 0.0 || range[0] >= range[1] {
        return None;
    }
    let low = size.iter().copied().filter(|v| *v > 0.0).fold(top, f64::min).max(LOWEST * top);
    let (low, high) = (0.7 * low, 1.4 * top);
    let x = || Axis::frequency(Spread::Log, range);
    let along = || Along::of(frequency_hz);
    let several = spectra.hits() > 1;
    let mut magnitude = Panel::new(x(), Axis::log("receptance", "m/N", [low, high]));
    if several {
        // the standard deviation of the magnitude is that of H1's component along H1
        let sigma: Vec<f64> = (0..spectra.lines()).map(|line| spectra.variance(line, axis).sqrt()).collect();
        let ends = |sign: f64| size.iter().zip(&sigma).map(move |(v, s)| (v + sign * s).max(0.5 * low));
        let shape = Shape::Ribbon { x: along(), low: Packed::of(ends(-1.0)), high: Packed::of(ends(1.0)) };
        magnitude = magnitude.with(Mark::new(Role::Group2, shape).named("± 1 σ"));
    }
    magnitude = magnitude.with(Mark::line(Role::Group1, along(), size.iter().copied()).named("|H1|"));
    let hits = spectra.hits();
    let mut say =
        format!("Along {}, of {hits} {}.", ["x", "y", "z"][axis], if hits == 1 { "hit" } else { "hits" });
    say.push_str(if several {
        " ± 1 σ from coherence and number of hits."
    } else {
        " ± 1 σ and coherence come with the second hit."
    });
    if !average.left_out.is_empty() {
        say = format!("{say} Left out: {}.", average.left_out.join("; "));
    }
    let mut figure = Figure::new("cell-frf", "", title, say).with(magnitude);
    if several {
        let coherence = (0..spectra.lines()).map(|line| spectra.coherence(line, axis).clamp(0.0, 1.0));
        figure =
            figure.with(
                Panel::new(x(), Axis::linear("coherence", "", [0.0, 1.05]))
                    .high(Height::Low)
                    .with(Mark::line(Role::Group1, along(), coherence)),
            );
    }
    Some(figure)
}

/// Most hits that are averaged, the newest. Plans ask for about ten; this bounds the computing time
/// for a cell with very many hits.
const MOST_HITS: usize = 64;

/// Why a hit has no spectra.
#[derive(Debug, thiserror::Error)]
pub enum NoSpectra {
    /// The hit does not exist, or the file cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// It has no pulse, or does not match the other hits.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
    /// There is no force or no response.
    #[error("its session has no channel for the hammer's force, or none for the response")]
    NoChannel,
    /// The response is not a motion.
    #[error("the vibrometer's channels measure no motion")]
    NoMotion,
}

/// Spectra of one hit, assigned to a cell: force, and the response's channels as displacements, m.
///
/// # Errors
/// The record cannot be read, or has no pulse.
pub fn of_hit(store: &Store, plan: &Plan, cell: i64, row: &RecordRow) -> Result<CrossSpectra, NoSpectra> {
    let shown = Shown::of(store, cell, row)?.ok_or(NoSpectra::NoChannel)?;
    let channels = store.channels(row.session)?;
    let places = store.response_places(cell, row, &channels)?;
    let (Some(force), Some(places)) = (channels.place(ChannelRole::HammerForce), places) else {
        return Err(NoSpectra::NoChannel);
    };
    let quantity = match channels.channels[places[0]].quantity {
        Quantity::Velocity => MotionQuantity::Velocity,
        Quantity::Displacement => MotionQuantity::Displacement,
        Quantity::Acceleration => MotionQuantity::Acceleration,
        Quantity::Force | Quantity::Voltage => return Err(NoSpectra::NoMotion),
    };
    let analysed = AnalysedLength::of(store, plan)?.samples(row, shown.rate_hz);
    let cut = |signal: &[f64]| -> Vec<f64> {
        signal[analysed.start.min(signal.len())..analysed.end.min(signal.len())].to_vec()
    };
    let by_the_hit = |signal: &Vec<f64>| -> Vec<f64> {
        let before = before_the_hit(ChannelView::F64(signal), analysed.start);
        cut(signal).into_iter().map(|value| value - before).collect()
    };
    let records = ImpactRecords {
        fs_hz: shown.rate_hz,
        force_n: vec![cut(&shown.force_n)],
        response: vec![shown.response.iter().map(by_the_hit).collect()],
        quantity,
    };
    let delay = |place: usize| f64::from(channels.channels[place].delay_ns) * 1e-9;
    let settings = FrfSettings {
        windowing: Windowing { sigma_per_s: plan.window.get_ref().exponential_per_s, ..Windowing::default() },
        delay_s: places.iter().map(|place| delay(*place) - delay(force)).collect(),
        ..FrfSettings::default()
    };
    Ok(estimate(&records, &[true], &settings)?.converted(quantity, MotionQuantity::Displacement))
}

/// The average of a cell's kept hits.
#[derive(Debug, Clone, PartialEq)]
pub struct Average {
    /// The cell.
    pub(super) cell: i64,
    /// The requested records, the oldest first.
    pub(super) records: Vec<i64>,
    /// Their spectra at the analysis' lines; `None` before the first usable hit.
    pub spectra: Option<CrossSpectra>,
    /// Messages about records that cannot be used.
    pub left_out: Vec<String>,
}

impl Average {
    fn add(&mut self, store: &Store, plan: &Plan, cell: i64, row: &RecordRow) -> Result<(), StoreError> {
        let added = of_hit(store, plan, cell, row).and_then(|hit| {
            let hit = hit.band(LINES_HZ[0], LINES_HZ[1]);
            match &mut self.spectra {
                Some(sum) => sum.add(&hit)?,
                none => *none = Some(hit),
            }
            Ok(())
        });
        self.records.push(row.id);
        match added {
            Err(NoSpectra::Store(error)) if !matches!(error, StoreError::Damaged { .. }) => Err(error),
            Err(error) => {
                self.left_out.push(format!("record {}: {error}", row.id));
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }
}

/// The average requested last: only the new hits of the same cell are added.
#[derive(Debug, Default)]
pub struct Averages {
    last: Mutex<Option<Average>>,
}

impl Averages {
    /// The average of the newest kept hits of a cell.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_cell(&self, store: &Store, cell: i64) -> Result<Average, StoreError> {
        let kept: Vec<RecordRow> =
            store.records_for(cell)?.into_iter().flatten().filter(RecordRow::kept).collect();
        let kept = &kept[kept.len().saturating_sub(MOST_HITS)..];
        // valid even after a poisoned lock: it holds nothing or a complete average
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last
            .take()
            .filter(|known| known.cell == cell)
            .filter(|known| kept.iter().map(|row| row.id).collect::<Vec<_>>().starts_with(&known.records));
        let mut average =
            known.unwrap_or(Average { cell, records: Vec::new(), spectra: None, left_out: Vec::new() });
        let plan = store.plan()?;
        for row in &kept[average.records.len()..] {
            average.add(store, &plan, cell, row)?;
        }
        *last = Some(average.clone());
        Ok(average)
    }
}

#[cfg(test)]
#[path = "spectra_figures_tests.rs"]
mod tests;
