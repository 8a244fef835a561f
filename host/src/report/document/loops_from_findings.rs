//! Converts the findings on the loops to the format of the results.

use crate::analyse::{Contact, Findings, ImpactLoops, RecordLoops, SlopeIs};
use crate::hysteresis::{Kind, LoopAnalysis, OverCycles};
use crate::report::words::{level_sentences, warning_sentences};
use crate::results::{DecayStep, Force, Hysteresis, ranges};

/// The impacts together, the shaker's levels, and a separate record: each with the raw force, then
/// with the corrected one.
pub fn rows(found: &Findings) -> Vec<Hysteresis> {
    let contact = found.contact.as_ref();
    let mut rows: Vec<Hysteresis> =
        contact.and_then(|contact| contact.impacts.as_ref()).map_or_else(Vec::new, of_impacts);
    let levels = contact.map_or(&[][..], |contact| &contact.levels);
    rows.extend(of_records(levels, contact.and_then(|contact: &Contact| contact.hidden.resonance_hz())));
    rows.extend(of_records(found.record.as_slice(), None));
    rows
}

fn of_impacts(impacts: &ImpactLoops) -> Vec<Hysteresis> {
    let warnings = warning_sentences::impact_loops(impacts);
    let row = |force, slope: OverCycles, decay: &[DecayStep]| Hysteresis {
        force,
        kind: Kind::Impact,
        frequency_hz: impacts.frequency_hz,
        amplitude_m: impacts.amplitude_m,
        shape: impacts.shape,
        k_t_n_per_m: None,
        c_t_n_s_per_m: None,
        k_t_budget: None,
        k_t_why: None,
        slope_between_spots_n_per_m: (impacts.slope_is == SlopeIs::Contact).then_some(slope),
        stick_part: None,
        k_eq_n_per_m: Some(slope),
        k_secant_n_per_m: None,
        k_fundamental_n_per_m: None,
        // the first cycle of a decay is not closed
        energy_j: None,
        friction_limit_n: None,
        friction_coefficient: None,
        phase_deg: impacts.phase_deg,
        shape_evidence: None,
        decay_cycles: Vec::new(),
        decay: decay.to_vec(),
        level: None,
        moment: None,
        records: ranges(impacts.records.iter().copied()),
        findings: Vec::new(),
        warnings: warnings.clone(),
    };
    let mut rows = vec![row(Force::Raw, impacts.slope_n_per_m, &impacts.decay)];
    rows.extend(impacts.corrected_n_per_m.map(|slope| row(Force::Corrected, slope, &[])));
    rows
}

/// All rows with the raw force, then all with the corrected one; `resonance_hz` is a resonance of a
/// specimen, which affects Δx at every frequency.
fn of_records(records: &[RecordLoops], resonance_hz: Option<f64>) -> Vec<Hysteresis> {
    let row = |one: &RecordLoops, found: &LoopAnalysis, force| {
        let mut row = of_record(found, force);
        if one.level.is_some() {
            row = row.between_spots();
        }
        (row.level, row.moment) = (one.level.map(|(id, _)| id), one.level.map(|(_, moment)| moment.name()));
        if let (Some(_), Some(resonance_hz)) = (found.k_t_n_per_m, resonance_hz) {
            row.warnings.push(warning_sentences::beside_resonance(found.frequency_hz, resonance_hz));
        }
        row
    };
    let raw = records.iter().map(|one| at_the_contact(row(one, &one.raw, Force::Raw), one));
    let corrected = |one: &RecordLoops| Some(row(one, one.corrected.as_ref()?, Force::Corrected));
    raw.chain(records.iter().filter_map(corrected)).collect()
}

/// The row of a level, with the results for the contact alone added.
fn at_the_contact(row: Hysteresis, one: &RecordLoops) -> Hysteresis {
    match &one.own {
        None => row,
        Some(Err(why)) => Hysteresis { k_t_why: Some(level_sentences::none(why)), ..row },
        Some(Ok(own)) => {
            let k = own.k_t_n_per_m;
            let (std, cycles) = (own.std_n_per_m, one.raw.k_eq_n_per_m.cycles);
            Hysteresis {
                k_t_n_per_m: Some(OverCycles { mean: k.mean, std, cycles, ci95: Some(k.ci95) }),
                c_t_n_s_per_m: Some(own.c_t_n_s_per_m),
                k_t_budget: Some(own.shares),
                k_t_why: Some(level_sentences::corrected(&own.shares, own.correction)),
                ..row
            }
        }
    }
}

/// One record's loops with this force.
fn of_record(found: &LoopAnalysis, force: Force) -> Hysteresis {
    Hysteresis {
        force,
        kind: found.kind,
        frequency_hz: Some(found.frequency_hz),
        amplitude_m: Some(found.amplitude_m),
        shape: found.shape,
        k_t_n_per_m: found.k_t_n_per_m,
        c_t_n_s_per_m: None,
        k_t_budget: None,
        k_t_why: None,
        slope_between_spots_n_per_m: None,
        stick_part: found.stick_part,
        k_eq_n_per_m: Some(found.k_eq_n_per_m),
        k_secant_n_per_m: found.k_secant_n_per_m,
        k_fundamental_n_per_m: found.k_fundamental_n_per_m.map(num_complex::Complex::norm),
        energy_j: found.energy_j,
        friction_limit_n: found.friction_limit_n,
        friction_coefficient: found.friction_coefficient,
        phase_deg: Some(found.phase_deg),
        shape_evidence: found.shape_evidence,
        decay_cycles: found.decay_cycles.clone(),
        decay: Vec::new(),
        level: None,
        moment: None,
        records: Vec::new(),
        findings: found.findings.clone(),
        warnings: found
            .warnings
            .iter()
            .cloned()
            .chain(found.findings.iter().map(warning_sentences::loop_finding))
            .collect(),
    }
}
