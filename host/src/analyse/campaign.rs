//! The stages of a campaign's analysis, in order.

use super::assemble::everything;
use super::averages::{CellAverage, LINES_HZ};
use super::cell::Measurements;
use super::cell::{BANDS, Progress, Wanted};
use super::checks::between_the_arms;
use super::findings::{Findings, Settings};
use super::from_frfs::Substructured;
use super::from_frfs::{Fit, NoFit, fits};
use super::from_frfs::{Recommended, recommended};
use super::missing::{Missing, given_up};
use super::{cells_stage, chosen, configuration_stage, contact_stage};
use crate::results::MAIN_BAND;
use crate::spectra::Windowing;
use crate::structure::Structure;
use crate::substructuring::averaged::Priors;
use crate::substructuring::between_arms::{BetweenArms, NoStiffness, between_arms};
use crate::substructuring::geometry::Grouping;
use crate::substructuring::{Band, Frf, Geometry, IdmSet, Method, fit, identify, keep_common_lines};
use std::collections::HashSet;

/// Analyses the measurements. The caller adds the provenance and the equipment used.
pub fn analyse_measurements<M: Measurements>(
    measurements: &M,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Findings {
    let (names, geometry) = (measurements.cells(), measurements.geometry());
    let mut cells = cells_stage::read_all(measurements, &names, wanted.replicates > 0, progress);
    let windowing = Windowing { sigma_per_s: measurements.sigma_per_s(), ..Windowing::default() };
    let mut found = Findings {
        settings: Some(Settings { windowing, lines_hz: LINES_HZ }),
        missing: std::mem::take(&mut cells.missing),
        ..Findings::default()
    };
    found.missing.extend(given_up(&names, measurements.given_up()));
    found.data_quality = chosen::data_quality(geometry, &cells.averages);

    let place = |structure: Structure| Structure::ALL.iter().position(|s| *s == structure);
    cells.averages.sort_by_key(|average| place(average.name.configuration));
    let all = Structure::ALL.map(|structure| {
        let planned = names.iter().filter(|c| c.configuration == structure).count();
        let own = of_configuration(&cells.averages, structure);
        let points = geometry.points(structure);
        let (one, whole) = rayon::join(
            || configuration_stage::of(measurements, structure, points, own, planned),
            || wanted.frfs.then(|| everything(points, own, measurements.quantity())).flatten(),
        );
        found.frfs.extend(Some(structure).zip(whole));
        found.missing.extend(one.missing);
        found.configurations.push(one.measured);
        one.frf
    });
    forget_frfs(&mut cells.averages);
    let frfs = all.each_ref().map(Option::as_ref);
    let own = on_common_lines(frfs, &mut found.missing);
    let alike = own.as_ref().map_or(frfs, |own| own.each_ref().map(Some));
    let identified = if let [Some(a), Some(b), Some(ajb)] = alike {
        substructured([a, b, ajb], geometry)
    } else {
        let absent = Structure::ALL.into_iter().zip(frfs).filter(|(_, frf)| frf.is_none());
        Err(Missing::Configurations(absent.map(|(structure, _)| structure).collect()))
    };
    match identified {
        Ok(of_frfs) => {
            found.missing.extend(of_frfs.cmif.as_ref().err().cloned().map(Missing::Cmif));
            found.substructured = Some(of_frfs);
        }
        Err(why) => found.missing.push(why),
    }
    // a plan without A's interface does not measure the stiffness between the arms
    let asks = geometry.ajb.channels.iter().any(|p| p.grouping == Grouping::InterfaceA);
    if let Some(ajb) = frfs[2].filter(|_| asks) {
        let priors = measurements.contact_priors().positions;
        let Recommended { estimates, bootstrap, missing } =
            recommended(geometry, ajb, &priors, &cells.hits, wanted.replicates);
        found.priors = Some(priors);
        (found.recommended, found.bootstrap) = (estimates, bootstrap);
        found.missing.extend(missing);
    }
    let fit = || {
        let [Some(a), Some(b), Some(ajb)] = alike else { return Vec::new() };
        let options =
            fit::Options { priors: measurements.contact_priors().positions, ..fit::Options::default() };
        fit_of_the_main_band([a, b, ajb], geometry, &options)
    };
    // run in parallel: each uses cores that the other leaves idle
    let (fits, own) = rayon::join(fit, || super::contact_answer::answer(measurements, &cells.averages));
    found.fits = fits;
    let fitted: Vec<_> = found.fits.iter().filter_map(|fit| Some(fit.outcome.as_ref().ok()?.row())).collect();
    let rows = found.substructured.iter().flat_map(|s| &s.rows).map(|row| &row.joint).chain(&fitted);
    let fbs = between_the_arms(&found.recommended, rows);
    let (contact, missing) = contact_stage::at_the_contact(measurements, &cells, fbs.as_ref(), own.as_ref());
    found.missing.extend(missing);
    found.contact = Some(contact);
    found.own_stiffness = Some(own.map(|(stiffness, _)| stiffness));
    found.between_arms = Some(decided(&found));
    found
}

/// Removes the FRFs that are now in the matrices from the averages; otherwise both copies would be
/// kept to the end. FRFs of impacts that are also used for the contact are kept, because they are
/// shown with it.
fn forget_frfs(averages: &mut [CellAverage]) {
    let of_assembly = |average: &CellAverage| average.name.configuration == Structure::Ajb;
    let seen = averages.iter().filter(|average| of_assembly(average) && average.contact.is_some());
    let seen: HashSet<String> = seen.map(|average| average.name.impact.clone()).collect();
    for average in averages {
        if !of_assembly(average) || !seen.contains(&average.name.impact) {
            average.spectra = average.spectra.of_outputs(0..0);
        }
    }
}

/// The averages of one configuration, from all averages sorted by configuration.
fn of_configuration(sorted: &[CellAverage], structure: Structure) -> &[CellAverage] {
    sorted
        .chunk_by(|a, b| a.name.configuration == b.name.configuration)
        .find(|own| own[0].name.configuration == structure)
        .unwrap_or_default()
}

/// Copies of all three restricted to their common lines; `None` if one is missing, if their lines
/// are equal, or if there is no common grid, which [`identify`](fn@identify) then reports.
fn on_common_lines(frfs: [Option<&Frf>; 3], missing: &mut Vec<Missing>) -> Option<[Frf; 3]> {
    let [Some(a), Some(b), Some(ajb)] = frfs else { return None };
    if b.frequency_hz() == a.frequency_hz() && ajb.frequency_hz() == a.frequency_hz() {
        return None;
    }
    let mut own = [a, b, ajb].map(Frf::clone);
    let left_out = keep_common_lines(&mut own).ok()?;
    missing.extend(left_out.map(Missing::LinesLeftOut));
    Some(own)
}

fn substructured(frfs: [&Frf; 3], geometry: &Geometry) -> Result<Substructured, Missing> {
    let [a, b, ajb] = frfs;
    let bands: Vec<Band> =
        BANDS.into_iter().filter(|band| a.frequency_hz().iter().any(|f| band.contains(*f))).collect();
    let identified = identify(a, b, ajb, geometry, &Method::ALL, &IdmSet::ALL, &bands);
    let mut found = identified
        .map(|found| Substructured::of(frfs, geometry, &Priors::default(), found))
        .map_err(Missing::Substructuring)?;
    // of the paper's methods the results include the spectra; the second form of A.1 is omitted
    // because it differs only by rounding
    let kept = |name: &str| Method::PAPER.iter().any(|m| *m != Method::InverseBa && m.name() == name);
    found.spectra.retain(|(spectrum, _)| kept(&spectrum.method));
    Ok(found)
}

/// The fit over the main band, from all three configurations and their noise.
fn fit_of_the_main_band(frfs: [&Frf; 3], geometry: &Geometry, options: &fit::Options) -> Vec<Fit> {
    let idms = IdmSet::Six;
    if frfs.iter().any(|frf| frf.variance().is_none()) {
        return vec![Fit { idms, outcome: Err(NoFit::ImportWithoutVariance) }];
    }
    fits(frfs, geometry, &[idms], &[MAIN_BAND], options)
}

/// Decides which estimate of the main band is the stiffness between the arms.
fn decided(found: &Findings) -> Result<BetweenArms, NoStiffness> {
    let fitted = found.fits.first().and_then(|fit| match &fit.outcome {
        Ok(fitted) => Some(Ok(fitted)),
        Err(NoFit::Failed(error)) => Some(Err(error)),
        Err(_) => None,
    });
    between_arms(fitted, found.recommended.iter().find(|r| r.band_hz == MAIN_BAND))
}
