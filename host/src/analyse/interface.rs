//! From FRFs to what results say of joint and interface: shared by campaigns and by `identify`.

use super::back_coupling;
use super::interface_checks;
use super::joint::shaped;
use super::line_noise;
use crate::results::{Check, InterfaceModes, MAIN_BAND, Results, VirtualPoint, rounded};
use crate::substructuring::averaged::Priors;
use crate::substructuring::cmif::{Cmif, cmif};
use crate::substructuring::explained::Explained;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping};
use crate::substructuring::identify::{Identification, VirtualPointQuality};
use crate::substructuring::noise::FrfNoise;
use crate::substructuring::{FrfMatrix, IdmSet, Method};

/// Curves of the CMIF that are kept: twelve interface motions at most, and the first beyond them.
const CURVES: usize = 13;

/// Puts what was identified, and what the same FRFs say of the interface, into the results.
pub fn fill(
    results: &mut Results,
    frfs: [&FrfMatrix; 3],
    noises: [Option<&FrfNoise>; 3],
    geometry: &Geometry,
    priors: &Priors,
    found: &Identification,
) {
    let [a, b, ajb] = frfs;
    let noise = line_noise::of(frfs, noises, geometry, found);
    let (joint, spectrum, refused) = shaped(found, &noise);
    results.joint = joint;
    results.joint_spectrum = spectrum;
    results.refused = refused;
    results.virtual_points = found.virtual_points.iter().map(virtual_point).collect();
    let [a, b, ajb] = [(a, &geometry.a), (b, &geometry.b), (ajb, &geometry.ajb)]
        .map(|(frf, points)| without_spares(frf, points));
    match cmif(&a, &b, &ajb, geometry) {
        Ok(found) => {
            results.checks.push(interface_checks::modes(&found));
            results.interface_modes = Some(interface_modes(&found));
        }
        Err(error) => results.missing.push(format!("No CMIF: {error}.")),
    }
    results.checks.extend(interface_checks::internals(found));
    results.checks.extend(interface_checks::configuration(found));
    results.checks.extend(back_coupled(frfs, noises, geometry, priors, found));
}

/// The check of the assembly put together again, with the most modes that Eq. (A.1) was asked for with; none where it was not.
fn back_coupled(
    frfs: [&FrfMatrix; 3],
    noises: [Option<&FrfNoise>; 3],
    geometry: &Geometry,
    priors: &Priors,
    found: &Identification,
) -> Option<Check> {
    let by_inverse = found.spectra.iter().filter(|s| s.method == Method::Inverse.name());
    let idms = IdmSet::of(&by_inverse.max_by_key(|s| s.idms)?.modes)?;
    let judged = Explained::of(frfs, noises, geometry, idms, MAIN_BAND, priors)?;
    back_coupling::check(&judged)
}

/// The matrix without the spare responses of A, which may be anything.
fn without_spares(frf: &FrfMatrix, points: &Configuration) -> FrfMatrix {
    let names = points.output_names();
    let spare = |name: &String| {
        points.channels.iter().zip(&names).any(|(p, n)| n == name && p.grouping == Grouping::InternalA)
    };
    let kept: Vec<String> = frf.outputs.iter().filter(|name| !spare(name)).cloned().collect();
    // these names were just taken from it
    frf.select(&kept, &frf.inputs).unwrap_or_else(|_| frf.clone())
}

/// Mean of the lines in the main band; of all lines where it has none.
fn mean_in_band(frequency_hz: &[f64], values: &[f64]) -> f64 {
    let inside: Vec<f64> =
        frequency_hz.iter().zip(values).filter(|(f, _)| MAIN_BAND.contains(**f)).map(|(_, v)| *v).collect();
    let used = if inside.is_empty() { values } else { &inside };
    used.iter().sum::<f64>() / used.len() as f64
}

fn virtual_point(quality: &VirtualPointQuality) -> VirtualPoint {
    let c = &quality.consistency;
    let named = |names: &[String], values: &[f64]| {
        names.iter().cloned().zip(values.iter().map(|v| rounded(*v, 6))).collect()
    };
    VirtualPoint {
        substructure: quality.substructure.into(),
        idms: quality.idms,
        modes: quality.modes.clone(),
        condition_responses: quality.condition_responses,
        condition_impacts: quality.condition_impacts,
        overall_sensor: mean_in_band(&quality.frequency_hz, &c.overall_sensor),
        overall_impact: mean_in_band(&quality.frequency_hz, &c.overall_impact),
        sensors: named(&quality.channels, &c.specific_sensor),
        impacts: named(&quality.impacts, &c.specific_impact),
        passivity: quality.modes.iter().copied().zip(quality.passivity.iter().copied()).collect(),
        reciprocity: quality.reciprocity,
    }
}

fn interface_modes(found: &Cmif) -> InterfaceModes {
    let curves = found.singular_values.iter().map(Vec::len).min().unwrap_or(0).min(CURVES);
    InterfaceModes {
        frequency_hz: found.frequency_hz.clone(),
        singular_values_m_per_n: (0..curves)
            .map(|c| found.singular_values.iter().map(|line| rounded(line[c], 4)).collect())
            .collect(),
        explained: found.explained.clone(),
        suggested: found.suggested,
        reason: found.reason.clone(),
    }
}
