//! Builds the document from the findings: every number and sentence of `results.json`.
//!
//! This includes the findings on the interface, converted to the format of the results, and the
//! provenance of the results: the information in the file, and how the analysis used its records.

use super::words::{check_sentences, mode_sentences, side_by_side, warning_sentences};
use crate::analyse::Findings;
use crate::results::{
    FirstMode, InterfaceModes, MAIN_BAND, Results, Source, VERSION, VirtualPoint, ranges, rounded,
};
use crate::substructuring::VirtualPointQuality;
use crate::substructuring::cmif::Cmif;
use serde_json::{Map, json};

pub use compared_from_results::compare;
pub use from_modes::{mode_rows, scaling};

mod compared_from_results;
mod from_findings;
mod from_modes;

/// Builds `results.json` from all findings.
pub fn document(found: Findings) -> Results {
    let source = source(&found);
    let checks = check_sentences::all(&found);
    let missing = found.missing.iter().map(warning_sentences::missing).collect();
    let answer = from_findings::answer(&found);
    let (joint, refused) = from_findings::joint_rows(&found);
    let hysteresis = from_findings::loop_rows(&found);
    let (modes, modal) = mode_rows(&found.modes);
    let mut results = Results {
        version: VERSION,
        source,
        answer,
        joint,
        recommended: found.recommended,
        bootstrap: found.bootstrap,
        modes,
        modal,
        first_mode: found.first_mode.map(with_meaning),
        hysteresis,
        wear: found.wear,
        checks,
        refused,
        missing,
        completeness: found.completeness,
        geometry: found.geometry,
        cells: found.cells,
        hits: found.hits,
        ..Results::default()
    };
    if let Some(of_frfs) = &found.substructured {
        results.virtual_points = of_frfs.virtual_points.iter().map(quality).collect();
        results.interface_modes = of_frfs.cmif.as_ref().ok().map(interface_modes);
        results.joint_spectrum = from_findings::spectrum(of_frfs);
    }
    for measured in found.configurations {
        if let Some(from) = measured.imported.as_ref().filter(|_| measured.records.is_empty()) {
            results.missing.push(warning_sentences::no_records(measured.configuration, &from.file));
        }
        results.usable_bands.extend(measured.usable_band);
        results.frfs.extend(measured.frfs);
        // the assembly comes last and takes precedence
        results.noise_floor = measured.noise_floor.or(results.noise_floor);
    }
    if let Some(contact) = found.contact {
        results.frfs.extend(contact.frfs);
        results.static_arm = contact.arm;
        results.example_loop = contact.example_loop;
        results.reconstruction = contact.reconstruction;
        results.shaker_loops = contact.shaker_loops;
        results.backbones = contact.backbones;
        results.impact_slopes = contact.impacts.map_or_else(Vec::new, |impacts| impacts.slopes);
    }
    results.side_by_side = side_by_side::kinds(&results);
    results
}

fn with_meaning(found: FirstMode) -> FirstMode {
    FirstMode { meaning: mode_sentences::first_mode(&found), ..found }
}

/// The source in the findings, with the settings of the analysis and the records used.
pub fn source(found: &Findings) -> Source {
    let mut source = found.source.clone();
    let settings = &mut source.settings;
    if let Some(of_records) = &found.settings {
        let window = of_records.windowing;
        settings.insert("exponential_window_per_s".into(), window.sigma_per_s.into());
        settings.insert("force_window_s".into(), json!([-window.force_before_s, window.force_after_s]));
        settings.insert("estimator".into(), "H1 on s = σ + iω".into());
        settings.insert("lines_hz".into(), json!(of_records.lines_hz));
    }
    let mut imported = Map::new();
    for measured in &found.configurations {
        let records = ranges(measured.records.iter().copied());
        if !records.is_empty() {
            source.records.insert(measured.configuration.into(), records);
        }
        if let Some(from) = &measured.imported {
            let about = json!({ "file": from.file, "imported": from.utc, "variance": from.with_variance });
            imported.insert(measured.configuration.into(), about);
        }
    }
    if !imported.is_empty() {
        settings.insert("imported_frf".into(), imported.into());
    }
    if let Some(priors) = &found.priors {
        settings.insert("priors".into(), json!(priors));
    }
    source
}

/// Number of CMIF curves kept: at most twelve interface motions, and the first beyond them.
const CURVES: usize = 13;

/// Quality of one virtual point.
pub fn quality(found: &VirtualPointQuality) -> VirtualPoint {
    let named = |names: &[String], values: &[f64]| {
        names.iter().cloned().zip(values.iter().map(|v| rounded(*v, 6))).collect()
    };
    let [overall_sensor, overall_impact] = found.held_over(MAIN_BAND);
    VirtualPoint {
        substructure: found.substructure.into(),
        idms: found.idms,
        modes: found.modes.clone(),
        condition_responses: found.condition_responses,
        condition_impacts: found.condition_impacts,
        overall_sensor,
        overall_impact,
        sensors: named(&found.channels, &found.consistency.specific_sensor),
        impacts: named(&found.impacts, &found.consistency.specific_impact),
        passivity: found.modes.iter().copied().zip(found.passivity.iter().copied()).collect(),
        reciprocity: found.reciprocity,
    }
}

/// The CMIF.
pub fn interface_modes(found: &Cmif) -> InterfaceModes {
    let curves = found.singular_values.iter().map(Vec::len).min().unwrap_or(0).min(CURVES);
    InterfaceModes {
        frequency_hz: found.frequency_hz.clone(),
        singular_values_m_per_n: (0..curves)
            .map(|c| found.singular_values.iter().map(|line| rounded(line[c], 4)).collect())
            .collect(),
        participation: found
            .participation_over(MAIN_BAND)
            .into_iter()
            .take(curves)
            .map(|parts| parts.map(|part| rounded(part, 4)))
            .collect(),
        explained: found.explained.clone(),
        suggested: found.suggested,
        reason: found.reason.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::document;
    use crate::analyse::Findings;

    #[test]
    fn nothing_found_is_a_document_that_says_so() {
        let results = document(Findings::default());
        assert!(results.joint.is_empty() && results.hysteresis.is_empty() && results.checks.is_empty());
        assert!(crate::report::page(&results).contains("No stiffness could be found"));
    }
}
