//! Selects what the report shows of the measurements: a driving point and a transfer FRF of every
//! configuration; and the data quality of every cell: the coherence along the hit's own direction,
//! and the random error derived from it.

use super::assemble::component_of;
use super::averages::CellAverage;
use super::cell::CellName;
use crate::frf::Frf;
use crate::results::{FrfCurve, MAIN_BAND, NoiseFloor, Role, rounded};
use crate::spectra::MotionQuantity;
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};
use num_complex::Complex;

/// The cell of this impact and channel, if it was measured.
fn find<'c>(cells: &'c [CellAverage], impact: &Point, channel: &Point) -> Option<&'c CellAverage> {
    let named = |c: &&CellAverage| c.name.impact == impact.name && c.name.response == channel.name;
    cells.iter().find(named).filter(|c| c.spectra.outputs() > 0)
}

/// The curves of a configuration that was measured in this campaign.
pub fn of_cells(
    configuration: Structure,
    points: &Configuration,
    cells: &[CellAverage],
    quantity: MotionQuantity,
) -> Vec<FrfCurve> {
    let chosen = choose(points, &|impact, channel| find(cells, impact, channel).is_some());
    let curve = |(role, impact, channel): (Role, &Point, &Point)| {
        Some(of_cell(points, configuration, (role, impact, channel), find(cells, impact, channel)?, quantity))
    };
    chosen.into_iter().filter_map(curve).collect()
}

/// The driving point compared with its own noise.
pub fn noise_floor(
    configuration: Structure,
    points: &Configuration,
    cells: &[CellAverage],
    quantity: MotionQuantity,
) -> Option<NoiseFloor> {
    let chosen = choose(points, &|impact, channel| find(cells, impact, channel).is_some());
    let (_, impact, channel) = chosen.into_iter().find(|(role, ..)| *role == Role::DrivingPoint)?;
    let y = &find(cells, impact, channel)?.spectra;
    if y.hits() < 2 {
        return None;
    }
    let order = quantity.order_of_s();
    let lines = || 0..y.lines();
    let axis = component_of(points, channel).min(y.outputs().saturating_sub(1));
    let magnitude = |l: usize| (y.h1(l, axis) * y.s(l).powi(-order)).norm();
    let frequency_hz = y.frequency_hz();
    let first_hz = frequency_hz.first().copied().unwrap_or(0.0);
    Some(NoiseFloor {
        configuration: configuration.into(),
        output: channel.description.clone(),
        input: impact.name.clone(),
        first_hz,
        step_hz: frequency_hz.get(1).map_or(0.0, |second| second - first_hz),
        magnitude_m_per_n: lines().map(|l| rounded(magnitude(l), 5)).collect(),
        noise_m_per_n: lines()
            .map(|l| rounded(y.variance(l, axis).sqrt() * y.s(l).norm().powi(-order), 5))
            .collect(),
        dynamic_stiffness_n_per_m: lines().map(|l| rounded(1.0 / magnitude(l), 5)).collect(),
    })
}

fn of_cell(
    points: &Configuration,
    configuration: Structure,
    pair: (Role, &Point, &Point),
    cell: &CellAverage,
    quantity: MotionQuantity,
) -> FrfCurve {
    let order = quantity.order_of_s();
    let y = &cell.spectra;
    let axis = component_of(points, pair.2).min(y.outputs().saturating_sub(1));
    // responses are positive along the channel's own direction
    let sign = pair.2.direction[2].signum();
    let receptance = (0..y.lines()).map(|line| y.h1(line, axis) * y.s(line).powi(-order) * sign);
    let several = cell.records.len() > 1;
    let coherence = (0..y.lines()).filter(|_| several).map(|line| y.coherence(line, axis));
    FrfCurve {
        hits: cell.records.len(),
        coherence: coherence.map(|c| rounded(if c.is_finite() { c } else { 0.0 }, 5)).collect(),
        ..curve(configuration, pair, y.frequency_hz(), receptance)
    }
}

/// The curves of imported FRFs; empty if their lines are not evenly spaced.
pub fn of_matrix(configuration: Structure, points: &Configuration, frf: &Frf) -> Vec<FrfCurve> {
    let place = |names: &[String], name: &str| names.iter().position(|n| n == name);
    let (outputs, inputs) = (points.output_names(), points.input_names());
    let find = |impact: &Point, channel: &Point| {
        let output = points.channels.iter().position(|p| p == channel)?;
        let input = points.impacts.iter().position(|p| p == impact)?;
        Some((place(frf.outputs(), &outputs[output])?, place(frf.inputs(), &inputs[input])?))
    };
    let steps = || frf.frequency_hz().windows(2).map(|pair| pair[1] - pair[0]);
    let first = steps().next().unwrap_or(0.0);
    // files give the axis with about six digits
    let even = steps().all(|step| (step - first).abs() <= 1e-3 * first);
    let (true, Ok(y)) = (even, frf.to_receptance()) else { return Vec::new() };
    let chosen = choose(points, &|impact, channel| find(impact, channel).is_some());
    let curve = |(role, impact, channel): (Role, &Point, &Point)| {
        let place = find(impact, channel)?;
        // responses are positive along the channel's own direction
        let sign = channel.direction[2].signum();
        let values = y.lines().iter().map(|y| y[place] * sign);
        Some(curve(configuration, (role, impact, channel), y.frequency_hz(), values))
    };
    chosen.into_iter().filter_map(curve).collect()
}

/// Driving point: the response along z nearest to an impact along z. Transfer: the same impact,
/// with the response across the joint in the assembly, otherwise at the far end. `measured` returns
/// whether a pair of impact and channel exists.
fn choose<'p>(
    points: &'p Configuration,
    measured: &dyn Fn(&Point, &Point) -> bool,
) -> Vec<(Role, &'p Point, &'p Point)> {
    // the specimens' motion is shown with the contact
    let along_z = |p: &&Point| p.direction[2].abs() > 0.9 && !p.grouping.is_specimen();
    let mut pairs: Vec<(&Point, &Point, f64)> = Vec::new();
    for impact in points.impacts.iter().filter(along_z) {
        for channel in points.channels.iter().filter(along_z).filter(|c| measured(impact, c)) {
            pairs.push((impact, channel, (impact.position() - channel.position()).norm()));
        }
    }
    let same_side = |a: &Point, b: &Point| on_a(a.grouping) == on_a(b.grouping);
    let driving = pairs
        .iter()
        .filter(|(i, c, _)| same_side(i, c))
        // in the assembly an impact on A is preferred
        .min_by(|x, y| {
            (!on_a(x.0.grouping), x.2)
                .partial_cmp(&(!on_a(y.0.grouping), y.2))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
    let Some(driving) = driving else { return Vec::new() };
    let others = || pairs.iter().filter(|(i, c, _)| i.name == driving.0.name && c.name != driving.1.name);
    let across = others().filter(|(i, c, _)| !same_side(i, c)).min_by(|x, y| x.2.total_cmp(&y.2));
    let transfer = across.or_else(|| others().max_by(|x, y| x.2.total_cmp(&y.2)));
    [(Role::DrivingPoint, Some(driving)), (Role::Transfer, transfer)]
        .into_iter()
        .filter_map(|(role, pair)| pair.map(|(impact, channel, _)| (role, *impact, *channel)))
        .collect()
}

/// One point of each arm along z, excited at `impact` in the assembly, for comparison with the
/// specimens.
pub fn arms(
    impact: &str,
    points: &Configuration,
    cells: &[CellAverage],
    quantity: MotionQuantity,
) -> Vec<FrfCurve> {
    let Some(hit) = points.impacts.iter().find(|p| p.name == impact) else { return Vec::new() };
    let arm = |role: Role, grouping: Grouping| {
        let measured = |channel: &&Point| channel.grouping == grouping && channel.direction[2].abs() > 0.9;
        points.channels.iter().filter(measured).find_map(|channel| {
            let own = |c: &&CellAverage| c.name.impact == impact && c.name.response == channel.name;
            let cell = cells.iter().filter(|c| c.name.configuration == Structure::Ajb).find(own)?;
            Some(of_cell(points, Structure::Ajb, (role, hit, channel), cell, quantity))
        })
    };
    let both = [arm(Role::ArmA, Grouping::InterfaceA), arm(Role::ArmB, Grouping::InterfaceB)];
    both.into_iter().flatten().collect()
}

/// Receptance along the two directions, with hit and response both positive along z: a driving
/// point starts at 0°.
fn curve(
    configuration: Structure,
    (role, impact, channel): (Role, &Point, &Point),
    frequency_hz: &[f64],
    receptance: impl Iterator<Item = Complex<f64>>,
) -> FrfCurve {
    let sign = impact.direction[2].signum();
    let (magnitude_m_per_n, phase_deg) = receptance
        .map(|y| y * sign)
        .map(|y| (rounded(y.norm(), 5), rounded(y.arg().to_degrees(), 5)))
        .unzip();
    let first_hz = frequency_hz.first().copied().unwrap_or(0.0);
    FrfCurve {
        configuration: configuration.into(),
        role,
        output: channel.description.clone(),
        input: impact.name.clone(),
        hits: 0,
        first_hz,
        step_hz: frequency_hz.get(1).map_or(0.0, |second| second - first_hz),
        magnitude_m_per_n,
        phase_deg,
        coherence: Vec::new(),
    }
}

fn on_a(grouping: Grouping) -> bool {
    matches!(grouping, Grouping::InterfaceA | Grouping::InternalA)
}

/// Number of lines at which coherence is reported: enough to show every dip, few enough to show all
/// cells.
const SHOWN_LINES: usize = 140;

/// Data quality of all cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DataQuality {
    /// Frequencies at which coherence is reported, Hz: lines of the first cell, which all cells
    /// share.
    pub frequency_hz: Vec<f64>,
    /// The cells, in the order in which they were averaged.
    pub cells: Vec<CellQuality>,
}

/// Data quality of one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellQuality {
    /// The cell.
    pub name: CellName,
    /// Coherence at [`DataQuality::frequency_hz`].
    pub coherence: Vec<f64>,
    /// Relative random error of the magnitude of H1: median over the main band; `None` with fewer
    /// than two hits.
    pub random_error: Option<f64>,
}

/// Indices of logarithmically spaced lines, without duplicates.
fn shown(frequency_hz: &[f64]) -> Vec<usize> {
    let (Some(first), Some(last)) = (frequency_hz.first(), frequency_hz.last()) else { return Vec::new() };
    let mut lines: Vec<usize> = (0..SHOWN_LINES)
        .map(|i| first * (last / first).powf(i as f64 / (SHOWN_LINES - 1) as f64))
        .map(|f| frequency_hz.partition_point(|line| *line < f).min(frequency_hz.len() - 1))
        .collect();
    lines.dedup();
    lines
}

/// Data quality of all cells.
pub fn data_quality(geometry: &Geometry, cells: &[CellAverage]) -> DataQuality {
    let lines = cells.first().map_or(&[][..], |cell| cell.spectra.frequency_hz());
    DataQuality {
        frequency_hz: shown(lines).into_iter().map(|line| lines[line]).collect(),
        cells: cells.iter().map(|cell| one(geometry, cell)).collect(),
    }
}

fn one(geometry: &Geometry, cell: &CellAverage) -> CellQuality {
    let y = &cell.spectra;
    let axis = along_the_hit(geometry, &cell.name).min(y.outputs().saturating_sub(1));
    let several = y.hits() > 1;
    let value = |line: usize| y.coherence(line, axis).clamp(0.0, 1.0);
    let lines = if several { shown(y.frequency_hz()) } else { Vec::new() };
    let error = |line: usize| y.variance(line, axis).sqrt() / y.h1(line, axis).norm();
    let mut errors: Vec<f64> =
        (0..y.lines()).filter(|l| several && MAIN_BAND.contains(y.frequency_hz()[*l])).map(error).collect();
    errors.sort_by(f64::total_cmp);
    CellQuality {
        name: cell.name.clone(),
        coherence: lines.into_iter().map(|l| rounded(value(l), 3)).collect(),
        random_error: errors.get(errors.len() / 2).map(|e| rounded(*e, 4)),
    }
}

/// The channel of the cell's location whose direction is closest to that of the hit.
fn along_the_hit(geometry: &Geometry, name: &CellName) -> usize {
    let points = geometry.points(name.configuration);
    let Some(hit) = points.impacts.iter().find(|p| p.name == name.impact) else { return 0 };
    let felt = |p: &Point| (0..3).map(|i| p.direction[i] * hit.direction[i]).sum::<f64>().abs();
    let own = points.channels.iter().filter(|p| p.name == name.response).enumerate();
    own.max_by(|a, b| felt(a.1).total_cmp(&felt(b.1))).map_or(0, |(place, _)| place)
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn lines_are_spread_over_the_logarithm_and_stand_once() {
        let lines: Vec<f64> = (0..1981).map(|i| 10.0 + 0.5 * f64::from(i)).collect();
        let found = shown(&lines);
        assert!(found.len() > 100 && found.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((found[0], found.last().copied()), (0, Some(1980)));
        assert!(shown(&[]).is_empty());
    }
}
