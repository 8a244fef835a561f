//! The lowest mode of the assembly over the campaign, from every hit that moves the contact: the
//! check that nothing changed while it was hit.
//!
//! Each hit gives a frequency ([`follow`]) with its own interval. Frequencies of one place of
//! impact share errors that do not depend on time (neighbouring modes, cut-off), so each cell is
//! compared with the mean of its place of impact, as for the contact's drift; the scatter of the
//! cells about a straight line over the hits gives the interval of the change.

use super::cells_stage::HitAtContact;
use super::modal::FoundModes;
use crate::contact::Interval;
use crate::hysteresis::hammer_slip::{HitResponse, LEAD_S, LENGTH_S, SIGMA_PER_S};
use crate::modes::{Followed, Mode, follow};
use crate::results::{FirstMode, HitFrequency, SessionFrequency};
use crate::structure::Structure;
use crate::substructuring::joint_over_bands::NORMAL_95;
use num_complex::Complex;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Lines within this distance of the mode are used, as a fraction of its frequency, and at least
/// [`LEAST_LINES`] on each side.
const NEAR: f64 = 0.15;
const LEAST_LINES: f64 = 8.0;

/// A hit has enough signal if the standard deviation of its frequency is below this fraction.
const ENOUGH: f64 = 2e-3;

/// Largest part of a hit's signal that the fit may leave ([`Followed::left`]): beyond, a mode that
/// was not identified changes the frequency, by more than its standard deviation says.
const LEFT: f64 = 0.05;

/// The mode is followed if this fraction of the hits has enough signal.
const MOST: f64 = 0.5;

/// Fewest cells of a place of impact: below, their scatter about a straight line is not known.
const FEWEST_CELLS: usize = 4;

/// The size of a change is reported up to this fraction of the distance to the nearest other mode.
/// The poles of the other modes are fixed at those of the averaged FRFs: a larger change smears
/// these, and then the size and even the sign found are wrong.
const REPORTED: f64 = 0.2;

/// A change is certain beyond this many standard deviations.
const CERTAIN: f64 = 4.0;

/// Relative changes below this are no concern: motion left by the last hit and the force's scatter
/// change the frequency found by as much.
const MUCH: f64 = 3e-4;

/// The lowest mode that most hits show, from all hits that move the contact in the order of cells;
/// `session` gives the session of a record. `None` if they show none.
pub fn first_mode(
    modes: &[FoundModes],
    hits: &[HitAtContact],
    session: impl Fn(i64) -> Option<i64>,
) -> Option<FirstMode> {
    let assembly = modes.iter().find(|found| found.structure == Some(Structure::Ajb))?;
    let all = &assembly.modes.modes;
    all.iter().find_map(|mode| {
        let found: Vec<(&HitAtContact, Followed)> =
            hits.iter().filter_map(|hit| Some((hit, of_hit(&hit.response, mode, all)?))).collect();
        let distances = all.iter().filter(|other| *other != mode);
        let nearest_hz = distances
            .map(|other| (other.frequency_hz - mode.frequency_hz).abs())
            .fold(f64::INFINITY, f64::min);
        (found.len() as f64 > MOST * hits.len() as f64)
            .then(|| summary(mode, nearest_hz, &found, hits.len(), &session))
    })
}

/// The frequency of `mode` in one hit; `None` without enough signal.
fn of_hit(hit: &HitResponse, mode: &Mode, all: &[Mode]) -> Option<Followed> {
    let reach = (NEAR * mode.frequency_hz).max(LEAST_LINES * hit.step_hz);
    let band = [mode.frequency_hz - reach, mode.frequency_hz + reach];
    let lines: Vec<usize> = hit.lines(band).collect();
    // the lines must begin well below the mode
    if hit.first_hz > mode.frequency_hz - 0.5 * reach {
        return None;
    }
    let s: Vec<Complex<f64>> =
        lines.iter().map(|l| Complex::new(SIGMA_PER_S, TAU * hit.frequency_hz(*l))).collect();
    let neighbours: Vec<Complex<f64>> = all
        .iter()
        .filter(|other| *other != mode && (band[0]..band[1]).contains(&other.frequency_hz))
        .map(|other| other.pole_per_s)
        .collect();
    let outputs = hit.per_newton.each_ref().map(|signal| lines.iter().map(|l| signal[*l]).collect());
    let found = follow(&s, &outputs, LENGTH_S - LEAD_S, mode.pole_per_s, &neighbours)?;
    let near = (found.frequency_hz - mode.frequency_hz).abs() < 0.5 * reach;
    log::debug!("{:.2} Hz ± {:.3}, left {:.3}", found.frequency_hz, found.frequency_std_hz, found.left);
    (near && found.left < LEFT && found.frequency_std_hz < ENOUGH * found.frequency_hz).then_some(found)
}

fn summary(
    mode: &Mode,
    nearest_hz: f64,
    found: &[(&HitAtContact, Followed)],
    hits: usize,
    session: &impl Fn(i64) -> Option<i64>,
) -> FirstMode {
    let row = |(hit, followed): &(&HitAtContact, Followed)| HitFrequency {
        record: hit.record,
        session: session(hit.record),
        impact: hit.cell.impact.clone(),
        frequency_hz: followed.frequency_hz,
        ci95: [-1.0, 1.0].map(|sign| followed.frequency_hz + sign * NORMAL_95 * followed.frequency_std_hz),
    };
    let mut rows: Vec<HitFrequency> = found.iter().map(row).collect();
    rows.sort_by_key(|row| row.record);
    let change = Change::of(found);
    let drifts = change.and_then(|change| change.certain(mode.frequency_hz));
    FirstMode {
        mode_hz: mode.frequency_hz,
        hits_tried: hits,
        sessions: sessions(found, session),
        change_hz: change.filter(|change| change.change_hz.abs() < REPORTED * nearest_hz).map(|change| {
            Interval {
                mean: change.change_hz,
                ci95: [-1.0, 1.0].map(|sign| change.change_hz + sign * NORMAL_95 * change.std_hz),
            }
        }),
        drifts,
        meaning: String::new(),
        hits: rows,
    }
}

/// Mean frequency of each session, as a deviation from the mean of its place of impact added to the
/// mean of all.
fn sessions(
    found: &[(&HitAtContact, Followed)],
    session: &impl Fn(i64) -> Option<i64>,
) -> Vec<SessionFrequency> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let all = mean(&found.iter().map(|(_, f)| f.frequency_hz).collect::<Vec<_>>());
    let mut of_impact: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (hit, followed) in found {
        of_impact.entry(&hit.cell.impact).or_default().push(followed.frequency_hz);
    }
    let mut of_session: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (hit, followed) in found {
        if let Some(session) = session(hit.record) {
            let usual = mean(&of_impact[hit.cell.impact.as_str()]);
            of_session.entry(session).or_default().push(all + followed.frequency_hz - usual);
        }
    }
    let one = |(session, values): (i64, Vec<f64>)| {
        let (n, centre) = (values.len() as f64, mean(&values));
        let scatter = values.iter().map(|v| (v - centre).powi(2)).sum::<f64>();
        let half = NORMAL_95 * (scatter / ((n - 1.0).max(1.0) * n)).sqrt();
        // the scatter of a single hit is not known
        let ci95 = (values.len() > 1).then_some([centre - half, centre + half]);
        SessionFrequency { session, hits: values.len(), frequency_hz: centre, ci95 }
    };
    of_session.into_iter().map(one).collect()
}

/// Change of the frequency from the first hit to the last.
#[derive(Debug, Clone, Copy)]
struct Change {
    change_hz: f64,
    std_hz: f64,
}

impl Change {
    /// `None` with too few cells.
    fn of(found: &[(&HitAtContact, Followed)]) -> Option<Self> {
        // time and frequency of each cell, by place of impact
        let mut impacts: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
        for own in found.chunk_by(|a, b| a.0.cell == b.0.cell) {
            let mean = |value: &dyn Fn(&(&HitAtContact, Followed)) -> f64| {
                own.iter().map(value).sum::<f64>() / own.len() as f64
            };
            let point = [mean(&|(hit, _)| hit.record as f64), mean(&|(_, f)| f.frequency_hz)];
            impacts.entry(&own[0].0.cell.impact).or_default().push(point);
        }
        impacts.retain(|_, cells| cells.len() >= FEWEST_CELLS);
        let cells = || impacts.values().flatten();
        let last = cells().map(|[t, _]| *t).fold(f64::NEG_INFINITY, f64::max);
        let duration = last - cells().map(|[t, _]| *t).fold(f64::INFINITY, f64::min);
        let mut points: Vec<[f64; 2]> = Vec::new();
        for own in impacts.values() {
            let n = own.len() as f64;
            let mean = |k: usize| own.iter().map(|point| point[k]).sum::<f64>() / n;
            points.extend(own.iter().map(|[t, f]| [t - mean(0), f - mean(1)]));
        }
        let squares: f64 = points.iter().map(|[t, _]| t * t).sum();
        let slope = points.iter().map(|[t, f]| t * f).sum::<f64>() / squares;
        let rest: f64 = points.iter().map(|[t, f]| (f - slope * t).powi(2)).sum();
        let freedom = points.len().checked_sub(impacts.len() + 1).filter(|n| *n > 0)? as f64;
        let std_hz = duration * (rest / freedom / squares).sqrt();
        let found = Change { change_hz: duration * slope, std_hz };
        (found.change_hz.is_finite() && found.std_hz > 0.0).then_some(found)
    }

    /// Whether the frequency changed; `None` if that is not clear.
    fn certain(&self, frequency_hz: f64) -> Option<bool> {
        let concern = MUCH * frequency_hz;
        if self.change_hz.abs() > concern.max(CERTAIN * self.std_hz) {
            Some(true)
        } else {
            (self.change_hz.abs() + 2.0 * self.std_hz < 5.0 * concern).then_some(false)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyse::CellName;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Three places of impact with six cells of three hits, whose frequency rises by `change_hz`
    /// from the first to the last and scatters from cell to cell by 0.1 Hz.
    fn change(seed: u64, change_hz: f64) -> Change {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut hits = Vec::new();
        for cell in 0..18 {
            let of_cell = 0.1 * normal() + f64::from(cell / 6);
            for hit in 0..3 {
                let record = i64::from(3 * cell + hit);
                let frequency_hz = 200.0 + of_cell + change_hz * record as f64 / 53.0 + 0.01 * normal();
                let response = HitResponse {
                    impulse_n_s: 0.01,
                    peak_n: 50.0,
                    peak_tangential_n: 10.0,
                    first_hz: 60.0,
                    step_hz: 3.0,
                    per_newton: Default::default(),
                };
                let cell = CellName {
                    configuration: Structure::Ajb,
                    impact: format!("Z{}", cell / 6),
                    response: format!("A{cell}"),
                };
                let pole_per_s = Complex::new(-1.0, TAU * frequency_hz);
                let followed = Followed { pole_per_s, frequency_hz, frequency_std_hz: 0.01, left: 0.0 };
                hits.push((HitAtContact { cell, record, response }, followed));
            }
        }
        let found: Vec<_> = hits.iter().map(|(hit, followed)| (hit, *followed)).collect();
        Change::of(&found).expect("enough cells")
    }

    #[test]
    fn a_change_is_found_with_its_size_and_none_without() {
        let (mut claimed, mut squares) = (0, 0.0);
        for seed in 0..300 {
            let none = change(seed, 0.0);
            squares += (none.change_hz / none.std_hz).powi(2);
            claimed += u32::from(none.certain(200.0) == Some(true));
            let some = change(1000 + seed, 4.0);
            assert_eq!(some.certain(200.0), Some(true), "{some:?}");
            assert!((some.change_hz - 4.0).abs() < 6.0 * some.std_hz, "{some:?}");
        }
        assert!(claimed <= 2, "{claimed} of 300 steady campaigns");
        let rms = f64::sqrt(squares / 300.0);
        assert!((0.9..1.25).contains(&rms), "{rms}");
    }
}
