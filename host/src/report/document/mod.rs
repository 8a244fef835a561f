//! The document made of the findings: every number and sentence of `results.json` in its place.

mod joint_rows;
mod loop_rows;
mod provenance;
mod virtual_points;

use super::words::{checks, missing};
use crate::analyse::Findings;
use crate::results::{Results, VERSION};

/// `results.json`, from all that was found.
pub fn document(found: Findings) -> Results {
    let source = provenance::source(&found);
    let checks = checks::all(&found);
    let missing = found.missing.iter().map(missing::sentence).collect();
    let (joint, refused) = joint_rows::rows(&found);
    let hysteresis = loop_rows::rows(&found);
    let mut results = Results {
        version: VERSION,
        source,
        joint,
        recommended: found.recommended,
        bootstrap: found.bootstrap,
        hysteresis,
        checks,
        refused,
        missing,
        completeness: found.completeness,
        ..Results::default()
    };
    if let Some(of_frfs) = &found.substructured {
        results.virtual_points = of_frfs.virtual_points.iter().map(virtual_points::quality).collect();
        results.interface_modes = of_frfs.cmif.as_ref().ok().map(virtual_points::interface_modes);
        results.joint_spectrum = joint_rows::spectrum(of_frfs);
    }
    for measured in found.configurations {
        results.usable_bands.extend(measured.usable_band);
        results.frfs.extend(measured.frfs);
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
