//! From a campaign to results: everything is computed from the campaign file alone.
//!
//! Cells are read one at a time on each thread and averaged at once, so that memory holds the signals of a few
//! cells, never of a campaign. What is missing is said in [`Results::missing`] and done without: hysteresis needs the
//! assembly only, substructuring needs all three configurations.

mod assemble;
mod averages;
mod cell;
mod checks;
mod chosen;
mod contact;
mod from_store;
mod joint;
mod loops;
#[cfg(test)]
mod synthetic;

pub use cell::{Cell, CellName, ContactDelays, ContactSignals, Hit, Measurements};
pub use checks::{HIDDEN_RESONANCE, SERIES_COMPLIANCE, UNIDENTIFIED};
pub use contact::DIRECT;
pub use from_store::{AnalyseError, analyse, geometry};
pub use joint::shaped;

use super::{Completeness, MAIN_BAND_HZ, Refusal, Results, UsableBand, ranges, words};
use crate::spectra::{Windowing, usable_band};
use crate::substructuring::averaged::{Priors, averaged};
use crate::substructuring::fit;
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping};
use crate::substructuring::identify::identify;
use crate::substructuring::idm::IdmSet;
use crate::substructuring::joint::Band;
use crate::substructuring::method::Method;
use averages::{CellAverage, ContactAverage, HIGHEST_HZ, LOWEST_HZ, average};
use contact::{ContactCompliance, specimen_curves};
use loops::ImpactLoop;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The bands that means are taken over, Hz; the first is the main one.
pub const BANDS_HZ: [[f64; 2]; 3] = [MAIN_BAND_HZ, [100.0, 800.0], [100.0, 300.0]];

/// The methods that a campaign is analysed with.
pub const METHODS: [Method; 2] = [Method::Internal, Method::InternalPrinted];

const CONFIGURATIONS: [&str; 3] = ["A", "B", "AJB"];

/// How far the analysis is: cells done, and cells in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Cells done.
    pub done: usize,
    /// Cells in all.
    pub total: usize,
}

/// What came of one cell.
struct CellOutcome {
    average: Option<CellAverage>,
    loops: Vec<ImpactLoop>,
    complaints: Vec<String>,
}

/// Fills `results` (which has its source already) from the measurements.
pub fn analyse_measurements<M: Measurements>(
    measurements: &M,
    mut results: Results,
    progress: &(dyn Fn(Progress) + Sync),
) -> Results {
    let cells = measurements.cells();
    let geometry = measurements.geometry();
    let sigma = measurements.sigma_per_s();
    let done = AtomicUsize::new(0);
    let outcomes: Vec<CellOutcome> = cells
        .par_iter()
        .map(|name| {
            let outcome = one_cell(measurements, geometry, name);
            progress(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total: cells.len() });
            outcome
        })
        .collect();
    let mut averages = Vec::new();
    let mut impact_loops = Vec::new();
    for outcome in outcomes {
        averages.extend(outcome.average);
        impact_loops.extend(outcome.loops);
        results.missing.extend(outcome.complaints);
    }
    note_given_up(&mut results, &cells, measurements.given_up());
    note_settings(&mut results, sigma);
    let mut frfs: [Option<FrfMatrix>; 3] = [None, None, None];
    for (place, (name, points)) in configurations(geometry).into_iter().enumerate() {
        let planned = cells.iter().filter(|c| c.configuration == name).count();
        let own: Vec<CellAverage> =
            averages.iter().filter(|a| a.name.configuration == name).cloned().collect();
        note_missing(&mut results, name, planned, &own);
        let records = ranges(own.iter().flat_map(|c| c.records.iter().copied()));
        if !records.is_empty() {
            results.source.records.insert(name.into(), records);
        }
        results.usable_bands.extend(force_band(name, &own));
        results.frfs.extend(chosen::curves(name, points, &own, sigma, measurements.quantity()));
        let assembled = assemble::assemble(name, points, &own, sigma, measurements.quantity());
        if assembled.frf.is_some() {
            note_left_out(&mut results, name, "impacts", &assembled.impacts_left_out);
            note_left_out(&mut results, name, "response locations", &assembled.responses_left_out);
        }
        frfs[place] = assembled.frf;
    }
    substructure(&mut results, geometry, &frfs);
    recommend(&mut results, geometry, &frfs, &averages);
    fitted(&mut results, geometry, &frfs, &averages);
    at_the_contact(&mut results, measurements, &averages, &impact_loops, sigma);
    results
}

fn configurations(geometry: &Geometry) -> [(&'static str, &Configuration); 3] {
    [(CONFIGURATIONS[0], &geometry.a), (CONFIGURATIONS[1], &geometry.b), (CONFIGURATIONS[2], &geometry.ajb)]
}

/// Whether hits at this impact move the contact along z from A's side: hits on B drive the load cells directly, and hits
/// along x move nothing in z.
fn counts_for_contact(geometry: &Geometry, name: &CellName) -> bool {
    name.configuration == "AJB"
        && geometry.ajb.impacts.iter().any(|p| {
            p.name == name.impact
                && matches!(p.grouping, Grouping::InterfaceA | Grouping::InternalA)
                && p.direction[2].abs() > 0.9
        })
}

fn one_cell<M: Measurements>(measurements: &M, geometry: &Geometry, name: &CellName) -> CellOutcome {
    let mut outcome = CellOutcome { average: None, loops: Vec::new(), complaints: Vec::new() };
    let complaint = |what: &dyn std::fmt::Display| {
        format!("{}: cell {} × {}: {what}.", name.configuration, name.impact, name.response)
    };
    let cell = match measurements.read(name) {
        Ok(cell) => cell,
        Err(error) => {
            outcome.complaints.push(complaint(&error));
            return outcome;
        }
    };
    outcome.complaints.extend(cell.left_out.iter().map(|what| complaint(what)));
    if cell.hits.is_empty() {
        return outcome;
    }
    let contact = counts_for_contact(geometry, name);
    if contact {
        for hit in &cell.hits {
            let Some(signals) = &hit.contact else { continue };
            match loops::of_hit(hit.record, &name.impact, cell.fs_hz, signals, cell.contact_delay_s) {
                Ok(found) => outcome.loops.push(found),
                Err(error) => {
                    outcome
                        .complaints
                        .push(complaint(&format!("record {} gives no loop: {error}", hit.record)));
                }
            }
        }
    }
    match average(name.clone(), cell, measurements.sigma_per_s(), measurements.quantity(), contact) {
        Ok(averaged) => outcome.average = Some(averaged),
        Err(error) => outcome.complaints.push(complaint(&error)),
    }
    outcome
}

fn note_settings(results: &mut Results, sigma_per_s: f64) {
    let window = Windowing::default();
    let settings = &mut results.source.settings;
    settings.insert("exponential_window_per_s".into(), sigma_per_s.into());
    settings
        .insert("force_window_s".into(), serde_json::json!([-window.force_before_s, window.force_after_s]));
    settings.insert("estimator".into(), "H1 on s = σ + iω".into());
    settings.insert("lines_hz".into(), serde_json::json!([LOWEST_HZ, HIGHEST_HZ]));
}

/// Cells given up, those of one location and one reason in one sentence.
fn note_given_up(results: &mut Results, planned: &[CellName], given_up: Vec<(CellName, String)>) {
    let mut groups: Vec<(String, String, String, Vec<String>)> = Vec::new();
    for (cell, reason) in given_up {
        let same =
            groups.iter_mut().find(|g| g.0 == cell.configuration && g.1 == cell.response && g.2 == reason);
        match same {
            Some(group) => group.3.push(cell.impact),
            None => groups.push((cell.configuration, cell.response, reason, vec![cell.impact])),
        }
    }
    for (configuration, response, reason, impacts) in groups {
        let all =
            planned.iter().filter(|c| c.configuration == configuration && c.response == response).count();
        let where_hit = match impacts.len() {
            n if n > 1 && n == all => format!("all {n} impacts"),
            n if n > 6 => format!("{n} of {all} impacts"),
            _ => impacts.join(", "),
        };
        results.missing.push(format!("{configuration}: {response} was given up for {where_hit}: {reason}."));
    }
}

fn note_missing(results: &mut Results, name: &str, planned: usize, own: &[CellAverage]) {
    let absent = planned.saturating_sub(own.len());
    if planned == 0 {
        results.missing.push(format!("{name} is not in the plan."));
    } else if own.is_empty() {
        results
            .missing
            .push(format!("{name} has not been measured: none of its {planned} cells has a kept hit."));
    } else if absent > 0 {
        results.missing.push(format!("{name}: {absent} of {planned} cells have no kept hit."));
    }
    let single = own.iter().filter(|c| c.records.len() == 1).count();
    if single > 0 {
        results
            .missing
            .push(format!("{name}: {single} cells have a single kept hit, so their coherence is not known."));
    }
}

fn note_left_out(results: &mut Results, name: &str, what: &str, left_out: &[String]) {
    if !left_out.is_empty() {
        results.missing.push(format!(
            "{name}: {what} left out of substructuring, because cells are missing: {}.",
            left_out.join(", ")
        ));
    }
}

/// Where the mean force of a configuration's hits is within 6 dB of its level.
fn force_band(name: &str, own: &[CellAverage]) -> Option<UsableBand> {
    let first = own.first()?;
    let alike = || own.iter().filter(|c| c.force_spectrum.len() == first.force_spectrum.len());
    let count = alike().count() as f64;
    let mean: Vec<f64> = (0..first.force_spectrum.len())
        .map(|l| alike().map(|c| c.force_spectrum[l]).sum::<f64>() / count)
        .collect();
    let frequency_hz: Vec<f64> = (0..mean.len()).map(|l| l as f64 * first.step_hz).collect();
    let band = usable_band(&frequency_hz, &mean, 6.0)?;
    Some(UsableBand { configuration: name.into(), band_hz: [band.low_hz, band.high_hz] })
}

fn substructure(results: &mut Results, geometry: &Geometry, frfs: &[Option<FrfMatrix>; 3]) {
    let [Some(a), Some(b), Some(ajb)] = frfs else {
        let absent: Vec<&str> =
            CONFIGURATIONS.into_iter().zip(frfs).filter(|(_, f)| f.is_none()).map(|(name, _)| name).collect();
        results.missing.push(format!("Substructuring needs A, B and AJB; missing: {}.", absent.join(", ")));
        return;
    };
    let bands: Vec<Band> = BANDS_HZ
        .into_iter()
        .filter(|b| a.frequency_hz.iter().any(|f| (b[0]..=b[1]).contains(f)))
        .map(|[low_hz, high_hz]| Band { low_hz, high_hz })
        .collect();
    match identify(a, b, ajb, geometry, &METHODS, &IdmSet::ALL, &bands) {
        Ok(found) => {
            let (joint, spectrum, refused) = shaped(&found);
            results.joint = joint;
            results.joint_spectrum = spectrum;
            results.refused = refused;
        }
        Err(error) => results.missing.push(format!("Substructuring was not possible: {error}.")),
    }
}

/// The estimates to quote, with their intervals, from the assembly alone.
fn recommend(
    results: &mut Results,
    geometry: &Geometry,
    frfs: &[Option<FrfMatrix>; 3],
    averages: &[CellAverage],
) {
    let Some(ajb) = &frfs[2] else { return };
    let own: Vec<CellAverage> =
        averages.iter().filter(|a| a.name.configuration == CONFIGURATIONS[2]).cloned().collect();
    let noise = assemble::noise(&geometry.ajb, ajb, &own);
    let priors = Priors::default();
    results.source.settings.insert("priors".into(), serde_json::json!(priors));
    for [low_hz, high_hz] in BANDS_HZ {
        let band = Band { low_hz, high_hz };
        match averaged(ajb, Some(&noise), geometry, IdmSet::Six, band, &priors) {
            Ok(estimate) => results.recommended.push(estimate),
            Err(error) => {
                results.missing.push(format!("No estimate with an interval by Eq. A.1: {error}."));
                return;
            }
        }
    }
}

/// The fit over the main band, from all three configurations and their noise.
fn fitted(
    results: &mut Results,
    geometry: &Geometry,
    frfs: &[Option<FrfMatrix>; 3],
    averages: &[CellAverage],
) {
    // what is missing of the three is said already
    let [Some(a), Some(b), Some(ajb)] = frfs else { return };
    let noise = |frf: &FrfMatrix, place: usize| {
        let (name, points) = configurations(geometry)[place];
        let own: Vec<CellAverage> =
            averages.iter().filter(|a| a.name.configuration == name).cloned().collect();
        assemble::noise(points, frf, &own)
    };
    let noises = [noise(a, 0), noise(b, 1), noise(ajb, 2)];
    let [a, b, ajb] = [(a, 0), (b, 1), (ajb, 2)].map(|(frf, i)| fit::Noisy { frf, noise: &noises[i] });
    let [low_hz, high_hz] = MAIN_BAND_HZ;
    let options = fit::Options::default();
    match fit::fit(a, b, ajb, geometry, IdmSet::Six, Band { low_hz, high_hz }, &options) {
        Ok(fitted) => results.joint.push((&fitted.row()).into()),
        Err(error) => results.refused.push(Refusal {
            method: fit::NAME.into(),
            idms: IdmSet::Six.count(),
            reason: error.to_string(),
        }),
    }
}

fn at_the_contact<M: Measurements>(
    results: &mut Results,
    measurements: &M,
    averages: &[CellAverage],
    impact_loops: &[ImpactLoop],
    sigma_per_s: f64,
) {
    results.hysteresis.extend(loops::gathered(impact_loops));
    results.impact_slopes = loops::slopes(impact_loops);
    results.example_loop = example_loop(measurements, averages, impact_loops);
    let counting: Vec<(&CellAverage, &ContactAverage)> =
        averages.iter().filter_map(|c| Some((c, c.contact.as_ref()?))).collect();
    let mut by_impact: Vec<(&str, ContactAverage)> = Vec::new();
    for (cell, contact) in &counting {
        match by_impact.iter_mut().find(|(name, _)| *name == cell.name.impact) {
            Some((_, sum)) if sum.force.len() == contact.force.len() => sum.add(contact),
            Some(_) => {}
            None => by_impact.push((&cell.name.impact, (*contact).clone())),
        }
    }
    let mut compliance = None;
    if let Some((cell, _)) = counting.first() {
        let sums: Vec<&ContactAverage> =
            by_impact.iter().map(|(_, c)| c).filter(|c| c.force.len() == cell.frequency_hz.len()).collect();
        compliance = ContactCompliance::of(&cell.frequency_hz, sigma_per_s, &sums);
        // the moving mass drives the contact as the shaker does; any other impact will do
        let geometry = measurements.geometry();
        let mass = |name: &str| {
            geometry.ajb.impacts.iter().any(|p| p.name == name && p.grouping == Grouping::InternalA)
        };
        let sign = |name: &str| {
            geometry.ajb.impacts.iter().find(|p| p.name == name).map_or(1.0, |p| p.direction[2].signum())
        };
        let shown = by_impact.iter().max_by_key(|(name, _)| mass(name));
        if let Some((name, sum)) = shown {
            results.frfs.extend(specimen_curves(name, sign(name), &cell.frequency_hz, sigma_per_s, sum));
        }
    }
    let direct = compliance.as_ref().and_then(|c| c.direct(sigma_per_s));
    let series = {
        let loops = results.impact_loops().and_then(words::slope).map(|(_, k)| k);
        checks::series_compliance(
            checks::between_the_arms(results).as_ref(),
            checks::at_the_specimens(direct.as_ref(), loops),
        )
    };
    results.joint.extend(direct);
    results.checks.push(series);
    results.checks.push(checks::hidden_resonance(compliance.as_ref()));
}

/// The signals of the hit whose slope is the middle of all, read once more.
fn example_loop<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    impact_loops: &[ImpactLoop],
) -> Option<super::LoopCurve> {
    let shown = loops::middle(impact_loops)?;
    let name = &averages.iter().find(|c| c.records.contains(&shown.record))?.name;
    let cell = measurements.read(name).ok()?;
    let hit = cell.hits.iter().find(|h| h.record == shown.record)?;
    Some(loops::drawn(shown, cell.fs_hz, hit.contact.as_ref()?, cell.contact_delay_s))
}

/// Kept and refused hits of one configuration, from counts per cell: (wanted, kept, refused by verdict).
pub fn completeness<'a>(
    name: &str,
    cells: impl IntoIterator<Item = (usize, usize, Vec<(&'a str, usize)>)>,
) -> Completeness {
    let mut sum = Completeness { configuration: name.into(), ..Completeness::default() };
    for (wanted, kept, refused) in cells {
        sum.cells += 1;
        sum.wanted += wanted;
        sum.kept += kept;
        sum.cells_complete += usize::from(kept >= wanted);
        for (verdict, count) in refused {
            *sum.refused.entry(verdict.to_owned()).or_default() += count;
        }
    }
    sum
}
