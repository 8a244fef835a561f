//! Builds the document from the findings: every number and sentence of `results.json`.

mod answer_from_findings;
mod compared_from_results;
mod interface_from_findings;
mod joint_from_findings;
mod loops_from_findings;
mod source_from_findings;

pub use compared_from_results::compare;

use super::words::{check_sentences, missing_sentences, side_by_side};
use crate::analyse::Findings;
use crate::results::{Results, VERSION};

/// Builds `results.json` from all findings.
pub fn document(found: Findings) -> Results {
    let source = source_from_findings::source(&found);
    let checks = check_sentences::all(&found);
    let missing = found.missing.iter().map(missing_sentences::sentence).collect();
    let answer = answer_from_findings::answer(&found);
    let (joint, refused) = joint_from_findings::rows(&found);
    let hysteresis = loops_from_findings::rows(&found);
    let mut results = Results {
        version: VERSION,
        source,
        answer,
        joint,
        recommended: found.recommended,
        bootstrap: found.bootstrap,
        hysteresis,
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
        results.virtual_points =
            of_frfs.virtual_points.iter().map(interface_from_findings::quality).collect();
        results.interface_modes = of_frfs.cmif.as_ref().ok().map(interface_from_findings::interface_modes);
        results.joint_spectrum = joint_from_findings::spectrum(of_frfs);
    }
    for measured in found.configurations {
        if let Some(from) = measured.imported.as_ref().filter(|_| measured.records.is_empty()) {
            results.missing.push(missing_sentences::imported(measured.configuration, &from.file));
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
