//! Converts the findings on the interface to the format of the results.

use crate::results::{InterfaceModes, MAIN_BAND, VirtualPoint, rounded};
use crate::substructuring::VirtualPointQuality;
use crate::substructuring::cmif::Cmif;

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
