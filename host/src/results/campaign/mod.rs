//! From a campaign to results: everything is computed from the campaign file alone.
//!
//! Cells are read one at a time on each thread and averaged at once, so that memory holds the signals of a few
//! cells, never of a campaign. What is missing is said in [`Results::missing`] and done without: hysteresis needs the
//! assembly only, substructuring needs all three configurations.

mod assemble;
mod at_contact;
mod averages;
mod back_coupling;
mod cell;
mod checks;
mod chosen;
mod contact;
mod fitted;
mod from_store;
mod hit_spectra;
mod imported;
mod interface;
mod interface_checks;
mod joint;
mod line_noise;
mod loops;
mod phase_split;
mod recommended;
mod shaker;
mod static_arm;
#[cfg(test)]
mod synthetic;

pub use assemble::Measured;
pub use back_coupling::BACK_COUPLING;
pub use cell::{Cell, CellName, ContactDelays, ContactSignals, Hit, KnownContact, Measurements, ShakerLevel};
pub use checks::{HIDDEN_RESONANCE, SERIES_COMPLIANCE};
pub use contact::DIRECT;
pub use from_store::{AnalyseError, CampaignFile, analyse, geometry};
pub use interface::fill;
pub use interface_checks::{INTERFACE_MODES, INTERNALS, SAME_IN_ALL};

use super::{Completeness, MAIN_BAND_HZ, Results, UsableBand, ranges};
use crate::spectra::{Windowing, usable_band};
use crate::substructuring::Band;
use crate::substructuring::averaged::{CellHits, Priors};
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping};
use crate::substructuring::identify::identify;
use crate::substructuring::idm::IdmSet;
use crate::substructuring::method::Method;
use crate::substructuring::noise::FrfNoise;
use at_contact::at_the_contact;
use averages::{CellAverage, FORCE_LINES, LINES_HZ, average};
use loops::ImpactLoop;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The bands that means are taken over, Hz; the first is the main one.
pub const BANDS_HZ: [[f64; 2]; 3] = [MAIN_BAND_HZ, [100.0, 800.0], [100.0, 300.0]];

/// The methods whose spectra a campaign's results keep and show; of all others they keep the bands.
const SHOWN: [Method; 3] = [Method::Internal, Method::InternalPrinted, Method::Inverse];

/// What is wanted beyond the usual, and what is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// Replicates of the bootstrap over hits; 0 for none.
    pub replicates: usize,
    /// Contact and static arm.
    pub known: KnownContact,
}

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
    hits: Option<CellHits>,
    loops: Vec<ImpactLoop>,
    complaints: Vec<String>,
}

/// Fills `results` (which has its source already) from the measurements.
pub fn analyse_measurements<M: Measurements>(
    measurements: &M,
    mut results: Results,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Results {
    let cells = measurements.cells();
    let geometry = measurements.geometry();
    let sigma = measurements.sigma_per_s();
    let done = AtomicUsize::new(0);
    let outcomes: Vec<CellOutcome> = cells
        .par_iter()
        .map(|name| {
            let outcome = one_cell(measurements, geometry, name, wanted.replicates > 0);
            progress(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total: cells.len() });
            outcome
        })
        .collect();
    let mut averages = Vec::new();
    let mut impact_loops = Vec::new();
    let mut hits = Vec::new();
    for outcome in outcomes {
        averages.extend(outcome.average);
        hits.extend(outcome.hits);
        impact_loops.extend(outcome.loops);
        results.missing.extend(outcome.complaints);
    }
    note_given_up(&mut results, &cells, measurements.given_up());
    note_settings(&mut results, sigma);
    let mut frfs: [Option<FrfMatrix>; 3] = [None, None, None];
    let mut noises: [Option<FrfNoise>; 3] = [None, None, None];
    for (place, (name, points)) in configurations(geometry).into_iter().enumerate() {
        let planned = cells.iter().filter(|c| c.configuration == name).count();
        let own: Vec<CellAverage> =
            averages.iter().filter(|a| a.name.configuration == name).cloned().collect();
        if let Some(imported) = imported::of(measurements, &mut results, name, own.len()) {
            results.frfs.extend(chosen::of_matrix(name, points, &imported.frf));
            frfs[place] = Some(imported.frf);
            noises[place] = imported.noise;
            continue;
        }
        note_missing(&mut results, name, planned, &own);
        let records = ranges(own.iter().flat_map(|c| c.records.iter().copied()));
        if !records.is_empty() {
            results.source.records.insert(name.into(), records);
        }
        results.usable_bands.extend(force_band(name, &own));
        results.frfs.extend(chosen::of_cells(name, points, &own, measurements.quantity()));
        let assembled = assemble::assemble(name, points, &own, measurements.quantity());
        if assembled.measured.is_some() {
            note_left_out(&mut results, name, "impacts", &assembled.impacts_left_out);
            note_left_out(&mut results, name, "response locations", &assembled.responses_left_out);
        }
        (frfs[place], noises[place]) = assembled.measured.map(|m| (m.frf, m.noise)).unzip();
    }
    substructure(&mut results, geometry, &frfs, &noises);
    if let Some(ajb) = &frfs[2] {
        recommended::fill(&mut results, geometry, ajb, noises[2].as_ref(), &hits, wanted);
    }
    fitted::fill(&mut results, geometry, &frfs, &noises);
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

/// Whether hits at this impact drive the load cells through arm B alone: what the static arm is identified from.
fn drives_the_cells(geometry: &Geometry, name: &CellName) -> bool {
    name.configuration == "B"
        && geometry.b.impacts.iter().any(|p| p.name == name.impact && p.grouping == Grouping::InterfaceB)
}

fn one_cell<M: Measurements>(
    measurements: &M,
    geometry: &Geometry,
    name: &CellName,
    keep_hits: bool,
) -> CellOutcome {
    let mut outcome = CellOutcome { average: None, hits: None, loops: Vec::new(), complaints: Vec::new() };
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
            match loops::of_hit(hit.record, &name.impact, cell.fs_hz, signals, signals.delay_s) {
                Ok(found) => outcome.loops.push(found),
                Err(error) => {
                    outcome
                        .complaints
                        .push(complaint(&format!("record {} gives no loop: {error}", hit.record)));
                }
            }
        }
    }
    let contact = contact || drives_the_cells(geometry, name);
    if keep_hits {
        match hit_spectra::of(name, &geometry.ajb, &cell, measurements.sigma_per_s(), measurements.quantity())
        {
            Ok(hits) => outcome.hits = hits,
            Err(error) => outcome.complaints.push(complaint(&error)),
        }
    }
    match average(name.clone(), cell, measurements.sigma_per_s(), measurements.quantity(), contact, LINES_HZ)
    {
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
    settings.insert("lines_hz".into(), serde_json::json!(LINES_HZ));
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
    let frequency_hz: Vec<f64> = (0..mean.len())
        .map(|block| first.step_hz * ((block * FORCE_LINES) as f64 + 0.5 * (FORCE_LINES - 1) as f64))
        .collect();
    let band = usable_band(&frequency_hz, &mean, 6.0)?;
    Some(UsableBand { configuration: name.into(), band_hz: [band.low_hz, band.high_hz] })
}

fn substructure(
    results: &mut Results,
    geometry: &Geometry,
    frfs: &[Option<FrfMatrix>; 3],
    noises: &[Option<FrfNoise>; 3],
) {
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
    match identify(a, b, ajb, geometry, &Method::ALL, &IdmSet::ALL, &bands) {
        Ok(found) => {
            let noises = noises.each_ref().map(Option::as_ref);
            interface::fill(results, [a, b, ajb], noises, geometry, &Priors::default(), &found);
            if let Some(spectrum) = &mut results.joint_spectrum {
                spectrum.curves.retain(|c| SHOWN.iter().any(|m| m.name() == c.method));
            }
        }
        Err(error) => results.missing.push(format!("Substructuring was not possible: {error}.")),
    }
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
