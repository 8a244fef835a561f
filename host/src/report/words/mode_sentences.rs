//! Modes in plain sentences.

use super::number::{band, decimals, interval_places, to_its_interval};
use crate::analyse::FoundModes;
use crate::modes::NoiseKnown;
use crate::results::{FirstMode, ModalFit, ModeRow};

/// χ² per degree of freedom above which the model does not explain the FRFs within their noise.
const MISFIT: f64 = 1.3;

/// Evidence below which a mode may describe an error of the FRFs: about what noise alone gives once
/// in a thousand identifications of a single FRF.
const LITTLE: f64 = 40.0;

/// What limits the use of these modes.
pub fn warnings(found: &FoundModes) -> Vec<String> {
    let modes = &found.modes;
    let mut told = Vec::new();
    let estimated = modes.noise == NoiseKnown::Estimated;
    if let Some(why) = &found.without_variance {
        told.push(if estimated {
            format!(
                "No variances are used ({why}): the noise is estimated from what the modes leave of the FRFs, so nothing tells whether the modes explain the FRFs."
            )
        } else {
            format!(
                "No variances are used ({why}): an error of {} % of each FRF is assumed, and intervals and evidence are as good as this assumption.",
                decimals(100.0 * found.frf_error, 1)
            )
        });
    }
    if !estimated && modes.chi2_per_dof > MISFIT {
        told.push(format!(
            "χ² per degree of freedom is {}: the FRFs differ from those of any linear structure by more than their noise. All intervals are widened by its root, and modes may be listed that describe this difference.",
            decimals(modes.chi2_per_dof, 2)
        ));
    }
    if !modes.complete {
        told.push(
            "The search was ended before it had found all poles that the FRFs give evidence for: they are not those of one linear structure within the error that is assumed. Modes may be missing, and others may be none; assume a larger error, or a narrower band."
                .into(),
        );
    }
    let doubtful = modes.modes.iter().filter(|mode| mode.evidence < LITTLE);
    let doubtful: Vec<String> = doubtful.map(|mode| decimals(mode.frequency_hz, 1)).collect();
    if !doubtful.is_empty() {
        told.push(format!(
            "Doubtful, because without it the other modes would explain the FRFs about as well if their residues were free: {} Hz.",
            doubtful.join(", ")
        ));
    }
    if !found.left_out.is_empty() {
        told.push(format!(
            "Not used, because some of their FRFs are missing: {}.",
            found.left_out.join(", ")
        ));
    }
    told
}

/// The modes of one structure as lines of a table for the terminal.
pub fn table(fit: &ModalFit, modes: &[ModeRow]) -> Vec<String> {
    let own: Vec<&ModeRow> = modes.iter().filter(|mode| mode.structure == fit.structure).collect();
    let mut lines = vec![heading(fit, own.len())];
    if !own.is_empty() {
        lines.push("  frequency, Hz          damping, %             collinearity  moves most     (± half the 95 % interval)".into());
    }
    for mode in own {
        let [frequency, damping] = values(mode);
        lines.push(format!(
            "  {frequency:<22} {damping:<22} {:<13} {}",
            decimals(mode.phase_collinearity, 3),
            mode.largest
        ));
    }
    lines.extend(fit.warnings.iter().map(|warning| format!("  {warning}")));
    lines
}

/// Number of modes, band and χ² of one structure.
pub fn heading(fit: &ModalFit, modes: usize) -> String {
    let structure = fit.structure.as_ref().map_or(String::new(), |structure| format!("{structure}: "));
    let fits = fit
        .chi2_per_dof
        .map_or(String::new(), |chi2| format!(", χ² per degree of freedom {}", decimals(chi2, 2)));
    let plural = if modes == 1 { "mode" } else { "modes" };
    format!("{structure}{modes} {plural} in {}{fits}", band(fit.band_hz))
}

/// Frequency in Hz and damping in %, each with half its 95 % interval.
pub fn values(mode: &ModeRow) -> [String; 2] {
    [(&mode.frequency_hz, 1.0), (&mode.damping_ratio, 100.0)].map(|(value, scale)| {
        to_its_interval(scale * value.mean, scale * 0.5 * (value.ci95[1] - value.ci95[0]))
    })
}

/// Whether the first mode changed over the campaign.
pub fn first_mode(found: &FirstMode) -> String {
    let (hits, tried) = (found.hits.len(), found.hits_tried);
    let mode = format!(
        "The mode at {} Hz, the lowest of the assembly that most hits show ({hits} of {tried}),",
        decimals(found.mode_hz, 1)
    );
    let change = found.change_hz.as_ref().map(|change| {
        let places = interval_places(0.5 * (change.ci95[1] - change.ci95[0]));
        let [mean, low, high] = [change.mean, change.ci95[0], change.ci95[1]].map(|v| decimals(v, places));
        format!("{mean} Hz from the first hit to the last (95 % {low}…{high})")
    });
    match (found.drifts, change) {
        (Some(true), Some(change)) => {
            format!("{mode} changed by {change}: contact or clamps were not the same in all hits.")
        }
        (Some(false), Some(change)) => format!("{mode} did not change: {change}."),
        (_, Some(change)) => format!("{mode} changed by {change}, which decides nothing."),
        (Some(true), None) => format!(
            "{mode} changed, by how much is not known because it is not small against the distance to other modes: contact or clamps were not the same in all hits."
        ),
        (_, None) => format!("{mode} was seen in too few cells, or too near other modes, to tell a change."),
    }
}
