//! Figures of the force spectrum of the last hit and of the growing average FRF of its cell.

use super::averaging::{Average, Averages, NoSpectra, of_hit};
use crate::campaign::plan::{Cell as PlanCell, Plan};
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Packed, Panel, Role, Shape, Spread};
use crate::spectra::{CrossSpectra, estimate};

/// Lines averaged into one value of the force spectrum, as for the usable bands of the report, so
/// that noise of single lines does not end a band.
const FORCE_LINES: usize = 16;
/// Drop that bounds the excited band, dB; the customary value.
const DROP_DB: f64 = 6.0;
/// The force spectrum is shown up to this multiple of the band's upper end; beyond it is noise.
const BEYOND: f64 = 2.5;
/// Smallest magnitude shown, relative to the largest: a 16-bit converter (96 dB) cannot distinguish
/// smaller values from noise.
const LOWEST: f64 = 1e-5;

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

#[cfg(test)]
#[path = "spectra_figures_tests.rs"]
mod tests;
